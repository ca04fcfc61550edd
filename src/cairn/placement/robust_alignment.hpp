// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
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

  /// Of a centred pose that is an optimum at this scale.
  PoseUncertainty uncertainty(const Rigid3& pose, double scale) const;

 private:
  // Normal equations of a step, about the moved source's centre.
  struct Equations {
    Matrix6d information = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    double weight = 0.0;
    std::size_t count = 0;
    Matrix6d scatter = Matrix6d::Zero();    // for the uncertainty, as is
    Matrix6d curvature = Matrix6d::Zero();  // the objective's second derivative

    Equations& operator+=(const Equations& other);
  };

  std::vector<Match> find_matches(std::span<const Eigen::Vector3d> moved,
                                  BatchTree::Batch& queries) const;
  Equations equations(std::span<const Eigen::Vector3d> moved, std::span<const Match> matches,
                      const Rigid3& pose, double scale, double length, bool for_uncertainty) const;
  void add(const Eigen::Vector3d& moved, const Match& match, const Eigen::Matrix3d& rotation,
           const Eigen::Vector3d& pivot, double scale, double length, bool for_uncertainty,
           Equations& sum) const;
  double radius(std::size_t points) const;

  const CentredPair& pair_;
  const BatchTree& target_tree_;
  bool use_covariances_;
  bool one_to_one_;
  Executor executor_;
};

}  // namespace cairn
