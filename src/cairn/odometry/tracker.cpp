// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/odometry/tracker.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/core/error.hpp"
#include "cairn/odometry/bundle_adjustment.hpp"
#include "cairn/odometry/landmark_covariance.hpp"
#include "cairn/odometry/marginal_covariance.hpp"
#include "cairn/odometry/noise_estimation.hpp"
#include "cairn/odometry/residual_limits.hpp"

namespace cairn {
namespace {

constexpr std::size_t kFewestToStart = 50;  // corners with depth

std::vector<double> octave_scales(const FeatureExtractor& extractor) {
  std::vector<double> scales;
  for (int octave = 0; octave < extractor.levels(); ++octave) {
    scales.push_back(extractor.scale(octave));
  }
  return scales;
}

// Whether a landmark of the keyframe is so near that another would look the same: corners are found
// again a little aside, or on the next octave.
bool crowded(const Keyframe& keyframe, std::uint32_t keypoint, double scale) {
  const Keypoint& at = keyframe.features.keypoints()[keypoint];
  constexpr double kNear = 3.0;  // pixels of the octave
  bool found = false;
  keyframe.features.visit_near(at.pixel.cast<double>(), kNear * scale, [&](std::uint32_t other) {
    if (other == keypoint || !keyframe.landmarks[other]) return;
    const int octaves = std::abs(keyframe.features.keypoints()[other].octave - at.octave);
    found = found || octaves <= 1;
  });
  return found;
}

}  // namespace

Odometry::Tracker::Tracker(const Camera& camera, const OdometryOptions& options)
    : options_(options),
      camera_(camera),
      image_(static_cast<int>(camera.width), static_cast<int>(camera.height)),
      extractor_(camera, options.features),
      sensor_(options.noise, extractor_.pinhole(), octave_scales(extractor_)),
      graph_(sensor_) {
  options_.validate();
}

FrameReport Odometry::Tracker::track(double timestamp_s, Features features,
                                     std::string image_name) {
  Frame frame;
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

  std::optional<PoseEstimate> located;
  double radius = 4.0;
  if (!lost_) {
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
    report.status = FrameStatus::kLost;
    return report;
  }
  report.status = FrameStatus::kTracked;
  report.landmarks = located->inlier_count;
  report.reprojection_errors = reprojection_errors(frame);

  const bool was_lost = lost_;
  lost_ = false;
  if (frame.features.has_depth() && wants_keyframe(frame, located->inlier_count)) {
    make_keyframe(frame);
    report.keyframe = true;
  }
  const Rigid3& reference_pose = graph_.keyframes()[reference_].world_from_camera;
  recorded_.push_back(
      {frame.timestamp_s, reference_, reference_pose.inverse() * frame.world_from_camera});
  const bool consecutive = previous_ && !was_lost && previous_->number + 1 == frame.number;
  if (consecutive) {
    motion_ = previous_->world_from_camera.inverse() * frame.world_from_camera;
  } else {
    motion_.reset();
  }
  previous_ = std::move(frame);
  return report;
}

bool Odometry::Tracker::start(Frame& frame) {
  const auto keypoints = frame.features.keypoints();
  const auto with_depth = static_cast<std::size_t>(
      std::count_if(keypoints.begin(), keypoints.end(),
                    [](const Keypoint& keypoint) { return keypoint.depth_m > 0.0F; }));
  if (with_depth < kFewestToStart) return false;
  if (options_.start) frame.world_from_camera = options_.start(frame.timestamp_s);
  make_keyframe(frame);
  recorded_.push_back({frame.timestamp_s, 0, Rigid3()});
  previous_ = std::move(frame);
  return true;
}

std::vector<PointMatch> Odometry::Tracker::points_of(const Frame& frame,
                                                     std::span<const LandmarkMatch> matches) const {
  std::vector<PointMatch> points;
  points.reserve(matches.size());
  for (const LandmarkMatch& match : matches) {
    points.push_back({graph_.landmark(match.landmark).position,
                      sensor_.measurement(frame.features.keypoints()[match.keypoint])});
  }
  return points;
}

PoseEstimate Odometry::Tracker::solve(Frame& frame, std::span<const LandmarkMatch> matches) const {
  PoseEstimate estimate =
      refine_pose(sensor_.pinhole(), points_of(frame, matches), frame.world_from_camera);
  take(frame, matches, estimate);
  return estimate;
}

void Odometry::Tracker::take(Frame& frame, std::span<const LandmarkMatch> matches,
                             const PoseEstimate& estimate) {
  frame.world_from_camera = estimate.world_from_camera;
  std::fill(frame.landmarks.begin(), frame.landmarks.end(), std::nullopt);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (estimate.inliers[i]) frame.landmarks[matches[i].keypoint] = matches[i].landmark;
  }
}

