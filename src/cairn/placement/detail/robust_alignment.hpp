// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/scales.hpp"
#include "cairn/registration/concepts.hpp"
#include "cairn/registration/estimation/pose_covariance.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {

/// The robust objective of two centred clouds, and its minimisation: what refine() documents.
class RobustAlignment {
 public:
  struct Schedule {
    double coarse = 0.0;
    double fine = 0.0;
    /// Below `fine` a landmark of the target is matched once, with the nearest of the source, down to this
    /// scale. 0: the run ends at `fine`.
    double finest = 0.0;
    int max_iterations = 100;
    std::size_t points = static_cast<std::size_t>(-1);  ///< the first of the source that take part
    bool free_scale = false;  ///< the scale is estimated; else it stays as it is
  };

  struct Iteration {
    Similarity3 target_from_source;      ///< after the iteration's step
    double mean_squared_distance = 0.0;  ///< of its matches, before the step
    std::vector<Match> matches;
  };

  struct Run {
    Similarity3 target_from_source;
    int iterations = 0;  ///< steps made
    StopReason stop_reason = StopReason::kIterationLimit;
  };

  /// @param pair, target_tree must outlive this; the tree is of the target's positions
  RobustAlignment(const CentredPair& pair, const BatchTree& target_tree, bool use_covariances,
                  bool one_to_one, const Executor& executor);

  /// From a centred pose to the nearest optimum.
  /// @param observe called after each iteration; may be empty
  Run run(const Similarity3& initial, const Schedule& schedule, const std::stop_token& stop = {},
          const std::function<void(Iteration)>& observe = {}) const;

  std::vector<Match> matches(const Similarity3& pose) const;

  /// The objective, which is large where many landmarks meet.
  /// @param matches of the pose, from matches()
  double value(const Similarity3& pose, double scale, std::span<const Match> matches) const;

  /// Of a centred pose that is an optimum at this scale; nothing is known of one with few matches. A
  /// direction is open if, a little way along it, landmarks fit about as well as at the pose.
  /// @param matches of the pose, from matches()
  /// @param free_scale as in Schedule
  PoseUncertainty uncertainty(const Similarity3& pose, double scale, std::vector<Match> matches,
                              bool free_scale = false) const;

 private:
  // Of as many freedoms as a motion has: 6 of a rigid one, 7 with a scale.
  template <int kFreedoms>
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
  template <int kFreedoms>
  struct Equations {
    using Matrix = Eigen::Matrix<double, kFreedoms, kFreedoms>;
    using Vector = Eigen::Matrix<double, kFreedoms, 1>;

    Matrix information = Matrix::Zero();
    Vector gradient = Vector::Zero();
    double weight = 0.0;
    std::size_t count = 0;

    Equations& operator+=(const Equations& other);
  };

  std::vector<Match> find_matches(std::span<const Eigen::Vector3d> moved, BatchTree::Batch& queries,
                                  bool one_to_one) const;
  // Nothing for a match that hardly counts.
  std::optional<Term> term(const Eigen::Vector3d& moved, const Match& match,
                           const Eigen::Matrix3d& linear, double scale) const;
  template <int kFreedoms>
  Equations<kFreedoms> equations(std::span<const Eigen::Vector3d> moved,
                                 std::span<const Match> matches, const Similarity3& pose,
                                 double scale, const Arm& arm) const;
  template <int kFreedoms>
  Run run_with(const Similarity3& initial, const Schedule& schedule, const std::stop_token& stop,
               const std::function<void(Iteration)>& observe) const;
  template <int kFreedoms>
  PoseUncertainty uncertainty_with(const Similarity3& pose, double scale,
                                   std::vector<Match> matches) const;
  double radius(std::size_t points) const;

  const CentredPair& pair_;
  const BatchTree& target_tree_;
  bool use_covariances_;
  bool one_to_one_;
  Executor executor_;
};

}  // namespace cairn
