// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

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
  /// @param image_values width x height x kChannels values; consistent() checks that
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

}  // namespace cairn
