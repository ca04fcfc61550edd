// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/random.hpp"
#include "cairn/experiments/run.hpp"

/// Studies: many pairs of maps, each aligned from many initial poses by several methods.

namespace cairn {

/// Maps on disk.
struct PairFiles {
  std::string source;  ///< path of a map
  std::string target;
  std::optional<std::string> truth;  ///< path of a file with 16 numbers, target_from_source
};

/// Two sessions of one simulated place, each mapped from its own images.
struct PairSimulation {
  std::string environment = {};  ///< desk, office, corridor, warehouse, room or kitchen
  std::uint64_t seed = 1;        ///< seed of the place
  std::string path = "sweep";
  std::size_t frames = 150;  ///< frames per session
  double rate_hz = 10.0;     ///< frames per second
  double changed = 0.1;      ///< share of the movable objects that moved between the sessions
};

struct StudyPair {
  std::string name;  ///< letters, digits, '-', '_' and '.'; unique
  std::variant<PairFiles, PairSimulation> maps;

  bool has_truth() const;  ///< always true for a simulated place
};

/// Bounds of a uniform distribution, independent for each of the six numbers.
struct DisplacementRange {
  Displacement low;
  Displacement high;
};

/// A study: every pair with every initial pose, method, strategy and k.
struct Study {
  std::string name;
  std::uint64_t seed = 0;
  std::vector<StudyPair> pairs;
  std::size_t initial_count = 100;  ///< initial poses per pair
  /// Displacements of the source from its true pose (the identity if unknown), about its centroid
  /// and along the target's axes.
  DisplacementRange initial;
  std::vector<Method> methods = {Method::kIcp};
  std::vector<std::string> strategies = {"base", "covariance", "observations", "distance"};
  std::vector<std::size_t> k = {5};
  IcpOptions align;  ///< only max_iterations and max_distance can be set in a study
  PointSetOptions points;
  PoseTolerance success;
  /// A run with a lower score, m², is a success by the paper's measure. std::nullopt: for each
  /// pair, 1.078 times the lowest score, see success_score_above().
  std::optional<double> success_score;
  double confidence_level = 0.95;  ///< confidence level of intervals
  /// Largest difference of success rates that counts as equivalent. For studies/analyse.py.
  double equivalence_margin = 0.05;
};

/// Reads a study from YAML (docs/experiments.md).
/// @param name file name in messages
/// @throws Error (input) naming file, line, key, value and constraint; unknown keys are errors
Study parse_study(const std::string& yaml, std::string_view name);

/// All settings that determine a study's runs, in canonical form: equal texts and maps give equal runs.
std::string canonical_text(const Study& study);

/// The runs of a study, ordered by pair, initial pose, k, method and strategy. Methods and
/// strategies that ignore k, such as base ICP, run only with the first k.
class StudyPlan {
 public:
  explicit StudyPlan(const Study& study);

  std::size_t size() const { return study_.pairs.size() * runs_per_pair(); }
  std::size_t runs_per_pair() const { return study_.initial_count * combinations_.size(); }
  std::size_t pair_of(std::size_t run) const { return run / runs_per_pair(); }
  /// Depends only on the study and `run`. Methods and strategies share the initial poses.
  Trial trial(std::size_t run) const;
  /// Seed for the run's method; the same for all methods and strategies from one initial pose.
  std::uint64_t seed_of(std::size_t run) const;
  const Study& study() const { return study_; }

 private:
  struct Combination {
    Method method;
    std::string strategy;
    std::size_t k;
  };

  // Shared by all runs from the same initial pose.
  Random random_of(std::size_t run) const;

  Study study_;
  std::vector<Combination> combinations_;
};

/// Initial target_from_source of a displaced pair.
/// @param truth true target_from_source; std::nullopt: the identity
/// @param centroid centroid of the source landmarks, in the source frame
Rigid3 displaced(const Displacement& displacement, const std::optional<Rigid3>& truth,
                 const Eigen::Vector3d& centroid);

/// Part `index` of `count` of a study, from 1: a contiguous range of its runs.
struct Shard {
  std::size_t index = 1;
  std::size_t count = 1;

  /// @throws Error (misuse) unless 1 <= index <= count
  void validate() const;
  std::size_t begin(std::size_t runs) const {
    return runs / count * (index - 1) + extra(runs, index - 1);
  }
  std::size_t end(std::size_t runs) const { return runs / count * index + extra(runs, index); }

 private:
  // The first shards have one more run if runs do not divide evenly.
  std::size_t extra(std::size_t runs, std::size_t shards) const {
    return shards < runs % count ? shards : runs % count;
  }
};

/// A folder with the runs of a study or shard. The process may be killed at any time: complete rows
/// of runs.csv and timings.csv are kept, and no row appears twice. From a truncated or damaged
/// row on, rows are dropped and run again. The folder serves one process at a time and rejects a
/// second process before it reads or writes anything.
class StudyFolder {
 public:
  /// Creates the folder, or continues with its content.
  /// @param inputs other inputs of the runs, one line each, e.g. the hashes of the maps
  /// @throws Error (storage) if another process uses the folder or writing fails; (input) if it
  ///        holds runs of another study or shard, naming the difference, or rows that do not match
  ///        the plan
  StudyFolder(const std::filesystem::path& folder, const StudyPlan& plan, const Shard& shard,
              const std::vector<std::string>& inputs = {});
  ~StudyFolder();
  StudyFolder(const StudyFolder&) = delete;
  StudyFolder& operator=(const StudyFolder&) = delete;