std::optional<PoseEstimate> Odometry::Tracker::locate_by_previous(Frame& frame,
                                                                  double radius) const {
  if (!previous_) return std::nullopt;
  const Rigid3 predicted =
      motion_ ? previous_->world_from_camera * *motion_ : previous_->world_from_camera;
  const Rigid3 camera_from_world = predicted.inverse();
  std::vector<LandmarkIndex> landmarks;
  std::vector<ExpectedAppearance> appearances;
  std::vector<float> angle_of(graph_.landmarks().size(), 0.0F);
  for (std::size_t i = 0; i < previous_->landmarks.size(); ++i) {
    const auto& index = previous_->landmarks[i];
    if (!index || graph_.landmark(*index).gone()) continue;
    const auto appearance = expected_appearance(sensor_, image_, graph_.landmark(*index),
                                                camera_from_world, predicted.translation());
    if (!appearance) continue;
    landmarks.push_back(*index);
    appearances.push_back(*appearance);
    angle_of[index->value] = previous_->features.keypoints()[i].angle;
  }
  const std::vector<bool> taken(frame.features.size(), false);
  std::vector<LandmarkMatch> matches =
      match_near(graph_, frame.features, landmarks, appearances, taken,
                 {.radius_pixels = radius, .max_distance = 90, .max_ratio = 0.9});
  std::vector<float> turns;
  for (const LandmarkMatch& match : matches) {
    turns.push_back(frame.features.keypoints()[match.keypoint].angle -
                    angle_of[match.landmark.value]);
  }
  matches = keep_common_turn(std::move(matches), turns);
  if (matches.size() < options_.min_tracked) return std::nullopt;
  PoseEstimate estimate = refine_pose(sensor_.pinhole(), points_of(frame, matches), predicted);
  constexpr double kLeastShare = 0.3;  // of matches that agree with one motion
  if (estimate.inlier_count < options_.min_tracked ||
      static_cast<double>(estimate.inlier_count) <
          kLeastShare * static_cast<double>(matches.size())) {
    return std::nullopt;
  }
  take(frame, matches, estimate);
  return estimate;
}

std::optional<PoseEstimate> Odometry::Tracker::locate_by_keyframe(Frame& frame,
                                                                  std::uint32_t keyframe) const {
  const std::vector<LandmarkMatch> matches = match_by_descriptor(graph_, keyframe, frame.features);
  if (matches.size() < options_.min_tracked) return std::nullopt;
  auto estimate =
      find_pose(sensor_.pinhole(), points_of(frame, matches), options_.min_tracked, frame.number);
  if (estimate) take(frame, matches, *estimate);
  return estimate;
}

std::optional<PoseEstimate> Odometry::Tracker::locate_anywhere(Frame& frame) const {
  // The latest keyframes, then an even sample of the others: bounded work in any map.
  constexpr std::uint32_t kLatest = 5;
  constexpr std::uint32_t kSampled = 30;
  const auto count = static_cast<std::uint32_t>(graph_.keyframes().size());
  std::vector<std::uint32_t> candidates;
  for (std::uint32_t i = 0; i < std::min(kLatest, count); ++i) candidates.push_back(count - 1 - i);
  const std::uint32_t others = count - std::min(kLatest, count);
  const std::uint32_t step = std::max(1U, others / kSampled);
  // Shifted from frame to frame, so that in the end all are tried.
  for (auto i = static_cast<std::uint32_t>(frame.number % step); i < others; i += step) {
    candidates.push_back(i);
  }
  for (const std::uint32_t keyframe : candidates) {
    if (auto estimate = locate_by_keyframe(frame, keyframe)) return estimate;
  }
  return std::nullopt;
}

