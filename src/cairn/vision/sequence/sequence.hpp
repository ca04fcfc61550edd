// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/vision/sequence/image.hpp"

namespace cairn {

/// The files of one frame of an RGB-D sequence.
struct SequenceFrame {
  double timestamp_s = 0.0;  ///< of the colour image
  std::filesystem::path color;
  std::optional<std::filesystem::path> depth;  ///< std::nullopt if no depth image is near in time
};

struct SequenceOptions {
  double depth_units_per_metre = 5000.0;  ///< of the stored depth; positive
  double max_time_difference_s = 0.02;    ///< between a colour image and its depth image; positive

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// An RGB-D sequence on disk in the layout of the TUM benchmark: rgb.txt, depth.txt and the images that
/// they list. Holds the lists; reads images one by one.
class RgbdSequence {
 public:
  /// @throws Error (input) naming file, line and field if the lists cannot be read
  explicit RgbdSequence(const std::filesystem::path& folder, const SequenceOptions& options = {},
                        const LogSink& log = {});

  /// In the order of time.
  std::span<const SequenceFrame> frames() const { return frames_; }
  std::size_t frames_without_depth() const { return frames_without_depth_; }
  std::size_t unused_depth_images() const { return unused_depth_images_; }

  /// Images of one frame.
  struct Images {
    GrayImage gray;
    DepthImage depth;  ///< empty if the frame has none
  };
  /// Thread-safe.
  /// @throws Error (input) naming the file: missing, truncated, damaged, or colour and depth of different
  ///        sizes
  Images read(std::size_t frame) const;

 private:
  double depth_units_per_metre_;
  std::vector<SequenceFrame> frames_;
  std::size_t frames_without_depth_ = 0;
  std::size_t unused_depth_images_ = 0;
};

}  // namespace cairn
