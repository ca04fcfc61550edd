// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/vision/detail/bundle_adjustment.hpp"
#include "cairn/vision/detail/covariances.hpp"
#include "cairn/vision/detail/keyframe_map.hpp"
#include "cairn/vision/detail/landmark_colors.hpp"
#include "cairn/vision/map_sequence.hpp"

namespace cairn {
namespace {

using detail::ExpectedLandmarks;
using detail::FeatureExtractor;
using detail::KeyframeMap;
using detail::Keypoint;
using detail::LandmarkGraph;
using detail::LandmarkMatch;
using detail::TrackedFrame;

// A frame and its pose.
struct PosedFrame {
  std::size_t frame = 0;
  TimedPose pose;
};

std::optional<Rigid3> pose_near(const Trajectory& poses, double timestamp_s,
                                double max_difference_s) {
  const TimedPose* const nearest = nearest_pose(poses, timestamp_s);
  if (nearest == nullptr) return std::nullopt;
  const double difference = std::abs(nearest->timestamp_s - timestamp_s);
  if (difference > max_difference_s) return std::nullopt;
  if (auto pose = interpolated(poses, timestamp_s)) return pose;
  constexpr double kSameTime = 1e-3;  // if only some keyframes have poses, with rounded times
  return difference <= kSameTime ? std::optional(nearest->world_from_camera) : std::nullopt;
}

std::vector<PosedFrame> frames_with_pose(std::span<const double> timestamps_s,
                                         const Trajectory& poses, double max_difference_s) {
  std::vector<PosedFrame> posed;
  for (std::size_t i = 0; i < timestamps_s.size(); ++i) {
    const auto pose = pose_near(poses, timestamps_s[i], max_difference_s);
    if (pose) posed.push_back({i, {timestamps_s[i], *pose}});
  }
  if (posed.empty()) {
    const auto stretch = [](double first, double last) {
      return fmt::format("{:.6f} to {:.6f} s", first, last);
    };
    throw Error(ErrorKind::kInput, "poses",
                timestamps_s.empty() ? "there is no frame"
                : poses.empty()
                    ? "there is none"
                    : fmt::format("none is near in time to a frame: poses from {}, frames from {}",
                                  stretch(poses.poses().front().timestamp_s,
                                          poses.poses().back().timestamp_s),
                                  stretch(timestamps_s.front(), timestamps_s.back())),
                "poses at the times of the frames");
  }
  return posed;
}

std::vector<PosedFrame> choose_keyframes(std::span<const PosedFrame> frames) {
  std::vector<PosedFrame> chosen;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool at_an_end = chosen.empty() || i + 1 == frames.size();
    if (at_an_end || detail::is_new_view(chosen.back().pose.world_from_camera.inverse() *
                                         frames[i].pose.world_from_camera)) {
      chosen.push_back(frames[i]);
    }
  }
  return chosen;
}

// Builds the landmarks of consecutive keyframes.
class PosedMapping {
 public:
  PosedMapping(const Camera& camera, const MapAtPosesOptions& options)
      : map_(camera, options.features, options.noise) {}

  const FeatureExtractor& extractor() const { return map_.extractor(); }

  /// The number of landmarks that it observes.
  std::size_t add(TrackedFrame frame) {
    // Search radius for a corner, because poses and landmarks have errors.
    constexpr double kRadius = 6.0;
    frame.landmarks.assign(frame.features.size(), std::nullopt);
    const ExpectedLandmarks expected = map_.expected_in(frame);
    std::vector<LandmarkMatch> matches =
        map_.align(frame, map_.match_corners(frame, expected, kRadius));
    const auto more = map_.find_without_corners(frame, expected, matches);
    matches.insert(matches.end(), more.begin(), more.end());
    take(frame, matches);
    map_.note_found(frame, expected);
    const std::uint32_t index = map_.add_keyframe(frame);

    std::vector<LandmarkIndex> observed;
    for (const auto& landmark : map_.graph().keyframes()[index].landmarks) {
      if (landmark) observed.push_back(*landmark);
    }
    adjust_landmarks(map_.graph(), observed);
    map_.cull(index);
    return observed.size();
  }

  LandmarkMap finish(const MapOptions& options) {
    LandmarkGraph& graph = map_.graph();
    map_.adopt_estimated_noise();
    std::vector<LandmarkIndex> again;
    for (std::uint32_t i = 0; i < graph.landmarks().size(); ++i) {
      if (graph.landmarks()[i].observations.size() > 1) again.push_back({i});
    }
    drop_outliers(graph, again);
    adjust_landmarks(graph, again);
    // The poses are fixed.
    const std::vector<std::optional<Matrix6d>> exact(graph.keyframes().size(), Matrix6d::Zero());
    return map_.to_map(options, recursive_covariances(graph, exact), {});
  }

 private:
  // Keeps the matches at the expected depth, which excludes other surfaces and wrong corners.
  void take(TrackedFrame& frame, std::span<const LandmarkMatch> matches) const {
    const Rigid3 camera_from_world = frame.world_from_camera.inverse();
    constexpr double kMostOff = 5.0;  // standard deviations
    for (const LandmarkMatch& match : matches) {
      const Keypoint& keypoint = frame.features.keypoints()[match.keypoint];
      const double depth = (camera_from_world * map_.graph().landmark(match.landmark).position).z();
      const bool agrees = keypoint.depth_m <= 0.0F ||
                          std::abs(keypoint.depth_m - depth) <=
                              kMostOff * map_.sensor().sigma_depth_m(depth, keypoint.octave);
      if (agrees) frame.landmarks[match.keypoint] = match.landmark;
    }
  }