PoseEstimate Odometry::Tracker::locate_in_map(Frame& frame, double radius) {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  std::vector<LandmarkMatch> matches;
  std::vector<bool> taken(frame.features.size(), false);
  std::vector<bool> matched(graph_.landmarks().size(), false);
  for (std::uint32_t i = 0; i < frame.landmarks.size(); ++i) {
    if (!frame.landmarks[i]) continue;
    matches.push_back({i, *frame.landmarks[i], 0});
    taken[i] = true;
    matched[frame.landmarks[i]->value] = true;
  }
  std::vector<LandmarkIndex> candidates;
  std::vector<ExpectedAppearance> appearances;
  std::vector<LandmarkIndex> expected;
  for (std::uint32_t i = 0; i < graph_.landmarks().size(); ++i) {
    const TrackedLandmark& landmark = graph_.landmarks()[i];
    if (landmark.gone()) continue;
    const auto appearance = expected_appearance(sensor_, image_, landmark, camera_from_world,
                                                frame.world_from_camera.translation());
    if (!appearance) continue;
    expected.push_back({i});
    if (matched[i]) continue;
    candidates.push_back({i});
    appearances.push_back(*appearance);
  }
  const auto more =
      match_near(graph_, frame.features, candidates, appearances, taken, {.radius_pixels = radius});
  matches.insert(matches.end(), more.begin(), more.end());
  // A match whose patch looks different is often of the corner next to the right one: done without
  // where enough are better.
  std::vector<LandmarkMatch> aligned;
  for (const LandmarkMatch& match : matches) {
    const Keypoint& keypoint = frame.features.keypoints()[match.keypoint];
    const auto found = find_patch(frame.features, match.landmark, camera_from_world, keypoint.raw);
    if (!found) continue;
    frame.features.move_keypoint(match.keypoint, found->raw, extractor_.undistorted(found->raw));
    aligned.push_back(match);
  }
  if (aligned.size() >= 6 * options_.min_tracked) matches = std::move(aligned);
  PoseEstimate estimate = solve(frame, matches);
  if (estimate.inlier_count < options_.min_tracked) return estimate;

  std::fill(matched.begin(), matched.end(), false);
  for (const LandmarkMatch& match : matches) matched[match.landmark.value] = true;
  std::vector<LandmarkIndex> unmatched;
  for (const LandmarkIndex index : expected) {
    const TrackedLandmark& landmark = graph_.landmark(index);
    if (!matched[index.value] && 4 * landmark.found >= landmark.expected)
      unmatched.push_back(index);
  }
  constexpr std::size_t kMostSought = 500;
  if (unmatched.size() > kMostSought) {
    // Those seen most often are the most likely to be seen again.
    std::stable_sort(unmatched.begin(), unmatched.end(), [&](LandmarkIndex a, LandmarkIndex b) {
      return graph_.landmark(a).found > graph_.landmark(b).found;
    });
    unmatched.resize(kMostSought);
  }
  const auto found = find_without_corners(frame, unmatched);
  if (!found.empty()) {
    matches.insert(matches.end(), found.begin(), found.end());
    estimate = solve(frame, matches);
    if (estimate.inlier_count < options_.min_tracked) return estimate;
  }
  for (const LandmarkIndex index : expected) ++graph_.landmark(index).expected;
  for (const auto& index : frame.landmarks) {
    if (!index) continue;
    TrackedLandmark& landmark = graph_.landmark(*index);
    ++landmark.found;
    landmark.last_seen = frame.number;
  }
  return estimate;
}

