// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/odometry/bundle_adjustment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include <ceres/ceres.h>

namespace cairn {
namespace {

constexpr double kPixelGate = 9.210;  // chi² of two degrees of freedom, 99 %
constexpr double kDepthGate = 6.635;  // of one

using Row6 = Eigen::Matrix<double, 3, 7, Eigen::RowMajor>;
using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// A pose as Ceres moves it: quaternion x y z w, then translation.
using PoseBlock = std::array<double, 7>;

PoseBlock to_block(const Rigid3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  const Eigen::Vector3d& t = pose.translation();
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

Rigid3 to_pose(const PoseBlock& block) {
  return {Eigen::Quaterniond(block[3], block[0], block[1], block[2]),
          Eigen::Vector3d(block[4], block[5], block[6])};
}

// Steps are Rigid3's left perturbations (δt, δφ). Cost functions give derivatives by those in the
// first six columns of what Ceres takes for derivatives by the seven numbers; with this Jacobian the
// product is right.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(x);
    const Eigen::Quaterniond moved =
        (rotation_exp(Eigen::Vector3d(delta[3], delta[4], delta[5])) * q).normalized();
    Eigen::Map<Eigen::Vector4d>{x_plus_delta} = moved.coeffs();
    for (int i = 0; i < 3; ++i) x_plus_delta[4 + i] = x[4 + i] + delta[i];
    return true;
  }
  bool PlusJacobian(const double* /*x*/, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    const Eigen::Map<const Eigen::Quaterniond> to(y);
    const Eigen::Map<const Eigen::Quaterniond> from(x);
    for (int i = 0; i < 3; ++i) y_minus_x[i] = y[4 + i] - x[4 + i];
    Eigen::Map<Eigen::Vector3d>{y_minus_x + 3} = rotation_log(to * from.conjugate());
    return true;
  }
  bool MinusJacobian(const double* /*x*/, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
};

class MeasurementCost final : public ceres::SizedCostFunction<3, 7, 3> {
 public:
  MeasurementCost(const Pinhole& pinhole, const PointMeasurement& measured)
      : pinhole_(&pinhole), measured_(measured) {}

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> rotation(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> centre(parameters[0] + 4);
    const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
    const Eigen::Matrix3d camera_from_world = rotation.toRotationMatrix().transpose();
    const Eigen::Vector3d arm = point - centre;
    const Eigen::Vector3d x_in_camera = camera_from_world * arm;
    if (x_in_camera.z() < kNearestDepth) return false;
    const PointResidual residual = point_residual(*pinhole_, measured_, x_in_camera);
    Eigen::Map<Eigen::Vector3d>{residuals} = residual.value;
    if (jacobians == nullptr) return true;
    const Eigen::Matrix3d by_point = residual.by_x_in_camera * camera_from_world;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Row6> by_pose(jacobians[0]);
      by_pose.leftCols<3>() = -by_point;
      by_pose.middleCols<3>(3) = by_point * skew(arm);
      by_pose.col(6).setZero();
    }
    if (jacobians[1] != nullptr) Eigen::Map<Row3>{jacobians[1]} = by_point;
    return true;
  }

 private:
  const Pinhole* pinhole_;
  PointMeasurement measured_;
};

// What an adjustment is about, in the order of indices: results depend on nothing else.
struct Scope {
  std::vector<std::uint32_t> keyframes;  // moving and fixed
  std::vector<bool> moves;               // one a keyframe of the graph
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
  std::vector<bool> keyframe_in = scope.moves;
  for (std::uint32_t i = 0; i < landmark_in.size(); ++i) {
    if (!landmark_in[i]) continue;
    scope.landmarks.push_back({i});
    for (const auto& reference : graph.landmarks()[i].observations) {
      keyframe_in[reference.keyframe] = true;
    }
  }
  for (std::uint32_t i = 0; i < keyframe_in.size(); ++i) {
    if (keyframe_in[i]) scope.keyframes.push_back(i);
  }
  return scope;
}

// Landmarks seen from one keyframe only stay where they are in that keyframe.
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

void drop_outliers(LandmarkGraph& graph, const Scope& scope) {
  const SensorModel& sensor = graph.sensor();
  for (const LandmarkIndex index : scope.landmarks) {
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
        explained = residual.squared_pixel() <= kPixelGate;
        keyframe.depth_disagrees[reference.keypoint] = residual.squared_depth() > kDepthGate;
      }
      if (!explained) graph.forget(reference);
    }
    // One that is left alone with a depth that never fitted is nothing.
    const auto& left = graph.landmark(index).observations;
    if (left.size() == 1 && observations.size() > 1 && !graph.measurement(left[0]).has_depth()) {
      graph.remove(index);
    }
    graph.refresh(index);
  }
}

}  // namespace

void adjust(LandmarkGraph& graph, std::span<const std::uint32_t> moving,
            const AdjustmentOptions& options) {
  const Scope scope = scope_of(graph, moving, options.min_observations);
  if (scope.landmarks.empty()) return;

  // Ceres orders blocks by address within a group: contiguous arrays keep that the same every time.
  std::vector<PoseBlock> poses;
  std::vector<std::size_t> pose_of(graph.keyframes().size());
  for (const std::uint32_t keyframe : scope.keyframes) {
    pose_of[keyframe] = poses.size();
    poses.push_back(to_block(graph.keyframes()[keyframe].world_from_camera));
  }
  std::vector<Eigen::Vector3d> points;
  for (const LandmarkIndex index : scope.landmarks) points.push_back(graph.landmark(index).position);

  PoseManifold manifold;
  ceres::HuberLoss loss(std::sqrt(7.815));  // chi² of three degrees of freedom, 95 %
  ceres::Problem::Options ownership;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.disable_all_safety_checks = true;
  ceres::Problem problem(ownership);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    problem.AddParameterBlock(poses[i].data(), 7, &manifold);
    if (!scope.moves[scope.keyframes[i]]) problem.SetParameterBlockConstant(poses[i].data());
    ordering->AddElementToGroup(poses[i].data(), 1);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    problem.AddParameterBlock(points[i].data(), 3);
    ordering->AddElementToGroup(points[i].data(), 0);
    for (const KeypointReference& reference : graph.landmark(scope.landmarks[i]).observations) {
      problem.AddResidualBlock(
          new MeasurementCost(graph.sensor().pinhole(), graph.measurement(reference)), &loss,
          poses[pose_of[reference.keyframe]].data(), points[i].data());
    }
  }
  ceres::Solver::Options solve;
  solve.linear_solver_type = moving.size() > 40 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
  solve.linear_solver_ordering = ordering;
  solve.max_num_iterations = options.max_iterations;
  solve.function_tolerance = 1e-4;
  solve.num_threads = 1;  // sums in a fixed order
  solve.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solve, &problem, &summary);
  if (!summary.IsSolutionUsable()) return;

  for (const std::uint32_t keyframe : scope.keyframes) {
    if (!scope.moves[keyframe]) continue;
    Keyframe& moved = graph.keyframes()[keyframe];
    const Rigid3 before = moved.world_from_camera;
    moved.world_from_camera = to_pose(poses[pose_of[keyframe]]);
    carry_along(graph, keyframe, before, options.min_observations);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    graph.landmark(scope.landmarks[i]).position = points[i];
  }
  drop_outliers(graph, scope);
}

}  // namespace cairn
