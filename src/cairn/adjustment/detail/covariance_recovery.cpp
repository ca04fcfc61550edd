// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/detail/covariance_recovery.hpp"

#include <algorithm>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

using Block6 = Eigen::Matrix<double, 6, 6>;
using Block36 = Eigen::Matrix<double, 3, 6>;

// One landmark's part of the normal equations.
struct LandmarkBlocks {
  Eigen::Matrix3d inverse_information = Eigen::Matrix3d::Zero();
  std::vector<Block36> coupling;  // one per observation: with its frame's pose
  std::vector<Block6> poses;      // the same, of the pose with itself
};

LandmarkBlocks blocks_of(const LinearLandmark& landmark) {
  LandmarkBlocks blocks;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const LinearObservation& at : landmark.observations) {
    information += at.share * at.by_point.transpose() * at.by_point;
    blocks.coupling.emplace_back(at.share * at.by_point.transpose() * at.by_pose);
    blocks.poses.emplace_back(at.share * at.by_pose.transpose() * at.by_pose);
  }
  information += landmark.prior;
  blocks.inverse_information = information.inverse();
  return blocks;
}

void check_stop(const Execution& execution) {
  if (!execution.stop.stop_requested()) return;
  throw Error(ErrorKind::kCancelled, "covariances", "were cancelled", "");
}

// Pairs (frame, frame) that a landmark couples, without frame 0, lower one second.
template <class Visit>
void visit_couplings(const LinearProblem& problem, const Execution& execution, const Visit& visit) {
  for (const LinearLandmark& landmark : problem.landmarks) {
    // A single view with depth does not constrain the view's pose.
    if (landmark.observations.size() < 2) continue;
    check_stop(execution);
    const LandmarkBlocks blocks = blocks_of(landmark);
    for (std::size_t i = 0; i < landmark.observations.size(); ++i) {
      const std::uint32_t at = landmark.observations[i].frame;
      if (at == 0) continue;
      visit(at, at, blocks.poses[i]);
      const Eigen::Matrix<double, 6, 3> left =
          blocks.coupling[i].transpose() * blocks.inverse_information;
      for (std::size_t j = 0; j < landmark.observations.size(); ++j) {
        const std::uint32_t other = landmark.observations[j].frame;
        if (other == 0) continue;
        visit(at, other, Block6(-left * blocks.coupling[j]));
      }
    }
  }
}

// Information that fixes the scale frame's distance: large enough to fix it, small enough for numerical
// stability.
Block6 scale_information(const LinearProblem& problem, const Block6& diagonal) {
  Block6 information = Block6::Zero();
  const Eigen::Vector3d away =
      (problem.camera_centres[*problem.scale_frame] - problem.camera_centres[0]).normalized();
  constexpr double kHeld = 1e4;
  information.topLeftCorner<3, 3>() =
      kHeld * diagonal.topLeftCorner<3, 3>().trace() * away * away.transpose();
  return information;
}

Eigen::Index row_of(std::uint32_t frame) {
  return 6 * (static_cast<Eigen::Index>(frame) - 1);
}

// Covariances of pairs of poses, without frame 0.
class DensePoses {
 public:
  DensePoses(const LinearProblem& problem, const Execution& execution) {
    const std::size_t count = problem.camera_centres.size();
    const auto size = static_cast<Eigen::Index>(6 * (std::max<std::size_t>(count, 1) - 1));
    Eigen::MatrixXd reduced = Eigen::MatrixXd::Zero(size, size);
    visit_couplings(problem, execution,
                    [&](std::uint32_t at, std::uint32_t other, const Block6& block) {
                      reduced.block<6, 6>(row_of(at), row_of(other)) += block;
                    });
    if (problem.scale_frame) {
      auto own = reduced.block<6, 6>(row_of(*problem.scale_frame), row_of(*problem.scale_frame));
      own += scale_information(problem, own);
    }
    reduced.diagonal() += problem.least_information.replicate(size / 6, 1);
    covariance_ = reduced.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
  }

  Block6 operator()(std::uint32_t a, std::uint32_t b) const {
    return covariance_.block<6, 6>(row_of(a), row_of(b));
  }

 private:
  Eigen::MatrixXd covariance_;
};

// Refuses more pairs of frames than fit the memory, before it is taken.
void check_pairs(const LinearProblem& problem, const Execution& execution) {
  constexpr std::size_t kMostPairs = 2'000'000;  // about 350 bytes each
  const std::size_t frames = problem.camera_centres.size();
  std::vector<std::vector<std::uint32_t>> observed(frames);  // landmarks by frame
  for (std::uint32_t l = 0; l < problem.landmarks.size(); ++l) {
    for (const LinearObservation& at : problem.landmarks[l].observations) {
      observed[at.frame].push_back(l);
    }
  }
  std::size_t pairs = 0;
  std::vector<std::uint32_t> counted_for(frames, 0);
  for (std::uint32_t frame = 1; frame < frames; ++frame) {
    check_stop(execution);
    counted_for[frame] = frame;
    for (const std::uint32_t l : observed[frame]) {
      for (const LinearObservation& at : problem.landmarks[l].observations) {
        if (at.frame == 0 || counted_for[at.frame] == frame) continue;
        counted_for[at.frame] = frame;
        ++pairs;
      }
    }
    if (pairs > kMostPairs) {
      throw Error(ErrorKind::kInput, "covariances",
                  fmt::format("more than {} pairs of frames share landmarks", kMostPairs),
                  "a map whose frames share landmarks with fewer others");
    }
  }
}