std::optional<Odometry::Tracker::FoundPatch> Odometry::Tracker::find_patch(
    const Features& features, LandmarkIndex landmark, const Rigid3& camera_from_world,
    const Pixel& start) const {
  const TrackedLandmark& seen = graph_.landmark(landmark);
  const auto patch_from_image = graph_.patch_from_image(seen, camera_from_world);
  if (!patch_from_image) return std::nullopt;
  // The level on which the patch has about its own resolution.
  const double octave = sensor_.octave_of(1.0 / std::sqrt(patch_from_image->determinant()));
  const auto levels = static_cast<int>(features.pyramid().size());
  const int level = std::clamp(static_cast<int>(std::lround(octave)), 0, levels - 1);
  const cv::Mat& image = features.pyramid()[static_cast<std::size_t>(level)];
  const Eigen::Vector2d level_scale(static_cast<double>(image_.width) / image.cols,
                                    static_cast<double>(image_.height) / image.rows);
  const Eigen::Vector2d at((start.u + 0.5) / level_scale.x() - 0.5,
                           (start.v + 0.5) / level_scale.y() - 0.5);
  constexpr double kMostAway = 2.5;  // pixels of the level
  const auto found = align_patch(seen.appearance->patch, image,
                                 *patch_from_image * level_scale.asDiagonal(), at, kMostAway);
  if (!found) return std::nullopt;
  return FoundPatch{
      {(found->x() + 0.5) * level_scale.x() - 0.5, (found->y() + 0.5) * level_scale.y() - 0.5},
      level};
}

// Landmarks that should be visible but are at no corner: their patches are looked for where they
// should be, and become keypoints of the frame.
std::vector<LandmarkMatch> Odometry::Tracker::find_without_corners(
    Frame& frame, std::span<const LandmarkIndex> landmarks) const {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;
  std::vector<LandmarkMatch> matches;
  for (const LandmarkIndex index : landmarks) {
    const TrackedLandmark& landmark = graph_.landmark(index);
    const Eigen::Vector3d x_in_camera = camera_from_world * landmark.position;
    const auto start = project(camera_, x_in_camera);
    if (!start) continue;
    const auto found = find_patch(frame.features, index, camera_from_world, *start);
    if (!found) continue;
    Keypoint keypoint;
    keypoint.raw = found->raw;
    keypoint.pixel = extractor_.undistorted(found->raw);
    keypoint.octave = static_cast<std::uint8_t>(found->octave);
    keypoint.source = PixelSource::kAligned;
    keypoint.depth_m = extractor_.depth_at(frame.features.depth_m(), found->raw);
    // Something else in front of it, or behind.
    if (keypoint.depth_m > 0.0F && std::abs(keypoint.depth_m - x_in_camera.z()) >
                                       5.0 * sensor_.sigma_depth_m(keypoint.depth_m)) {
      continue;
    }
    const auto number = static_cast<std::uint32_t>(frame.features.size() + keypoints.size());
    matches.push_back({number, index, 0});
    keypoints.push_back(keypoint);
    descriptors.push_back(landmark.descriptor);
  }
  frame.features.add(keypoints, descriptors);
  frame.landmarks.resize(frame.features.size());
  return matches;
}

void Odometry::Tracker::cut_patch(const KeypointReference& reference) {
  Keyframe& keyframe = graph_.keyframes()[reference.keyframe];
  const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
  const cv::Mat& image = keyframe.features.pyramid()[keypoint.octave];
  const Eigen::Vector2d center((keypoint.raw.u + 0.5) * image.cols / image_.width - 0.5,
                               (keypoint.raw.v + 0.5) * image.rows / image_.height - 0.5);
  const LandmarkIndex landmark = *keyframe.landmarks[reference.keypoint];
  if (const auto patch = ReferencePatch::cut(image, center)) {
    graph_.landmark(landmark).appearance =
        LandmarkAppearance{reference, *patch,
                           extractor_.depth_slope(keyframe.features.depth_m(), keypoint.raw,
                                                  4.0 * sensor_.scale(keypoint.octave))};
    keyframe.features.set_source(reference.keypoint, PixelSource::kReference);
  }
}

