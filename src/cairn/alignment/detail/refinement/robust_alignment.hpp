// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/stages.hpp"

namespace cairn::detail {

/// The robust objective of two centred clouds and its minimisation, as documented at refine().
class RobustAlignment {
 public:
  struct Schedule {
    double coarse = 0.0;
    double fine = 0.0;
    /// Last scale. From `fine` down to this scale, each target landmark is matched at most once, with the nearest
    /// source landmark. 0: the run ends at `fine`.
    double finest = 0.0;
    int max_iterations = 100;
    std::size_t points = static_cast<std::size_t>(-1);  ///< number of first source landmarks to use
    bool free_scale = false;  ///< whether to estimate the scale; otherwise it stays
  };

  struct Iteration {
    Similarity3 target_from_source;      ///< after the iteration's step
    double mean_squared_distance = 0.0;  ///< of `matches`, before the step
    std::vector<Match> matches;
  };

  struct Run {
    Similarity3 target_from_source;
    int iterations = 0;  ///< number of steps
    StopReason stop_reason = StopReason::kIterationLimit;
  };

  RobustAlignment(const PreparedCloud& source, const PreparedCloud& target, bool one_to_one,
                  const Executor& executor);

  /// Refines a centred pose to the nearest optimum.
  /// @param observe called after each iteration; may be empty
  Run run(const Similarity3& initial, const Schedule& schedule, const std::stop_token& stop = {},
          const std::function<void(Iteration)>& observe = {}) const;

  std::vector<Match> matches(const Similarity3& pose) const;

  /// Value of the objective, which increases with the number of matching landmarks.
  /// @param matches result of matches() for the pose
  double value(const Similarity3& pose, double scale, std::span<const Match> matches) const;

  /// Uncertainty of a centred pose that is an optimum for this scale; unknown with few matches. A direction is
  /// open if a small motion along it hardly changes the objective.
  /// @param matches    result of matches() for the pose
  /// @param free_scale as in Schedule
  /// @param known      whether the matches are right whatever landmark is nearest, e.g. from descriptors; they
  ///        then stay fixed as the pose moves
  PoseUncertainty uncertainty(const Similarity3& pose, double scale, std::vector<Match> matches,
                              bool free_scale = false, bool known = false) const;

 private:
  // kFreedoms: degrees of freedom of the motion, 6 for a rigid one, 7 with a scale.
  template <int kFreedoms>
  class Trial;

  // Pivot of a rotation, and the length that makes the rotation angle comparable to a translation.
  struct Arm {
    Eigen::Vector3d pivot;  // in the target frame
    double length = 1.0;
  };

  // Contribution of a match to the objective's derivatives.
  struct Term {
    Eigen::Matrix3d information;  // of its residual, at the kernel scale
    Eigen::Vector3d force;        // information times residual
    double weight = 0.0;
    double value = 0.0;  // contribution to the objective, which is maximised
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
  // std::nullopt for a match of negligible weight.
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
                                   std::vector<Match> matches, bool known) const;
  double radius(std::size_t points) const;

  PreparedCloud source_;
  PreparedCloud target_;
  bool one_to_one_;
  Executor executor_;
};

}  // namespace cairn::detail
