// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sequence/image_file.hpp"

#include <string>
#include <string_view>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

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

// The decoders fill what is missing of a cut file with grey and say so on stderr only: look for the
// end mark first. Some cameras pad after it, so it may stand anywhere near the end.
void check_complete(const std::filesystem::path& path, std::string_view bytes) {
  constexpr std::size_t kPadding = 4096;
  if (bytes.empty()) refuse(path, "the file is empty", "an image");
  const bool png = bytes.starts_with(kPngStart);
  if (!png && !bytes.starts_with(kJpegStart)) refuse(path, "neither PNG nor JPEG", "either");
  const std::string_view tail = bytes.substr(bytes.size() - std::min(kPadding, bytes.size()));
  if (tail.find(png ? kPngEnd : kJpegEnd) == std::string_view::npos) {
    refuse(path, "the image is cut off", "its end mark");
  }
}

// Size of a PNG from its header: refused before anything is allocated for it.
void check_png_size(const std::filesystem::path& path, std::string_view bytes) {
  constexpr std::size_t kHeader = 24;
  constexpr std::uint32_t kLargest = 1U << 16;
  if (!bytes.starts_with(kPngStart) || bytes.size() < kHeader) return;
  const auto big_endian = [&](std::size_t offset) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      value = (value << 8) | static_cast<unsigned char>(bytes[offset + i]);
    }
    return value;
  };
  if (big_endian(16) > kLargest || big_endian(20) > kLargest) {
    refuse(path, "an image of more than 65536 pixels a side", "a camera image");
  }
}

cv::Mat read_image(const std::filesystem::path& path, int flags) {
  const std::string bytes = read_file(path);
  check_complete(path, bytes);
  check_png_size(path, bytes);
  cv::Mat image;
  try {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    image = cv::imdecode(raw, flags);
  } catch (const cv::Exception& error) {
    refuse(path, "the image cannot be decoded: " + error.err, "an undamaged image");
  }
  if (image.empty()) refuse(path, "the image cannot be decoded", "an undamaged image");
  return image;
}

void write_image(const std::filesystem::path& path, const cv::Mat& image, const char* format,
                 const std::vector<int>& parameters, Durability durability) {
  std::vector<unsigned char> bytes;
  cv::imencode(format, image, bytes, parameters);
  write_file(
      path,
      [&](const ByteSink& sink) {
        sink({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
      },
      durability);
}

}  // namespace

cv::Mat read_gray_image(const std::filesystem::path& path) {
  return read_image(path, cv::IMREAD_GRAYSCALE);
}

cv::Mat read_color_image(const std::filesystem::path& path) {
  return read_image(path, cv::IMREAD_COLOR);
}

cv::Mat read_depth_image(const std::filesystem::path& path) {
  cv::Mat image = read_image(path, cv::IMREAD_UNCHANGED);
  if (image.type() != CV_16UC1) {
    refuse(path, cv::typeToString(image.type()) + " pixels", "one channel of 16 bits");
  }
  return image;
}

void write_png(const std::filesystem::path& path, const cv::Mat& image, Durability durability) {
  // Without parameters OpenCV takes one filter and run lengths: half the time of any level of
  // compression, at a fifth more bytes. A sequence is written once, at camera speed.
  write_image(path, image, ".png", {}, durability);
}

void write_jpeg(const std::filesystem::path& path, const cv::Mat& image, int quality,
                Durability durability) {
  write_image(path, image, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality}, durability);
}

}  // namespace cairn
