// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "cairn/experiments/displacement.hpp"

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

/// "In all cases where the alignment is satisfactory, the score is below 0.0037 for this map pair": m²,
/// valid for that pair only.
inline constexpr double kPublishedSuccessScore = 0.0037;

struct PublishedOutcome {
  double score;  ///< m²
  int iterations;
  double duration_s;  ///< PCL without optimisation, scored at each iteration
};

/// One configuration, and its results in the paper's supplement.
struct PublishedExperiment {
  Experiment experiment;
  std::size_t k;
  Displacement initial;
  double initial_score;                      ///< m²
  std::array<PublishedOutcome, 4> outcomes;  ///< in the order of kPaperStrategies
};

/// All 45, in the order of the supplement.
std::span<const PublishedExperiment> published_experiments();

/// The score of base ICP from the identity, 0.0034319 m²: the paper's example of a good alignment (Figure
/// 2a).
double published_reference_score();

/// A success threshold for another pair of maps: 1.078 times the score of a good alignment, the ratio of
/// the published threshold to published_reference_score().
double success_score_above(double good_score);

}  // namespace cairn
