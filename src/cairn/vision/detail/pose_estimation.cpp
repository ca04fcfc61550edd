// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/pose_estimation.hpp"

#include <algorithm>
#include <array>
#include <map>

#include <Eigen/Geometry>

#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn::detail {
namespace {

using Rows3x6 = Eigen::Matrix<double, 3, 6>;

struct NormalEquations {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
};

// Weights of a residual's three rows.
Eigen::Vector3d weights_of(const PointResidual& residual, bool robust) {
  const double pixel = robust ? huber_weight(residual.squared_pixel(), kPixel95) : 1.0;
  // Truncated, because a grossly wrong depth is more frequent than a wrong match.
  const double depth = residual.squared_depth() > kDepth99 ? 0.0 : 1.0;
  return {pixel, pixel, depth};
}

// Calls visit(place, residual, by_pose) for each used match in front of its camera.
template <class Visit>
void for_each_residual(std::span<const BodyCamera> cameras, const std::vector<bool>& use,
                       const Rigid3& world_from_body, const Visit& visit) {
  const Eigen::Matrix3d body_from_world = world_from_body.rotation().transpose();
  std::size_t i = 0;
  for (const BodyCamera& camera : cameras) {
    const Eigen::Matrix3d camera_from_world = camera.camera_from_body.rotation() * body_from_world;
    for (const PointMatch& match : camera.matches) {
      const std::size_t place = i++;
      if (!use[place]) continue;
      const Eigen::Vector3d arm = match.x_in_world - world_from_body.translation();
      const Eigen::Vector3d x_in_camera =
          camera_from_world * arm + camera.camera_from_body.translation();
      if (x_in_camera.z() < kNearestDepth) continue;
      const PointResidual residual = point_residual(camera.pinhole, match.measured, x_in_camera);
      const Eigen::Matrix3d by_x = residual.by_x_in_camera * camera_from_world;
      visit(place, residual, Rows3x6(derivative_by_pose(by_x, arm)));
    }
  }
}

NormalEquations accumulate(std::span<const BodyCamera> cameras, const std::vector<bool>& use,
                           const Rigid3& world_from_body, bool robust) {
  NormalEquations sum;
  for_each_residual(cameras, use, world_from_body,
                    [&](std::size_t, const PointResidual& residual, const Rows3x6& by_pose) {
                      const Rows3x6 weighted = weights_of(residual, robust).asDiagonal() * by_pose;
                      sum.information += by_pose.transpose() * weighted;
                      sum.gradient += weighted.transpose() * residual.value;
                    });
  return sum;
}

// @param first place of the first match among the inliers
std::size_t classify(const Pinhole& pinhole, std::span<const PointMatch> matches,
                     const Rigid3& world_from_camera, std::vector<bool>& inliers,
                     std::size_t first = 0) {
  const Rigid3 camera_from_world = world_from_camera.inverse();
  std::size_t count = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector3d x_in_camera = camera_from_world * matches[i].x_in_world;
    const bool is_inlier =
        x_in_camera.z() >= kNearestDepth &&
        point_residual(pinhole, matches[i].measured, x_in_camera).squared_pixel() <= kPixel99;
    inliers[first + i] = is_inlier;
    count += is_inlier ? 1 : 0;
  }
  return count;
}

// Moves three points onto three others: rotation between the triangles' own frames.
std::optional<Rigid3> triangle_pose(const std::array<Eigen::Vector3d, 3>& world,
                                    const std::array<Eigen::Vector3d, 3>& camera) {
  const auto frame = [](const std::array<Eigen::Vector3d, 3>& p) -> std::optional<Eigen::Matrix3d> {
    const Eigen::Vector3d a = p[1] - p[0];
    const Eigen::Vector3d normal = a.cross(p[2] - p[0]);
    constexpr double kSmallest = 1e-4;  // m²: too small or too flat a triangle
    if (normal.norm() < kSmallest) return std::nullopt;
    Eigen::Matrix3d axes;
    axes.col(0) = a.normalized();
    axes.col(2) = normal.normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return axes;
  };
  const auto world_axes = frame(world);
  const auto camera_axes = frame(camera);
  if (!world_axes || !camera_axes) return std::nullopt;
  const Eigen::Matrix3d rotation = *world_axes * camera_axes->transpose();
  const Eigen::Vector3d world_centre = (world[0] + world[1] + world[2]) / 3.0;
  const Eigen::Vector3d camera_centre = (camera[0] + camera[1] + camera[2]) / 3.0;
  return Rigid3(rotation, world_centre - rotation * camera_centre);
}

}  // namespace

