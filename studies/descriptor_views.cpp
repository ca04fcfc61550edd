// SPDX-License-Identifier: BSD-3-Clause
// How far a view may turn, approach and roll before landmarks are no longer found by their descriptors: with one
// descriptor of a landmark, and with those of its most distinct views.
//   cairn_descriptor_views_benchmark FIRST_SEED END_SEED
// A simulated camera maps each kind of place on its sweep, at the true poses. Views of some keyframes are rendered
// again, changed about the point that they look at. Counted are the keyframe's landmarks of three and more
// observations that such a view shows, those of them that have a corner there, and of these those whose most similar
// corner of the image is that one. One CSV row a change, of all places together, to stdout.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "cairn/core/detail/hamming.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#include "cairn/simulation/simulator.hpp"
#include "cairn/vision/detail/features.hpp"
#include "cairn/vision/map_sequence.hpp"

#include "study_main.hpp"

namespace {

using namespace cairn;

constexpr std::size_t kFrames = 260;
constexpr double kRate = 20.0;
constexpr std::size_t kViewsAPlace = 6;  // keyframes whose views are changed
constexpr double kCorner = 3.0;          // pixels of its octave, from a landmark to its corner
constexpr double kSameDepth = 0.03;  // share of the depth, within which a landmark is what is shown
constexpr std::uint32_t kMostBits = 64;  // as placement and location allow
constexpr std::size_t kFewestObserved = 3;

struct Change {
  std::string kind;
  double amount = 0.0;  // degrees, or the distance as a multiple
};

std::vector<Change> changes() {
  std::vector<Change> all;
  for (const double degrees : {0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0}) {
    all.push_back({"turn", degrees});
    if (degrees > 0.0) all.push_back({"turn", -degrees});
  }
  for (const double distance : {0.4, 0.5, 0.65, 0.8, 1.25, 1.5, 2.0, 2.5}) {
    all.push_back({"distance", distance});
  }
  for (const double degrees : {15.0, 30.0, 45.0, 90.0, 135.0, 180.0}) {
    all.push_back({"roll", degrees});
  }
  return all;
}

Rigid3 changed(const Rigid3& world_from_camera, double depth, const Change& change) {
  const Eigen::Vector3d centre = world_from_camera.translation();
  const Eigen::Vector3d point = world_from_camera * Eigen::Vector3d(0.0, 0.0, depth);
  const Eigen::Quaterniond& q = world_from_camera.quaternion();
  if (change.kind == "turn") {
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(radians(change.amount), Eigen::Vector3d::UnitZ()));
    return Rigid3(turn * q, point + turn * (centre - point));
  }
  if (change.kind == "distance") return Rigid3(q, point + change.amount * (centre - point));
  return Rigid3(
      q * Eigen::Quaterniond(Eigen::AngleAxisd(radians(change.amount), Eigen::Vector3d::UnitZ())),
      centre);
}

FrameImages images_of(const RgbdFrame& frame) {
  return frame_images(frame.timestamp_s, frame.width, frame.height, frame.bgr, frame.depth_m);
}

struct Counts {
  std::size_t shown = 0;
  std::size_t cornered = 0;
  std::size_t by_one = 0;
  std::size_t by_several = 0;
  std::size_t descriptors = 0;  // of the landmarks with a corner
};

// The corner that is most similar to one of a landmark's first `most` descriptors, if similar enough.
std::optional<std::uint32_t> most_similar(const DescriptorColumn& column, std::uint32_t landmark,
                                          std::size_t most, const detail::Features& features) {
  std::optional<std::uint32_t> best;
  std::uint32_t least = kMostBits + 1;
  for (std::size_t k = 0; k < std::min(column.count(landmark), most); ++k) {
    detail::Descriptor descriptor;
    std::memcpy(descriptor.data(), column.descriptor(landmark, k).data(), sizeof descriptor);
    for (std::uint32_t i = 0; i < features.size(); ++i) {
      const auto bits = static_cast<std::uint32_t>(
          detail::hamming_distance(descriptor, features.descriptors()[i]));
      if (bits < least) {
        least = bits;
        best = i;
      }
    }
  }
  return best;
}

