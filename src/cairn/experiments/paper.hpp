// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/experiments/run.hpp"

/// The paper's experiments: published results, and runs on another pair of maps.
namespace cairn {

/// The paper's four experiments (section 4).
enum class Experiment {
  kNeighbors,  ///< 4.1, Table 1: the number of candidates k
  kYaw,        ///< 4.2, Figure 3
  kXy,         ///< 4.3, Figure 4: by quadrants
  kXyYaw,      ///< 4.4, Figure 5
};

inline constexpr std::array kExperiments = {Experiment::kNeighbors, Experiment::kYaw,
                                            Experiment::kXy, Experiment::kXyYaw};

/// "k", "yaw", "xy", "xy_yaw".
std::string_view experiment_name(Experiment experiment);

/// The paper's strategies, in its order: base ICP and the three confidences.
inline constexpr std::array<std::string_view, 4> kPaperStrategies = {"base", "covariance",
                                                                     "observations", "distance"};

/// The paper's success threshold, m², valid for its pair of maps only: "In all cases where the
/// alignment is satisfactory, the score is below 0.0037 for this map pair".
inline constexpr double kPublishedSuccessScore = 0.0037;

struct PublishedOutcome {
  double score;  ///< m²
  int iterations;
  double duration_s;  ///< of unoptimised PCL code that computed the score at each iteration
};

/// One configuration, and its results in the paper's supplement.
struct PublishedExperiment {
  Experiment experiment;
  std::size_t k;
  Displacement initial;
  double initial_score;                      ///< m²
  std::array<PublishedOutcome, 4> outcomes;  ///< in the order of kPaperStrategies
};

/// All 45 configurations, in the order of the supplement.
std::span<const PublishedExperiment> published_experiments();

/// The score of base ICP from the identity, 0.0034319 m²: the paper's example of a good alignment (Figure
/// 2a).
double published_reference_score();

/// A success threshold for another pair of maps: 1.078 times the score of a good alignment. 1.078 is the
/// ratio of the published threshold to published_reference_score().
double success_score_above(double good_score);

struct PaperOptions {
  IcpOptions align;  ///< default: the paper's options; `initial` and `k` are ignored
  PointSetOptions points;
  /// A run with a lower score, m², is a success. std::nullopt: 1.078 times the score of base ICP
  /// without displacement, see success_score_above().
  std::optional<double> success_score;
  PoseTolerance tolerance;
  /// Also search, in each XY quadrant, for the displacement at which the alignment fails, as in the paper.
  bool search_xy = false;
  double search_limit_m = 5.0;        ///< largest |x| and |y|; positive
  double search_resolution_m = 0.01;  ///< positive

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// One quadrant's search. The paper took "0.25 m and 0.5 m, and then increased until at least one
/// ICP strategy stopped aligning successfully". This search uses steps of 0.25 m, then bisection
/// between the last two displacements.
struct QuadrantSearch {
  int sign_x = 1;
  int sign_y = 1;
  std::vector<TrialResult> runs = {};  ///< all runs, four at each displacement
  /// Largest displacement below first_failure_m at which all strategies succeeded; std::nullopt if
  /// none.
  std::optional<double> last_success_m = {};
  std::optional<double> first_failure_m = {};  ///< std::nullopt: none up to the limit
  std::vector<std::string> failed = {};        ///< strategies that failed at first_failure_m
};

struct PaperResults {
  std::vector<TrialResult> runs;  ///< 45 configurations x 4 strategies, in the published order
  bool has_truth = false;         ///< whether the truth is known; else no run has a pose error
  /// Whether the inverse of the truth has less than half the truth's score, as for swapped maps.
  bool fits_inverse = false;
  double success_score = 0.0;
  std::optional<Agreement> agreement;  ///< agreement among the runs' poses
  std::vector<QuadrantSearch> searches;

  bool score_success(const TrialResult& run) const {
    return run.score && *run.score < success_score;
  }
};

/// Runs the paper's experiments on another pair of maps, each run from initial_pose(). The
/// executor's threads share the runs; the results do not depend on the number of threads.
/// @throws Error (misuse); (input) if a map lacks a metric's input; (cancelled)
PaperResults run_paper_experiments(const MapPair& pair, const PaperOptions& options = {},
                                   const Execution& execution = {});

/// Initial target_from_source of a run: the true pose, or the identity if it is unknown, displaced
/// as in the paper: rotated about the target's origin, then translated.
Rigid3 initial_pose(const Displacement& displacement, const std::optional<Rigid3>& truth);

/// The run of one strategy under a published configuration.
const TrialResult& run_of(const PaperResults& results, std::size_t configuration,
                          std::size_t strategy);

/// Tables as in the paper and its supplement, with the published numbers next to ours. They contain
/// the scores per experiment (for k, the paper's Table 1), iterations, success counts and, if the
/// truth is known, pose errors. They contain no durations.
/// @param tolerance largest pose error of a success
std::vector<ResultTable> paper_tables(const PaperResults& results, const PoseTolerance& tolerance);

/// The main findings in sentences: which strategies converge to the true pose from which
/// displacements, and how often score and pose error disagree. The pose that most runs agree on
/// replaces an unknown truth.
/// @param tolerance largest pose error of a success
std::vector<std::string> paper_findings(const PaperResults& results,
                                        const PoseTolerance& tolerance);

/// Duration of each run, next to the published one.
ResultTable paper_durations(const PaperResults& results);

/// Displacement at which each quadrant failed, for results with a search.
ResultTable search_table(const PaperResults& results);

/// Start of the runs: "the true pose, displaced" or "the maps as they lie, displaced".
std::string_view start_text(const PaperResults& results);

/// Two frames, one of each map, that observed the same place.
struct CommonView {
  FrameIndex source;
  FrameIndex target;
  std::size_t landmarks = 0;  ///< source landmarks observed by both frames
};

/// Finds the pair of frames, one of each aligned map, with the largest number of common landmarks;
/// of equal pairs, the first. A source landmark is common if its nearest target landmark is within
/// the radius, one frame observes the source landmark, and the other the target landmark.
/// @param radius in the maps' unit of length, positive
/// @returns std::nullopt if no two frames have a common landmark, or a map has no observations
std::optional<CommonView> find_common_view(const LandmarkMap& source, const LandmarkMap& target,
                                           const Rigid3& target_from_source, double radius);

}  // namespace cairn
