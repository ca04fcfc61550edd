// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Collects observations in the order of a file and orders them by landmark.
class ObservationList {
 public:
  void add(std::uint32_t landmark, FrameIndex frame, const Pixel& pixel,
           std::optional<std::uint32_t> keypoint = {}) {
    entries_.push_back({landmark, frame, pixel, keypoint});
  }

  /// Fills the table, observations of one landmark in the order in which they were added. Without any, they are unknown:
  /// programs that do not keep tracks write empty ones.
  void fill(ObservationTable& table, std::size_t landmarks) {
    if (entries_.empty()) return;
    table.offsets.assign(landmarks + 1, 0);
    for (const Entry& entry : entries_) ++table.offsets[entry.landmark + 1];
    for (std::size_t i = 0; i < landmarks; ++i) table.offsets[i + 1] += table.offsets[i];
    std::vector<std::uint64_t> next(table.offsets.begin(), table.offsets.end() - 1);
    table.frames.resize(entries_.size());
    table.pixels.resize(entries_.size());
    table.keypoints.resize(entries_.size());
    for (const Entry& entry : entries_) {
      const std::uint64_t row = next[entry.landmark]++;
      table.frames[row] = entry.frame;
      table.pixels[row] = entry.pixel;
      table.keypoints[row] = entry.keypoint;
    }
    entries_ = {};
  }

 private:
  struct Entry {
    std::uint32_t landmark;
    FrameIndex frame;
    Pixel pixel;
    std::optional<std::uint32_t> keypoint;
  };
  std::vector<Entry> entries_;
};

}  // namespace cairn::detail
