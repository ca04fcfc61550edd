// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/lens_estimation.hpp"

#include <algorithm>
#include <cmath>

#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {
namespace {

// Pose, logarithm of the focal length, two radial terms, principal point in larger sides of the image. The last is not used:
// the solver is compiled for twelve.
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;
constexpr int kLens = 6;
constexpr int kLensUnknowns = 5;
constexpr int kCentre = 9;

double larger_side(const Camera& camera) {
  return std::max(camera.width, camera.height);
}

using LensVector = Eigen::Matrix<double, kLensUnknowns, 1>;

LensVector lens_of(const Camera& camera) {
  const std::vector<double>& p = camera.parameters;
  const double side = larger_side(camera);
  return {std::log(p[0] / side), p[3], p[4], p[1] / side, p[2] / side};
}

Camera with_lens(Camera camera, const LensVector& lens) {
  const double side = larger_side(camera);
  camera.parameters = {side * std::exp(lens[0]), side * lens[3], side * lens[4], lens[1], lens[2]};
  return camera;
}

// Standard deviations of the first three about zero, and of the principal point about that given.
const Eigen::Vector3d kUsualLens = {0.7, 0.2, 0.1};
constexpr double kUsualCentre = 0.015;

struct LensEquations {
  Matrix12d information = Matrix12d::Zero();
  Vector12d gradient = Vector12d::Zero();
  double squares = 0.0;  // of the residuals that the noise explains
  std::size_t count = 0;
};

// Pixel of x = (x/z, y/z) with derivatives by x and by the lens.
struct LensPixel {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d by_x;
  Eigen::Matrix<double, 2, kLensUnknowns> by_lens;
};

LensPixel through_lens(const Camera& camera, const Eigen::Vector2d& x) {
  const std::vector<double>& p = camera.parameters;
  const double r2 = x.squaredNorm();
  const double factor = 1.0 + r2 * (p[3] + r2 * p[4]);
  LensPixel seen;
  const Eigen::Vector2d from_centre = p[0] * factor * x;
  seen.pixel = from_centre + Eigen::Vector2d(p[1], p[2]);
  seen.by_x = p[0] * (factor * Eigen::Matrix2d::Identity() +
                      2.0 * (p[3] + 2.0 * r2 * p[4]) * x * x.transpose());
  seen.by_lens.col(0) = from_centre;
  seen.by_lens.col(1) = p[0] * r2 * x;
  seen.by_lens.col(2) = p[0] * r2 * r2 * x;
  seen.by_lens.rightCols<2>() = larger_side(camera) * Eigen::Matrix2d::Identity();
  return seen;
}

// @param plain without Huber's kernel, of the matches that the noise explains
LensEquations equations(const Camera& camera, std::span<const PointMatch> matches,
                        const Rigid3& world_from_camera, bool plain) {
  LensEquations sum;
  sum.information(11, 11) = 1.0;
  const Eigen::Vector3d weights = kUsualLens.cwiseProduct(kUsualLens).cwiseInverse();
  sum.information.diagonal().segment<3>(kLens) = weights;
  sum.gradient.segment<3>(kLens) = weights.cwiseProduct(lens_of(camera).head<3>());
  const Eigen::Matrix3d camera_from_world = world_from_camera.rotation().transpose();
  for (const PointMatch& match : matches) {
    const Eigen::Vector3d arm = match.x_in_world - world_from_camera.translation();
    const Eigen::Vector3d x = camera_from_world * arm;
    if (x.z() < kNearestDepth) continue;
    const LensPixel seen = through_lens(camera, x.head<2>() / x.z());
    const double inverse_sigma = 1.0 / match.measured.sigma_pixel;
    const Eigen::Vector2d residual = inverse_sigma * (seen.pixel - match.measured.pixel);
    const double squared = residual.squaredNorm();
    if (plain && squared > kPixel99) continue;
    Eigen::Matrix<double, 2, 3> plane_by_x;
    plane_by_x << 1.0, 0.0, -x.x() / x.z(), 0.0, 1.0, -x.y() / x.z();
    Eigen::Matrix<double, 2, 12> by_all;
    by_all.leftCols<6>() =
        derivative_by_pose(inverse_sigma / x.z() * seen.by_x * plane_by_x * camera_from_world, arm);
    by_all.middleCols<kLensUnknowns>(kLens) = inverse_sigma * seen.by_lens;
    by_all.col(11).setZero();
    const double weight = plain ? 1.0 : huber_weight(squared, kPixel95);
    sum.information += weight * by_all.transpose() * by_all;
    sum.gradient += weight * by_all.transpose() * residual;
    sum.squares += squared;
    ++sum.count;
  }
  return sum;
}

// The equations of all but the principal point, which stays as it is.
LensEquations without_centre(LensEquations sum) {
  sum.information.middleRows<2>(kCentre).setZero();
  sum.information.middleCols<2>(kCentre).setZero();
  sum.information.diagonal().segment<2>(kCentre).setOnes();
  sum.gradient.segment<2>(kCentre).setZero();
  return sum;
}

}  // namespace