bool Odometry::Tracker::wants_keyframe(const Frame& frame, std::size_t found) const {
  const Keyframe& latest = graph_.keyframes().back();
  const std::size_t since = frame.number - latest.frame;
  const Rigid3 moved = latest.world_from_camera.inverse() * frame.world_from_camera;
  constexpr double kTurn = 0.17;         // rad
  constexpr double kTranslation = 0.15;  // m
  const bool new_view = moved.angle() > kTurn || moved.translation().norm() > kTranslation;
  const bool thinned = static_cast<double>(found) < 0.7 * static_cast<double>(reference_found_);
  const bool nearly_lost = found < 5 * options_.min_tracked;
  if (nearly_lost) return true;
  return since >= 3 && (new_view || thinned);
}

void Odometry::Tracker::make_keyframe(Frame& frame) {
  Keyframe keyframe;
  keyframe.frame = frame.number;
  keyframe.timestamp_s = frame.timestamp_s;
  keyframe.image_name = frame.image_name;
  keyframe.world_from_camera = frame.world_from_camera;
  keyframe.features = frame.features;
  const std::uint32_t index = graph_.add_keyframe(std::move(keyframe));
  std::size_t found = 0;
  for (std::uint32_t i = 0; i < frame.landmarks.size(); ++i) {
    if (frame.landmarks[i] && !graph_.landmark(*frame.landmarks[i]).gone()) {
      graph_.observe(*frame.landmarks[i], {index, i});
      graph_.refresh(*frame.landmarks[i]);
      if (!graph_.landmark(*frame.landmarks[i]).appearance) cut_patch({index, i});
      ++found;
    }
  }
  const auto keypoints = frame.features.keypoints();
  for (std::uint32_t i = 0; i < keypoints.size(); ++i) {
    if (graph_.keyframes()[index].landmarks[i] || keypoints[i].depth_m <= 0.0F) continue;
    if (crowded(graph_.keyframes()[index], i, sensor_.scale(keypoints[i].octave))) continue;
    graph_.add_landmark({index, i});
    cut_patch({index, i});
  }
  if (index > 0) {
    merge_known_landmarks(index);
    std::vector<std::uint32_t> moving = {index};
    for (const auto& [neighbour, shared] : graph_.covisible(index)) {
      constexpr std::size_t kFewestShared = 15;
      if (moving.size() >= options_.adjusted_keyframes || shared < kFewestShared) break;
      if (neighbour != 0) moving.push_back(neighbour);  // the first fixes the map in the world
    }
    adjust(graph_, moving);
    cull(index);
  }
  graph_.keyframes()[index].features.drop_images();
  frame.landmarks = graph_.keyframes()[index].landmarks;
  frame.world_from_camera = graph_.keyframes()[index].world_from_camera;
  reference_ = index;
  reference_found_ = static_cast<std::size_t>(
      std::count_if(frame.landmarks.begin(), frame.landmarks.end(),
                    [](const auto& landmark) { return landmark.has_value(); }));
}

// Landmarks that are new to a keyframe may be known already, but were not recognised.
void Odometry::Tracker::merge_known_landmarks(std::uint32_t keyframe) {
  constexpr std::size_t kNeighbours = 8;
  auto neighbours = graph_.covisible(keyframe);
  if (neighbours.size() > kNeighbours) neighbours.resize(kNeighbours);
  for (const auto& [neighbour, shared] : neighbours) {
    const Rigid3& pose = graph_.keyframes()[neighbour].world_from_camera;
    const Rigid3 camera_from_world = pose.inverse();
    std::vector<LandmarkIndex> landmarks;
    std::vector<ExpectedAppearance> appearances;
    for (const auto& index : graph_.keyframes()[keyframe].landmarks) {
      if (!index || graph_.observes(neighbour, *index)) continue;
      const auto appearance = expected_appearance(sensor_, image_, graph_.landmark(*index),
                                                  camera_from_world, pose.translation());
      if (!appearance) continue;
      landmarks.push_back(*index);
      appearances.push_back(*appearance);
    }
    const std::vector<bool> taken(graph_.keyframes()[neighbour].features.size(), false);
    const auto matches =
        match_near(graph_, graph_.keyframes()[neighbour].features, landmarks, appearances, taken,
                   {.radius_pixels = 3.0, .max_distance = 60, .max_ratio = 1.0});
    for (const LandmarkMatch& match : matches) {
      if (graph_.landmark(match.landmark).gone()) continue;
      const PointMeasurement measured =
          sensor_.measurement(graph_.keyframes()[neighbour].features.keypoints()[match.keypoint]);
      const PointResidual residual =
          point_residual(sensor_.pinhole(), measured,
                         camera_from_world * graph_.landmark(match.landmark).position);
      constexpr double kMostDepth = 9.0;  // three standard deviations
      if (residual.squared_pixel() > kPixel95 || residual.squared_depth() > kMostDepth) continue;
      const auto there = graph_.keyframes()[neighbour].landmarks[match.keypoint];
      if (!there || *there == match.landmark) continue;
      // The older one stays: its patch is what its observations were aligned with.
      const LandmarkIndex older = std::min(*there, match.landmark);
      const LandmarkIndex newer = std::max(*there, match.landmark);
      graph_.merge(newer, older);
    }
  }
}

