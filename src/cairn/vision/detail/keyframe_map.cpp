// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/keyframe_map.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/map/operations.hpp"
#include "cairn/vision/detail/noise_estimation.hpp"
#include "cairn/vision/detail/pose_estimation.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {
namespace {

// Whether a landmark of the keyframe is so close that a new one would be a duplicate, because the same corner
// is often detected slightly shifted, or on the next octave.
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

bool is_new_view(const Rigid3& motion) {
  constexpr double kTurn = 0.17;         // rad
  constexpr double kTranslation = 0.15;  // m
  return motion.angle() > kTurn || motion.translation().norm() > kTranslation;
}

KeyframeMap::KeyframeMap(const Camera& camera, const FeatureOptions& features,
                         const SensorNoise& noise)
    : camera_(camera),
      image_(static_cast<int>(camera.width), static_cast<int>(camera.height)),
      extractor_(camera, features),
      configured_noise_(noise),
      sensor_(sensor_with(noise)),
      graph_(sensor_) {}

SensorModel KeyframeMap::sensor_with(const SensorNoise& noise) const {
  return {noise, extractor_.pinhole(), extractor_.scales(), extractor_.baseline_m()};
}

ExpectedLandmarks KeyframeMap::expected_in(const TrackedFrame& frame) const {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  ExpectedLandmarks expected;
  for (std::uint32_t i = 0; i < graph_.landmarks().size(); ++i) {
    const TrackedLandmark& landmark = graph_.landmarks()[i];
    if (landmark.gone()) continue;
    const auto appearance = expected_appearance(sensor_, image_, landmark, camera_from_world,
                                                frame.world_from_camera.translation());
    if (!appearance) continue;
    expected.landmarks.push_back({i});
    expected.appearances.push_back(*appearance);
  }
  return expected;
}

std::vector<LandmarkMatch> KeyframeMap::match_corners(const TrackedFrame& frame,
                                                      const ExpectedLandmarks& expected,
                                                      double radius) const {
  std::vector<LandmarkMatch> matches;
  std::vector<bool> taken(frame.features.size(), false);
  std::vector<bool> matched(graph_.landmarks().size(), false);
  for (std::uint32_t i = 0; i < frame.landmarks.size(); ++i) {
    if (!frame.landmarks[i]) continue;
    matches.push_back({i, *frame.landmarks[i], 0});
    taken[i] = true;
    matched[frame.landmarks[i]->value] = true;
  }
  ExpectedLandmarks others;
  for (std::size_t i = 0; i < expected.landmarks.size(); ++i) {
    if (matched[expected.landmarks[i].value]) continue;
    others.landmarks.push_back(expected.landmarks[i]);
    others.appearances.push_back(expected.appearances[i]);
  }
  const auto more =
      match_near(graph_, frame.features, others.landmarks, others.appearances, taken, radius);
  matches.insert(matches.end(), more.begin(), more.end());
  return matches;
}

std::vector<LandmarkMatch> KeyframeMap::align(TrackedFrame& frame,
                                              std::span<const LandmarkMatch> matches) const {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  std::vector<LandmarkMatch> aligned;
  for (const LandmarkMatch& match : matches) {
    const Keypoint& keypoint = frame.features.keypoints()[match.keypoint];
    const auto found = find_patch(frame.features, match.landmark, camera_from_world, keypoint.raw);
    if (!found) continue;
    frame.features.move_keypoint(match.keypoint, found->raw, extractor_.undistorted(found->raw));
    if (!frame.features.row_motion().none()) extractor_.correct(frame.features, match.keypoint);
    aligned.push_back(match);
  }
  return aligned;
}

void KeyframeMap::note_found(const TrackedFrame& frame, const ExpectedLandmarks& expected) {
  for (const LandmarkIndex index : expected.landmarks) ++graph_.landmark(index).expected;
  for (const auto& index : frame.landmarks) {
    if (!index) continue;
    TrackedLandmark& landmark = graph_.landmark(*index);
    ++landmark.found;
    landmark.last_seen = frame.number;
  }
}

void KeyframeMap::adopt_estimated_noise() {
  sensor_ = sensor_with(configured_noise_);
  sensor_ = sensor_with(estimated_noise(graph_));
}

void KeyframeMap::clear() {
  sensor_ = sensor_with(configured_noise_);
  graph_ = LandmarkGraph(sensor_);
}

std::optional<KeyframeMap::FoundPatch> KeyframeMap::find_patch(const Features& features,
                                                               LandmarkIndex landmark,
                                                               const Rigid3& camera_from_world,
                                                               const Pixel& start) const {
  const TrackedLandmark& seen = graph_.landmark(landmark);
  const auto patch_from_image = graph_.patch_from_image(seen, camera_from_world);
  if (!patch_from_image) return std::nullopt;
  // The pyramid level with about the patch's resolution.
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

// Expected landmarks without a match, except those that are rarely found.
std::vector<LandmarkIndex> KeyframeMap::worth_seeking(
    const ExpectedLandmarks& expected, std::span<const LandmarkMatch> matches) const {
  std::vector<bool> matched(graph_.landmarks().size(), false);
  for (const LandmarkMatch& match : matches) matched[match.landmark.value] = true;
  std::vector<LandmarkIndex> sought;
  for (const LandmarkIndex index : expected.landmarks) {
    const TrackedLandmark& landmark = graph_.landmark(index);
    if (!matched[index.value] && 4 * landmark.found >= landmark.expected) sought.push_back(index);
  }
  constexpr std::size_t kMostSought = 500;
  if (sought.size() > kMostSought) {
    // Prefers landmarks that were found most often.
    std::stable_sort(sought.begin(), sought.end(), [&](LandmarkIndex a, LandmarkIndex b) {
      return graph_.landmark(a).found > graph_.landmark(b).found;
    });
    sought.resize(kMostSought);
  }
  return sought;
}

// Fixed-point iteration, because the row that sees a point depends on the pixel, and the pixel on the row.
std::optional<Pixel> KeyframeMap::seen_at(const RowMotion& motion,
                                          const Eigen::Vector3d& x_in_camera) const {
  if (!(x_in_camera.z() > 0.0)) return std::nullopt;  // where a fisheye sees, but no keypoint is
  auto pixel = project(camera_, x_in_camera);
  if (motion.none()) return pixel;
  constexpr int kSteps = 3;  // each multiplies the error by its share of the image's height
  for (int step = 0; step < kSteps && pixel; ++step) {
    const double row = std::clamp(pixel->v, 0.0, image_.height - 1.0);
    pixel = project(camera_, motion.at_row(x_in_camera, row));
  }
  return pixel;
}

// The keypoint's pixel with a global shutter, as a map's poses and cameras assume.
Pixel KeyframeMap::pixel_in_map(const Keyframe& keyframe, const Keypoint& keypoint) const {
  if (keyframe.features.row_motion().none()) return keypoint.raw;
  const auto pixel =
      project(camera_, sensor_.pinhole().back_project(keypoint.pixel.cast<double>(), 1.0));
  return pixel ? *pixel : keypoint.raw;
}

std::vector<LandmarkMatch> KeyframeMap::find_without_corners(
    TrackedFrame& frame, const ExpectedLandmarks& expected,
    std::span<const LandmarkMatch> matches) const {
  const Rigid3 camera_from_world = frame.world_from_camera.inverse();
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;
  std::vector<LandmarkMatch> added;
  for (const LandmarkIndex index : worth_seeking(expected, matches)) {
    const TrackedLandmark& landmark = graph_.landmark(index);
    const Eigen::Vector3d x_in_camera = camera_from_world * landmark.position;
    const auto start = seen_at(frame.features.row_motion(), x_in_camera);
    if (!start) continue;
    const auto found = find_patch(frame.features, index, camera_from_world, *start);
    if (!found) continue;
    Keypoint keypoint;
    keypoint.raw = found->raw;
    keypoint.pixel.setZero();  // corrected() sets it, which GCC does not see
    keypoint.octave = static_cast<std::uint8_t>(found->octave);
    keypoint.source = PixelSource::kPatch;
    keypoint.read_depth_m = extractor_.depth_at(frame.features, found->raw, found->octave);
    keypoint = extractor_.corrected(frame.features, keypoint);
    // The depth is that of another surface.
    if (keypoint.depth_m > 0.0F &&
        std::abs(keypoint.depth_m - x_in_camera.z()) >
            5.0 * sensor_.sigma_depth_m(keypoint.depth_m, keypoint.octave)) {
      continue;
    }
    const auto number = static_cast<std::uint32_t>(frame.features.size() + keypoints.size());
    added.push_back({number, index, 0});
    keypoints.push_back(keypoint);
    descriptors.push_back(landmark.descriptor);
  }
  frame.features.add(keypoints, descriptors);
  frame.landmarks.resize(frame.features.size());
  return added;
}

void KeyframeMap::cut_patch(const KeypointReference& reference) {
  Keyframe& keyframe = graph_.keyframes()[reference.keyframe];
  const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
  const cv::Mat& image = keyframe.features.pyramid()[keypoint.octave];
  const Eigen::Vector2d center((keypoint.raw.u + 0.5) * image.cols / image_.width - 0.5,
                               (keypoint.raw.v + 0.5) * image.rows / image_.height - 0.5);
  const LandmarkIndex landmark = *keyframe.landmarks[reference.keypoint];
  if (const auto patch = ReferencePatch::cut(image, center)) {
    graph_.landmark(landmark).appearance = LandmarkAppearance{
        reference, *patch,
        extractor_.depth_slope(keyframe.features, keypoint.raw, keypoint.octave)};
    keyframe.features.set_source(reference.keypoint, PixelSource::kReference);
  }
}

std::uint32_t KeyframeMap::add_keyframe(const TrackedFrame& frame) {
  Keyframe keyframe;
  keyframe.frame = frame.number;
  keyframe.timestamp_s = frame.timestamp_s;
  keyframe.image_name = frame.image_name;
  keyframe.world_from_camera = frame.world_from_camera;
  keyframe.features = frame.features;
  const std::uint32_t index = graph_.add_keyframe(std::move(keyframe));
  for (std::uint32_t i = 0; i < frame.landmarks.size(); ++i) {
    if (frame.landmarks[i] && !graph_.landmark(*frame.landmarks[i]).gone()) {
      graph_.observe(*frame.landmarks[i], {index, i});
      graph_.refresh(*frame.landmarks[i]);
      if (!graph_.landmark(*frame.landmarks[i]).appearance) cut_patch({index, i});
    }
  }
  const auto keypoints = frame.features.keypoints();
  for (std::uint32_t i = 0; i < keypoints.size(); ++i) {
    if (graph_.keyframes()[index].landmarks[i] || keypoints[i].depth_m <= 0.0F) continue;
    if (crowded(graph_.keyframes()[index], i, sensor_.scale(keypoints[i].octave))) continue;
    graph_.add_landmark({index, i});
    cut_patch({index, i});
  }
  if (index > 0) merge_known_landmarks(index);
  Keyframe& added = graph_.keyframes()[index];
  added.shown = extractor_.describe_added(added.features);
  added.features.drop_images();
  return index;
}

void KeyframeMap::correct_keyframe(std::uint32_t index, const RowMotion& motion) {
  Keyframe& keyframe = graph_.keyframes()[index];
  extractor_.correct(keyframe.features, motion);
  if (index > 0) {
    std::vector<PointMatch> points;
    for (std::uint32_t i = 0; i < keyframe.landmarks.size(); ++i) {
      const auto& landmark = keyframe.landmarks[i];
      if (!landmark || graph_.landmark(*landmark).observations.size() < 2) continue;
      points.push_back({graph_.landmark(*landmark).position, graph_.measurement({index, i})});
    }
    constexpr std::size_t kFewest = 15;
    if (points.size() >= kFewest) {
      keyframe.world_from_camera =
          refine_pose(sensor_.pinhole(), points, keyframe.world_from_camera).world_from_camera;
    }
  }
  for (std::uint32_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const Keypoint& keypoint = keyframe.features.keypoints()[i];
    if (!keyframe.landmarks[i] || keypoint.depth_m <= 0.0F) continue;
    TrackedLandmark& landmark = graph_.landmark(*keyframe.landmarks[i]);
    if (landmark.observations.size() > 1) continue;
    landmark.position =
        keyframe.world_from_camera *
        sensor_.pinhole().back_project(keypoint.pixel.cast<double>(), keypoint.depth_m);
    graph_.refresh(*keyframe.landmarks[i]);
  }
}

// Merges new landmarks of a keyframe with known ones that were not recognised.
void KeyframeMap::merge_known_landmarks(std::uint32_t keyframe) {
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
    const auto matches = match_near(graph_, graph_.keyframes()[neighbour].features, landmarks,
                                    appearances, taken, 3.0, 60, 1.0);
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
      // Keeps the older one, because its observations were aligned with its patch.
      const LandmarkIndex older = std::min(*there, match.landmark);
      const LandmarkIndex newer = std::max(*there, match.landmark);
      graph_.merge(newer, older);
    }
  }
}

