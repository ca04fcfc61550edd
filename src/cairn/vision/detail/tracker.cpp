// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/tracker.hpp"

#include <algorithm>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/bundle_adjustment.hpp"
#include "cairn/vision/detail/covariances.hpp"

namespace cairn::detail {
namespace {

// Whether a map can be built from the frame alone.
bool can_start_map(const Features& features) {
  constexpr std::ptrdiff_t kFewest = 50;  // corners with depth
  const auto keypoints = features.keypoints();
  return std::count_if(keypoints.begin(), keypoints.end(),
                       [](const Keypoint& keypoint) { return keypoint.depth_m > 0.0F; }) >= kFewest;
}

// Errors of the velocity at a frame, per axis, as a share of its change between two frames: extrapolated from the
// frames before, and interpolated between the motions before and after.
constexpr double kExtrapolated = 0.1;
constexpr double kInterpolated = 0.03;

// The velocity at a frame: that of one interval, and a share of the change between two.
RowMotionPrior prior_from(const RowMotion& interval, const RowMotion& earlier,
                          const RowMotion& later, double share, double error) {
  constexpr double kLeast = 1e-4;  // m/s, rad/s
  const Eigen::Vector3d faster = later.velocity_m_s - earlier.velocity_m_s;
  const Eigen::Vector3d turning = later.turn_rad_s - earlier.turn_rad_s;
  RowMotionPrior prior{interval, kLeast + error * faster.norm(), kLeast + error * turning.norm()};
  prior.motion.velocity_m_s += share * faster;
  prior.motion.turn_rad_s += share * turning;
  return prior;
}

// If there is but one interval.
RowMotionPrior vague_prior(const RowMotion& interval) {
  constexpr double kSpeed = 0.1;  // m/s
  constexpr double kTurn = 0.2;   // rad/s
  return {interval, kSpeed, kTurn};
}

// If there is none.
RowMotionPrior no_prior(const RowMotion& assumed) {
  constexpr double kSpeed = 0.5;  // m/s
  constexpr double kTurn = 1.0;   // rad/s
  return {assumed, kSpeed, kTurn};
}

}  // namespace

Tracker::Tracker(const Camera& camera, const OdometryOptions& options)
    : options_(options), map_(camera, options.features, options.noise), graph_(map_.graph()) {
  options_.validate();
}

FrameReport Tracker::track(double timestamp_s, Features features, std::string image_name) {
  TrackedFrame frame;
  frame.number = frames_++;
  frame.timestamp_s = timestamp_s;
  frame.image_name = std::move(image_name);
  frame.features = std::move(features);
  frame.landmarks.assign(frame.features.size(), std::nullopt);

  FrameReport report;
  if (graph_.keyframes().empty()) {
    if (!start(frame)) return report;
    report.status = FrameStatus::kTracked;
    report.keyframe = true;
    report.landmarks = graph_.landmarks().size();
    return report;
  }

  if (options_.readout_s > 0.0 && velocity_) map_.extractor().correct(frame.features, *velocity_);
  std::optional<PoseEstimate> located;
  double radius = 4.0;
  if (!lost_ || bridges(frame)) {
    for (const double window : {15.0, 35.0}) {
      located = locate_by_previous(frame, window);
      if (located) break;
    }
    if (!located) located = locate_by_keyframe(frame, reference_);
  }
  if (!located) {
    located = locate_anywhere(frame);
    radius = 8.0;
  }
  if (located) located = locate_in_map(frame, radius);
  if (!located || located->inlier_count < options_.min_tracked) {
    lost_ = true;
    motion_.reset();
    velocity_.reset();
    report.status = FrameStatus::kLost;
    return report;
  }
  if (options_.readout_s > 0.0 && previous_ && previous_->number + 1 == frame.number) {
    settle_previous(frame);
  }
  report.status = FrameStatus::kTracked;
  report.landmarks = located->inlier_count;
  report.reprojection_errors = reprojection_errors(frame);

  lost_ = false;
  // After a gap, the motion during the readout is uncertain, and so is the pose.
  motion_is_certain_ =
      !(options_.readout_s > 0.0) || !previous_ || previous_->number + 1 == frame.number;
  if (frame.features.has_depth() && wants_keyframe(frame, located->inlier_count)) {
    make_keyframe(frame);
    report.keyframe = true;
  }
  const Rigid3& reference_pose = graph_.keyframes()[reference_].world_from_camera;
  recorded_.push_back(
      {frame.timestamp_s, reference_, reference_pose.inverse() * frame.world_from_camera});
  note_motion(frame);
  previous_ = std::move(frame);
  return report;
}

bool Tracker::bridges(const TrackedFrame& frame) const {
  constexpr double kLongest = 0.3;  // seconds
  if (!previous_) return false;
  const double gap_s = frame.timestamp_s - previous_->timestamp_s;
  return gap_s > 0.0 && (previous_->number + 1 == frame.number || gap_s <= kLongest);
}

// The mean velocity since the last frame is that half-way between both; extrapolates its change.
RowMotionPrior Tracker::row_motion(const TrackedFrame& frame) const {
  if (!bridges(frame)) return no_prior(frame.features.row_motion());
  const double duration_s = frame.timestamp_s - previous_->timestamp_s;
  const Rigid3 previous_from_frame =
      previous_->world_from_camera.inverse() * frame.world_from_camera;
  const RowMotion motion = motion_between(previous_from_frame, duration_s);
  if (!between_) return vague_prior(motion);
  // Both in the axes of this frame's camera.
  RowMotion before = *between_;
  const Eigen::Quaterniond frame_from_previous = previous_from_frame.quaternion().conjugate();
  before.velocity_m_s = frame_from_previous * before.velocity_m_s;
  before.turn_rad_s = frame_from_previous * before.turn_rad_s;
  return prior_from(motion, before, motion, duration_s / (duration_s + between_s_), kExtrapolated);
}

PoseEstimate Tracker::solve_with_motion(TrackedFrame& frame, std::span<const LandmarkMatch> matches,
                                        RowMotionPrior prior) const {
  std::vector<double> rows;
  for (const LandmarkMatch& match : matches) {
    rows.push_back(frame.features.keypoints()[match.keypoint].raw.v);
  }
  prior.motion.readout_s = options_.readout_s;
  prior.motion.rows = map_.image().height;
  map_.extractor().correct(frame.features, prior.motion);
  map_.extractor().correct(
      frame.features, refined_row_motion(map_.sensor().pinhole(), points_of(frame, matches), rows,
                                         prior, frame.world_from_camera));
  return solve(frame, matches);
}

void Tracker::note_motion(const TrackedFrame& frame) {
  if (!bridges(frame)) {
    motion_.reset();
    between_.reset();
    velocity_.reset();
    motion_is_steady_ = !(options_.readout_s > 0.0);
    return;
  }
  const Rigid3 motion = previous_->world_from_camera.inverse() * frame.world_from_camera;
  motion_.reset();
  if (previous_->number + 1 == frame.number) motion_ = motion;
  velocity_.reset();
  if (options_.readout_s > 0.0) velocity_ = frame.features.row_motion();
  const std::optional<RowMotion> earlier = between_;
  between_s_ = frame.timestamp_s - previous_->timestamp_s;
  between_ = motion_between(motion, between_s_);
  // The next frame will tell the motion better, too late for the end of a map.
  constexpr double kSteady = 0.25;  // rad/s
  motion_is_steady_ = !(options_.readout_s > 0.0) ||
                      (earlier && (between_->turn_rad_s - earlier->turn_rad_s).norm() < kSteady);
}

void Tracker::settle_previous(TrackedFrame& next) {
  const double duration_s = next.timestamp_s - previous_->timestamp_s;
  if (!(duration_s > 0.0)) return;
  const Rigid3 previous_from_next = previous_->world_from_camera.inverse() * next.world_from_camera;
  RowMotion after = motion_between(previous_from_next, duration_s);
  after.velocity_m_s = previous_from_next.quaternion() * after.velocity_m_s;
  const RowMotionPrior prior =
      between_ ? prior_from(*between_, *between_, after, between_s_ / (between_s_ + duration_s),
                            kInterpolated)
               : vague_prior(after);
  const Rigid3 before = previous_->world_from_camera;
  const bool is_keyframe = graph_.keyframes().back().frame == previous_->number;
  std::vector<LandmarkMatch> matches = matches_of(*previous_);
  // Landmarks that a keyframe alone saw are as wrong as its motion was.
  std::erase_if(matches, [&](const LandmarkMatch& match) {
    return is_keyframe && graph_.landmark(match.landmark).observations.size() < 2;
  });
  solve_with_motion(*previous_, matches, prior);
  if (is_keyframe) {
    const auto index = static_cast<std::uint32_t>(graph_.keyframes().size() - 1);
    map_.correct_keyframe(index, previous_->features.row_motion());
    adjust_newest();
    previous_->landmarks = graph_.keyframes()[index].landmarks;
    previous_->world_from_camera = graph_.keyframes()[index].world_from_camera;
  } else {
    const Rigid3& reference_pose = graph_.keyframes()[reference_].world_from_camera;
    recorded_.back().keyframe_from_camera = reference_pose.inverse() * previous_->world_from_camera;
  }
  if (between_) {
    *between_ = motion_between(
        motion_during(*between_, between_s_) * before.inverse() * previous_->world_from_camera,
        between_s_);
  }
  solve_with_motion(next, matches_of(next), row_motion(next));
}

std::vector<LandmarkMatch> Tracker::matches_of(const TrackedFrame& frame) const {
  std::vector<LandmarkMatch> matches;
  for (std::uint32_t i = 0; i < frame.landmarks.size(); ++i) {
    if (frame.landmarks[i] && !graph_.landmark(*frame.landmarks[i]).gone()) {
      matches.push_back({i, *frame.landmarks[i], 0});
    }
  }
  return matches;
}

// Across a gap at the last velocity.
Rigid3 Tracker::predicted_pose(const TrackedFrame& frame) const {
  const Rigid3& last = previous_->world_from_camera;
  if (motion_) return last * *motion_;
  if (!between_ || !bridges(frame)) return last;
  return last * motion_during(*between_, frame.timestamp_s - previous_->timestamp_s);
}

bool Tracker::start(TrackedFrame& frame) {
  if (!can_start_map(frame.features)) return false;
  if (options_.start) frame.world_from_camera = options_.start(frame.timestamp_s);
  make_keyframe(frame);
  recorded_.push_back({frame.timestamp_s, 0, Rigid3()});
  previous_ = std::move(frame);
  return true;
}

std::vector<PointMatch> Tracker::points_of(const TrackedFrame& frame,
                                           std::span<const LandmarkMatch> matches) const {
  std::vector<PointMatch> points;
  points.reserve(matches.size());
  for (const LandmarkMatch& match : matches) {
    points.push_back({graph_.landmark(match.landmark).position,
                      map_.sensor().measurement(frame.features.keypoints()[match.keypoint])});
  }
  return points;
}

PoseEstimate Tracker::solve(TrackedFrame& frame, std::span<const LandmarkMatch> matches) const {
  PoseEstimate estimate =
      refine_pose(map_.sensor().pinhole(), points_of(frame, matches), frame.world_from_camera);
  take(frame, matches, estimate);
  return estimate;
}

void Tracker::take(TrackedFrame& frame, std::span<const LandmarkMatch> matches,
                   const PoseEstimate& estimate) {
  frame.world_from_camera = estimate.world_from_camera;
  std::fill(frame.landmarks.begin(), frame.landmarks.end(), std::nullopt);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (estimate.inliers[i]) frame.landmarks[matches[i].keypoint] = matches[i].landmark;
  }
}

