// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/map_sequence.hpp"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/vision/detail/landmark_colors.hpp"
#include "cairn/vision/detail/tracker.hpp"

namespace cairn {
namespace {

// Enough items that no thread waits for another; each holds two images.
constexpr std::size_t kFramesAhead = 6;

// Depths of an image, metres.
struct DepthRange {
  float middle = 0.0F;  // the median
  float reach = 0.0F;   // which one depth in 20 exceeds
};

struct PreparedFrame {
  double timestamp_s = 0.0;
  std::string name;
  std::string defect;
  bool has_depth = false;
  std::optional<DepthRange> depth_range;
  std::optional<detail::Features> features;  // std::nullopt: unreadable
};

// Of one pixel in 64; std::nullopt where no depth is known.
std::optional<DepthRange> depth_range(const DepthImage& depth_m) {
  constexpr std::size_t kStep = 8;
  std::vector<float> depths;
  for (std::size_t row = 0; row < depth_m.height; row += kStep) {
    for (std::size_t column = 0; column < depth_m.width; column += kStep) {
      if (depth_m.at(column, row) > 0.0F) depths.push_back(depth_m.at(column, row));
    }
  }
  if (depths.empty()) return std::nullopt;
  return DepthRange{upper_median(depths), nth_lowest(depths, depths.size() * 19 / 20)};
}

PreparedFrame prepare(const FrameImages& images, const detail::FeatureExtractor& extractor) {
  const cv::Mat gray = detail::matrix_of(images.gray);
  const bool has_depth = !images.depth_m.empty() || !images.right.empty();
  PreparedFrame prepared{images.timestamp_s,          images.name, images.defect, has_depth,
                         depth_range(images.depth_m), std::nullopt};
  if (!gray.empty()) {
    prepared.features =
        extractor.extract(gray, detail::matrix_of(images.depth_m), detail::matrix_of(images.right));
  }
  return prepared;
}

// Combines the frames' results, in order.
class Mapping {
 public:
  Mapping(const Camera& camera, const MapSequenceOptions& options, const Execution& execution)
      : tracker_(camera, options.odometry), options_(&options), execution_(&execution) {}

  const detail::FeatureExtractor& extractor() const { return tracker_.extractor(); }

  void add(PreparedFrame frame, std::size_t frames) {
    ++result_.frames;
    if (!frame.has_depth) ++result_.frames_without_depth;
    if (frame.depth_range) {
      depth_middles_m_.push_back(frame.depth_range->middle);
      depth_reaches_m_.push_back(frame.depth_range->reach);
    }
    FrameReport report;
    if (frame.features) {
      report = tracker_.track(frame.timestamp_s, std::move(*frame.features), frame.name);
    } else {
      ++result_.unreadable;
      if (execution_->log) execution_->log("left out: " + frame.defect);
      report.status = result_.tracked > 0 ? FrameStatus::kLost : FrameStatus::kWaiting;
    }
    if (report.status == FrameStatus::kTracked) note_tracked(report);
    if (report.status == FrameStatus::kLost) note_lost(frame.timestamp_s);
    if (report.status == FrameStatus::kWaiting) ++result_.waiting;
    was_lost_ = report.status == FrameStatus::kLost;

    // A map that starts without depth would be lost at once; the next frame may be suitable.
    if (report.status == FrameStatus::kTracked && is_long_enough() &&
        tracker_.can_begin_new_map()) {
      detail::FinishedMap finished = tracker_.begin_new_map(options_->map);
      add_poses(finished.trajectory);
      first_from_map_ = first_from_map_ * finished.to_next.target_from_source->rigid();
      result_.maps.push_back(with_content_uuid(std::move(finished.map)));
      Link& link = result_.links.emplace_back(finished.to_next);
      link.target = NodeId{result_.links.size() - 1};
      link.source = NodeId{result_.links.size()};
      frames_in_map_ = 1;
      path_in_map_ = 0.0;
      turn_in_map_ = 0.0;
      last_pose_ = tracker_.last_pose();
    }
    if (options_->on_frame) {
      options_->on_frame({result_.frames, frames, report.landmarks, result_.lost_frames()});
    }
    if (execution_->progress) {
      execution_->progress(static_cast<double>(result_.frames) / static_cast<double>(frames));
    }
  }

