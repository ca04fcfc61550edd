// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/scales.hpp"
#include "cairn/registration/concepts.hpp"
#include "cairn/registration/estimation/pose_covariance.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// The robust objective of two centred clouds, and its minimisation: what refine() documents.
class RobustAlignment {
 public:
  struct Schedule {
    double coarse = 0.0;
    double fine = 0.0;
    int max_iterations = 100;
    std::size_t points = static_cast<std::size_t>(-1);  ///< the first of the source that take part
  };

  /// @param pair, target_tree must outlive this; the tree is of the target's positions
  RobustAlignment(const CentredPair& pair, const BatchTree& target_tree, bool use_covariances,
                  bool one_to_one, const Executor& executor);

  /// From a centred pose to the nearest optimum.
  /// @param observe called after each iteration; may be empty
  IcpRun run(const Rigid3& initial, const Schedule& schedule, const std::stop_token& stop = {},
             const std::function<void(Iteration)>& observe = {}) const;

  std::vector<Match> matches(const Rigid3& pose) const;

  /// Of a centred pose that is an optimum at this scale; nothing is known of one with few matches. A
  /// direction is open if, a little way along it, landmarks fit about as well as at the pose.
  /// @param matches of the pose, from matches()
  PoseUncertainty uncertainty(const Rigid3& pose, double scale, std::vector<Match> matches) const;

 private:
  class Trial;

  // What a turn is about, and the length that makes its angle comparable to a translation.
  struct Arm {
    Eigen::Vector3d pivot;  // in the target frame
    double length = 1.0;
  };

  // What a match adds to the objective's derivatives.
  struct Term {
    Eigen::Matrix3d information;  // of its residual, under the kernel's scale
    Eigen::Vector3d force;        // information times residual
    double weight = 0.0;
    double value = 0.0;  // of the objective, which is to be large
  };

  // Normal equations of a step.
  struct Equations {
    Matrix6d information = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    double weight = 0.0;
    std::size_t count = 0;

    Equations& operator+=(const Equations& other);
  };

  std::vector<Match> find_matches(std::span<const Eigen::Vector3d> moved,
                                  BatchTree::Batch& queries) const;
  // Nothing for a match that hardly counts.
  std::optional<Term> term(const Eigen::Vector3d& moved, const Match& match,
                           const Eigen::Matrix3d& rotation, double scale) const;
  Equations equations(std::span<const Eigen::Vector3d> moved, std::span<const Match> matches,
                      const Rigid3& pose, double scale, const Arm& arm) const;
  double radius(std::size_t points) const;

  const CentredPair& pair_;
  const BatchTree& target_tree_;
  bool use_covariances_;
  bool one_to_one_;
  Executor executor_;
};

}  // namespace cairn
