// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"

namespace cairn::detail {

/// One line of rgb.txt or depth.txt.
struct ImageEntry {
  double timestamp_s = 0.0;
  std::string file;  ///< relative to the sequence's folder

  friend bool operator==(const ImageEntry&, const ImageEntry&) = default;
};

/// Reads a list of images: one `timestamp file` per line; lines that start with '#' are comments. Returns
/// them in time order; sorts a list that is out of order and logs a remark, or a loss if the last line does not end.
/// @throws Error (input) naming source, line and field for a timestamp that is not a number, a file outside
///         the sequence's folder, a duplicate timestamp, or a list without entries
std::vector<ImageEntry> read_image_list(ByteSource& source, const LogSink& log = {});

/// A colour image and its depth image, as indices into their lists.
struct ImagePair {
  std::size_t color = 0;
  std::optional<std::size_t> depth;  ///< std::nullopt if no depth image is close enough in time
};

/// Pairs colour images with depth images one to one, closest in time first, if less than `max_difference_s`
/// apart. Returns all colour images, in order.
std::vector<ImagePair> associate_images(const std::vector<ImageEntry>& color,
                                        const std::vector<ImageEntry>& depth,
                                        double max_difference_s);

}  // namespace cairn::detail