  KeyframeMap map_;
};

struct PosedImages {
  std::string defect;
  TrackedFrame frame;
};

// @param frames may become keyframes
// @param result contains the counts so far
MapAtPoses map_keyframes(std::span<const PosedFrame> frames,
                         const std::function<FrameImages(std::size_t frame)>& read_frame,
                         const Camera& camera, const MapAtPosesOptions& options,
                         const Execution& execution, MapAtPoses result) {
  const std::vector<PosedFrame> keyframes = choose_keyframes(frames);
  PosedMapping mapping(camera, options);
  const auto prepare = [&](std::size_t i) {
    if (execution.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, "mapping", "was cancelled", "");
    }
    const FrameImages images = read_frame(keyframes[i].frame);
    PosedImages prepared{images.defect, {}};
    if (images.gray.empty()) return prepared;
    prepared.frame.number = keyframes[i].frame;
    prepared.frame.timestamp_s = images.timestamp_s;
    prepared.frame.image_name = images.name;
    prepared.frame.features = mapping.extractor().extract(detail::matrix_of(images.gray),
                                                          detail::matrix_of(images.depth_m),
                                                          detail::matrix_of(images.right));
    prepared.frame.world_from_camera = keyframes[i].pose.world_from_camera;
    return prepared;
  };
  const auto add = [&](std::size_t i, PosedImages prepared) {
    std::size_t landmarks = 0;
    if (prepared.defect.empty()) {
      if (!prepared.frame.features.has_depth()) ++result.without_depth;
      landmarks = mapping.add(std::move(prepared.frame));
    } else {
      ++result.unreadable;
      if (execution.log) execution.log("left out: " + prepared.defect);
    }
    if (options.on_frame) options.on_frame({i + 1, keyframes.size(), landmarks, 0});
    if (execution.progress) {
      execution.progress(static_cast<double>(i + 1) / static_cast<double>(keyframes.size()));
    }
  };
  constexpr std::size_t kFramesAhead = 6;
  execution.executor.in_order(keyframes.size(), kFramesAhead, prepare, add);
  result.map = with_content_uuid(mapping.finish(options.map));
  reject_if(result.map.landmark_count() == 0, "sequence",
            fmt::format("no landmark in {} keyframes", keyframes.size()),
            "images with texture and depth");
  return result;
}

// Result before any image is read. @param frames total number, with and without a pose
MapAtPoses counted(std::span<const PosedFrame> posed, std::size_t frames) {
  std::vector<TimedPose> poses;
  for (const PosedFrame& frame : posed) poses.push_back(frame.pose);
  MapAtPoses result;
  result.trajectory = Trajectory(std::move(poses));
  result.frames = frames;
  result.without_pose = frames - posed.size();
  return result;
}

}  // namespace

void MapAtPosesOptions::validate() const {
  features.validate();
  noise.validate();
  map.validate();
  refuse_if(map.covariance != LandmarkCovariance::kRecursive, "MapAtPosesOptions.map.covariance",
            "marginal", "recursive where poses are given");
  refuse_if(!(max_time_difference_s > 0.0 && std::isfinite(max_time_difference_s)),
            "MapAtPosesOptions.max_time_difference_s", fmt::format("{}", max_time_difference_s),
            "a positive number of seconds");
}

MapAtPoses map_at_poses(std::span<const double> timestamps_s,
                        const std::function<FrameImages(std::size_t frame)>& read_frame,
                        const Trajectory& poses, const Camera& camera,
                        const MapAtPosesOptions& options, const Execution& execution) {
  options.validate();
  const auto posed = frames_with_pose(timestamps_s, poses, options.max_time_difference_s);
  return map_keyframes(posed, read_frame, camera, options, execution,
                       counted(posed, timestamps_s.size()));
}

MapAtPoses map_at_poses(const ImageSequence& sequence, const Trajectory& poses,
                        const Camera& camera, const MapAtPosesOptions& options,
                        const Execution& execution) {
  options.validate();
  std::vector<double> timestamps;
  for (const SequenceFrame& frame : sequence.frames()) timestamps.push_back(frame.timestamp_s);
  auto posed = frames_with_pose(timestamps, poses, options.max_time_difference_s);
  MapAtPoses result = counted(posed, timestamps.size());
  result.without_depth = std::erase_if(posed, [&](const PosedFrame& frame) {
    const SequenceFrame& files = sequence.frames()[frame.frame];
    return !files.depth && !files.right;
  });
  const auto read = [&](std::size_t frame) {
    return frame_images(sequence, frame, camera, options.skip_unreadable);
  };
  MapAtPosesOptions with_baseline = options;
  with_baseline.features.baseline_m = sequence.baseline_m();
  result = map_keyframes(posed, read, camera, with_baseline, execution, std::move(result));
  result.map = detail::with_colors(std::move(result.map), sequence, execution);
  return result;
}

}  // namespace cairn
