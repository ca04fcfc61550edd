// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/core/file.hpp"

namespace cairn {

/// An image in memory: rows from the top, pixels from the left, channels interleaved, without padding.
template <class T, std::size_t kChannels = 1>
struct Image {
  static constexpr std::size_t kPixelValues = kChannels;

  Image() = default;
  Image(std::uint32_t image_width, std::uint32_t image_height, T value = T())
      : width(image_width),
        height(image_height),
        values(std::size_t{image_width} * image_height * kChannels, value) {}
  /// @param image_values width x height x kChannels values; consistent() checks the number
  Image(std::uint32_t image_width, std::uint32_t image_height, std::vector<T> image_values)
      : width(image_width), height(image_height), values(std::move(image_values)) {}

  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<T> values;

  bool empty() const { return values.empty(); }
  bool consistent() const { return values.size() == std::size_t{width} * height * kChannels; }

  /// First channel of a pixel within the image.
  const T& at(std::size_t column, std::size_t row) const {
    return values[(row * width + column) * kChannels];
  }
  T& at(std::size_t column, std::size_t row) { return values[(row * width + column) * kChannels]; }

  bool operator==(const Image&) const = default;
};

template <class A, std::size_t kOfA, class B, std::size_t kOfB>
bool same_size(const Image<A, kOfA>& a, const Image<B, kOfB>& b) {
  return a.width == b.width && a.height == b.height;
}

using GrayImage = Image<std::uint8_t>;
using ColorImage = Image<std::uint8_t, 3>;      ///< blue, green, red
using StoredDepthImage = Image<std::uint16_t>;  ///< in the units of its file; 0 if unknown
using DepthImage = Image<float>;                ///< metres; 0 if unknown

/// Reads a colour image (PNG or JPEG, grey or colour) as 8-bit grey, at its own size. Pixels are as stored:
/// an EXIF orientation is not applied.
/// @throws Error (input) naming the file: missing, neither PNG nor JPEG, truncated, damaged, more than
///        16384 pixels a side or 2^26 in all, a CMYK JPEG
GrayImage read_gray_image(const std::filesystem::path& path);

/// Reads a colour image (PNG or JPEG) as 8-bit blue, green, red.
/// @throws Error as read_gray_image
ColorImage read_color_image(const std::filesystem::path& path);

/// Reads a depth image in its stored units: a PNG with one 16-bit channel.
/// @throws Error as read_gray_image, and (input) for any other image
StoredDepthImage read_depth_image(const std::filesystem::path& path);

/// Decodes the bytes of an image file as GrayImage, ColorImage or StoredDepthImage.
/// @param name name of the image in errors
template <class ImageOf>
ImageOf decode_image(std::string_view bytes, const std::filesystem::path& name);

/// Converts stored depth to metres; 0 (no reading) stays 0.
DepthImage metric_depth(const StoredDepthImage& stored, double units_per_metre);

/// Rounds depth to stored units; 0 beyond 16 bits, as in a real camera.
StoredDepthImage stored_depth(const DepthImage& depth_m, double units_per_metre);

/// Grey value of a colour, as computed by libpng's png_set_rgb_to_gray().
std::uint8_t gray_of(std::uint8_t blue, std::uint8_t green, std::uint8_t red);

/// Writes a GrayImage, ColorImage or StoredDepthImage as PNG, atomically.
/// @throws Error (storage) naming the file; (misuse) if the image is empty or its number of values does not
///        match its size
template <class ImageOf>
void write_png(const std::filesystem::path& path, const ImageOf& image,
               Durability durability = Durability::kAtOnce);

/// Writes a GrayImage or ColorImage as JPEG, atomically.
/// @param quality 0 to 100
/// @throws Error as write_png()
template <class ImageOf>
void write_jpeg(const std::filesystem::path& path, const ImageOf& image, int quality = 95,
                Durability durability = Durability::kAtOnce);

/// Encodes an image as the bytes of a JPEG file.
/// @param quality 0 to 100
/// @throws Error (misuse) as write_jpeg()
std::string jpeg_bytes(const ColorImage& image, int quality = 95);

}  // namespace cairn