void Odometry::Tracker::cull(std::uint32_t newest) {
  const std::size_t now = graph_.keyframes()[newest].frame;
  for (std::uint32_t i = 0; i < graph_.landmarks().size(); ++i) {
    const TrackedLandmark& landmark = graph_.landmarks()[i];
    if (landmark.gone()) continue;
    constexpr std::uint32_t kFewestExpected = 8;
    constexpr double kLeastShare = 0.2;
    if (landmark.observations.size() < 2 && landmark.expected >= kFewestExpected &&
        landmark.found < kLeastShare * landmark.expected && landmark.last_seen < now) {
      graph_.remove({i});
    }
  }
}

std::vector<float> Odometry::Tracker::reprojection_errors(const Frame& frame) const {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  std::vector<float> errors;
  for (std::size_t i = 0; i < frame.landmarks.size(); ++i) {
    if (!frame.landmarks[i]) continue;
    const Eigen::Vector2d pixel = sensor_.pinhole().project(
        camera_from_world * graph_.landmark(*frame.landmarks[i]).position);
    errors.push_back(
        static_cast<float>((pixel - frame.features.keypoints()[i].pixel.cast<double>()).norm()));
  }
  return errors;
}

Trajectory Odometry::Tracker::trajectory() const {
  std::vector<TimedPose> poses;
  for (const RecordedPose& recorded : recorded_) {
    poses.push_back({recorded.timestamp_s, graph_.keyframes()[recorded.keyframe].world_from_camera *
                                               recorded.keyframe_from_camera});
  }
  return Trajectory(std::move(poses));
}

// What the last frames saw would else be observed once at most.
void Odometry::Tracker::end_at_last_frame() {
  if (!last_pose() || graph_.keyframes().back().frame == previous_->number) return;
  recorded_.pop_back();
  make_keyframe(*previous_);
  recorded_.push_back({previous_->timestamp_s, reference_, Rigid3()});
}

void Odometry::Tracker::complete() {
  end_at_last_frame();
  if (graph_.keyframes().size() < 2 || options_.final_iterations == 0) return;
  sensor_ = SensorModel(estimated_noise(graph_), extractor_.pinhole(), octave_scales(extractor_));
  std::vector<std::uint32_t> moving;
  for (std::uint32_t i = 1; i < graph_.keyframes().size(); ++i) moving.push_back(i);
  adjust(graph_, moving, {.max_iterations = options_.final_iterations});
}

std::optional<Rigid3> Odometry::Tracker::last_pose() const {
  if (!previous_ || lost_) return std::nullopt;
  return previous_->world_from_camera;
}