void KeyframeMap::cull(std::uint32_t newest) {
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

namespace {

// The landmark's descriptor, and those of its observations that differ most.
std::vector<std::span<const std::uint8_t>> distinct_views(const LandmarkGraph& graph,
                                                          const TrackedLandmark& landmark,
                                                          std::size_t most) {
  const auto bytes_of = [](const Descriptor& descriptor) {
    return std::span(reinterpret_cast<const std::uint8_t*>(descriptor.data()), sizeof(Descriptor));
  };
  std::vector<std::span<const std::uint8_t>> all = {bytes_of(landmark.descriptor)};
  for (const KeypointReference& reference : landmark.observations) {
    const Keyframe& keyframe = graph.keyframes()[reference.keyframe];
    const std::size_t corners = keyframe.features.corners();
    if (reference.keypoint < corners) {
      all.push_back(bytes_of(keyframe.features.descriptors()[reference.keypoint]));
    } else if (const std::size_t added = reference.keypoint - corners;
               added < keyframe.shown.size() && keyframe.shown[added]) {
      all.push_back(bytes_of(*keyframe.shown[added]));
    }
  }
  std::vector<std::span<const std::uint8_t>> views;
  for (const std::size_t i : distinct_descriptors(all, 0, most, DescriptorNorm::kHamming)) {
    views.push_back(all[i]);
  }
  return views;
}

}  // namespace

LandmarkMap KeyframeMap::to_map(const MapOptions& options,
                                const std::vector<Eigen::Matrix3d>& landmark_covariances,
                                const std::vector<Matrix6d>& pose_covariances) const {
  MapTables tables;
  tables.cameras = {camera_};
  for (const Matrix6d& covariance : pose_covariances) {
    tables.frames.pose_covariances.emplace_back(covariance);
  }
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
    landmarks.covariances.push_back(landmark_covariances[i]);
    if (landmarks.descriptors) {
      append_descriptors(*landmarks.descriptors,
                         distinct_views(graph_, landmark, options.descriptors_each));
    }
    for (const KeypointReference& reference : landmark.observations) {
      const Keyframe& keyframe = graph_.keyframes()[reference.keyframe];
      const Keypoint& keypoint = keyframe.features.keypoints()[reference.keypoint];
      observations.frames.push_back({reference.keyframe});
      observations.pixels.push_back(pixel_in_map(keyframe, keypoint));
      observations.keypoints.emplace_back(reference.keypoint);
      observations.octaves.emplace_back(keypoint.octave);
      observations.sources.emplace_back(keypoint.source);
      observations.sigmas_px.emplace_back(sensor_.sigma_pixel(keypoint));
      const bool has_depth =
          keypoint.depth_m > 0.0F && !keyframe.depth_disagrees[reference.keypoint];
      observations.depths.push_back(has_depth ? std::optional<double>(keypoint.depth_m)
                                              : std::nullopt);
    }
    observations.offsets.push_back(observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn::detail
