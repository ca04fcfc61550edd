// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

#include "cairn/core/file.hpp"
#include "cairn/vision/sequence/image.hpp"

namespace cairn {

/// Reads a colour image (PNG or JPEG, grey or colour) as 8-bit grey, at its own size. Pixels are as stored:
/// an EXIF orientation is not applied.
/// @throws Error (input) naming the file: missing, neither PNG nor JPEG, truncated, damaged, more than
///        16384 pixels a side or 2^26 in all, a CMYK JPEG
GrayImage read_gray_image(const std::filesystem::path& path);

/// Reads a colour image (PNG or JPEG) as 8-bit blue, green, red.
/// @throws Error as read_gray_image
ColorImage read_color_image(const std::filesystem::path& path);

/// Reads a depth image as stored, a PNG with one 16-bit channel.
/// @throws Error as read_gray_image, and for any other image
StoredDepthImage read_depth_image(const std::filesystem::path& path);

/// Writes an image as PNG, atomically.
/// @throws Error (storage) naming the file; (misuse) if the image is empty or its number of values does not
///        match its size
void write_png(const std::filesystem::path& path, const GrayImage& image,
               Durability durability = Durability::kAtOnce);
void write_png(const std::filesystem::path& path, const ColorImage& image,
               Durability durability = Durability::kAtOnce);
void write_png(const std::filesystem::path& path, const StoredDepthImage& image,
               Durability durability = Durability::kAtOnce);

/// Writes an image as JPEG, atomically.
/// @param quality 0 to 100
/// @throws Error as write_png()
void write_jpeg(const std::filesystem::path& path, const GrayImage& image, int quality = 95,
                Durability durability = Durability::kAtOnce);
void write_jpeg(const std::filesystem::path& path, const ColorImage& image, int quality = 95,
                Durability durability = Durability::kAtOnce);

/// An image as the bytes of a JPEG file.
/// @param quality 0 to 100
/// @throws Error (misuse) as write_jpeg()
std::string jpeg_bytes(const ColorImage& image, int quality = 95);

}  // namespace cairn