FinishedMap Odometry::Tracker::begin_new_map(const MapOptions& options) {
  if (!last_pose()) {
    throw Error(ErrorKind::kMisuse, "begin_new_map", "the last frame was not tracked",
                "a call after a frame that was");
  }
  complete();
  options.validate();
  MiniMapLink link;
  link.previous_from_next = graph_.keyframes().back().world_from_camera;
  std::vector<Eigen::Matrix3d> covariances;
  if (graph_.keyframes().size() <= kMostMarginalKeyframes) {
    MarginalCovariances marginal = marginal_covariances(graph_);
    link.covariance = marginal.keyframes.back();
    if (options.covariance == LandmarkCovariance::kMarginal) {
      covariances = std::move(marginal.landmarks);
    }
  } else {
    link.covariance = keyframe_pose_covariances(graph_).back();
  }
  if (covariances.empty()) covariances = landmark_covariances(options.covariance);
  FinishedMap finished{map(options, covariances), trajectory(), link};

  Frame frame = std::move(*previous_);
  graph_ = LandmarkGraph(sensor_);
  recorded_.clear();
  std::fill(frame.landmarks.begin(), frame.landmarks.end(), std::nullopt);
  for (std::uint32_t i = 0; i < frame.features.size(); ++i) {
    frame.features.set_source(i, PixelSource::kCorner);  // patches were the old map's
  }
  frame.world_from_camera = Rigid3();
  make_keyframe(frame);
  recorded_.push_back({frame.timestamp_s, 0, Rigid3()});
  previous_ = std::move(frame);
  return finished;
}

std::vector<Eigen::Matrix3d> Odometry::Tracker::landmark_covariances(
    LandmarkCovariance kind) const {
  return kind == LandmarkCovariance::kMarginal
             ? marginal_covariances(graph_).landmarks
             : recursive_covariances(graph_, keyframe_pose_covariances(graph_));
}

LandmarkMap Odometry::Tracker::map(const MapOptions& options) const {
  options.validate();
  return map(options, landmark_covariances(options.covariance));
}

LandmarkMap Odometry::Tracker::map(const MapOptions& options,
                                   const std::vector<Eigen::Matrix3d>& covariances) const {
  MapTables tables;
  tables.cameras = {camera_};
  for (const Keyframe& keyframe : graph_.keyframes()) {
    tables.frames.ids.push_back({keyframe.frame});
    const Eigen::Quaterniond q = keyframe.world_from_camera.quaternion();
    tables.frames.translations.push_back(keyframe.world_from_camera.translation());
    tables.frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    tables.frames.cameras.emplace_back(CameraIndex{0});
    tables.frames.timestamps_s.emplace_back(keyframe.timestamp_s);
    tables.frames.image_names.push_back(keyframe.image_name);
  }
  LandmarkTable& landmarks = tables.landmarks;
  ObservationTable& observations = tables.observations;
  if (options.descriptors) landmarks.descriptors = {"ORB", sizeof(Descriptor), {}, {}};
  observations.offsets.push_back(0);
  for (std::size_t i = 0; i < graph_.landmarks().size(); ++i) {
    const TrackedLandmark& landmark = graph_.landmarks()[i];
    if (landmark.gone() || landmark.observations.size() < options.min_observations) continue;
    landmarks.ids.push_back({i});
    landmarks.positions.push_back(landmark.position);
    landmarks.covariances.push_back(covariances[i]);
    if (landmarks.descriptors) {
      landmarks.descriptors->known.push_back(1);
      const auto* const bytes = reinterpret_cast<const std::uint8_t*>(landmark.descriptor.data());
      landmarks.descriptors->bytes.insert(landmarks.descriptors->bytes.end(), bytes,
                                          bytes + sizeof(Descriptor));
    }
    for (const KeypointReference& reference : landmark.observations) {
      const Keyframe& keyframe = graph_.keyframes()[reference.keyframe];
      const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
      observations.frames.push_back({reference.keyframe});
      observations.pixels.push_back(keypoint.raw);
      observations.keypoints.emplace_back(reference.keypoint);
      observations.octaves.emplace_back(keypoint.octave);
      const bool has_depth =
          keypoint.depth_m > 0.0F && !keyframe.depth_disagrees[reference.keypoint];
      observations.depths.push_back(has_depth ? std::optional<double>(keypoint.depth_m)
                                              : std::nullopt);
    }
    observations.offsets.push_back(observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn
