// SPDX-License-Identifier: BSD-3-Clause
#include "workload.hpp"

#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <string>

#include <Eigen/Eigenvalues>

#include "cairn/core/random.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn::benchmarks {
namespace {

constexpr std::size_t kLandmarks = 6081;  // as many as the real map has with two observations

LandmarkMap well_observed(const LandmarkMap& map, std::size_t landmarks) {
  std::vector<LandmarkIndex> kept = landmarks_observed(map, 2);
  if (kept.size() > landmarks) kept.resize(landmarks);
  return with_landmarks(map, kept);
}

Eigen::Vector3d noise(const Eigen::Matrix3d& covariance, Random& random) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  const Eigen::Vector3d normal(random.normal(), random.normal(), random.normal());
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseProduct(normal);
}

Workload make_workload(const LandmarkMap& map) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  Workload result;
  result.target = point_set(map, observations_metric());
  result.source = result.target;
  Random random(1);
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    result.source.positions[i] += noise(map.covariance(LandmarkIndex{i}).value(), random);
  }
  for (PointSet* const set : {&result.source, &result.target}) {
    for (auto& position : set->positions) position = position.cast<float>().cast<double>();
  }
  result.options.initial =
      Rigid3::from_roll_pitch_yaw({0, 1, 0.4}, 10 * kDegree, 0, 22.5 * kDegree);
  return result;
}

}  // namespace

const Workload& workload() {
  static const Workload result = [] {
    const char* const data = std::getenv("CAIRN_DATA");
    return data == nullptr || *data == '\0'
               ? workload(kLandmarks)
               : make_workload(
                     well_observed(read_map(std::string(data) + "/map_fr1_desk.txt"), kLandmarks));
  }();
  return result;
}

const Workload& workload(std::size_t landmarks) {
  static std::map<std::size_t, Workload> made;
  const auto found = made.find(landmarks);
  if (found != made.end()) return found->second;
  // At least every second landmark is observed twice. Few frames make a large map quickly.
  const LandmarkMap map = synthetic_map(
      {.seed = 1, .landmarks = 2 * landmarks, .frames = landmarks < 100'000 ? 60U : 10U});
  return made.emplace(landmarks, make_workload(well_observed(map, landmarks))).first->second;
}

PointSet random_points(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  PointSet points;
  points.positions.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    points.positions.emplace_back(random.uniform(), random.uniform(), random.uniform());
    points.positions.back() = points.positions.back().cast<float>().cast<double>();
  }
  return points;
}

}  // namespace cairn::benchmarks