Camera radial_camera(const Camera& camera, double focal_length) {
  const Intrinsics centre = intrinsics(camera);
  return {camera.id,
          "RADIAL",
          camera.width,
          camera.height,
          {focal_length, centre.cx, centre.cy, 0.0, 0.0}};
}

std::optional<LensEstimate> estimate_lens(const Camera& camera, std::span<const PointMatch> matches,
                                          const Rigid3& world_from_camera) {
  constexpr int kSteps = 20;
  constexpr double kSettled = 1e-8;
  constexpr double kLongest =
      0.2;  // a longer step leaves the range in which the equations are nearly linear
  LensEstimate estimate{camera, world_from_camera};
  for (const bool plain : {false, true}) {
    for (int step = 0; step < kSteps; ++step) {
      const LensEquations sum =
          without_centre(equations(estimate.camera, matches, estimate.world_from_camera, plain));
      const auto solution = solve_positive_definite<12>(sum.information, sum.gradient);
      if (!solution || !solution->allFinite()) return std::nullopt;
      const double longest = solution->cwiseAbs().maxCoeff();
      const Vector12d delta = -(longest > kLongest ? kLongest / longest : 1.0) * *solution;
      estimate.world_from_camera = estimate.world_from_camera.perturbed(delta.head<6>());
      estimate.camera = with_lens(estimate.camera,
                                  lens_of(estimate.camera) + delta.segment<kLensUnknowns>(kLens));
      if (delta.norm() < kSettled) break;
    }
  }
  if (!camera_defect(estimate.camera).empty()) return std::nullopt;
  // An error of the principal point moves all else, and two radial terms are not all of a real lens, so residuals count if
  // they are larger than the noise.
  const LensEquations all = equations(estimate.camera, matches, estimate.world_from_camera, true);
  const LensEquations sum = without_centre(all);
  const double freedom =
      std::max(1.0, 2.0 * static_cast<double>(sum.count) - kLens - kLensUnknowns);
  const double inflation = std::max(1.0, sum.squares / freedom);
  Matrix12d inverse;
  for (int k = 0; k < inverse.cols(); ++k) {
    const auto column = solve_positive_definite<12>(sum.information, Vector12d(Vector12d::Unit(k)));
    if (!column) return std::nullopt;
    inverse.col(k) = *column;
  }
  Eigen::Matrix<double, 12, 2> by_centre = all.information.middleCols<2>(kCentre);
  by_centre.middleRows<2>(kCentre).setZero();
  const Eigen::Matrix<double, 12, 2> moved = kUsualCentre * inverse * by_centre;
  const Matrix12d covariance = inflation * inverse + moved * moved.transpose();
  estimate.covariance = covariance.topLeftCorner<6, 6>();
  estimate.focal_length_sigma = estimate.camera.parameters[0] * std::sqrt(covariance(kLens, kLens));
  return estimate;
}

}  // namespace cairn::detail
