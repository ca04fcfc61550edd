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

/// Reads a list of images: one `timestamp file` per line; lines that start with '#' are comments. Returns the images
/// in the order of time. If the list is out of order, sorts it and logs a remark. If the last line has no line end,
/// logs a loss.
/// @throws Error (input) naming source, line and field for a timestamp that is not a number, a file outside
///         the sequence's folder, a duplicate timestamp, or a list without entries
std::vector<ImageEntry> read_image_list(ByteSource& source, const LogSink& log = {});

/// The file name of a list's line.
/// @throws Error (input) naming the place if the name is empty or leaves the sequence's folder
std::string file_inside(std::string file, const std::string& place);

/// Pairs images with those of another camera one to one, closest in time first, if less than `max_difference_s` apart.
/// Returns the partner of each image, as an index; std::nullopt if none is close enough in time.
std::vector<std::optional<std::size_t>> associate_images(const std::vector<ImageEntry>& images,
                                                         const std::vector<ImageEntry>& partners,
                                                         double max_difference_s);

}  // namespace cairn::detail
