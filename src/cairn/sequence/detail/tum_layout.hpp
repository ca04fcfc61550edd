// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"

namespace cairn {

/// One line of rgb.txt or depth.txt.
struct ImageEntry {
  double timestamp_s = 0.0;
  std::string file;  ///< relative to the sequence's folder

  friend bool operator==(const ImageEntry&, const ImageEntry&) = default;
};

/// Reads a list of images: `timestamp file` a line, lines that start with '#' are comments. Returned
/// in the order of time; a list out of order is sorted and remarked on.
/// @throws Error (input) naming source, line and field: text where a number belongs, a file that
///         leaves the sequence's folder, a timestamp that occurs twice, no entries
std::vector<ImageEntry> read_image_list(ByteSource& source, const LogSink& log = {});

/// A colour image and the depth image that belongs to it, as positions in their lists.
struct ImagePair {
  std::size_t color = 0;
  std::optional<std::size_t> depth;  ///< nothing if no depth image is near enough in time
};

/// Gives each colour image at most one depth image, and each depth image to at most one colour image:
/// the closest in time first, less than `max_difference_s` apart. All colour images, in order.
std::vector<ImagePair> associate_images(const std::vector<ImageEntry>& color,
                                        const std::vector<ImageEntry>& depth,
                                        double max_difference_s);

}  // namespace cairn