// The same of those pairs only that a landmark couples.
class SparsePoses {
 public:
  SparsePoses(const LinearProblem& problem, const Execution& execution)
      : rows_(problem.camera_centres.size()) {
    check_pairs(problem, execution);
    for (std::uint32_t at = 1; at < rows_.size(); ++at) rows_[at].emplace(at, Block6::Zero());
    visit_couplings(problem, execution,
                    [&](std::uint32_t at, std::uint32_t other, const Block6& block) {
                      const auto [found, added] = rows_[at].try_emplace(other, block);
                      if (!added) found->second += block;
                    });
    if (problem.scale_frame) {
      Block6& own = rows_[*problem.scale_frame].at(*problem.scale_frame);
      own += scale_information(problem, own);
    }
    const auto size = static_cast<Eigen::Index>(6 * (rows_.size() - 1));
    Eigen::SparseMatrix<double> reduced(size, size);
    {
      std::vector<Eigen::Triplet<double>> entries;
      for (std::uint32_t at = 1; at < rows_.size(); ++at) {
        for (const auto& [other, block] : rows_[at]) {
          if (other > at) break;  // the lower triangle is enough
          for (int i = 0; i < 6; ++i) {
            for (int j = 0; j < 6; ++j) {
              entries.emplace_back(row_of(at) + i, row_of(other) + j, block(i, j));
            }
          }
        }
      }
      for (Eigen::Index i = 0; i < size; ++i) {
        entries.emplace_back(i, i, problem.least_information[i % 6]);
      }
      reduced.setFromTriplets(entries.begin(), entries.end());
    }
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(reduced);
    execution.executor.for_blocks(rows_.size() - 1, 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin + 1; i < end + 1; ++i) {
        check_stop(execution);
        const auto other = static_cast<std::uint32_t>(i);
        Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(size, 6);
        unit.middleRows<6>(row_of(other)).setIdentity();
        const Eigen::MatrixXd columns = factor.solve(unit);
        // Row `other` holds the transposed blocks of column `other`; no other thread writes there.
        for (auto& [at, block] : rows_[other]) {
          block = columns.middleRows<6>(row_of(at)).transpose();
        }
      }
    });
  }

  Block6 operator()(std::uint32_t a, std::uint32_t b) const {
    const auto found = rows_[a].find(b);
    // A frame that shares no landmark with another is practically undetermined.
    return found == rows_[a].end() ? Block6::Zero() : found->second;
  }

 private:
  std::vector<std::map<std::uint32_t, Block6>> rows_;
};

template <class Poses>
Eigen::Matrix3d landmark_covariance(const LinearProblem& problem, const LinearLandmark& landmark,
                                    CovarianceGauge gauge, const Poses& poses) {
  const LandmarkBlocks blocks = blocks_of(landmark);
  Eigen::Matrix3d sum = blocks.inverse_information;
  if (gauge == CovarianceGauge::kFirstObserver && landmark.observations.size() < 2) return sum;
  // Derivative, by each pose, of where the landmark is.
  std::vector<Block36> by_pose;
  for (const Block36& coupling : blocks.coupling) {
    by_pose.emplace_back(-blocks.inverse_information * coupling);
  }
  if (gauge == CovarianceGauge::kFirstObserver) {
    const std::uint32_t first = landmark.observations.front().frame;
    by_pose.front().leftCols<3>() -= Eigen::Matrix3d::Identity();
    by_pose.front().rightCols<3>() += skew(landmark.position - problem.camera_centres[first]);
  }
  for (std::size_t i = 0; i < by_pose.size(); ++i) {
    const std::uint32_t at = landmark.observations[i].frame;
    if (at == 0) continue;
    for (std::size_t j = 0; j < by_pose.size(); ++j) {
      const std::uint32_t other = landmark.observations[j].frame;
      if (other == 0) continue;
      sum += by_pose[i] * poses(at, other) * by_pose[j].transpose();
    }
  }
  return sum;
}

template <class Poses>
RecoveredCovariances recover(const LinearProblem& problem, CovarianceGauge gauge,
                             const Execution& execution, const Poses& poses) {
  RecoveredCovariances result;
  result.frames.assign(problem.camera_centres.size(), Matrix6d::Zero());
  result.landmarks.assign(problem.landmarks.size(), Eigen::Matrix3d::Zero());
  for (std::uint32_t k = 1; k < problem.camera_centres.size(); ++k) {
    const Block6 block = poses(k, k);
    result.frames[k] = 0.5 * (block + block.transpose());
  }
  constexpr std::size_t kBlock = 64;
  execution.executor.for_blocks(
      problem.landmarks.size(), kBlock, [&](std::size_t begin, std::size_t end) {
        check_stop(execution);
        for (std::size_t l = begin; l < end; ++l) {
          const LinearLandmark& landmark = problem.landmarks[l];
          if (landmark.observations.empty()) continue;
          const Eigen::Matrix3d sum = landmark_covariance(problem, landmark, gauge, poses);
          result.landmarks[l] = 0.5 * (sum + sum.transpose());
        }
      });
  return result;
}

}  // namespace

RecoveredCovariances recover_covariances(const LinearProblem& problem, CovarianceGauge gauge,
                                         const Execution& execution, std::size_t most_dense) {
  return problem.camera_centres.size() <= most_dense
             ? recover(problem, gauge, execution, DensePoses(problem, execution))
             : recover(problem, gauge, execution, SparsePoses(problem, execution));
}

}  // namespace cairn::detail