  MappedSequence finish() {
    remark_on_depth();
    tracker_.complete();
    add_poses(tracker_.trajectory());
    result_.trajectory = Trajectory(std::move(poses_));
    // Drops a mini-map of a single frame at the end, because the previous one has the same data.
    if (frames_in_map_ > 1 || (frames_in_map_ == 1 && result_.maps.empty())) {
      result_.maps.push_back(with_content_uuid(tracker_.map(options_->map)));
    } else if (!result_.links.empty()) {
      result_.links.pop_back();
    }
    for (const LandmarkMap& map : result_.maps) result_.keyframes += map.frame_count();
    if (result_.tracked > 0) {
      result_.mean_tracked_landmarks = landmark_sum_ / static_cast<double>(result_.tracked);
    }
    if (!errors_.empty()) result_.median_reprojection_error = upper_median(errors_);
    return std::move(result_);
  }

 private:
  void note_tracked(const FrameReport& report) {
    ++result_.tracked;
    ++frames_in_map_;
    landmark_sum_ += static_cast<double>(report.landmarks);
    if (!report.keyframe) {
      errors_.insert(errors_.end(), report.reprojection_errors.begin(),
                     report.reprojection_errors.end());
    }
    const Rigid3 pose = *tracker_.last_pose();
    if (last_pose_) {
      path_in_map_ += (pose.translation() - last_pose_->translation()).norm();
      turn_in_map_ += (last_pose_->inverse() * pose).angle();
    }
    last_pose_ = pose;
  }

  void note_lost(double timestamp_s) {
    if (!was_lost_) result_.lost.push_back({timestamp_s, timestamp_s, 0});
    result_.lost.back().last_timestamp_s = timestamp_s;
    ++result_.lost.back().frames;
  }

  // Depth images in the wrong unit give a map that is wrong only by a factor, which only implausible lengths
  // reveal.
  void remark_on_depth() {
    if (!execution_->log || depth_reaches_m_.empty()) return;
    const double middle = upper_median(depth_middles_m_);
    const double reach = upper_median(depth_reaches_m_);
    constexpr double kLeast = 0.4;  // least range of most depth cameras
    const double most = options_->odometry.features.max_depth_m;
    if (middle >= kLeast && reach <= most) return;
    const bool near = middle < kLeast;
    execution_->log(fmt::format(
        "{} {:.3g} m, where depth cameras measure {} to {} m: check the depth images' units per "
        "metre (--depth-units; 1000 for millimetres), on which all lengths depend",
        near ? "half of all depths are below" : "the depth images reach", near ? middle : reach,
        kLeast, most));
  }

  bool is_long_enough() const {
    if (!options_->mini_maps) return false;
    const MiniMapLength& length = *options_->mini_maps;
    return (length.metres && path_in_map_ >= *length.metres) ||
           (length.frames && frames_in_map_ >= *length.frames) ||
           (length.turn_rad && turn_in_map_ >= *length.turn_rad);
  }

  // The first pose of a mini-map is the last one of the map before.
  void add_poses(const Trajectory& trajectory) {
    for (const TimedPose& pose : trajectory.poses()) {
      if (!poses_.empty() && pose.timestamp_s <= poses_.back().timestamp_s) continue;
      poses_.push_back({pose.timestamp_s, first_from_map_ * pose.world_from_camera});
    }
  }