std::optional<PoseEstimate> Tracker::locate_by_previous(TrackedFrame& frame, double radius) const {
  if (!previous_) return std::nullopt;
  const Rigid3 predicted = predicted_pose(frame);
  const Rigid3 camera_from_world = predicted.inverse();
  std::vector<LandmarkIndex> landmarks;
  std::vector<ExpectedAppearance> appearances;
  std::vector<float> angle_of(graph_.landmarks().size(), 0.0F);
  for (std::size_t i = 0; i < previous_->landmarks.size(); ++i) {
    const auto& index = previous_->landmarks[i];
    if (!index || graph_.landmark(*index).gone()) continue;
    const auto appearance =
        expected_appearance(map_.sensor(), map_.image(), graph_.landmark(*index), camera_from_world,
                            predicted.translation());
    if (!appearance) continue;
    landmarks.push_back(*index);
    appearances.push_back(*appearance);
    angle_of[index->value] = previous_->features.keypoints()[i].angle;
  }
  const std::vector<bool> taken(frame.features.size(), false);
  std::vector<LandmarkMatch> matches =
      match_near(graph_, frame.features, landmarks, appearances, taken, radius, 90, 0.9);
  std::vector<float> turns;
  for (const LandmarkMatch& match : matches) {
    turns.push_back(frame.features.keypoints()[match.keypoint].angle -
                    angle_of[match.landmark.value]);
  }
  matches = keep_common_turn(std::move(matches), turns);
  if (matches.size() < options_.min_tracked) return std::nullopt;
  PoseEstimate estimate =
      refine_pose(map_.sensor().pinhole(), points_of(frame, matches), predicted);
  constexpr double kLeastShare = 0.3;  // of matches that agree with one motion
  if (estimate.inlier_count < options_.min_tracked ||
      static_cast<double>(estimate.inlier_count) <
          kLeastShare * static_cast<double>(matches.size())) {
    return std::nullopt;
  }
  take(frame, matches, estimate);
  return estimate;
}

