// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "cairn/adjustment/adjust.hpp"
#include "cairn/adjustment/detail/covariance_recovery.hpp"
#include "cairn/adjustment/detail/frame_groups.hpp"
#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/adjustment/detail/seen_point.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {

using namespace detail;  // what the least-squares problem is made of

namespace {

const Camera& camera_of(const LandmarkMap& map, FrameIndex frame) {
  return map.cameras()[map.frames().cameras[frame.value]->value];
}

// @param lead the frame whose pose is estimated, with which that of the measurement moves
LinearObservation linearise(const LandmarkMap& map, const Measurement& measurement,
                            std::uint32_t lead, const Eigen::Vector3d& x_in_world) {
  const Rigid3 pose = map.world_from_camera(measurement.frame);
  const Eigen::Matrix3d camera_from_world = pose.rotation().transpose();
  const Eigen::Vector3d x_in_camera = camera_from_world * (x_in_world - pose.translation());
  LinearObservation at;
  const Camera& camera = camera_of(map, measurement.frame);
  const auto pixel = seen_pixel(CameraProjection(camera), camera.parameters.data(),
                                measurement.pixel, measurement.sigma_px, x_in_camera);
  if (pixel) at.by_point.topRows<2>() = pixel->by_x_in_camera * camera_from_world;
  if (measurement.depth) at.by_point.row(2) = camera_from_world.row(2) / measurement.sigma_depth;
  at.by_pose = derivative_by_pose(at.by_point, x_in_world - map.frames().translations[lead]);
  return at;
}

// The 95 % quantile of chi-squared numbers (Wilson and Hilferty).
double usual_sum(double degrees_of_freedom) {
  constexpr double kNormal95 = 1.6448536;
  const double a = 2.0 / (9.0 * degrees_of_freedom);
  const double root = 1.0 - a + kNormal95 * std::sqrt(a);
  return degrees_of_freedom * root * root * root;
}

double excess_of_residuals(const LandmarkMap& map, const std::vector<Measurement>& measurements,
                           const Eigen::Vector3d& x_in_world) {
  double sum = 0.0;
  double rows = 0.0;
  for (const Measurement& one : measurements) {
    const auto squared = squared_residuals(map, one, x_in_world);
    if (!squared) continue;
    sum += squared->pixel + squared->depth;
    rows += one.depth ? 3.0 : 2.0;
  }
  constexpr double kUnknowns = 3.0;
  const double free = rows - kUnknowns;
  return free > 0.0 && sum > usual_sum(free) ? sum / free : 1.0;
}

// Whether the observations determine the point, for given poses.
bool is_determined(const LinearLandmark& landmark) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const LinearObservation& at : landmark.observations) {
    information += at.by_point.transpose() * at.by_point;
  }
  const double size = information.trace() / 3.0;
  constexpr double kLeast = 1e-12;
  return size > 0.0 && information.determinant() > kLeast * size * size * size;
}

// The least-squares problem of a group's frames, and the landmarks that it determines.
std::pair<LinearProblem, std::vector<std::uint32_t>> problem_of(
    const LandmarkMap& map, const RigidFrames& rigid,
    std::span<const std::vector<Measurement>> measurements, const FrameGroup& group,
    std::vector<std::uint32_t>& index_in_group) {
  LinearProblem problem;
  for (const std::uint32_t frame : group.frames) {
    if (!rigid.leads(frame)) {
      index_in_group[frame] = index_in_group[rigid.lead[frame]];
      continue;
    }
    index_in_group[frame] = static_cast<std::uint32_t>(problem.camera_centres.size());
    problem.camera_centres.push_back(map.frames().translations[frame]);
  }
  if (group.scale_frame) problem.scale_frame = index_in_group[*group.scale_frame];
  double by_length = 0.0;
  double by_angle = 0.0;
  std::vector<std::uint32_t> landmarks;
  for (const std::uint32_t l : group.landmarks) {
    LinearLandmark linear;
    linear.position = map.landmarks().positions[l];
    for (const Measurement& one : measurements[l]) {
      linear.observations.push_back(
          linearise(map, one, rigid.lead[one.frame.value], linear.position));
      linear.observations.back().frame = index_in_group[one.frame.value];
      const auto& by_pose = linear.observations.back().by_pose;
      by_length += by_pose.leftCols<3>().squaredNorm();
      by_angle += by_pose.rightCols<3>().squaredNorm();
    }
    if (!is_determined(linear)) continue;
    problem.landmarks.push_back(std::move(linear));
    landmarks.push_back(l);
  }
  // In the problem's own units, because the map's are arbitrary.
  const double poses = 3.0 * static_cast<double>(problem.camera_centres.size());
  constexpr double kLeast = 1e-10;
  const auto least = [&](double information) {
    return kLeast * information / poses + std::numeric_limits<double>::min();
  };
  problem.least_information.head<3>().setConstant(least(by_length));
  problem.least_information.tail<3>().setConstant(least(by_angle));
  return {std::move(problem), std::move(landmarks)};
}

}  // namespace

void CovarianceOptions::validate() const {
  if (noise) noise->validate();
}

EstimatedCovariances estimate_covariances(const LandmarkMap& map, const CovarianceOptions& options,
                                          const Execution& execution) {
  options.validate();
  EstimatedCovariances result;
  result.noise = options.noise ? *options.noise : estimated_noise(map);
  const auto measurements = measurements_of(map, result.noise);
  const auto& positions = map.landmarks().positions;
  std::vector<Eigen::Matrix3d> covariances(
      map.landmark_count(), Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    const auto stated = map.covariance(LandmarkIndex{l});
    if (!stated || map.observation_count(LandmarkIndex{l}) > 0) continue;
    covariances[l] = *stated;
    ++result.known;
  }

  OptionalColumn<Matrix6d> pose_covariances = map.frames().pose_covariances;
  pose_covariances.resize(map.frame_count());
  result.references.resize(map.frame_count());

  std::vector<std::uint32_t> index_in_group(map.frame_count());
  const RigidFrames rigid = rigid_frames(map.rigs(), map.frames());
  const auto& centres = map.frames().translations;
  for (const FrameGroup& group : frame_groups(map, rigid, measurements, 2)) {
    for (const std::uint32_t frame : group.frames) {
      result.references[frame] = FrameIndex{group.frames.front()};
      pose_covariances.set(frame, std::nullopt);
    }
    const auto [problem, landmarks] = problem_of(map, rigid, measurements, group, index_in_group);
    const RecoveredCovariances recovered = recover_covariances(problem, options.gauge, execution);
    for (const std::uint32_t frame : group.frames) {
      Matrix6d covariance = recovered.frames[index_in_group[frame]];
      if (!rigid.leads(frame)) {
        covariance = covariance_at_point(covariance, centres[frame] - centres[rigid.lead[frame]]);
      }
      if (pose_covariance_defect(covariance).empty()) pose_covariances.set(frame, covariance);
    }
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      const std::uint32_t l = landmarks[i];
      Eigen::Matrix3d covariance = recovered.landmarks[i];
      if (options.widen_misfits) {
        covariance *= excess_of_residuals(map, measurements[l], positions[l]);
      }
      if (!landmark_covariance_defect(covariance).empty()) continue;
      covariances[l] = covariance;
      ++result.known;
    }
  }
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  tables.info.uuid.reset();
  tables.landmarks.covariances = std::move(covariances);
  tables.frames.pose_covariances = std::move(pose_covariances);
  result.map = LandmarkMap(std::move(tables));
  return result;
}

}  // namespace cairn
