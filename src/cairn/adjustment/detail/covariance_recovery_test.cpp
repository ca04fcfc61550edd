// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/covariance_recovery.hpp"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/adjustment/detail/pose_derivative.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

Eigen::Vector3d random_vector(Random& random, double size) {
  const double x = random.uniform(-size, size);
  const double y = random.uniform(-size, size);
  return {x, y, random.uniform(-size, size)};
}

// Each landmark is seen by a run of frames, each residual rows of its own. `rows` 2: pixels only, of
// cameras that all look along z.
LinearProblem make_problem(std::size_t frames, std::size_t landmarks, bool with_depth) {
  Random random(11);
  LinearProblem problem;
  for (std::size_t i = 0; i < frames; ++i) {
    problem.camera_centres.emplace_back(0.2 * static_cast<double>(i), 0.1 * random.normal(),
                                        0.1 * random.normal());
  }
  for (std::size_t l = 0; l < landmarks; ++l) {
    const std::size_t first = random.index(frames - 2);
    LinearLandmark landmark;
    landmark.position =
        problem.camera_centres[first] + Eigen::Vector3d(0, 0, 3) + random_vector(random, 1.0);
    for (std::size_t k = first; k < std::min(frames, first + 2 + random.index(4)); ++k) {
      LinearObservation at;
      at.frame = static_cast<std::uint32_t>(k);
      at.share = 1.0 / (1.0 + 0.2 * static_cast<double>(k - first));
      const Eigen::Vector3d arm = landmark.position - problem.camera_centres[k];
      const double focal = 500.0 / arm.z();
      at.by_point << focal, 0.0, -focal * arm.x() / arm.z(), 0.0, focal, -focal * arm.y() / arm.z(),
          0.0, 0.0, with_depth ? 50.0 : 0.0;
      at.by_pose = derivative_by_pose(at.by_point, arm);
      landmark.observations.push_back(at);
    }
    problem.landmarks.push_back(landmark);
  }
  problem.least_information.setConstant(1e-9);
  return problem;
}

// Inverse of the full normal equations of poses (but the first) and landmarks.
Eigen::MatrixXd full_covariance(const LinearProblem& problem) {
  const auto poses = 6 * (static_cast<Eigen::Index>(problem.camera_centres.size()) - 1);
  const Eigen::Index size = poses + 3 * static_cast<Eigen::Index>(problem.landmarks.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t l = 0; l < problem.landmarks.size(); ++l) {
    for (const LinearObservation& at : problem.landmarks[l].observations) {
      Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, size);
      if (at.frame > 0) {
        jacobian.middleCols<6>(6 * (static_cast<Eigen::Index>(at.frame) - 1)) = at.by_pose;
      }
      jacobian.middleCols<3>(poses + 3 * static_cast<Eigen::Index>(l)) = at.by_point;
      information += at.share * jacobian.transpose() * jacobian;
    }
    const Eigen::Index row = poses + 3 * static_cast<Eigen::Index>(l);
    information.block<3, 3>(row, row) += problem.landmarks[l].prior;
  }
  information.diagonal().head(poses).array() += 1e-9;
  return information.inverse();
}

double relative_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).norm() / b.norm();
}

TEST(RecoverCovariances, AreBlocksOfTheInverseOfTheNormalEquations) {
  LinearProblem problem = make_problem(6, 60, true);
  for (std::size_t l = 0; l < problem.landmarks.size(); l += 3) {
    problem.landmarks[l].prior = Eigen::Vector3d(1e3, 1e4, 1e5).asDiagonal();
  }
  const Eigen::MatrixXd full = full_covariance(problem);
  for (const std::size_t most_dense : {kMostDenseFrames, std::size_t{0}}) {
    const RecoveredCovariances recovered =
        recover_covariances(problem, CovarianceGauge::kFirstFrame, {}, most_dense);
    EXPECT_EQ(recovered.frames[0], Matrix6d(Matrix6d::Zero()));
    for (Eigen::Index k = 1; k < 6; ++k) {
      EXPECT_LT(relative_difference(recovered.frames[static_cast<std::size_t>(k)],
                                    full.block(6 * (k - 1), 6 * (k - 1), 6, 6)),
                1e-6);
    }
    for (std::size_t l = 0; l < problem.landmarks.size(); ++l) {
      const Eigen::Index row = 30 + 3 * static_cast<Eigen::Index>(l);
      EXPECT_LT(relative_difference(recovered.landmarks[l], full.block(row, row, 3, 3)), 1e-6);
    }
  }
}

TEST(RecoverCovariances, SparseFactorsGiveWhatDenseOnesDo) {
  LinearProblem problem = make_problem(60, 900, true);
  for (const CovarianceGauge gauge :
       {CovarianceGauge::kFirstFrame, CovarianceGauge::kFirstObserver}) {
    const auto dense = recover_covariances(problem, gauge);
    const auto sparse = recover_covariances(problem, gauge, {}, 0);
    for (std::size_t l = 0; l < problem.landmarks.size(); ++l) {
      ASSERT_LT(relative_difference(sparse.landmarks[l], dense.landmarks[l]), 1e-6);
    }
    for (std::size_t k = 1; k < 60; ++k) {
      ASSERT_LT(relative_difference(sparse.frames[k], dense.frames[k]), 1e-6);
    }
  }
}

// Not certain, which a missing block would mean.
TEST(RecoverCovariances, AFrameThatSharesNoLandmarkIsUndetermined) {
  LinearProblem problem = make_problem(6, 60, true);
  problem.camera_centres.emplace_back(2.0, 0.0, 0.0);
  for (const std::size_t most_dense : {kMostDenseFrames, std::size_t{0}}) {
    const auto recovered =
        recover_covariances(problem, CovarianceGauge::kFirstFrame, {}, most_dense);
    const Eigen::Matrix<double, 6, 6> alone = recovered.frames.back();
    EXPECT_LT(relative_difference(alone, 1e9 * Eigen::MatrixXd::Identity(6, 6)), 1e-6);
  }
}

TEST(RecoverCovariances, TheHeldScaleHasNoUncertainty) {
  LinearProblem problem = make_problem(6, 60, false);
  problem.scale_frame = 5;
  const auto recovered = recover_covariances(problem, CovarianceGauge::kFirstFrame);
  const Eigen::Vector3d away = (problem.camera_centres[5] - problem.camera_centres[0]).normalized();
  const Matrix6d& covariance = recovered.frames[5];
  const double along = away.dot(covariance.topLeftCorner<3, 3>() * away);
  EXPECT_LT(along, 1e-3 * Eigen::Matrix3d(covariance.topLeftCorner(3, 3)).trace());
  for (const Eigen::Matrix3d& landmark : recovered.landmarks) {
    EXPECT_LT(landmark.trace(), 1.0);  // else the free scale's: about 1 / least_information
  }
}

TEST(RecoverCovariances, DoNotDependOnTheNumberOfThreads) {
  const LinearProblem problem = make_problem(30, 400, true);
  for (const std::size_t most_dense : {kMostDenseFrames, std::size_t{0}}) {
    const auto one = recover_covariances(problem, CovarianceGauge::kFirstFrame,
                                         {Executor(1), {}, {}}, most_dense);
    const auto more = recover_covariances(problem, CovarianceGauge::kFirstFrame,
                                          {Executor(0), {}, {}}, most_dense);
    EXPECT_EQ(one.landmarks, more.landmarks);
    EXPECT_EQ(one.frames, more.frames);
  }
}

}  // namespace
}  // namespace cairn::detail
