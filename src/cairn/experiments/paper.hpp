// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/experiments/published.hpp"
#include "cairn/experiments/run.hpp"

namespace cairn {

struct PaperOptions {
  IcpOptions
      align;  ///< the paper's by default; initial pose, k, executor and callbacks are ignored
  PointSetOptions points;
  /// A run with a lower score, m², is a success. std::nullopt: 1.078 times the score of base ICP without
  /// displacement, the ratio of the paper's 0.0037 to its own.
  std::optional<double> success_score;
  PoseTolerance tolerance;
  /// Also search for the displacement at which each XY quadrant fails, as in the paper.
  bool search_xy = false;
  double search_limit_m = 5.0;        ///< of |x| and |y|; positive
  double search_resolution_m = 0.01;  ///< positive
  Execution execution = {};

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// One quadrant's search. The paper took "0.25 m and 0.5 m, and then increased until at least one ICP
/// strategy stopped aligning successfully"; here in steps of 0.25 m, then by bisection between the last
/// two.
struct QuadrantSearch {
  int sign_x = 1;
  int sign_y = 1;
  std::vector<TrialResult> runs = {};  ///< all runs, four at each displacement
  /// Largest displacement below the first failure at which all succeeded; std::nullopt if there is none.
  std::optional<double> last_success_m = {};
  std::optional<double> first_failure_m = {};  ///< std::nullopt: none up to the limit
  std::vector<std::string> failed = {};        ///< strategies that failed there
};

struct PaperResults {
  std::vector<TrialResult> runs;  ///< 45 configurations x 4 strategies, in the published order
  bool has_truth = false;         ///< of the pair; without it no run has an error
  double success_score = 0.0;
  std::optional<Agreement> agreement;  ///< of the runs
  std::vector<QuadrantSearch> searches;

  bool score_success(const TrialResult& run) const {
    return run.score && *run.score < success_score;
  }
};

/// The paper's experiments on another pair of maps. Runs are spread over the executor's threads; the
/// results do not depend on their number. Each starts from initial_pose().
/// @throws Error (misuse); (input) if a map lacks a metric's input; (cancelled)
PaperResults run_paper_experiments(const MapPair& pair, const PaperOptions& options = {});

/// Initial target_from_source of a run: the true pose, or the pose as read if the truth is unknown, displaced as the
/// paper's maps were: turned about the target's origin, then moved.
Rigid3 initial_pose(const Displacement& displacement, const std::optional<Rigid3>& truth);

/// The run of one strategy under a published configuration.
const TrialResult& run_of(const PaperResults& results, std::size_t configuration,
                          std::size_t strategy);

}  // namespace cairn
