// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Two frames that see the same landmarks.
struct CovisibleFrames {
  FrameIndex first;
  FrameIndex second;
  std::size_t landmarks = 0;  ///< number that both observe
};

/// Frames that belong together, by the landmarks that they share.
struct ConnectedFrames {
  std::vector<FrameIndex> frames;  ///< ascending
  /// Share of the landmarks that the group sees which other frames see, too; 0 if it sees none.
  double shared = 0.0;
};

/// How the frames of a map are connected by landmarks that several of them see: the strongest connections that connect
/// all frames that can be connected (a maximum spanning forest, by Kruskal 1956). Refers to the map.
class Covisibility {
 public:
  explicit Covisibility(const LandmarkMap& map);

  /// Strongest first; of equal ones, by their frames.
  std::span<const CovisibleFrames> forest() const { return forest_; }

  /// Divides the frames between `seeds` and `others`: each frame belongs to the one to which it is connected more strongly,
  /// where a chain of connections is as strong as its weakest. Frames that neither reaches belong to neither.
  /// @return the group of `seeds`
  ConnectedFrames group_of(std::span<const FrameIndex> seeds,
                           std::span<const FrameIndex> others) const;

 private:
  const LandmarkMap& map_;
  std::vector<CovisibleFrames> forest_;
};

/// Per frame: the landmarks that it observes, ascending.
std::vector<std::vector<std::uint32_t>> landmarks_by_frame(const LandmarkMap& map);

}  // namespace cairn::detail
