// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/costs.hpp"

#include <vector>

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

Rigid3 random_pose(Random& random) {
  Vector6d step;
  for (int i = 0; i < 6; ++i) step[i] = random.uniform(-0.3, 0.3);
  return Rigid3().perturbed(step);
}

// Compares the derivatives that a cost gives, by the manifold's steps, with central differences.
// `blocks` of 7 numbers are poses, others vectors.
void expect_true_derivatives(const ceres::CostFunction& cost,
                             std::vector<std::vector<double>> blocks, double tolerance) {
  const int rows = cost.num_residuals();
  const auto pointers = [&] {
    std::vector<const double*> result;
    for (const auto& block : blocks) result.push_back(block.data());
    return result;
  };
  std::vector<std::vector<double>> jacobians;
  std::vector<double*> jacobian_pointers;
  for (const auto& block : blocks) {
    jacobians.emplace_back(static_cast<std::size_t>(rows) * block.size());
  }
  for (auto& jacobian : jacobians) jacobian_pointers.push_back(jacobian.data());
  Eigen::VectorXd residuals(rows);
  ASSERT_TRUE(cost.Evaluate(pointers().data(), residuals.data(), jacobian_pointers.data()));
  const PoseManifold manifold;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const std::vector<double> at = blocks[b];
    const bool is_pose = at.size() == 7;
    const std::size_t steps = is_pose ? 6 : at.size();
    for (std::size_t i = 0; i < steps; ++i) {
      const double size = 1e-6 * std::max(1.0, is_pose ? 1.0 : std::abs(at[i]));
      const auto residuals_at = [&](double step) {
        if (is_pose) {
          std::vector<double> delta(6, 0.0);
          delta[i] = step;
          manifold.Plus(at.data(), delta.data(), blocks[b].data());
        } else {
          blocks[b][i] = at[i] + step;
        }
        Eigen::VectorXd value(rows);
        EXPECT_TRUE(cost.Evaluate(pointers().data(), value.data(), nullptr));
        blocks[b] = at;
        return value;
      };
      const Eigen::VectorXd numeric = (residuals_at(size) - residuals_at(-size)) / (2.0 * size);
      for (int row = 0; row < rows; ++row) {
        const double given = jacobians[b][static_cast<std::size_t>(row) * at.size() + i];
        EXPECT_NEAR(given, numeric[row], tolerance * (1.0 + std::abs(numeric[row])))
            << "block " << b << " step " << i << " row " << row;
      }
    }
  }
}

std::vector<double> numbers(const Rigid3& pose) {
  const PoseBlock block = to_block(pose);
  return {block.begin(), block.end()};
}

// A camera of each model with some distortion.
std::vector<Camera> cameras() {
  std::vector<Camera> result;
  for (const CameraModel& model : camera_models()) {
    Camera camera{CameraId{1}, std::string(model.name), 640, 480, {}};
    for (const std::string_view name : model.parameters) {
      double value = 0.02;
      if (name.starts_with('f')) value = 500.0;
      if (name == "cx") value = 320.0;
      if (name == "cy") value = 240.0;
      if (name == "omega") value = 0.8;
      if (name == "alpha") value = 0.55;
      if (name == "beta") value = 1.1;
      if (name == "w") value = 640.0;
      if (name == "h") value = 480.0;
      camera.parameters.push_back(value);
    }
    EXPECT_EQ(camera_defect(camera), "");
    result.push_back(camera);
  }
  return result;
}

TEST(CalibrationCost, DerivativesOfAllModelsAgreeWithNumericOnes) {
  Random random(3);
  for (const Camera& camera : cameras()) {
    SCOPED_TRACE(camera.model);
    const Rigid3 pose = random_pose(random);
    const Eigen::Vector3d point = pose * Eigen::Vector3d(0.4, -0.3, 2.0);
    const Rigid3 mount = Rigid3::from_roll_pitch_yaw({0.1, -0.2, 0.05}, 0.1, -0.05, 0.2);
    for (const Rigid3* camera_from_body : {static_cast<const Rigid3*>(nullptr), &mount}) {
      const CalibrationCost cost(camera, {300.0, 200.0}, 0.7, camera_from_body);
      EXPECT_EQ(
          cost.parameter_block_sizes(),
          (std::vector<std::int32_t>{7, 3, static_cast<std::int32_t>(camera.parameters.size())}));
      expect_true_derivatives(
          cost, {numbers(pose), {point.x(), point.y(), point.z()}, camera.parameters}, 1e-4);
    }
  }
}

TEST(CalibrationCost, DerivativesAgreeBesideAndBehindTheCamera) {
  Random random(7);
  std::size_t seen = 0;
  for (const Camera& camera : cameras()) {
    SCOPED_TRACE(camera.model);
    const Rigid3 pose = random_pose(random);
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(1.5, -0.7, -0.3), Eigen::Vector3d(1e-8, 0.2, -2.0)}) {
      const auto pixel = project(camera, x);
      if (!pixel) continue;
      ++seen;
      const Eigen::Vector3d point = pose * x;
      // The second point lies on the border of a panorama, this observation beyond it.
      const CalibrationCost cost(camera, {pixel->u + 2.0, pixel->v}, 0.7);
      expect_true_derivatives(
          cost, {numbers(pose), {point.x(), point.y(), point.z()}, camera.parameters}, 1e-4);
    }
  }
  EXPECT_GE(seen, 9U) << "fisheyes, EUCM and the panorama see sideways";
}

TEST(PointCost, DepthDerivativesAgreeWithNumericOnes) {
  Random random(4);
  const Rigid3 pose = random_pose(random);
  const Eigen::Vector3d point = pose * Eigen::Vector3d(0.4, -0.3, 2.0);
  const PointCost cost([](const Eigen::Vector3d& x) { return seen_depth(2.1, 0.02, x); });
  expect_true_derivatives(cost, {numbers(pose), {point.x(), point.y(), point.z()}}, 1e-6);
}

TEST(PointCost, RefusesAPointBehindTheCamera) {
  const PointCost cost([](const Eigen::Vector3d& x) { return seen_depth(2.1, 0.02, x); });
  const PoseBlock pose = to_block(Rigid3());
  const std::vector<double> point = {0.0, 0.0, -1.0};
  const std::vector<const double*> blocks = {pose.data(), point.data()};
  Eigen::Vector2d residuals;
  EXPECT_FALSE(cost.Evaluate(blocks.data(), residuals.data(), nullptr));
}

TEST(PoseManifold, MinusUndoesPlus) {
  Random random(8);
  const PoseManifold manifold;
  const PoseBlock pose = to_block(random_pose(random));
  const std::vector<double> step = {0.1, -0.2, 0.3, 0.2, -0.1, 0.05};
  PoseBlock moved{};
  manifold.Plus(pose.data(), step.data(), moved.data());
  std::vector<double> back(6);
  manifold.Minus(moved.data(), pose.data(), back.data());
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(back[i], step[i], 1e-12);
}

}  // namespace
}  // namespace cairn::detail
