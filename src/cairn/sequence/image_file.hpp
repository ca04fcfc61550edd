// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "cairn/core/file.hpp"
#include "cairn/sequence/image.hpp"

namespace cairn {

/// Reads a colour image (PNG or JPEG, grey or colour) as 8-bit grey, of its own size.
/// Pixels are those that are stored: an EXIF orientation is not applied.
/// @throws Error (input) naming the file: missing, neither PNG nor JPEG, cut off, damaged, more than
/// 16384 pixels a side or 2^26 in all, a CMYK JPEG
GrayImage read_gray_image(const std::filesystem::path& path);

/// Reads a colour image (PNG or JPEG) as 8-bit blue, green, red.
/// @throws Error as read_gray_image
ColorImage read_color_image(const std::filesystem::path& path);

/// Reads a depth image, a PNG of one 16-bit channel, as it is stored.
/// @throws Error as read_gray_image, and for any other kind of image
StoredDepthImage read_depth_image(const std::filesystem::path& path);

/// Writes an image as PNG, whole or not at all.
/// @throws Error (storage) naming the file; (misuse) if the image is empty or has another number of
///         values than its size says
void write_png(const std::filesystem::path& path, const GrayImage& image,
               Durability durability = Durability::kAtOnce);
void write_png(const std::filesystem::path& path, const ColorImage& image,
               Durability durability = Durability::kAtOnce);
void write_png(const std::filesystem::path& path, const StoredDepthImage& image,
               Durability durability = Durability::kAtOnce);

/// Writes an image as JPEG, whole or not at all.
/// @param quality 0 to 100
/// @throws Error as write_png()
void write_jpeg(const std::filesystem::path& path, const GrayImage& image, int quality = 95,
                Durability durability = Durability::kAtOnce);
void write_jpeg(const std::filesystem::path& path, const ColorImage& image, int quality = 95,
                Durability durability = Durability::kAtOnce);

}  // namespace cairn
