// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/odometry/marginal_covariance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/odometry/linearisation.hpp"

namespace cairn {
namespace {

using Block6 = Eigen::Matrix<double, 6, 6>;
using Block36 = Eigen::Matrix<double, 3, 6>;

// One landmark's part of the normal equations.
struct LandmarkBlocks {
  Eigen::Matrix3d inverse_information = Eigen::Matrix3d::Zero();
  std::vector<Block36> coupling;  // one an observation: with the pose that made it
  std::vector<Block6> poses;      // the same, of the pose with itself
};

LandmarkBlocks blocks_of(const LandmarkGraph& graph, const TrackedLandmark& landmark) {
  LandmarkBlocks blocks;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < landmark.observations.size(); ++i) {
    const LinearisedObservation at = linearise(graph, landmark.observations[i], landmark.position);
    const double share = information_share(i + 1);
    information += share * at.by_point.transpose() * at.by_point;
    blocks.coupling.emplace_back(share * at.by_point.transpose() * at.by_pose);
    blocks.poses.emplace_back(share * at.by_pose.transpose() * at.by_pose);
  }
  information += unknown_depth_information(graph, landmark);
  blocks.inverse_information = information.inverse();
  return blocks;
}

}  // namespace

MarginalCovariances marginal_covariances(const LandmarkGraph& graph) {
  const std::size_t count = graph.keyframes().size();
  if (count > kMostMarginalKeyframes) {
    throw Error(ErrorKind::kMisuse, "marginal covariances", fmt::format("{} keyframes", count),
                fmt::format("at most {}; cut the sequence into mini-maps", kMostMarginalKeyframes));
  }
  MarginalCovariances result;
  result.keyframes.assign(count, Matrix6d::Zero());
  result.landmarks.assign(graph.landmarks().size(), Eigen::Matrix3d::Zero());

  // The reduced system: landmarks eliminated, the first keyframe left out.
  const auto size = static_cast<Eigen::Index>(6 * (std::max<std::size_t>(count, 1) - 1));
  Eigen::MatrixXd reduced = Eigen::MatrixXd::Zero(size, size);
  const auto row_of = [](std::uint32_t keyframe) {
    return 6 * (static_cast<Eigen::Index>(keyframe) - 1);
  };
  std::vector<LandmarkBlocks> blocks(graph.landmarks().size());
  for (std::size_t l = 0; l < graph.landmarks().size(); ++l) {
    const TrackedLandmark& landmark = graph.landmarks()[l];
    if (landmark.gone()) continue;
    blocks[l] = blocks_of(graph, landmark);
    // One view with a depth of its own says nothing about where the view was from.
    if (landmark.observations.size() < 2) continue;
    for (std::size_t i = 0; i < landmark.observations.size(); ++i) {
      const std::uint32_t at = landmark.observations[i].keyframe;
      if (at == 0) continue;
      reduced.block<6, 6>(row_of(at), row_of(at)) += blocks[l].poses[i];
      const Eigen::Matrix<double, 6, 3> left =
          blocks[l].coupling[i].transpose() * blocks[l].inverse_information;
      for (std::size_t j = 0; j < landmark.observations.size(); ++j) {
        const std::uint32_t other = landmark.observations[j].keyframe;
        if (other == 0) continue;
        reduced.block<6, 6>(row_of(at), row_of(other)) -= left * blocks[l].coupling[j];
      }
    }
  }
  // A keyframe that nothing ties to the others is as good as unknown, not a reason to fail.
  reduced.diagonal().array() += 1e-6;
  const Eigen::MatrixXd covariance = reduced.ldlt().solve(Eigen::MatrixXd::Identity(size, size));

  for (std::uint32_t k = 1; k < count; ++k) {
    const Block6 block = covariance.block<6, 6>(row_of(k), row_of(k));
    result.keyframes[k] = 0.5 * (block + block.transpose());
  }
  for (std::size_t l = 0; l < graph.landmarks().size(); ++l) {
    const TrackedLandmark& landmark = graph.landmarks()[l];
    if (landmark.gone()) continue;
    // Derivative, by each pose, of where the landmark is relative to its first keyframe.
    std::vector<Block36> by_pose;
    for (std::size_t i = 0; i < landmark.observations.size(); ++i) {
      by_pose.emplace_back(-blocks[l].inverse_information * blocks[l].coupling[i]);
    }
    const std::uint32_t first = landmark.observations.front().keyframe;
    by_pose.front().leftCols<3>() -= Eigen::Matrix3d::Identity();
    by_pose.front().rightCols<3>() +=
        skew(landmark.position - graph.keyframes()[first].world_from_camera.translation());
    Eigen::Matrix3d sum = blocks[l].inverse_information;
    if (landmark.observations.size() >= 2) {
      for (std::size_t i = 0; i < by_pose.size(); ++i) {
        const std::uint32_t at = landmark.observations[i].keyframe;
        if (at == 0) continue;
        for (std::size_t j = 0; j < by_pose.size(); ++j) {
          const std::uint32_t other = landmark.observations[j].keyframe;
          if (other == 0) continue;
          sum += by_pose[i] * covariance.block<6, 6>(row_of(at), row_of(other)) *
                 by_pose[j].transpose();
        }
      }
    }
    result.landmarks[l] = excess_of_residuals(graph, landmark) * 0.5 * (sum + sum.transpose());
  }
  return result;
}

}  // namespace cairn