PoseEstimate refine_pose(const Pinhole& pinhole, std::span<const PointMatch> matches,
                         const Rigid3& world_from_camera) {
  const BodyCamera alone{pinhole, Rigid3(), matches};
  return refine_pose({&alone, 1}, world_from_camera);
}

PoseEstimate refine_pose(std::span<const BodyCamera> cameras, const Rigid3& world_from_body) {
  constexpr int kRounds = 4;
  constexpr int kSteps = 8;
  std::size_t count = 0;
  for (const BodyCamera& camera : cameras) count += camera.matches.size();
  PoseEstimate estimate;
  estimate.world_from_camera = world_from_body;
  estimate.inliers.assign(count, true);
  for (int round = 0; round < kRounds; ++round) {
    for (int step = 0; step < kSteps; ++step) {
      // The last round is plain least squares of those that fit.
      const NormalEquations sum =
          accumulate(cameras, estimate.inliers, estimate.world_from_camera, round + 1 < kRounds);
      const auto solution = solve_positive_definite<6>(sum.information, sum.gradient);
      if (!solution || !solution->allFinite()) break;
      const Vector6d delta = -*solution;
      estimate.world_from_camera = estimate.world_from_camera.perturbed(delta);
      constexpr double kSettled = 1e-7;  // metres, radians
      if (delta.norm() < kSettled) break;
    }
    estimate.inlier_count = 0;
    std::size_t first = 0;
    for (const BodyCamera& camera : cameras) {
      estimate.inlier_count += classify(
          camera.pinhole, camera.matches,
          estimate.world_from_camera * camera.camera_from_body.inverse(), estimate.inliers, first);
      first += camera.matches.size();
    }
  }
  const NormalEquations sum =
      accumulate(cameras, estimate.inliers, estimate.world_from_camera, false);
  if (const auto covariance = inverse_of_positive_definite(sum.information)) {
    estimate.covariance = *covariance;
  } else {
    estimate.inlier_count = 0;  // the pose is undetermined
    estimate.inliers.assign(count, false);
  }
  return estimate;
}

std::optional<Matrix6d> growth_without_landmarks(std::span<const BodyCamera> cameras,
                                                 std::span<const std::uint32_t> landmarks,
                                                 const Rigid3& world_from_body, std::size_t count) {
  std::map<std::uint32_t, Matrix6d> by_landmark;  // parts of the information
  Matrix6d information = Matrix6d::Zero();
  const std::vector<bool> all_matches(landmarks.size(), true);
  for_each_residual(cameras, all_matches, world_from_body,
                    [&](std::size_t i, const PointResidual& residual, const Rows3x6& by_pose) {
                      const Matrix6d part =
                          by_pose.transpose() * weights_of(residual, false).asDiagonal() * by_pose;
                      information += part;
                      by_landmark.try_emplace(landmarks[i], Matrix6d::Zero()).first->second += part;
                    });
  std::vector<Matrix6d> parts;
  for (const auto& [landmark, part] : by_landmark) parts.push_back(part);
  const auto all = inverse_of_positive_definite(information);
  if (!all) return std::nullopt;
  Matrix6d covariance = *all;
  for (count = std::min(count, parts.size()); count > 0; --count) {
    double largest = -1.0;
    auto chosen = parts.begin();
    for (auto part = parts.begin(); part != parts.end(); ++part) {
      const auto without = inverse_of_positive_definite(Matrix6d(information - *part));
      if (!without) return std::nullopt;
      const double variance = without->topLeftCorner<3, 3>().trace();
      if (variance <= largest) continue;
      largest = variance;
      chosen = part;
      covariance = *without;
    }
    information -= *chosen;
    parts.erase(chosen);
  }
  return covariance - *all;
}

