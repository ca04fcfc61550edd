// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "cairn/core/random.hpp"
#include "cairn/vision/detail/landmark_graph.hpp"

namespace cairn::testing {

using namespace cairn::detail;  // NOLINT(google-build-using-namespace)

inline constexpr Pinhole kTestPinhole{500.0, 505.0, 319.5, 239.5};

/// 640 x 480 pixels, four octaves.
inline const SensorModel& test_sensor() {
  static const SensorModel sensor({}, kTestPinhole, {1.0, 1.2, 1.44, 1.728});
  return sensor;
}

inline Descriptor random_descriptor(Random& random) {
  Descriptor descriptor;
  for (auto& word : descriptor) {
    word = (static_cast<std::uint64_t>(random.index(1ULL << 32U)) << 32U) |
           static_cast<std::uint64_t>(random.index(1ULL << 32U));
  }
  return descriptor;
}

inline Eigen::Vector3d random_vector(Random& random, double size) {
  const double x = random.uniform(-size, size);
  const double y = random.uniform(-size, size);
  return {x, y, random.uniform(-size, size)};
}

inline Vector6d random_step(Random& random, double metres, double radians) {
  Vector6d step;
  step << random_vector(random, metres), random_vector(random, radians);
  return step;
}

inline Features features_of(std::vector<Keypoint> keypoints, std::vector<Descriptor> descriptors) {
  const cv::Mat image = cv::Mat::zeros(480, 640, CV_8UC1);
  return {std::move(keypoints), std::move(descriptors), {image}, image};
}

struct GraphOptions {
  std::uint64_t seed = 1;
  std::size_t keyframes = 5;
  std::size_t points = 150;
  double noise = 1.0;       ///< factor on the sensor's own; 0: exact
  double with_depth = 0.9;  ///< share of the keypoints
  double seen_again = 0.8;  ///< share of the views in which a point is a keypoint
};

/// A graph as the truth has it but for the measurements' noise: keyframes at arm's length of each
/// other, which look at points two to four metres away.
struct TrueGraph {
  LandmarkGraph graph{test_sensor()};
  std::vector<Rigid3> poses;            ///< one a keyframe
  std::vector<Eigen::Vector3d> points;  ///< one a landmark
};

inline TrueGraph make_true_graph(const GraphOptions& options) {
  Random random(options.seed);
  TrueGraph made;
  std::vector<Eigen::Vector3d> points;
  std::vector<Descriptor> descriptors;
  for (std::size_t i = 0; i < options.points; ++i) {
    const double x = random.uniform(-1.5, 1.5);
    const double y = random.uniform(-1.0, 1.0);
    points.emplace_back(x, y, random.uniform(2.0, 4.0));
    descriptors.push_back(random_descriptor(random));
  }
  std::vector<std::optional<LandmarkIndex>> landmark_of(points.size());
  for (std::size_t k = 0; k < options.keyframes; ++k) {
    Keyframe keyframe;
    keyframe.frame = k;
    keyframe.timestamp_s = static_cast<double>(k);
    keyframe.world_from_camera = Rigid3().perturbed(random_step(random, 0.3, 0.1));
    const Rigid3 camera_from_world = keyframe.world_from_camera.inverse();
    std::vector<Keypoint> keypoints;
    std::vector<Descriptor> seen;
    std::vector<std::size_t> point_of;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d x = camera_from_world * points[i];
      const Eigen::Vector2d pixel = kTestPinhole.project(x);
      if (pixel.x() < 0.0 || pixel.y() < 0.0 || pixel.x() > 639.0 || pixel.y() > 479.0) continue;
      if (!random.chance(options.seen_again)) continue;
      Keypoint keypoint;
      keypoint.octave = static_cast<std::uint8_t>(random.index(4));
      const double sigma = options.noise * test_sensor().sigma_pixel(keypoint);
      const Eigen::Vector2d off(random.normal(), random.normal());
      keypoint.pixel = (pixel + sigma * off).cast<float>();
      keypoint.raw = {keypoint.pixel.x(), keypoint.pixel.y()};
      const double depth =
          x.z() + options.noise * test_sensor().sigma_depth_m(x.z(), 0) * random.normal();
      if (random.chance(options.with_depth)) keypoint.depth_m = static_cast<float>(depth);
      keypoints.push_back(keypoint);
      seen.push_back(descriptors[i]);
      point_of.push_back(i);
    }
    keyframe.features = features_of(std::move(keypoints), std::move(seen));
    made.poses.push_back(keyframe.world_from_camera);
    const std::uint32_t index = made.graph.add_keyframe(std::move(keyframe));
    for (std::uint32_t j = 0; j < point_of.size(); ++j) {
      auto& landmark = landmark_of[point_of[j]];
      if (landmark) {
        made.graph.observe(*landmark, {index, j});
      } else if (made.graph.keyframes()[index].features.keypoints()[j].depth_m > 0.0F) {
        landmark = made.graph.add_landmark({index, j});
        made.graph.landmark(*landmark).position = points[point_of[j]];
        made.points.push_back(points[point_of[j]]);
      }
    }
  }
  for (std::uint32_t i = 0; i < made.points.size(); ++i) made.graph.refresh({i});
  return made;
}

}  // namespace cairn::testing
