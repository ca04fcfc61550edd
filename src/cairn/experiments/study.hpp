// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/experiments/run.hpp"

namespace cairn {

/// Maps on disk.
struct PairFiles {
  std::string source;  ///< path of a map
  std::string target;
  std::optional<std::string> truth;  ///< path of 16 numbers, target_from_source
};

/// Two sessions of one simulated place, each mapped from its own images.
struct PairSimulation {
  std::string environment = {};  ///< desk, office, corridor, warehouse, room or kitchen
  std::uint64_t seed = 1;        ///< of the place
  std::string path = "sweep";
  std::size_t frames = 150;  ///< of each session
  double rate_hz = 10.0;     ///< frames per second
  double changed = 0.1;      ///< share of the movable objects that moved between the sessions
};

struct StudyPair {
  std::string name;  ///< letters, digits, '-', '_' and '.'; unique
  std::variant<PairFiles, PairSimulation> maps;

  bool has_truth() const;  ///< always true of a simulated place
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
  /// Displacements of the source from its true pose, at its centroid and along the target's axes; from the
  /// pose as read if the truth is unknown.
  DisplacementRange initial;
  std::vector<Method> methods = {Method::kIcp};
  std::vector<std::string> strategies = {"base", "covariance", "observations", "distance"};
  std::vector<std::size_t> k = {5};
  IcpOptions align;  ///< only max_iterations and max_distance can be set in a study
  PointSetOptions points;
  PoseTolerance success;
  /// A run with a lower score, m², is a success by the paper's measure. std::nullopt: for each pair, the
  /// lowest score times the ratio of the paper's threshold to its good example.
  std::optional<double> success_score;
  double confidence_level = 0.95;  ///< of intervals
  double equivalence_margin =
      0.05;  ///< largest difference of success rates that counts as equivalent
};

/// Reads a study from YAML (docs/experiments.md).
/// @param name of the file, for messages
/// @throws Error (input) naming file, line, key, value and constraint; unknown keys are errors
Study parse_study(const std::string& yaml, std::string_view name);

/// All settings that determine a study's runs, in canonical form: equal texts and maps give equal runs.
std::string canonical_text(const Study& study);

/// The runs of a study in order: by pair, initial pose, k (only the first for methods and strategies that
/// ignore k, such as base ICP), method and strategy.
class StudyPlan {
 public:
  explicit StudyPlan(const Study& study);

  std::size_t size() const { return study_.pairs.size() * runs_per_pair(); }
  std::size_t runs_per_pair() const { return study_.initial_count * combinations_.size(); }
  std::size_t pair_of(std::size_t run) const { return run / runs_per_pair(); }
  /// Depends only on the study and the number. Methods and strategies share the initial poses.
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
/// @param truth std::nullopt: the displacement is from the pose as read
/// @param centroid of the source's landmarks, in the source frame
Rigid3 displaced(const Displacement& displacement, const std::optional<Rigid3>& truth,
                 const Eigen::Vector3d& centroid);

}  // namespace cairn
