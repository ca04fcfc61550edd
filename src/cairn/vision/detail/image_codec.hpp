// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cairn::detail::codec {

/// Largest side and largest number of pixels of an image that is decoded. Both are checked against
/// the file's header before anything is allocated.
inline constexpr std::uint32_t kLargestSide = 16384;
inline constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 26;

enum class Format { kPng, kJpeg };

/// Header of an image file.
struct Header {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int channels = 0;  ///< as stored: 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha
  int bits = 8;      ///< of a channel: 1, 2, 4, 8 or 16
  bool has_palette = false;
};

/// Requested pixel format.
enum class Pixels { kGray8, kBgr8, kGray16 };

/// Bytes per pixel.
constexpr std::size_t size_of(Pixels pixels) {
  return pixels == Pixels::kGray8 ? 1 : pixels == Pixels::kBgr8 ? 3 : 2;
}

/// Why an image cannot be decoded or encoded; empty if it can.
using Fault = std::string;

/// Decodes a file in memory: first its header, then its pixels into the caller's memory.
/// libpng and libjpeg report faults by longjmp(), which never leaves a function of this class.
class Decoder {
 public:
  explicit Decoder(Format format, std::string_view bytes);
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder();

  /// Call once, before read_pixels().
  Fault read_header(Header& header);

  /// Decodes into rows at `first`, `stride` bytes apart.
  /// @param pixels kGray16 only for a PNG of one 16-bit channel
  Fault read_pixels(Pixels pixels, unsigned char* first, std::size_t stride);

 private:
  struct Png;
  struct Jpeg;
  Png* png_ = nullptr;
  Jpeg* jpeg_ = nullptr;
};

/// Rows of an image to be encoded.
struct Rows {
  const unsigned char* first = nullptr;
  std::size_t stride = 0;  ///< bytes from row to row
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  Pixels pixels = Pixels::kGray8;
};

/// Appends the image to `bytes` as PNG.
Fault encode_png(const Rows& rows, std::string& bytes);

/// Appends the image, 8-bit grey or colour, to `bytes` as JPEG.
/// @param quality 0 to 100
Fault encode_jpeg(const Rows& rows, int quality, std::string& bytes);

}  // namespace cairn::detail::codec
