// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/map_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "cairn/core/error.hpp"
#include "cairn/formats/content_uuid.hpp"
#include "cairn/vision/detail/odometry/landmark_colors.hpp"

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
  std::optional<Features> features;  // std::nullopt: unreadable
};

// A copy of an image as an OpenCV matrix.
template <class T>
cv::Mat matrix_of(int type, const Image<T>& image) {
  cv::Mat matrix(static_cast<int>(image.height), static_cast<int>(image.width), type);
  std::copy(image.values.begin(), image.values.end(), matrix.ptr<T>());
  return matrix;
}

float quantile(std::vector<float>& values, std::size_t twentieths) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(values.size() * twentieths / 20);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// Of one pixel in 64; std::nullopt where no depth is known.
std::optional<DepthRange> depth_range(const cv::Mat& depth_m) {
  constexpr int kStep = 8;
  std::vector<float> depths;
  for (int row = 0; row < depth_m.rows; row += kStep) {
    const float* const values = depth_m.ptr<float>(row);
    for (int column = 0; column < depth_m.cols; column += kStep) {
      if (values[column] > 0.0F) depths.push_back(values[column]);
    }
  }
  if (depths.empty()) return std::nullopt;
  return DepthRange{quantile(depths, 10), quantile(depths, 19)};
}

PreparedFrame prepare(const FrameImages& images, const Odometry& odometry) {
  PreparedFrame prepared{
      images.timestamp_s,          images.name, images.defect, !images.depth_m.empty(),
      depth_range(images.depth_m), std::nullopt};
  if (!images.gray.empty()) prepared.features = odometry.extract(images.gray, images.depth_m);
  return prepared;
}

// Combines the frames' results, in order.
class Mapping {
 public:
  Mapping(const Camera& camera, const MapSequenceOptions& options)
      : odometry_(camera, options.odometry), options_(&options) {}

  const Odometry& odometry() const { return odometry_; }
  void add(PreparedFrame frame, std::size_t frames);
  MappedSequence finish();

 private:
  void note_tracked(const FrameReport& report);
  void note_lost(double timestamp_s);
  void remark_on_depth();
  bool is_long_enough() const;
  void add_poses(const Trajectory& trajectory);

