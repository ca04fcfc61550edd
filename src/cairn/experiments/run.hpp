// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/icp.hpp"

namespace cairn {

/// A rule for choosing matches: base ICP, or a confidence.
struct Strategy {
  std::string name;              ///< "base", or the metric's name
  std::optional<Metric> metric;  ///< std::nullopt: base
};

/// @param name "base" or a name that metric_named accepts
/// @throws Error (misuse) listing the names if there is no such strategy
Strategy strategy_named(std::string_view name);

/// Two maps to align repeatedly.
struct MapPair {
  std::string name;
  LandmarkMap source;
  LandmarkMap target;
  std::optional<Rigid3> truth;  ///< target_from_source; std::nullopt if unknown
};

/// Method by which a trial estimates the pose.
enum class Method {
  kIcp,       ///< the paper's ICP and PCL's stopping rules; iterations comparable to published ones
  kFast,      ///< ICP, on growing samples first; stops when matches repeat
  kRobust,    ///< refine(), with confidences as weights
  kAnywhere,  ///< place(); ignores the initial pose; a pose that is not aligned is a failure
};

/// "icp" etc.: the names in studies and tables.
std::string_view to_string(Method method);

inline constexpr std::array kMethods = {Method::kIcp, Method::kFast, Method::kRobust,
                                        Method::kAnywhere};

/// Display name of a method and strategy. ICP: the strategy, e.g. "base". Other methods: the
/// method, and any strategy but base, e.g. "robust" or "robust observations".
std::string approach_name(Method method, std::string_view strategy);

/// Whether the method depends on the number of candidates.
bool uses_k(Method method);
/// Whether the method needs landmark clouds: kRobust and kAnywhere.
bool needs_clouds(Method method);

/// Landmarks of a pair with the confidences of one strategy.
struct PairPoints {
  PointSet source;
  PointSet target;
  /// Landmark clouds for needs_clouds(); empty unless requested.
  LandmarkCloud source_cloud = {};
  LandmarkCloud target_cloud = {};
};

/// @throws Error if a map lacks the strategy's input
PairPoints pair_points(const MapPair& pair, const Strategy& strategy,
                       const PointSetOptions& options = {}, bool with_clouds = false);

/// An initial misalignment, as listed in experiments and tables: R = Rz(yaw)·Ry(pitch)·Rx(roll), then the
/// translation.
struct Displacement {
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.0;
  double roll_deg = 0.0;
  double pitch_deg = 0.0;
  double yaw_deg = 0.0;

  Rigid3 pose() const;

  friend bool operator==(const Displacement&, const Displacement&) = default;
};

/// "x 0.5 y -0.5 yaw 10": the nonzero parts of a displacement, in metres and degrees; "none" for zero.
std::string describe(const Displacement& displacement);

/// One alignment task: the key of a row in tables.
struct Trial {
  std::string pair = {};
  std::string experiment = {};  ///< name of its experiment
  std::size_t number = 0;       ///< configuration, from 1; shared by strategies
  Method method = Method::kIcp;
  std::string strategy = {};
  std::size_t k = 5;  ///< configured number of candidates; base ICP ignores k
  Displacement initial = {};

  friend bool operator==(const Trial&, const Trial&) = default;
};

/// A trial and its result.
struct TrialResult {
  Trial trial;
  RegistrationStatus status = RegistrationStatus::kFailed;
  StopReason stop_reason = StopReason::kTooFewMatches;
  int iterations = 0;
  std::optional<int> cycle_length;           ///< cycle of repeated matches; 1: a fixed point
  std::optional<double> initial_score;       ///< Eq. 5, m²
  std::optional<double> score;               ///< Eq. 5, m²
  std::optional<Rigid3> target_from_source;  ///< std::nullopt for a failure
  std::optional<PoseError> error;            ///< if there is a pose and the truth is known
  bool fits_inverse = false;                 ///< see cairn::fits_inverse(); not in runs.csv
  double duration_s = 0.0;                   ///< the only value that is not reproducible
};

/// Aligns with the trial's method. `initial` and the trial's k replace the values in the options.
/// kRobust uses only the initial pose and max_iterations; kAnywhere uses no options.
/// @param points points of the pair, with clouds if needs_clouds()
/// @param initial initial target_from_source
/// @throws Error (cancelled)
TrialResult run_trial(Trial trial, const PairPoints& points, const Rigid3& initial,
                      const std::optional<Rigid3>& truth, IcpOptions options,
                      const Execution& execution = {});

/// Runs as rows of two tables (docs/experiments.md): `runs.csv`, which is reproducible, and `timings.csv`
/// with the same keys and the durations.
///
/// Rows end with a checksum and LF. A row without LF is incomplete; a row whose checksum does not
/// match is damaged.
std::string runs_header();
std::string runs_row(const TrialResult& run);
std::string timings_header();
std::string timings_row(const TrialResult& run);

/// The runs in a `runs.csv`, without durations. Skips a truncated last row.
/// @throws Error (input) naming line, column and constraint, or the line of a damaged row
std::vector<TrialResult> parse_runs(std::string_view text, std::string_view name);

/// Largest pose error of a success.
struct PoseTolerance {
  double rotation_deg = 5.0;
  double translation_m = 0.05;

  bool holds(const PoseError& error) const;
};

/// The pose that most poses agree with, for pairs without known truth. Agreement is no proof:
/// strategies may agree on a wrong pose.
struct Agreement {
  std::size_t pose =
      0;  ///< index of the pose with the most others within the tolerance; the first of equals
  std::vector<bool> agrees;  ///< one per pose: whether it is within the tolerance of `pose`
};

/// @param poses  std::nullopt: a run without a pose, which agrees with no pose
/// @param source landmarks in the source frame; translations are compared at their centroid
/// @returns std::nullopt if there is no pose
std::optional<Agreement> find_agreement(std::span<const std::optional<Rigid3>> poses,
                                        std::span<const Eigen::Vector3d> source,
                                        const PoseTolerance& tolerance = {});

/// A table for display: as CSV in full, or as Markdown or LaTeX with rounded numbers.
struct ResultTable {
  struct Column {
    std::string name;
    std::string unit = {};  ///< empty: none
    int digits = 4;         ///< significant digits of rounded numbers
  };
  using Cell = std::variant<std::monostate, double, std::string>;  ///< unknown, number, text

  std::string name;   ///< file name without ending, e.g. "table1_scores"
  std::string title;  ///< a heading as a sentence, with an explanation
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows;

  /// Rounds numbers to 15 digits, which removes rounding errors of unit conversions
  /// (4.5849899999999995).
  void round();

  std::string csv() const;
  std::string markdown() const;
  /// A tabular environment with rules of the package booktabs.
  std::string latex() const;
};

}  // namespace cairn
