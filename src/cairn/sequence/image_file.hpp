// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include <opencv2/core/mat.hpp>

#include "cairn/core/file.hpp"

namespace cairn {

/// Reads a colour image (PNG or JPEG, grey or colour) as 8-bit grey, of its own size.
/// Pixels are those that are stored: an EXIF orientation is not applied.
/// @throws Error (input) naming the file: missing, neither PNG nor JPEG, cut off, damaged, more than
/// 16384 pixels a side or 2^26 in all, a CMYK JPEG
cv::Mat read_gray_image(const std::filesystem::path& path);

/// Reads a colour image (PNG or JPEG) as 8-bit blue, green, red.
/// @throws Error as read_gray_image
cv::Mat read_color_image(const std::filesystem::path& path);

/// Reads a depth image, a PNG of one 16-bit channel, as it is stored.
/// @throws Error as read_gray_image, and for any other kind of image
cv::Mat read_depth_image(const std::filesystem::path& path);

/// Writes an image as PNG, whole or not at all.
/// @throws Error (storage) naming the file
void write_png(const std::filesystem::path& path, const cv::Mat& image,
               Durability durability = Durability::kAtOnce);

/// Writes an image as JPEG, whole or not at all.
/// @param image 8-bit grey or blue, green, red
/// @param quality 0 to 100
/// @throws Error (storage) naming the file
void write_jpeg(const std::filesystem::path& path, const cv::Mat& image, int quality = 95,
                Durability durability = Durability::kAtOnce);

}  // namespace cairn