  Odometry odometry_;
  const MapSequenceOptions* options_;
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

void Mapping::add(PreparedFrame frame, std::size_t frames) {
  ++result_.frames;
  if (!frame.has_depth) ++result_.frames_without_depth;
  if (frame.depth_range) {
    depth_middles_m_.push_back(frame.depth_range->middle);
    depth_reaches_m_.push_back(frame.depth_range->reach);
  }
  FrameReport report;
  if (frame.features) {
    report = odometry_.track(frame.timestamp_s, std::move(*frame.features), frame.name);
  } else {
    ++result_.unreadable;
    if (options_->log) options_->log("left out: " + frame.defect);
    report.status = result_.tracked > 0 ? FrameStatus::kLost : FrameStatus::kWaiting;
  }
  if (report.status == FrameStatus::kTracked) note_tracked(report);
  if (report.status == FrameStatus::kLost) note_lost(frame.timestamp_s);
  if (report.status == FrameStatus::kWaiting) ++result_.waiting;
  was_lost_ = report.status == FrameStatus::kLost;

  // A map that starts without depth would be lost at once; the next frame may be suitable.
  if (report.status == FrameStatus::kTracked && is_long_enough() && odometry_.can_begin_new_map()) {
    FinishedMap finished = odometry_.begin_new_map(options_->map);
    add_poses(finished.trajectory);
    first_from_map_ = first_from_map_ * finished.to_next.previous_from_next;
    result_.maps.push_back(with_content_uuid(std::move(finished.map)));
    result_.links.push_back(finished.to_next);
    frames_in_map_ = 1;
    path_in_map_ = 0.0;
    turn_in_map_ = 0.0;
    last_pose_ = odometry_.last_pose();
  }
  if (options_->progress) {
    options_->progress({result_.frames, frames, report.landmarks, result_.lost_frames()});
  }
}

void Mapping::note_tracked(const FrameReport& report) {
  ++result_.tracked;
  ++frames_in_map_;
  landmark_sum_ += static_cast<double>(report.landmarks);
  if (!report.keyframe) {
    errors_.insert(errors_.end(), report.reprojection_errors.begin(),
                   report.reprojection_errors.end());
  }
  const Rigid3 pose = *odometry_.last_pose();
  if (last_pose_) {
    path_in_map_ += (pose.translation() - last_pose_->translation()).norm();
    turn_in_map_ += (last_pose_->inverse() * pose).angle();
  }
  last_pose_ = pose;
}

void Mapping::note_lost(double timestamp_s) {
  if (!was_lost_) result_.lost.push_back({timestamp_s, timestamp_s, 0});
  result_.lost.back().last_timestamp_s = timestamp_s;
  ++result_.lost.back().frames;
}

bool Mapping::is_long_enough() const {
  if (!options_->mini_maps) return false;
  const MiniMapLength& length = *options_->mini_maps;
  return (length.metres && path_in_map_ >= *length.metres) ||
         (length.frames && frames_in_map_ >= *length.frames) ||
         (length.turn_rad && turn_in_map_ >= *length.turn_rad);
}

// The first pose of a mini-map is the last one of the map before.
void Mapping::add_poses(const Trajectory& trajectory) {
  for (const TimedPose& pose : trajectory.poses()) {
    if (!poses_.empty() && pose.timestamp_s <= poses_.back().timestamp_s) continue;
    poses_.push_back({pose.timestamp_s, first_from_map_ * pose.world_from_camera});
  }
}

// Depth images in the wrong unit give a map that is wrong only by a factor, which only implausible lengths
// reveal.
void Mapping::remark_on_depth() {
  if (!options_->log || depth_reaches_m_.empty()) return;
  const double middle = quantile(depth_middles_m_, 10);
  const double reach = quantile(depth_reaches_m_, 10);
  constexpr double kLeast = 0.4;  // least range of most depth cameras
  const double most = options_->odometry.features.max_depth_m;
  if (middle >= kLeast && reach <= most) return;
  const bool near = middle < kLeast;
  options_->log(fmt::format(
      "{} {:.3g} m, where depth cameras measure {} to {} m: check the depth images' units per "
      "metre (1000 for millimetres), on which all lengths depend",
      near ? "half of all depths are below" : "the depth images reach", near ? middle : reach,
      kLeast, most));
}

MappedSequence Mapping::finish() {
  remark_on_depth();
  odometry_.complete();
  add_poses(odometry_.trajectory());
  result_.trajectory = Trajectory(std::move(poses_));
  // Drops a mini-map of a single frame at the end, because the previous one has the same data.
  if (frames_in_map_ > 1 || (frames_in_map_ == 1 && result_.maps.empty())) {
    result_.maps.push_back(with_content_uuid(odometry_.map(options_->map)));
  } else if (!result_.links.empty()) {
    result_.links.pop_back();
  }
  for (const LandmarkMap& map : result_.maps) result_.keyframes += map.frame_count();
  if (result_.tracked > 0) {
    result_.mean_tracked_landmarks = landmark_sum_ / static_cast<double>(result_.tracked);
  }
  if (!errors_.empty()) {
    const auto middle = errors_.begin() + static_cast<std::ptrdiff_t>(errors_.size() / 2);
    std::nth_element(errors_.begin(), middle, errors_.end());
    result_.median_reprojection_error = *middle;
  }
  return std::move(result_);
}

}  // namespace

void MapSequenceOptions::validate() const {
  odometry.validate();
  map.validate();
  if (!mini_maps) return;
  if (mini_maps->metres && !(*mini_maps->metres > 0.0 && std::isfinite(*mini_maps->metres))) {
    throw Error(ErrorKind::kMisuse, "MapSequenceOptions.mini_maps.metres",
                fmt::format("{}", *mini_maps->metres), "a positive number");
  }
  if (mini_maps->turn_rad && !(*mini_maps->turn_rad > 0.0 && std::isfinite(*mini_maps->turn_rad))) {
    throw Error(ErrorKind::kMisuse, "MapSequenceOptions.mini_maps.turn_rad",
                fmt::format("{}", *mini_maps->turn_rad), "a positive number");
  }
  if (mini_maps->frames && *mini_maps->frames < 2) {
    throw Error(ErrorKind::kMisuse, "MapSequenceOptions.mini_maps.frames",
                fmt::format("{}", *mini_maps->frames), "at least 2");
  }
}

