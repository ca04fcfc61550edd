// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/ids.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Two frames that see the same landmarks.
struct CovisibleFrames {
  FrameIndex first;
  FrameIndex second;
  std::size_t landmarks = 0;  ///< number that both observe
};

/// Frames that belong together, by the landmarks that they share.
struct FrameGroup {
  std::vector<FrameIndex> frames;  ///< ascending
  /// Share of the landmarks that the group sees which other frames see, too; 0 if it sees none.
  double shared = 0.0;
};

/// Frames that look at the same landmarks as other frames from the same side, but share few of them.
struct SeparateFrames {
  std::vector<FrameIndex> frames;  ///< ascending
  double shared = 0.0;             ///< share of the landmarks in view of both that both observe
  double usual = 0.0;  ///< the same among themselves or among the others, the lower of both
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
  FrameGroup group_of(std::span<const FrameIndex> seeds, std::span<const FrameIndex> others) const;

 private:
  const LandmarkMap& map_;
  std::vector<CovisibleFrames> forest_;
};

/// Groups of at least three frames that are where other frames are, by their poses, and share less than a quarter of the
/// landmarks that frames so close share elsewhere: a model that takes one of two similar places for the other is folded
/// there, or a loop is not closed. Only of maps whose images have names and no timestamps: mapping a session anew where
/// it returns is no defect.
std::vector<SeparateFrames> separate_frames(const LandmarkMap& map);

/// "a.jpg, b.jpg, ...": the names of the first eight frames' images, for people.
std::string image_list(const LandmarkMap& map, std::span<const FrameIndex> frames);

}  // namespace cairn