std::optional<PoseEstimate> Tracker::locate_by_keyframe(TrackedFrame& frame,
                                                        std::uint32_t keyframe) const {
  const std::vector<LandmarkMatch> matches = match_by_descriptor(graph_, keyframe, frame.features);
  if (matches.size() < options_.min_tracked) return std::nullopt;
  auto estimate = find_pose(map_.sensor().pinhole(), points_of(frame, matches),
                            options_.min_tracked, frame.number);
  if (estimate) take(frame, matches, *estimate);
  return estimate;
}

std::optional<PoseEstimate> Tracker::locate_anywhere(TrackedFrame& frame) const {
  // The latest keyframes, then an even sample of the others, which bounds the work.
  constexpr std::uint32_t kLatest = 5;
  constexpr std::uint32_t kSampled = 30;
  const auto count = static_cast<std::uint32_t>(graph_.keyframes().size());
  std::vector<std::uint32_t> candidates;
  for (std::uint32_t i = 0; i < std::min(kLatest, count); ++i) candidates.push_back(count - 1 - i);
  const std::uint32_t others = count - std::min(kLatest, count);
  const std::uint32_t step = std::max(1U, others / kSampled);
  // The sample shifts from frame to frame, so that all are tried eventually.
  for (auto i = static_cast<std::uint32_t>(frame.number % step); i < others; i += step) {
    candidates.push_back(i);
  }
  for (const std::uint32_t keyframe : candidates) {
    if (auto estimate = locate_by_keyframe(frame, keyframe)) return estimate;
  }
  return std::nullopt;
}