std::size_t MappedSequence::lost_frames() const {
  std::size_t sum = 0;
  for (const LostStretch& stretch : lost) sum += stretch.frames;
  return sum;
}

FrameImages frame_images(double timestamp_s, std::uint32_t width, std::uint32_t height,
                         std::span<const std::uint8_t> bgr, std::span<const float> depth_m) {
  const std::size_t pixels = std::size_t{width} * height;
  if (bgr.size() != 3 * pixels || (!depth_m.empty() && depth_m.size() != pixels)) {
    throw Error(ErrorKind::kMisuse, "frame_images",
                fmt::format("{} bytes of colour and {} depths", bgr.size(), depth_m.size()),
                fmt::format("those of {} x {} pixels", width, height));
  }
  const int rows = static_cast<int>(height);
  const int columns = static_cast<int>(width);
  FrameImages images;
  images.timestamp_s = timestamp_s;
  images.name = fmt::format("{:.6f}", timestamp_s);
  // OpenCV's header does not accept const, but the data is only read.
  auto* const color = const_cast<std::uint8_t*>(bgr.data());
  cv::cvtColor(cv::Mat(rows, columns, CV_8UC3, color), images.gray, cv::COLOR_BGR2GRAY);
  if (!depth_m.empty()) {
    auto* const depth = const_cast<float*>(depth_m.data());
    images.depth_m = cv::Mat(rows, columns, CV_32FC1, depth).clone();
  }
  return images;
}

FrameImages frame_images(const RgbdSequence& sequence, std::size_t frame, const Camera& camera,
                         bool skip_unreadable) {
  const SequenceFrame& entry = sequence.frames()[frame];
  FrameImages result;
  result.timestamp_s = entry.timestamp_s;
  result.name = entry.color.filename().string();
  try {
    RgbdSequence::Images images = sequence.read(frame);
    if (images.gray.width != camera.width || images.gray.height != camera.height) {
      throw Error(ErrorKind::kInput, entry.color.string(),
                  fmt::format("{} x {} pixels", images.gray.width, images.gray.height),
                  fmt::format("{} x {}, as the camera has", camera.width, camera.height));
    }
    result.gray = matrix_of(CV_8UC1, images.gray);
    if (!images.depth.empty()) result.depth_m = matrix_of(CV_32FC1, images.depth);
  } catch (const Error& error) {
    if (!skip_unreadable || error.kind() != ErrorKind::kInput) throw;
    result.defect = error.what();
  }
  return result;
}

MappedSequence map_frames(std::size_t frames,
                          const std::function<FrameImages(std::size_t frame)>& read_frame,
                          const Camera& camera, const MapSequenceOptions& options) {
  options.validate();
  Mapping mapping(camera, options);
  options.executor.in_order(
      frames, kFramesAhead,
      [&](std::size_t i) {
        if (options.stop.stop_requested()) {
          throw Error(ErrorKind::kCancelled, "mapping", "was cancelled", "");
        }
        return prepare(read_frame(i), mapping.odometry());
      },
      [&](std::size_t, PreparedFrame frame) { mapping.add(std::move(frame), frames); });
  return mapping.finish();
}

MappedSequence map_sequence(const RgbdSequence& sequence, const Camera& camera,
                            const MapSequenceOptions& options) {
  const auto read = [&](std::size_t frame) {
    return frame_images(sequence, frame, camera, options.skip_unreadable);
  };
  MappedSequence mapped = map_frames(sequence.frames().size(), read, camera, options);
  for (LandmarkMap& map : mapped.maps) {
    map = with_colors(std::move(map), sequence, options.executor, options.stop);
  }
  return mapped;
}

}  // namespace cairn
