// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/lens_estimation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {
namespace {

// Pose and lens. The last is not used: the solver is compiled for twelve.
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;
constexpr int kLens = 6;
constexpr int kUnknowns = kLens + kLensUnknowns;

double larger_side(const Camera& camera) {
  return std::max(camera.width, camera.height);
}

}  // namespace

LensVector lens_of(const Camera& camera) {
  const std::vector<double>& p = camera.parameters;
  const double side = larger_side(camera);
  return {std::log(p[0] / side), p[3], p[4], p[1] / side, p[2] / side};
}

Camera with_lens(Camera camera, const LensVector& lens) {
  const double side = larger_side(camera);
  camera.model = "RADIAL";
  camera.parameters = {side * std::exp(lens[0]), side * lens[3], side * lens[4], lens[1], lens[2]};
  return camera;
}

namespace {

LensPrior prior_with(const Camera& camera, double centre) {
  const Intrinsics at = intrinsics(camera);
  const LensVector deviations = {0.7, 0.2, 0.1, centre, centre};
  LensPrior prior{LensVector::Zero(), LensMatrix::Zero()};
  prior.mean.tail<2>() = Eigen::Vector2d(at.cx, at.cy) / larger_side(camera);
  prior.information = deviations.cwiseAbs2().cwiseInverse().asDiagonal();
  return prior;
}

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
                        const Rigid3& world_from_camera, const LensPrior& prior, bool plain) {
  LensEquations sum;
  sum.information(11, 11) = 1.0;
  sum.information.block<kLensUnknowns, kLensUnknowns>(kLens, kLens) = prior.information;
  sum.gradient.segment<kLensUnknowns>(kLens) = prior.information * (lens_of(camera) - prior.mean);
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

// Moves the estimate to the minimum.
// @param steps at most
// @return whether the matches determine it
bool minimise(LensEstimate& estimate, std::span<const PointMatch> matches, const LensPrior& prior,
              bool plain, int steps) {
  constexpr double kSettled = 1e-8;
  // A longer step leaves the range in which the equations are nearly linear.
  constexpr double kLongest = 0.2;
  for (int step = 0; step < steps; ++step) {
    const LensEquations sum =
        equations(estimate.camera, matches, estimate.world_from_camera, prior, plain);
    const auto solution = solve_positive_definite<12>(sum.information, sum.gradient);
    if (!solution || !solution->allFinite()) return false;
    const double longest = solution->cwiseAbs().maxCoeff();
    const Vector12d delta = -(longest > kLongest ? kLongest / longest : 1.0) * *solution;
    estimate.world_from_camera = estimate.world_from_camera.perturbed(delta.head<6>());
    estimate.camera =
        with_lens(estimate.camera, lens_of(estimate.camera) + delta.segment<kLensUnknowns>(kLens));
    if (delta.norm() < kSettled) break;
  }
  return true;
}

// Cuts the matches into halves with equal numbers across the longer side of the image that they cover, and each half again.
void cut(std::span<std::uint32_t> part, std::span<const PointMatch> matches, int cuts,
         std::vector<std::span<std::uint32_t>>& parts) {
  if (cuts == 0 || part.empty()) {
    parts.push_back(part);
    return;
  }
  Eigen::AlignedBox2d box;
  for (const std::uint32_t i : part) box.extend(matches[i].measured.pixel);
  const Eigen::Index axis = box.max().y() - box.min().y() > box.max().x() - box.min().x() ? 1 : 0;
  std::ranges::sort(part, {},
                    [&](std::uint32_t i) { return std::pair(matches[i].measured.pixel[axis], i); });
  cut(part.first(part.size() / 2), matches, cuts - 1, parts);
  cut(part.subspan(part.size() / 2), matches, cuts - 1, parts);
}

}  // namespace

LensPrior LensPrior::usual(const Camera& camera) {
  return prior_with(camera, 0.015);
}

LensPrior LensPrior::usual_about_centre(const Camera& camera) {
  return prior_with(camera, 1e-6);
}

LensPrior LensPrior::certain(const Camera& camera) {
  constexpr double kInformation = 1e12;
  return {lens_of(camera), kInformation * LensMatrix::Identity()};
}

double LensEstimate::focal_length_sigma() const {
  return camera.parameters.front() * std::sqrt(lens_covariance(0, 0));
}

Camera radial_camera(const Camera& camera, double focal_length) {
  const Intrinsics centre = intrinsics(camera);
  return {camera.id,
          "RADIAL",
          camera.width,
          camera.height,
          {focal_length, centre.cx, centre.cy, 0.0, 0.0}};
}