  detail::Tracker tracker_;
  const MapSequenceOptions* options_;
  const Execution* execution_;
  MappedSequence result_;
  std::vector<TimedPose> poses_;
  Rigid3 first_from_map_;  // the map being built, in the frame of the first
  std::vector<float> errors_;
  std::vector<float> depth_middles_m_;
  std::vector<float> depth_reaches_m_;
  double landmark_sum_ = 0.0;
  bool was_lost_ = false;
  std::size_t frames_in_map_ = 0;
  double path_in_map_ = 0.0;
  double turn_in_map_ = 0.0;
  std::optional<Rigid3> last_pose_;
};

}  // namespace

void MapSequenceOptions::validate() const {
  odometry.validate();
  map.validate();
  if (!mini_maps) return;
  const auto require_positive = [](std::optional<double> value, std::string_view field) {
    if (value) {
      detail::require(*value > 0.0 && std::isfinite(*value), field, *value, "a positive number");
    }
  };
  require_positive(mini_maps->metres, "MapSequenceOptions.mini_maps.metres");
  require_positive(mini_maps->turn_rad, "MapSequenceOptions.mini_maps.turn_rad");
  if (mini_maps->frames) {
    detail::require(*mini_maps->frames >= 2, "MapSequenceOptions.mini_maps.frames",
                    *mini_maps->frames, "at least 2");
  }
}

std::size_t MappedSequence::lost_frames() const {
  std::size_t sum = 0;
  for (const LostStretch& stretch : lost) sum += stretch.frames;
  return sum;
}

MappedSequence map_frames(std::size_t frames,
                          const std::function<FrameImages(std::size_t frame)>& read_frame,
                          const Camera& camera, const MapSequenceOptions& options,
                          const Execution& execution) {
  options.validate();
  Mapping mapping(camera, options, execution);
  execution.executor.in_order(
      frames, kFramesAhead,
      [&](std::size_t i) {
        if (execution.stop.stop_requested()) {
          throw Error(ErrorKind::kCancelled, "mapping", "was cancelled", "");
        }
        return prepare(read_frame(i), mapping.extractor());
      },
      [&](std::size_t, PreparedFrame frame) { mapping.add(std::move(frame), frames); });
  return mapping.finish();
}

MappedSequence map_sequence(const ImageSequence& sequence, const Camera& camera,
                            const MapSequenceOptions& options, const Execution& execution) {
  const auto read = [&](std::size_t frame) {
    return frame_images(sequence, frame, camera, options.skip_unreadable);
  };
  MapSequenceOptions with_baseline = options;
  with_baseline.odometry.features.baseline_m = sequence.baseline_m();
  MappedSequence mapped =
      map_frames(sequence.frames().size(), read, camera, with_baseline, execution);
  for (LandmarkMap& map : mapped.maps) {
    map = detail::with_colors(std::move(map), sequence, execution);
  }
  return mapped;
}

PoseGraph pose_graph(const MappedSequence& mapped, std::span<const std::string> names) {
  refuse_if(names.size() != mapped.maps.size(), "names", fmt::format("{} of them", names.size()),
            fmt::format("{}, one a mini-map", mapped.maps.size()));
  std::string uuids;
  for (const LandmarkMap& map : mapped.maps) uuids += map.info().uuid.value_or(content_uuid(map));
  const std::string session = uuid_of(uuids);
  PoseGraph graph;
  Similarity3 world_from_node;
  for (std::size_t i = 0; i < mapped.maps.size(); ++i) {
    graph.nodes.push_back({NodeId{i}, names[i], session, world_from_node});
    if (i >= mapped.links.size()) continue;
    world_from_node = world_from_node * *mapped.links[i].target_from_source;
    graph.links.push_back(mapped.links[i]);
  }
  return graph;
}

Matrix6d stated_covariance(const Matrix6d& marginal) {
  constexpr double kExcess = 100.0;  // of simulated sequences, whose sensor has no systematic error
  constexpr double kLength = 0.004;  // m, each axis
  constexpr double kAngle = 0.004;   // rad, each axis
  Matrix6d covariance = kExcess * marginal;
  covariance.diagonal().head<3>().array() += kLength * kLength;
  covariance.diagonal().tail<3>().array() += kAngle * kAngle;
  return covariance;
}

}  // namespace cairn