PoseEstimate Tracker::locate_in_map(TrackedFrame& frame, double radius) {
  const ExpectedLandmarks expected = map_.expected_in(frame);
  std::vector<LandmarkMatch> matches = map_.match_corners(frame, expected, radius);
  // A match with a different patch is often of a neighbouring corner. Excludes these if there are enough
  // others.
  std::vector<LandmarkMatch> aligned = map_.align(frame, matches);
  if (aligned.size() >= 6 * options_.min_tracked) matches = std::move(aligned);
  PoseEstimate estimate = solve(frame, matches);
  if (estimate.inlier_count < options_.min_tracked) return estimate;
  // Pose and velocity depend on each other.
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds && options_.readout_s > 0.0; ++round) {
    estimate = solve_with_motion(frame, matches, row_motion(frame));
    if (estimate.inlier_count < options_.min_tracked) return estimate;
  }

  const auto found = map_.find_without_corners(frame, expected, matches);
  if (!found.empty()) {
    matches.insert(matches.end(), found.begin(), found.end());
    estimate = solve(frame, matches);
    if (estimate.inlier_count < options_.min_tracked) return estimate;
  }
  map_.note_found(frame, expected);
  return estimate;
}

bool Tracker::wants_keyframe(const TrackedFrame& frame, std::size_t found) const {
  const Keyframe& latest = graph_.keyframes().back();
  const std::size_t since = frame.number - latest.frame;
  const Rigid3 moved = latest.world_from_camera.inverse() * frame.world_from_camera;
  const bool thinned = static_cast<double>(found) < 0.7 * static_cast<double>(reference_found_);
  const bool nearly_lost = found < 5 * options_.min_tracked;
  if (nearly_lost) return true;
  if (!motion_is_certain_) return false;
  return since >= 3 && (is_new_view(moved) || thinned);
}

void Tracker::adjust_newest() {
  const auto index = static_cast<std::uint32_t>(graph_.keyframes().size() - 1);
  if (index == 0) return;  // the first fixes the map in the world
  std::vector<std::uint32_t> moving = {index};
  for (const auto& [neighbour, shared] : graph_.covisible(index)) {
    constexpr std::size_t kFewestShared = 15;
    if (moving.size() >= options_.adjusted_keyframes || shared < kFewestShared) break;
    if (neighbour != 0) moving.push_back(neighbour);
  }
  adjust(graph_, moving);
}

void Tracker::make_keyframe(TrackedFrame& frame) {
  const std::uint32_t index = map_.add_keyframe(frame);
  if (index > 0) {
    adjust_newest();
    map_.cull(index);
  }
  frame.landmarks = graph_.keyframes()[index].landmarks;
  frame.world_from_camera = graph_.keyframes()[index].world_from_camera;
  reference_ = index;
  reference_found_ = static_cast<std::size_t>(
      std::count_if(frame.landmarks.begin(), frame.landmarks.end(),
                    [](const auto& landmark) { return landmark.has_value(); }));
}

