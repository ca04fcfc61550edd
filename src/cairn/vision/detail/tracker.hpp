// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/vision/detail/keyframe_map.hpp"
#include "cairn/vision/detail/pose_estimation.hpp"
#include "cairn/vision/map_sequence.hpp"
#include "cairn/vision/odometry.hpp"

namespace cairn::detail {

/// A map that was completed when the next map was begun.
struct FinishedMap {
  LandmarkMap map;
  Trajectory trajectory;
  Link to_next;  ///< link of odometry, without nodes: pose of the next map
};

/// Implementation of Odometry. The features of a frame are extracted outside of it, because this is costly and
/// independent of other frames.
class Tracker {
 public:
  Tracker(const Camera& camera, const OdometryOptions& options);
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  const FeatureExtractor& extractor() const { return map_.extractor(); }
  FrameReport track(double timestamp_s, Features features, std::string image_name);
  void complete();
  Trajectory trajectory() const;
  LandmarkMap map(const MapOptions& options) const;
  std::optional<Rigid3> last_pose() const;
  /// Whether a map can begin at the last frame: it was tracked, and has enough depth and texture.
  bool can_begin_new_map() const;
  /// Ends the map with the last frame as its last keyframe, and begins the next map with the same frame as its
  /// first keyframe. The camera of this keyframe is the frame of the next map. The two maps share no landmark.
  /// @throws Error (misuse) unless can_begin_new_map()
  FinishedMap begin_new_map(const MapOptions& options);

 private:
  // Pose of a frame relative to a keyframe, so that the frame moves with the keyframe.
  struct RecordedPose {
    double timestamp_s = 0.0;
    std::uint32_t keyframe = 0;
    Rigid3 keyframe_from_camera;
  };

  struct MapCovariances {
    std::vector<Eigen::Matrix3d> landmarks;
    std::vector<Matrix6d> poses;  // one per keyframe; none for more than kMostDenseFrames
  };

  bool start(TrackedFrame& frame);
  std::optional<PoseEstimate> locate_by_previous(TrackedFrame& frame, double radius) const;
  std::optional<PoseEstimate> locate_by_keyframe(TrackedFrame& frame, std::uint32_t keyframe) const;
  std::optional<PoseEstimate> locate_anywhere(TrackedFrame& frame) const;
  PoseEstimate locate_in_map(TrackedFrame& frame, double radius);
  std::vector<PointMatch> points_of(const TrackedFrame& frame,
                                    std::span<const LandmarkMatch> matches) const;
  // The frame's matches with landmarks that still exist.
  std::vector<LandmarkMatch> matches_of(const TrackedFrame& frame) const;
  // Refines the frame's pose and keeps the matches that fit.
  PoseEstimate solve(TrackedFrame& frame, std::span<const LandmarkMatch> matches) const;
  static void take(TrackedFrame& frame, std::span<const LandmarkMatch> matches,
                   const PoseEstimate& estimate);
  // Whether the last tracked frame shows how the camera moves: it is the frame before, or from a short time ago.
  bool bridges(const TrackedFrame& frame) const;
  // The velocity at a frame, from its pose and the preceding poses; if no frame bridges(), the velocity that its
  // features assume.
  RowMotionPrior row_motion(const TrackedFrame& frame) const;
  // Estimates the motion during the readout, corrects the frame for it, and solves again.
  PoseEstimate solve_with_motion(TrackedFrame& frame, std::span<const LandmarkMatch> matches,
                                 RowMotionPrior prior) const;
  void note_motion(const TrackedFrame& frame);
  // Corrects the last tracked frame for the motion during its readout, which is known better with the next frame.
  // Also moves its keyframe, if it is one, and the next frame's pose.
  void settle_previous(TrackedFrame& next);
  Rigid3 predicted_pose(const TrackedFrame& frame) const;
  bool wants_keyframe(const TrackedFrame& frame, std::size_t found) const;
  void make_keyframe(TrackedFrame& frame);
  // Adjusts the last keyframe and the keyframes that share most landmarks with it.
  void adjust_newest();
  void end_at_last_frame();
  MapCovariances map_covariances(LandmarkCovariance kind) const;
  std::vector<float> reprojection_errors(const TrackedFrame& frame) const;

  OdometryOptions options_;
  KeyframeMap map_;
  LandmarkGraph& graph_;  // of map_
  std::size_t frames_ = 0;
  bool lost_ = false;
  std::optional<TrackedFrame> previous_;  // the last tracked frame
  std::optional<Rigid3> motion_;          // previous_from_next, assumed constant
  std::optional<RowMotion> between_;      // mean velocity from the last frame but one to the last
  double between_s_ = 0.0;                // the time between them
  // Whether the motion during the readout of previous_ is certain.
  bool motion_is_certain_ = true;
  // Whether the motion is steady at previous_, so that its velocity is known without the next frame.
  bool motion_is_steady_ = true;
  std::optional<RowMotion> velocity_;  // at the last frame
  std::uint32_t reference_ = 0;  // keyframe that shares most landmarks with the last tracked frame
  std::size_t reference_found_ = 0;
  std::vector<RecordedPose> recorded_;
};

}  // namespace cairn::detail
