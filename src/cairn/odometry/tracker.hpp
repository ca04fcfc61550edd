// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/odometry/landmark_graph.hpp"
#include "cairn/odometry/landmark_matching.hpp"
#include "cairn/odometry/odometry.hpp"
#include "cairn/odometry/pose_estimation.hpp"

namespace cairn {

/// What Odometry does, frame by frame.
class Odometry::Tracker {
 public:
  Tracker(const Camera& camera, const OdometryOptions& options);
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  const FeatureExtractor& extractor() const { return extractor_; }
  FrameReport track(double timestamp_s, Features features, std::string image_name);
  void complete();
  Trajectory trajectory() const;
  LandmarkMap map(const MapOptions& options) const;
  std::optional<Rigid3> last_pose() const;
  FinishedMap begin_new_map(const MapOptions& options);

 private:
  // A frame while it is looked at.
  struct Frame {
    std::size_t number = 0;
    double timestamp_s = 0.0;
    std::string image_name;
    Features features;
    Rigid3 world_from_camera;
    std::vector<std::optional<LandmarkIndex>> landmarks;  // one a keypoint
  };
  // Where a frame was, relative to a keyframe, so that it follows when that moves.
  struct RecordedPose {
    double timestamp_s = 0.0;
    std::uint32_t keyframe = 0;
    Rigid3 keyframe_from_camera;
  };

  bool start(Frame& frame);
  std::optional<PoseEstimate> locate_by_previous(Frame& frame, double radius) const;
  std::optional<PoseEstimate> locate_by_keyframe(Frame& frame, std::uint32_t keyframe) const;
  std::optional<PoseEstimate> locate_anywhere(Frame& frame) const;
  PoseEstimate locate_in_map(Frame& frame, double radius);
  std::vector<PointMatch> points_of(const Frame& frame,
                                    std::span<const LandmarkMatch> matches) const;
  // Refines the frame's pose and keeps the matches that fit.
  PoseEstimate solve(Frame& frame, std::span<const LandmarkMatch> matches) const;
  static void take(Frame& frame, std::span<const LandmarkMatch> matches,
                   const PoseEstimate& estimate);
  // Where a landmark's patch is found in a frame, near `start`, and on which octave.
  struct FoundPatch {
    Pixel raw;
    int octave = 0;
  };
  std::optional<FoundPatch> find_patch(const Features& features, LandmarkIndex landmark,
                                       const Rigid3& camera_from_world, const Pixel& start) const;
  std::vector<LandmarkMatch> find_without_corners(Frame& frame,
                                                  std::span<const LandmarkIndex> landmarks) const;
  void cut_patch(const KeypointReference& reference);
  bool wants_keyframe(const Frame& frame, std::size_t found) const;
  void make_keyframe(Frame& frame);
  void merge_known_landmarks(std::uint32_t keyframe);
  void cull(std::uint32_t newest);
  void end_at_last_frame();
  std::vector<Eigen::Matrix3d> landmark_covariances(LandmarkCovariance kind) const;
  LandmarkMap map(const MapOptions& options, const std::vector<Eigen::Matrix3d>& covariances) const;
  std::vector<float> reprojection_errors(const Frame& frame) const;

  OdometryOptions options_;
  Camera camera_;
  cv::Size image_;
  FeatureExtractor extractor_;
  SensorModel sensor_;
  LandmarkGraph graph_;
  std::size_t frames_ = 0;
  bool lost_ = false;
  std::optional<Frame> previous_;  // the last tracked one
  std::optional<Rigid3> motion_;   // previous_from_next, taken to go on
  std::uint32_t reference_ = 0;    // keyframe that shares most with the last tracked frame
  std::size_t reference_found_ = 0;
  std::vector<RecordedPose> recorded_;
};

}  // namespace cairn
