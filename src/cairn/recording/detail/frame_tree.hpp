// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cairn/geometry/trajectory.hpp"
#include "cairn/recording/recording.hpp"

namespace cairn::detail {

/// Whether a topic states transforms that may change, as /tf does.
bool has_moving_transforms(const RecordedTopic& topic);

/// The coordinate frames of a recording: /tf_static, and on demand a topic of transforms that may
/// change. Names of frames are compared without ROS 1's leading slash.
class FrameTree {
 public:
  /// @param moving name of a topic of transforms that may change; empty: none
  /// @throws Error (input) for a frame with two parents in `moving`
  explicit FrameTree(const Recording& recording, const std::string& moving = {});

  /// target_from_source by transforms that do not change; identity for equal frames; std::nullopt
  /// if unknown.
  std::optional<Rigid3> between(const std::string& target, const std::string& source) const;

  /// Poses world_from_frame at the times of the most frequent transform between the two; the other
  /// transforms are interpolated.
  /// @param world empty: the topmost frame above `frame`
  /// @throws Error (input) if `world` is not above `frame`, or no transform moves `frame` in it
  Trajectory poses(const std::string& world, const std::string& frame) const;

 private:
  struct Step {
    std::string parent;
    Rigid3 parent_from_child;
    std::vector<TimedPose> moving;  ///< parent_from_child by time, if it may change
  };
  struct Path {
    std::vector<std::string> frames;  ///< from the lowest, one more than steps
    std::vector<const Step*> steps;
  };

  void read_moving(const Recording& recording, const std::string& topic);
  Path path_up(const std::string& frame) const;

  std::string place_;                  // for messages
  std::map<std::string, Step> steps_;  // by child
};

}  // namespace cairn::detail