std::optional<LensEstimate> estimate_lens(const Camera& camera, std::span<const PointMatch> matches,
                                          const Rigid3& world_from_camera, const LensPrior& prior) {
  constexpr int kSteps = 20;
  LensEstimate estimate{camera, world_from_camera};
  for (const bool plain : {false, true}) {
    if (!minimise(estimate, matches, prior, plain, kSteps)) return std::nullopt;
  }
  if (!camera_defect(estimate.camera).empty()) return std::nullopt;
  // Two radial terms are not all of a real lens, so residuals count if they are larger than the noise.
  const LensEquations sum =
      equations(estimate.camera, matches, estimate.world_from_camera, prior, true);
  const double freedom = std::max(1.0, 2.0 * static_cast<double>(sum.count) - kUnknowns);
  const double inflation = std::max(1.0, sum.squares / freedom);
  Matrix12d inverse;
  for (int k = 0; k < inverse.cols(); ++k) {
    const auto column = solve_positive_definite<12>(sum.information, Vector12d(Vector12d::Unit(k)));
    if (!column) return std::nullopt;
    inverse.col(k) = inflation * *column;
  }
  estimate.covariance = inverse.topLeftCorner<kLens, kLens>();
  estimate.lens_covariance = inverse.block<kLensUnknowns, kLensUnknowns>(kLens, kLens);
  estimate.lens_covariance_by_noise = estimate.lens_covariance / inflation;
  return estimate;
}

LensGain gain_of(const LensEstimate& lens, const LensEstimate& other,
                 std::span<const PointMatch> matches) {
  constexpr double kFar = 1.5;               // pixels: what is farther counts less
  constexpr double kSigmaOfMedian = 1.4826;  // of absolute deviations of normal ones
  constexpr double kExact = 0.05;            // pixels: no corner is better than that
  const Rigid3 by_lens = lens.world_from_camera.inverse();
  const Rigid3 by_other = other.world_from_camera.inverse();
  std::vector<double> own;  // residuals, coordinate by coordinate
  std::vector<double> others;
  for (const PointMatch& match : matches) {
    const Eigen::Vector2d& seen = match.measured.pixel;
    const auto here = project(lens.camera, by_lens * match.x_in_world);
    const auto there = project(other.camera, by_other * match.x_in_world);
    if (!here || !there) continue;
    own.insert(own.end(), {std::abs(here->u - seen.x()), std::abs(here->v - seen.y())});
    others.insert(others.end(), {std::abs(there->u - seen.x()), std::abs(there->v - seen.y())});
  }
  if (own.empty()) return {};
  const auto cost = [](const std::vector<double>& residuals) {
    double sum = 0.0;
    for (const double residual : residuals) {
      sum += std::sqrt(1.0 + (residual / kFar) * (residual / kFar)) - 1.0;
    }
    return sum * kFar * kFar;
  };
  const double before = cost(others);
  const double decrease = before - cost(own);
  const double noise = std::max(kSigmaOfMedian * upper_median(own), kExact);
  return before > 0.0 ? LensGain{decrease / (noise * noise), decrease / before} : LensGain{};
}

bool add_jackknife(LensEstimate& estimate, std::span<const PointMatch> matches,
                   const LensPrior& prior) {
  constexpr int kCuts = 3;
  constexpr int kSteps = 10;  // from nearby
  std::vector<std::uint32_t> order(matches.size());
  std::iota(order.begin(), order.end(), 0U);
  std::vector<std::span<std::uint32_t>> parts;
  cut(order, matches, kCuts, parts);
  std::vector<Eigen::Matrix<double, kUnknowns, 1>> changes;
  Eigen::Matrix<double, kUnknowns, 1> mean = Eigen::Matrix<double, kUnknowns, 1>::Zero();
  for (const std::span<std::uint32_t> part : parts) {
    std::vector<PointMatch> others;
    const auto begin = static_cast<std::size_t>(part.data() - order.data());
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (i < begin || i >= begin + part.size()) others.push_back(matches[order[i]]);
    }
    LensEstimate without = estimate;
    if (!minimise(without, others, prior, true, kSteps)) return false;
    if (!camera_defect(without.camera).empty()) return false;
    changes.emplace_back();
    changes.back() << estimate.world_from_camera.difference_to(without.world_from_camera),
        lens_of(without.camera) - lens_of(estimate.camera);
    mean += changes.back() / static_cast<double>(parts.size());
  }
  // Delete-a-group jackknife (Kott 2001): the sum of squares times (n - 1) / n. Eight parts show the variance poorly, so it
  // is that of Student's distribution with seven degrees of freedom.
  const double freedom = static_cast<double>(parts.size()) - 1.0;
  const double factor = freedom / (freedom + 1.0) * freedom / (freedom - 2.0);
  for (const auto& change : changes) {
    const Eigen::Matrix<double, kUnknowns, 1> off = std::sqrt(factor) * (change - mean);
    estimate.covariance += off.head<kLens>() * off.head<kLens>().transpose();
    estimate.lens_covariance += off.tail<kLensUnknowns>() * off.tail<kLensUnknowns>().transpose();
  }
  return true;
}

}  // namespace cairn::detail
