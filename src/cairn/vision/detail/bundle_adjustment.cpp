// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <Eigen/Cholesky>
#include <ceres/ceres.h>

#include "cairn/adjustment/detail/costs.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {
namespace {

enum class MeasuredPart { kPixel, kDepth };

// A pixel or depth residual of a keyframe's observation.
struct PartOfMeasurement {
  const Pinhole* pinhole;
  PointMeasurement measured;
  MeasuredPart part;

  std::optional<SeenPoint> operator()(const Eigen::Vector3d& x_in_camera) const {
    if (x_in_camera.z() < kNearestDepth) return std::nullopt;
    const PointResidual residual = point_residual(*pinhole, measured, x_in_camera);
    SeenPoint seen;
    if (part == MeasuredPart::kPixel) {
      seen.value = residual.value.head<2>();
      seen.by_x_in_camera = residual.by_x_in_camera.topRows<2>();
    } else {
      seen.value.x() = residual.value.z();
      seen.by_x_in_camera.row(0) = residual.by_x_in_camera.row(2);
    }
    return seen;
  }
};

using MeasurementCost = PointCost<PartOfMeasurement>;
using Rows3 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

// All observations of a landmark in fixed keyframes, linearised at its position: |L·(x - x₀) + r|² up to a
// constant.
struct FixedMeasurements {
  Eigen::Matrix3d l = Eigen::Matrix3d::Zero();  // upper triangular
  Eigen::Vector3d r = Eigen::Vector3d::Zero();
};

class FixedCost final : public ceres::SizedCostFunction<2, 3> {
 public:
  // Rows `first` and `first` + 1 of the three; a fourth is zero.
  FixedCost(const FixedMeasurements& fixed, const Eigen::Vector3d& linearised_at, int first)
      : linearised_at_(linearised_at) {
    l_.setZero();
    r_.setZero();
    for (int row = 0; row < 2 && first + row < 3; ++row) {
      l_.row(row) = fixed.l.row(first + row);
      r_[row] = fixed.r[first + row];
    }
  }

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> point(parameters[0]);
    Eigen::Map<Eigen::Vector2d>{residuals} = l_ * (point - linearised_at_) + r_;
    if (jacobians != nullptr && jacobians[0] != nullptr) Eigen::Map<Rows3>{jacobians[0]} = l_;
    return true;
  }

 private:
  Rows3 l_;
  Eigen::Vector2d r_;
  Eigen::Vector3d linearised_at_;
};

std::optional<FixedMeasurements> fixed_measurements(const LandmarkGraph& graph, LandmarkIndex index,
                                                    const std::vector<bool>& moves) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (const KeypointReference& reference : graph.landmark(index).observations) {
    if (moves[reference.keyframe]) continue;
    const Rigid3& pose = graph.keyframes()[reference.keyframe].world_from_camera;
    const Eigen::Matrix3d camera_from_world = pose.rotation().transpose();
    const Eigen::Vector3d x_in_camera =
        camera_from_world * (graph.landmark(index).position - pose.translation());
    if (x_in_camera.z() < kNearestDepth) continue;
    const PointResidual residual =
        point_residual(graph.sensor().pinhole(), graph.measurement(reference), x_in_camera);
    const double pixel_weight = huber_weight(residual.squared_pixel(), kPixel95);
    const Eigen::Vector3d weights(pixel_weight, pixel_weight,
                                  huber_weight(residual.squared_depth(), kDepth95));
    const Eigen::Matrix3d by_point = residual.by_x_in_camera * camera_from_world;
    const Eigen::Matrix3d weighted = weights.asDiagonal() * by_point;
    information += by_point.transpose() * weighted;
    gradient += weighted.transpose() * residual.value;
  }
  if (information.trace() <= 0.0) return std::nullopt;
  // A single view without depth leaves one direction open.
  information.diagonal().array() += 1e-9 * information.trace();
  const Eigen::LLT<Eigen::Matrix3d> factor(information);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return FixedMeasurements{factor.matrixU(), factor.matrixL().solve(gradient)};
}

// Variables of an adjustment, in the order of indices, so that results do not depend on another order.
struct Scope {
  std::vector<std::uint32_t> keyframes;  // the moving ones
  std::vector<bool> moves;               // one per keyframe of the graph
  std::vector<LandmarkIndex> landmarks;
};

Scope scope_of(const LandmarkGraph& graph, std::span<const std::uint32_t> moving,
               std::size_t min_observations) {
  Scope scope;
  scope.moves.assign(graph.keyframes().size(), false);
  for (const std::uint32_t keyframe : moving) scope.moves[keyframe] = true;
  std::vector<bool> landmark_in(graph.landmarks().size(), false);
  for (const std::uint32_t keyframe : moving) {
    for (const auto& index : graph.keyframes()[keyframe].landmarks) {
      if (index && graph.landmark(*index).observations.size() >= min_observations) {
        landmark_in[index->value] = true;
      }
    }
  }
  for (std::uint32_t i = 0; i < landmark_in.size(); ++i) {
    if (landmark_in[i]) scope.landmarks.push_back({i});
  }
  scope.keyframes.assign(moving.begin(), moving.end());
  std::sort(scope.keyframes.begin(), scope.keyframes.end());
  return scope;
}

// Landmarks observed by only one keyframe keep their position relative to it.
void carry_along(LandmarkGraph& graph, std::uint32_t keyframe, const Rigid3& before,
                 std::size_t min_observations) {
  const Rigid3 moved = graph.keyframes()[keyframe].world_from_camera * before.inverse();
  for (const auto& index : graph.keyframes()[keyframe].landmarks) {
    if (!index) continue;
    TrackedLandmark& landmark = graph.landmark(*index);
    if (landmark.observations.size() < min_observations &&
        landmark.observations.front().keyframe == keyframe) {
      landmark.position = moved * landmark.position;
    }
  }
}

}  // namespace

