// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sequence/image_file.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/sequence/detail/image_codec.hpp"

namespace cairn {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kPngStart = "\x89PNG\r\n\x1a\n"sv;
constexpr std::string_view kPngEnd = "IEND\xae\x42\x60\x82"sv;
constexpr std::string_view kJpegStart = "\xff\xd8\xff"sv;
constexpr std::string_view kJpegEnd = "\xff\xd9"sv;

[[noreturn]] void refuse(const std::filesystem::path& path, std::string_view what,
                         std::string_view expected) {
  throw Error(ErrorKind::kInput, path.string(), what, expected);
}

// libjpeg fills what is missing of a cut file with grey: look for the end mark first. Some cameras pad after it, so it may stand anywhere near the end.
codec::Format check_complete(const std::filesystem::path& path, std::string_view bytes) {
  constexpr std::size_t kPadding = 4096;
  if (bytes.empty()) refuse(path, "the file is empty", "an image");
  const bool png = bytes.starts_with(kPngStart);
  if (!png && !bytes.starts_with(kJpegStart)) refuse(path, "neither PNG nor JPEG", "either");
  const std::string_view tail = bytes.substr(bytes.size() - std::min(kPadding, bytes.size()));
  if (tail.find(png ? kPngEnd : kJpegEnd) == std::string_view::npos) {
    refuse(path, "the image is cut off", "its end mark");
  }
  return png ? codec::Format::kPng : codec::Format::kJpeg;
}

std::string kind_of(codec::Format format, const codec::Header& header) {
  const char* color = header.channels > 2 || header.has_palette ? "colour" : "grey";
  return fmt::format("{}{} pixels of {} bits{}", format == codec::Format::kJpeg ? "JPEG: " : "",
                     color, header.bits, header.channels % 2 == 0 ? " with alpha" : "");
}

cv::Mat read_image(const std::filesystem::path& path, codec::Pixels pixels) {
  const std::string bytes = read_file(path);
  const codec::Format format = check_complete(path, bytes);
  codec::Decoder decoder(format, bytes);
  codec::Header header;
  const auto check = [&](const codec::Fault& fault) {
    if (fault.empty()) return;
    refuse(path, "the image cannot be decoded: " + fault, "an undamaged image");
  };
  check(decoder.read_header(header));
  if (header.width > codec::kLargestSide || header.height > codec::kLargestSide ||
      std::uint64_t{header.width} * header.height > codec::kMostPixels) {
    refuse(path, fmt::format("an image of {} x {} pixels", header.width, header.height),
           fmt::format("at most {} pixels a side and {} in all", codec::kLargestSide,
                       codec::kMostPixels));
  }
  if (pixels == codec::Pixels::kGray16 &&
      (format != codec::Format::kPng || header.channels != 1 || header.bits != 16)) {
    refuse(path, kind_of(format, header), "one channel of 16 bits");
  }
  constexpr auto type = [](codec::Pixels asked) {
    switch (asked) {
      case codec::Pixels::kGray8:
        return CV_8UC1;
      case codec::Pixels::kBgr8:
        return CV_8UC3;
      case codec::Pixels::kGray16:
        break;
    }
    return CV_16UC1;
  };
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width), type(pixels));
  check(decoder.read_pixels(pixels, image.data, image.step[0]));
  return image;
}

codec::Rows rows_of(const std::filesystem::path& path, const cv::Mat& image) {
  codec::Rows rows;
  rows.first = image.data;
  rows.stride = image.step[0];
  rows.width = static_cast<std::uint32_t>(image.cols);
  rows.height = static_cast<std::uint32_t>(image.rows);
  switch (image.type()) {
    case CV_8UC1:
      rows.pixels = codec::Pixels::kGray8;
      return rows;
    case CV_8UC3:
      rows.pixels = codec::Pixels::kBgr8;
      return rows;
    case CV_16UC1:
      rows.pixels = codec::Pixels::kGray16;
      return rows;
    default:
      throw Error(ErrorKind::kMisuse, path.string(), cv::typeToString(image.type()) + " pixels",
                  "8-bit grey or colour, or 16-bit grey");
  }
}

void write_image(const std::filesystem::path& path, const codec::Fault& fault,
                 const std::string& bytes, Durability durability) {
  if (!fault.empty()) {
    throw Error(ErrorKind::kStorage, path.string(), "cannot be encoded: " + fault, "an image");
  }
  write_file(
      path, [&](const ByteSink& sink) { sink(bytes); }, durability);
}

}  // namespace

cv::Mat read_gray_image(const std::filesystem::path& path) {
  return read_image(path, codec::Pixels::kGray8);
}

cv::Mat read_color_image(const std::filesystem::path& path) {
  return read_image(path, codec::Pixels::kBgr8);
}

cv::Mat read_depth_image(const std::filesystem::path& path) {
  return read_image(path, codec::Pixels::kGray16);
}

void write_png(const std::filesystem::path& path, const cv::Mat& image, Durability durability) {
  std::string bytes;
  const codec::Fault fault = codec::encode_png(rows_of(path, image), bytes);
  write_image(path, fault, bytes, durability);
}

void write_jpeg(const std::filesystem::path& path, const cv::Mat& image, int quality,
                Durability durability) {
  const codec::Rows rows = rows_of(path, image);
  if (rows.pixels == codec::Pixels::kGray16) {
    throw Error(ErrorKind::kMisuse, path.string(), "16-bit pixels", "8-bit grey or colour");
  }
  std::string bytes;
  const codec::Fault fault = codec::encode_jpeg(rows, quality, bytes);
  write_image(path, fault, bytes, durability);
}

}  // namespace cairn
