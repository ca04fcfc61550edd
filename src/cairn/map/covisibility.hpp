// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Two frames that observe common landmarks.
struct CovisibleFrames {
  FrameIndex first;
  FrameIndex second;
  std::size_t landmarks = 0;  ///< number of common landmarks
};

/// Frames connected by common landmarks.
struct FrameGroup {
  std::vector<FrameIndex> frames;  ///< ascending
  /// Share of the group's observed landmarks that other frames observe, too; 0 without landmarks.
  double shared = 0.0;
};

/// Frames that view the same landmarks as others from similar viewpoints, but share few of them.
struct SeparateFrames {
  std::vector<FrameIndex> frames;  ///< ascending
  double shared = 0.0;             ///< share observed by both among landmarks in view of both
  double usual = 0.0;              ///< the lower share within the group or within the other frames
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
  FrameGroup group_of(std::span<const FrameIndex> seeds, std::span<const FrameIndex> others) const;

 private:
  const LandmarkMap& map_;
  std::vector<CovisibleFrames> forest_;
};

/// Groups of at least three frames that, by their poses, view the same landmarks as other frames,
/// but share less than a quarter of the share usual in the map: the model confuses two similar
/// places (a fold), or a loop is not closed. Only for maps with image names and no timestamps,
/// because a session that remaps a revisited place is no defect.
std::vector<SeparateFrames> separate_frames(const LandmarkMap& map);

/// Names of the first eight frames' images, for display: "a.jpg, b.jpg, ...".
std::string image_list(const LandmarkMap& map, std::span<const FrameIndex> frames);

}  // namespace cairn