void count(const LandmarkMap& map, FrameIndex keyframe, const RgbdFrame& view,
           const detail::FeatureExtractor& extractor, Counts& counts) {
  const detail::Features features =
      extractor.extract(detail::matrix_of(images_of(view).gray), cv::Mat());
  const Rigid3 camera_from_world = view.world_from_camera.inverse();
  const DescriptorColumn& column = *map.landmarks().descriptors;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto observing = map.observing_frames(LandmarkIndex{i});
    if (observing.size() < kFewestObserved ||
        std::find(observing.begin(), observing.end(), keyframe) == observing.end()) {
      continue;
    }
    const Eigen::Vector3d x = camera_from_world * map.landmarks().positions[i];
    if (x.z() <= 0.1) continue;
    const Eigen::Vector2d pixel = extractor.pinhole().project(x);
    const long u = std::lround(pixel.x());
    const long v = std::lround(pixel.y());
    if (u < 0 || v < 0 || u >= long{view.width} || v >= long{view.height}) continue;
    const double depth =
        view.exact_depth_m[static_cast<std::size_t>(v) * view.width + static_cast<std::size_t>(u)];
    if (std::abs(depth - x.z()) > kSameDepth * x.z()) continue;
    ++counts.shown;
    const auto is_there = [&](std::uint32_t corner) {
      const detail::Keypoint& keypoint = features.keypoints()[corner];
      return (keypoint.pixel.cast<double>() - pixel).norm() <=
             kCorner * extractor.scales()[keypoint.octave];
    };
    bool has_corner = false;
    for (std::uint32_t corner = 0; corner < features.size() && !has_corner; ++corner) {
      has_corner = is_there(corner);
    }
    if (!has_corner) continue;
    ++counts.cornered;
    counts.descriptors += column.count(i);
    const auto one = most_similar(column, i, 1, features);
    const auto several = most_similar(column, i, kMostDescriptorsEach, features);
    if (one && is_there(*one)) ++counts.by_one;
    if (several && is_there(*several)) ++counts.by_several;
  }
}

void measure(EnvironmentKind kind, std::uint64_t seed, std::vector<Counts>& counts) {
  const Executor executor(2);
  Environment place = make_environment({.kind = kind, .seed = seed}, executor);
  const Trajectory path = make_path(place, {.seed = seed, .frames = kFrames, .rate_hz = kRate});
  const RgbdSimulator first(place.scene, path, {}, executor);
  std::vector<double> times;
  for (const TimedPose& pose : path.poses()) times.push_back(pose.timestamp_s);
  const Camera camera = default_simulated_camera();
  const auto read = [&](std::size_t i) { return images_of(first.frame(i)); };
  const LandmarkMap map = map_at_poses(times, read, path, camera, {}, {.executor = executor}).map;
  const std::vector<Change> all = changes();
  std::vector<TimedPose> poses;
  std::vector<FrameIndex> keyframe_of;
  for (std::size_t i = 0; i < kViewsAPlace; ++i) {
    const auto keyframe =
        static_cast<std::uint32_t>((2 * i + 1) * map.frame_count() / (2 * kViewsAPlace));
    const Rigid3 pose = map.world_from_camera(FrameIndex{keyframe});
    const RgbdFrame seen = first.frame(map.frames().ids[keyframe].value, executor);
    const double depth =
        seen.exact_depth_m[std::size_t{seen.height / 2} * seen.width + seen.width / 2];
    for (const Change& change : all) {
      poses.push_back({0.1 * static_cast<double>(poses.size()), changed(pose, depth, change)});
      keyframe_of.push_back(FrameIndex{keyframe});
    }
  }
  SimulatorOptions other_noise;
  other_noise.seed = seed + 1;
  const RgbdSimulator again(std::move(place.scene), Trajectory(std::move(poses)), other_noise,
                            executor);
  const detail::FeatureExtractor extractor(camera, FeatureOptions());
  for (std::size_t i = 0; i < keyframe_of.size(); ++i) {
    count(map, keyframe_of[i], again.frame(i, executor), extractor, counts[i % all.size()]);
  }
  fmt::print(stderr, "{} {}: {} landmarks, {} keyframes\n", environment_name(kind), seed,
             map.landmark_count(), map.frame_count());
}

void run(const std::vector<std::string>& words) {
  const std::vector<Change> all = changes();
  std::vector<Counts> counts(all.size());
  for (std::uint64_t seed = std::stoull(words[0]); seed < std::stoull(words[1]); ++seed) {
    for (const std::string_view name : environment_names()) {
      measure(environment_kind(name), seed, counts);
    }
  }
  fmt::print("change,amount,shown,with_a_corner,found_by_one,found_by_several,descriptors\n");
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Counts& c = counts[i];
    fmt::print("{},{},{},{},{},{},{}\n", all[i].kind, all[i].amount, c.shown, c.cornered, c.by_one,
               c.by_several, c.descriptors);
  }
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(argc, argv, 2, "FIRST_SEED END_SEED", run);
}
