// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <utility>

#include <Eigen/Core>
#include <ceres/cost_function.h>
#include <ceres/sized_cost_function.h>

#include "cairn/adjustment/detail/pose_block.hpp"
#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/adjustment/detail/seen_point.hpp"
#include "cairn/map/camera.hpp"

namespace cairn::detail {

/// A camera's measurement of a point. Blocks: PoseBlock of the camera, point in the world.
/// @tparam Measure a function std::optional<SeenPoint>(const Eigen::Vector3d& x_in_camera); std::nullopt if
///        the point is not visible
template <class Measure>
class PointCost final : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  explicit PointCost(Measure measure) : measure_(std::move(measure)) {}

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> rotation(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> centre(parameters[0] + 4);
    const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
    const Eigen::Matrix3d camera_from_world = rotation.toRotationMatrix().transpose();
    const Eigen::Vector3d arm = point - centre;
    const std::optional<SeenPoint> seen = measure_(camera_from_world * arm);
    if (!seen) return false;
    Eigen::Map<Eigen::Vector2d>{residuals} = seen->value;
    if (jacobians == nullptr) return true;
    const Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point =
        seen->by_x_in_camera * camera_from_world;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> by_pose(jacobians[0]);
      by_pose.leftCols<6>() = derivative_by_pose(by_point, arm);
      by_pose.col(6).setZero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobians[1]} = by_point;
    }
    return true;
  }

 private:
  Measure measure_;
};

/// The same for a measured pixel, with the camera's parameters as a third block.
class CalibrationCost final : public ceres::CostFunction {
 public:
  /// @param camera camera whose model is used
  /// @param camera_from_body pose of the body in the camera, if the first block is the pose of a body that
  ///        carries the camera; must outlive the cost
  CalibrationCost(const Camera& camera, const Eigen::Vector2d& pixel, double sigma_px,
                  const Rigid3* camera_from_body = nullptr);

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  CameraProjection projection_;
  Eigen::Vector2d pixel_;
  double sigma_px_;
  const Rigid3* camera_from_body_;
};

}  // namespace cairn::detail