RowMotion refined_row_motion(const Pinhole& pinhole, std::span<const PointMatch> matches,
                             std::span<const double> rows, const RowMotionPrior& prior,
                             const Rigid3& world_from_camera) {
  using Matrix12d = Eigen::Matrix<double, 12, 12>;
  using Vector12d = Eigen::Matrix<double, 12, 1>;
  Rigid3 pose = world_from_camera;
  RowMotion change = prior.motion;
  change.velocity_m_s.setZero();
  change.turn_rad_s.setZero();
  Vector6d weights;
  weights << Eigen::Vector3d::Constant(1.0 / (prior.sigma_m_s * prior.sigma_m_s)),
      Eigen::Vector3d::Constant(1.0 / (prior.sigma_rad_s * prior.sigma_rad_s));
  constexpr int kSteps = 4;
  for (int step = 0; step < kSteps; ++step) {
    Vector6d changed;
    changed << change.velocity_m_s, change.turn_rad_s;
    Matrix12d information = Matrix12d::Zero();
    Vector12d gradient = Vector12d::Zero();
    information.diagonal().tail<6>() = weights;
    gradient.tail<6>() = weights.cwiseProduct(changed);
    const Eigen::Matrix3d world_axes = pose.rotation();
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector3d arm = matches[i].x_in_world - pose.translation();
      const Eigen::Vector3d x_in_camera = change.at_row(world_axes.transpose() * arm, rows[i]);
      if (x_in_camera.z() < kNearestDepth) continue;
      const PointResidual residual = point_residual(pinhole, matches[i].measured, x_in_camera);
      Eigen::Matrix<double, 3, 12> by_both;
      by_both.leftCols<6>() =
          derivative_by_pose(residual.by_x_in_camera * world_axes.transpose(), arm);
      const double time = change.time_of_row(rows[i]);
      by_both.middleCols<3>(6) = time * by_both.leftCols<3>() * world_axes;
      by_both.rightCols<3>() = time * by_both.middleCols<3>(3) * world_axes;
      const Eigen::Matrix<double, 3, 12> weighted =
          weights_of(residual, true).asDiagonal() * by_both;
      information += by_both.transpose() * weighted;
      gradient += weighted.transpose() * residual.value;
    }
    const auto solution = solve_positive_definite<12>(information, gradient);
    if (!solution || !solution->allFinite()) break;
    const Vector12d delta = -*solution;
    pose = pose.perturbed(delta.head<6>());
    change.velocity_m_s += delta.segment<3>(6);
    change.turn_rad_s += delta.tail<3>();
  }
  RowMotion refined = prior.motion;
  refined.velocity_m_s += change.velocity_m_s;
  refined.turn_rad_s += change.turn_rad_s;
  return refined;
}

std::optional<PoseEstimate> find_pose(const Pinhole& pinhole, std::span<const PointMatch> matches,
                                      std::size_t least_inliers, std::uint64_t seed) {
  std::vector<std::size_t> with_depth;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i].measured.has_depth()) with_depth.push_back(i);
  }
  if (with_depth.size() < std::max<std::size_t>(3, least_inliers)) return std::nullopt;
  Random random(seed);
  constexpr int kTrials = 300;
  std::optional<Rigid3> best;
  std::size_t best_count = 0;
  std::vector<bool> inliers(matches.size());
  // A wide tolerance at first, because the accuracy of a pose from three points is limited by their depths.
  std::vector<PointMatch> loose(matches.begin(), matches.end());
  constexpr double kLoose = 3.0;
  for (PointMatch& match : loose) match.measured.sigma_pixel *= kLoose;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::array<Eigen::Vector3d, 3> world;
    std::array<Eigen::Vector3d, 3> camera;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const PointMatch& match = matches[with_depth[random.index(with_depth.size())]];
      world[corner] = match.x_in_world;
      camera[corner] = pinhole.back_project(match.measured.pixel, match.measured.depth_m);
    }
    const auto pose = triangle_pose(world, camera);
    if (!pose) continue;
    const std::size_t count = classify(pinhole, loose, *pose, inliers);
    if (count > best_count) {
      best_count = count;
      best = pose;
    }
  }
  if (!best || best_count < least_inliers) return std::nullopt;
  // Repeats with the inliers only, so that wrong matches have no influence.
  classify(pinhole, loose, *best, inliers);
  std::vector<PointMatch> agreeing;
  for (std::size_t i = 0; i < loose.size(); ++i) {
    if (inliers[i]) agreeing.push_back(loose[i]);
  }
  const PoseEstimate coarse = refine_pose(pinhole, agreeing, *best);
  // Then with their own noise, on which the covariance is based.
  for (PointMatch& match : agreeing) match.measured.sigma_pixel /= kLoose;
  const PoseEstimate sharp = refine_pose(pinhole, agreeing, coarse.world_from_camera);
  PoseEstimate fine;
  fine.inliers.assign(matches.size(), false);
  fine.inlier_count = classify(pinhole, matches, sharp.world_from_camera, fine.inliers);
  if (fine.inlier_count < least_inliers) return std::nullopt;
  fine.world_from_camera = sharp.world_from_camera;
  fine.covariance = sharp.covariance;
  return fine;
}

}  // namespace cairn::detail
