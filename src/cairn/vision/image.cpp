// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/vision/detail/image_codec.hpp"

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
detail::codec::Format check_complete(const std::filesystem::path& path, std::string_view bytes) {
  constexpr std::size_t kPadding = 4096;
  if (bytes.empty()) refuse(path, "the file is empty", "an image");
  const bool png = bytes.starts_with(kPngStart);
  if (!png && !bytes.starts_with(kJpegStart)) refuse(path, "neither PNG nor JPEG", "either");
  const std::string_view tail = bytes.substr(bytes.size() - std::min(kPadding, bytes.size()));
  if (tail.find(png ? kPngEnd : kJpegEnd) == std::string_view::npos) {
    refuse(path, "the image is cut off", "its end mark");
  }
  return png ? detail::codec::Format::kPng : detail::codec::Format::kJpeg;
}

std::string kind_of(detail::codec::Format format, const detail::codec::Header& header) {
  const char* color = header.channels > 2 || header.has_palette ? "colour" : "grey";
  return fmt::format("{}{} pixels of {} bits{}",
                     format == detail::codec::Format::kJpeg ? "JPEG: " : "", color, header.bits,
                     header.channels % 2 == 0 ? " with alpha" : "");
}

// The codecs' pixel format of an image.
constexpr detail::codec::Pixels pixels_of(const GrayImage*) {
  return detail::codec::Pixels::kGray8;
}
constexpr detail::codec::Pixels pixels_of(const ColorImage*) {
  return detail::codec::Pixels::kBgr8;
}
constexpr detail::codec::Pixels pixels_of(const StoredDepthImage*) {
  return detail::codec::Pixels::kGray16;
}

template <class ImageOf>
std::size_t row_bytes(const ImageOf& image) {
  return image.width * ImageOf::kPixelValues * sizeof(image.values[0]);
}

template <class ImageOf>
ImageOf read_image(const std::filesystem::path& path) {
  constexpr detail::codec::Pixels kPixels = pixels_of(static_cast<const ImageOf*>(nullptr));
  const std::string bytes = read_file(path);
  const detail::codec::Format format = check_complete(path, bytes);
  detail::codec::Decoder decoder(format, bytes);
  detail::codec::Header header;
  const auto check = [&](const detail::codec::Fault& fault) {
    if (fault.empty()) return;
    refuse(path, "the image cannot be decoded: " + fault, "an undamaged image");
  };
  check(decoder.read_header(header));
  if (header.width > detail::codec::kLargestSide || header.height > detail::codec::kLargestSide ||
      std::uint64_t{header.width} * header.height > detail::codec::kMostPixels) {
    refuse(path, fmt::format("an image of {} x {} pixels", header.width, header.height),
           fmt::format("at most {} pixels a side and {} in all", detail::codec::kLargestSide,
                       detail::codec::kMostPixels));
  }
  if (kPixels == detail::codec::Pixels::kGray16 &&
      (format != detail::codec::Format::kPng || header.channels != 1 || header.bits != 16)) {
    refuse(path, kind_of(format, header), "one channel of 16 bits");
  }
  ImageOf image(header.width, header.height);
  auto* const first = reinterpret_cast<unsigned char*>(image.values.data());
  check(decoder.read_pixels(kPixels, first, row_bytes(image)));
  return image;
}

template <class ImageOf>
detail::codec::Rows rows_of(const std::filesystem::path& path, const ImageOf& image) {
  refuse_if(
      image.empty() || !image.consistent(), path.string(),
      fmt::format("{} x {} pixels with {} values", image.width, image.height, image.values.size()),
      "an image with a value for each channel of each pixel");
  return {.first = reinterpret_cast<const unsigned char*>(image.values.data()),
          .stride = row_bytes(image),
          .width = image.width,
          .height = image.height,
          .pixels = pixels_of(&image)};
}

// The bytes that `encode` appends; `where` names the image in errors.
template <class ImageOf, class Encode>
std::string encoded(const std::filesystem::path& where, const ImageOf& image,
                    const Encode& encode) {
  std::string bytes;
  const detail::codec::Fault fault = encode(rows_of(where, image), bytes);
  if (!fault.empty()) {
    throw Error(ErrorKind::kStorage, where.string(), "cannot be encoded: " + fault, "an image");
  }
  return bytes;
}

template <class ImageOf>
std::string encoded_as_jpeg(const std::filesystem::path& where, const ImageOf& image, int quality) {
  return encoded(where, image, [quality](const detail::codec::Rows& rows, std::string& bytes) {
    return detail::codec::encode_jpeg(rows, quality, bytes);
  });
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes,
                 Durability durability) {
  write_file(
      path, [&](const ByteSink& sink) { sink(bytes); }, durability);
}

template <class ImageOf>
void write_as_png(const std::filesystem::path& path, const ImageOf& image, Durability durability) {
  write_bytes(path, encoded(path, image, detail::codec::encode_png), durability);
}

template <class ImageOf>
void write_as_jpeg(const std::filesystem::path& path, const ImageOf& image, int quality,
                   Durability durability) {
  write_bytes(path, encoded_as_jpeg(path, image, quality), durability);
}

}  // namespace

GrayImage read_gray_image(const std::filesystem::path& path) {
  return read_image<GrayImage>(path);
}

ColorImage read_color_image(const std::filesystem::path& path) {
  return read_image<ColorImage>(path);
}

StoredDepthImage read_depth_image(const std::filesystem::path& path) {
  return read_image<StoredDepthImage>(path);
}

void write_png(const std::filesystem::path& path, const GrayImage& image, Durability durability) {
  write_as_png(path, image, durability);
}

void write_png(const std::filesystem::path& path, const ColorImage& image, Durability durability) {
  write_as_png(path, image, durability);
}

void write_png(const std::filesystem::path& path, const StoredDepthImage& image,
               Durability durability) {
  write_as_png(path, image, durability);
}

void write_jpeg(const std::filesystem::path& path, const GrayImage& image, int quality,
                Durability durability) {
  write_as_jpeg(path, image, quality, durability);
}

void write_jpeg(const std::filesystem::path& path, const ColorImage& image, int quality,
                Durability durability) {
  write_as_jpeg(path, image, quality, durability);
}

std::string jpeg_bytes(const ColorImage& image, int quality) {
  return encoded_as_jpeg("image", image, quality);
}

}  // namespace cairn