std::vector<float> Tracker::reprojection_errors(const TrackedFrame& frame) const {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  std::vector<float> errors;
  for (std::size_t i = 0; i < frame.landmarks.size(); ++i) {
    if (!frame.landmarks[i]) continue;
    const Eigen::Vector2d pixel = map_.sensor().pinhole().project(
        camera_from_world * graph_.landmark(*frame.landmarks[i]).position);
    errors.push_back(
        static_cast<float>((pixel - frame.features.keypoints()[i].pixel.cast<double>()).norm()));
  }
  return errors;
}

Trajectory Tracker::trajectory() const {
  std::vector<TimedPose> poses;
  for (const RecordedPose& recorded : recorded_) {
    poses.push_back({recorded.timestamp_s, graph_.keyframes()[recorded.keyframe].world_from_camera *
                                               recorded.keyframe_from_camera});
  }
  return Trajectory(std::move(poses));
}

// Otherwise, the landmarks of the last frames would have at most one observation.
void Tracker::end_at_last_frame() {
  if (!last_pose() || graph_.keyframes().back().frame == previous_->number) return;
  recorded_.pop_back();
  make_keyframe(*previous_);
  recorded_.push_back({previous_->timestamp_s, reference_, Rigid3()});
}

void Tracker::complete() {
  end_at_last_frame();
  if (graph_.keyframes().size() < 2 || options_.final_iterations == 0) return;
  map_.adopt_estimated_noise();
  std::vector<std::uint32_t> moving;
  for (std::uint32_t i = 1; i < graph_.keyframes().size(); ++i) moving.push_back(i);
  adjust(graph_, moving, options_.final_iterations);
}

std::optional<Rigid3> Tracker::last_pose() const {
  if (!previous_ || lost_) return std::nullopt;
  return previous_->world_from_camera;
}

bool Tracker::can_begin_new_map() const {
  return last_pose().has_value() && motion_is_certain_ && motion_is_steady_ &&
         can_start_map(previous_->features);
}

FinishedMap Tracker::begin_new_map(const MapOptions& options) {
  refuse_if(!can_begin_new_map(), "begin_new_map",
            last_pose() ? "the last frame has too few corners with depth"
                        : "the last frame was not tracked",
            "a call where can_begin_new_map()");
  complete();
  options.validate();
  Link link;
  link.kind = LinkKind::kOdometry;
  link.target_from_source = graph_.keyframes().back().world_from_camera;
  const MapCovariances covariances = map_covariances(options.covariance);
  // A metre and a radian where nothing determines the pose.
  link.covariance = covariances.poses.empty()
                        ? stated_covariance(keyframe_pose_covariances(graph_).back().value_or(
                              Matrix6d::Identity()))
                        : covariances.poses.back();
  FinishedMap finished{map_.to_map(options, covariances.landmarks, covariances.poses), trajectory(),
                       link};

  TrackedFrame frame = std::move(*previous_);
  map_.clear();
  recorded_.clear();
  std::fill(frame.landmarks.begin(), frame.landmarks.end(), std::nullopt);
  for (std::uint32_t i = 0; i < frame.features.size(); ++i) {
    frame.features.set_source(i, PixelSource::kCorner);  // the patches belonged to the old map
  }
  frame.world_from_camera = Rigid3();
  make_keyframe(frame);
  recorded_.push_back({frame.timestamp_s, 0, Rigid3()});
  previous_ = std::move(frame);
  return finished;
}

Tracker::MapCovariances Tracker::map_covariances(LandmarkCovariance kind) const {
  MapCovariances result;
  const bool marginal = kind == LandmarkCovariance::kMarginal;
  const std::vector<Keyframe>& keyframes = graph_.keyframes();
  if (marginal || keyframes.size() <= kMostDenseFrames) {
    MarginalCovariances all = marginal_covariances(graph_);
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      // The map is in the frame of its first keyframe.
      result.poses.push_back(i == 0 ? Matrix6d(Matrix6d::Zero())
                                    : stated_covariance(all.keyframes[i]));
    }
    if (marginal) result.landmarks = std::move(all.landmarks);
  }
  if (!marginal) {
    result.landmarks = recursive_covariances(graph_, keyframe_pose_covariances(graph_));
  }
  return result;
}

LandmarkMap Tracker::map(const MapOptions& options) const {
  options.validate();
  const MapCovariances covariances = map_covariances(options.covariance);
  return map_.to_map(options, covariances.landmarks, covariances.poses);
}

}  // namespace cairn::detail