  /// Kinds of processor that wrote rows, this one included, in ascending order; see
  /// processor_kind(). Rows from different kinds may differ in the last digits.
  const std::vector<std::string>& processors() const { return processors_; }

  /// Rows in the folder; the next run is shard.begin() + done().
  std::size_t done() const { return done_; }
  /// Appends the next run's rows.
  /// @throws Error (storage), e.g. for a full disk; (misuse) if it is not the next run
  void append(const TrialResult& run);
  /// Waits until all rows are on disk.
  void sync();

 private:
  struct Files;
  std::unique_ptr<Files> files_;
  std::vector<std::string> processors_;
  std::size_t done_ = 0;
};

/// Performs the missing runs of the folder in order, several in parallel. Loads a pair's maps only
/// if one of its runs is missing. The rows do not depend on the number of threads.
/// @param each_run  called with each run, before the progress
/// @param execution its progress is called after each run
/// @throws Error (cancelled); errors of `load_pair` and the folder
void run_study(const StudyPlan& plan, const Shard& shard, StudyFolder& folder,
               const std::function<MapPair(const StudyPair&)>& load_pair,
               const std::function<void(const TrialResult& run)>& each_run = {},
               const Execution& execution = {});

/// Whether the folder holds all runs of the shard, each row sound. Changes nothing.
/// @param inputs as for StudyFolder
/// @throws Error (input) as StudyFolder
bool is_complete(const std::filesystem::path& folder, const StudyPlan& plan, const Shard& shard,
                 const std::vector<std::string>& inputs = {});

/// @param name name of the study's file in messages
/// @throws Error (input) if the folder's runs are not of this study, naming the difference
void require_runs_of(const std::filesystem::path& folder, const Study& study,
                     std::string_view name);

/// Joins the complete folders of all shards of one study, in any order. The resulting runs.csv is
/// identical to the file of a single process. The merged folder is created atomically.
/// @param merged a new or empty folder
/// @return the kinds of processor that wrote the rows, as StudyFolder::processors()
/// @throws Error (input) naming a folder that is missing, incomplete, of another study or given
///        twice; (storage) if `merged` holds anything or cannot be written
std::vector<std::string> merge_study(const std::vector<std::filesystem::path>& shards,
                                     const std::filesystem::path& merged);

/// How often runs succeed.
struct SuccessCount {
  std::size_t successes = 0;
  std::size_t trials = 0;

  void add(bool success) {
    ++trials;
    if (success) ++successes;
  }
  std::optional<double> share() const;  ///< std::nullopt if there are no trials
};

/// Success count with a confidence interval of the share, at the study's confidence level. Runs of one pair
/// of maps are correlated, so the pairs count as independent, not the runs. The interval is [0, 1] for
/// fewer than two pairs.
struct SuccessRate : SuccessCount {
  double low = 0.0;
  double high = 1.0;
};

/// Results of one strategy with one method and k.
struct StrategySummary {
  /// approach_name(), e.g. "robust observations", followed by k if the study has several
  std::string name;
  SuccessRate success;                ///< by the true pose, over runs of pairs with truth
  std::vector<double> pair_rates;     ///< success rate per pair, in the order of pairs_with_truth
  std::vector<SuccessRate> of_group;  ///< success rate per group, as StudySummary::groups
  /// Success count by initial pose: rows by rotation, columns by translation.
  std::vector<SuccessCount> of_offset;
  std::size_t runs = 0;             ///< with and without truth
  std::size_t score_successes = 0;  ///< runs that succeed by the paper's measure
  std::size_t at_limit = 0;         ///< runs that ended at the iteration limit
  double median_iterations = 0.0;
  /// Median errors of the successes; std::nullopt if there are none.
  std::optional<double> median_rotation_rad;
  std::optional<double> median_translation;
};

/// Whether the score predicts success, i.e. a lower score means a better pose.
struct ScoreJudgement {
  std::size_t pairs = 0;  ///< pairs with both correct and wrong poses
  /// Median over these pairs of the area under the ROC curve: the probability that a correct pose
  /// has a lower score than a wrong pose of the same pair.
  double median_auc = 0.5;
  double lowest_auc = 0.5;
  SuccessRate passed_wrong;     ///< runs with a wrong pose that pass by score
  SuccessRate refused_right;    ///< runs with a correct pose that fail by score
  SuccessRate lowest_is_wrong;  ///< pairs whose lowest score belongs to a wrong pose
};

/// Summary of a study's runs. studies/analyse.py compares the strategies.
struct StudySummary {
  std::vector<std::string> pairs;             ///< names of all pairs
  std::vector<std::size_t> pairs_with_truth;  ///< indices into pairs
  std::vector<std::string> groups;    ///< kinds of place: pairs' names without a trailing number
  std::vector<double> lowest_scores;  ///< over all runs of each pair, m²; 0 without runs
  std::vector<double> rotation_edges_rad;  ///< bin edges of StrategySummary::of_offset, ascending
  std::vector<double> translation_edges_m;
  std::vector<StrategySummary> strategies;
  ScoreJudgement judgement;  ///< only meaningful with truth
};

/// @param runs all runs of the study, in order
/// @throws Error (misuse) for other runs, an error without truth, or a pose without error despite
///        truth
StudySummary summarise_study(const Study& study, std::span<const TrialResult> runs);

/// Success by strategy, kind of place, initial pose and pair, and whether the score predicts success.
std::vector<ResultTable> study_tables(const Study& study, const StudySummary& summary);

/// The main findings, one sentence each: which strategies succeed most and least often, whether the
/// score predicts success, and the scope of the study.
std::vector<std::string> study_findings(const Study& study, const StudySummary& summary);

}  // namespace cairn