void adjust(LandmarkGraph& graph, std::span<const std::uint32_t> moving, int max_iterations) {
  constexpr std::size_t kFewestObservations = 2;  // of a landmark that is adjusted
  const Scope scope = scope_of(graph, moving, kFewestObservations);
  if (scope.landmarks.empty()) return;

  // Contiguous arrays, because Ceres orders the blocks of a group by address, which must be deterministic.
  std::vector<PoseBlock> poses;
  std::vector<std::size_t> pose_of(graph.keyframes().size());
  for (const std::uint32_t keyframe : scope.keyframes) {
    pose_of[keyframe] = poses.size();
    poses.push_back(to_block(graph.keyframes()[keyframe].world_from_camera));
  }
  std::vector<Eigen::Vector3d> points;
  for (const LandmarkIndex index : scope.landmarks)
    points.push_back(graph.landmark(index).position);

  PoseManifold manifold;
  ceres::HuberLoss pixel_loss(std::sqrt(kPixel95));
  ceres::HuberLoss depth_loss(std::sqrt(kDepth95));
  ceres::Problem::Options ownership;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.disable_all_safety_checks = true;
  ceres::Problem problem(ownership);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (PoseBlock& pose : poses) {
    problem.AddParameterBlock(pose.data(), 7, &manifold);
    ordering->AddElementToGroup(pose.data(), 1);
  }
  const Pinhole& pinhole = graph.sensor().pinhole();
  for (std::size_t i = 0; i < points.size(); ++i) {
    double* const point = points[i].data();
    problem.AddParameterBlock(point, 3);
    ordering->AddElementToGroup(point, 0);
    for (const KeypointReference& reference : graph.landmark(scope.landmarks[i]).observations) {
      if (!scope.moves[reference.keyframe]) continue;
      const PointMeasurement measured = graph.measurement(reference);
      double* const pose = poses[pose_of[reference.keyframe]].data();
      problem.AddResidualBlock(new MeasurementCost({&pinhole, measured, MeasuredPart::kPixel}),
                               &pixel_loss, pose, point);
      if (!measured.has_depth()) continue;
      problem.AddResidualBlock(new MeasurementCost({&pinhole, measured, MeasuredPart::kDepth}),
                               &depth_loss, pose, point);
    }
    if (const auto fixed = fixed_measurements(graph, scope.landmarks[i], scope.moves)) {
      problem.AddResidualBlock(new FixedCost(*fixed, points[i], 0), nullptr, point);
      problem.AddResidualBlock(new FixedCost(*fixed, points[i], 2), nullptr, point);
    }
  }
  ceres::Solver::Options solve;
  solve.linear_solver_type = moving.size() > 40 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
  solve.linear_solver_ordering = ordering;
  solve.max_num_iterations = max_iterations;
  solve.function_tolerance = 1e-3;
  solve.num_threads = 1;  // sums in a fixed order
  solve.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solve, &problem, &summary);
  if (!summary.IsSolutionUsable()) return;

  for (const std::uint32_t keyframe : scope.keyframes) {
    Keyframe& moved = graph.keyframes()[keyframe];
    const Rigid3 before = moved.world_from_camera;
    moved.world_from_camera = to_pose(poses[pose_of[keyframe]].data());
    carry_along(graph, keyframe, before, kFewestObservations);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    graph.landmark(scope.landmarks[i]).position = points[i];
  }
  drop_outliers(graph, scope.landmarks);
}

void adjust_landmarks(LandmarkGraph& graph, std::span<const LandmarkIndex> landmarks) {
  const std::vector<bool> none_moves(graph.keyframes().size(), false);
  for (const LandmarkIndex index : landmarks) {
    constexpr int kMostSteps = 5;
    constexpr double kSmall = 1e-5;  // m
    for (int step = 0; step < kMostSteps; ++step) {
      const auto measured = fixed_measurements(graph, index, none_moves);
      if (!measured) break;
      const Eigen::Vector3d move = measured->l.triangularView<Eigen::Upper>().solve(-measured->r);
      graph.landmark(index).position += move;
      if (move.norm() < kSmall) break;
    }
    graph.refresh(index);
  }
}

void drop_outliers(LandmarkGraph& graph, std::span<const LandmarkIndex> landmarks) {
  const SensorModel& sensor = graph.sensor();
  for (const LandmarkIndex index : landmarks) {
    const std::vector<KeypointReference> observations = graph.landmark(index).observations;
    for (const KeypointReference& reference : observations) {
      Keyframe& keyframe = graph.keyframes()[reference.keyframe];
      const Eigen::Vector3d x_in_camera =
          keyframe.world_from_camera.inverse() * graph.landmark(index).position;
      bool explained = x_in_camera.z() >= kNearestDepth;
      if (explained) {
        const PointMeasurement measured =
            sensor.measurement(keyframe.features.keypoints()[reference.keypoint]);
        const PointResidual residual = point_residual(sensor.pinhole(), measured, x_in_camera);
        explained = residual.squared_pixel() <= kPixel99;
        keyframe.depth_disagrees[reference.keypoint] = residual.squared_depth() > kDepth99;
      }
      if (!explained) graph.forget(reference);
    }
    // Removes a landmark whose only observation has a depth that did not fit.
    const auto& left = graph.landmark(index).observations;
    if (left.size() == 1 && observations.size() > 1 && !graph.measurement(left[0]).has_depth()) {
      graph.remove(index);
    }
    graph.refresh(index);
  }
}

}  // namespace cairn::detail
