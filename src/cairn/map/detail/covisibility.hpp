// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Two frames that observe common landmarks.
struct CovisibleFrames {
  FrameIndex first;
  FrameIndex second;
  std::size_t landmarks = 0;  ///< number of common landmarks
};

/// Frames connected by common landmarks.
struct ConnectedFrames {
  std::vector<FrameIndex> frames;  ///< ascending
  /// Share of the group's observed landmarks that other frames observe, too; 0 without landmarks.
  double shared = 0.0;
};

/// Covisibility graph of a map's frames, reduced to its maximum spanning forest (Kruskal 1956);
/// edge weights are numbers of common landmarks. Keeps a reference to the map.
class Covisibility {
 public:
  explicit Covisibility(const LandmarkMap& map);

  /// Edges by descending weight, then by frames.
  std::span<const CovisibleFrames> forest() const { return forest_; }

  /// Divides the frames between `seeds` and `others`: each frame joins the side with the stronger
  /// connection; a path is as strong as its weakest edge. Frames connected to neither side belong
  /// to neither.
  /// @return the group of `seeds`
  ConnectedFrames group_of(std::span<const FrameIndex> seeds,
                           std::span<const FrameIndex> others) const;

 private:
  const LandmarkMap& map_;
  std::vector<CovisibleFrames> forest_;
};

/// Landmarks observed by each frame, ascending.
std::vector<std::vector<std::uint32_t>> landmarks_by_frame(const LandmarkMap& map);

}  // namespace cairn::detail
