// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/experiments/statistics/interval.hpp"

/// How well a score, such as a fitness score, tells successes from failures.
namespace cairn {

/// Which scores speak for success.
enum class ScoreMeaning { kHigherIsBetter, kLowerIsBetter };

/// What comes of judging as successes the scores that are as good as a threshold.
struct RocPoint {
  /// One of the scores; infinitely good for the point without predicted successes.
  double threshold = 0.0;
  double sensitivity = 0.0;  ///< share of the successes that are judged so
  double specificity = 0.0;  ///< share of the failures that are not
  double youden_j() const { return sensitivity + specificity - 1.0; }
};

struct Roc {
  std::size_t successes = 0;
  std::size_t failures = 0;
  /// Area under the curve: the probability that a success has the better score of a success and a
  /// failure drawn at random, ties counting half.
  double auc = 0.5;
  /// Of DeLong, DeLong and Clarke-Pearson, Biometrics 44, 837-845 (1988): from the variation of each
  /// trial's share. std::nullopt for fewer than two successes or failures.
  std::optional<double> delong_standard_error;
  /// auc ± z·delong_standard_error, cut at 0 and 1. std::nullopt without the error or if that is 0, as of a
  /// perfect score.
  std::optional<Interval> delong_interval;
  /// Of Hanley and McNeil, Radiology 143, 29-36 (1982), who take scores to be exponentially
  /// distributed: from auc and the counts alone.
  double hanley_mcneil_standard_error = 0.0;
  /// Score interval of Newcombe, Statistics in Medicine 25, 559-573 (2006), method 5: those areas with
  /// |auc - A| <= z·sqrt(V(A)), V(A) = A(1-A)(1 + m((1-A)/(2-A) + A/(1+A))) / (successes·failures),
  /// m = (successes + failures)/2 - 1. Never of zero width, good for few trials and perfect scores.
  Interval score_interval;
  /// From no predicted successes to all; one point per distinct score, and one before.
  std::vector<RocPoint> curve;
  /// The point of the largest Youden's J (Cancer 3, 32-35, 1950); of equal ones the strictest. Chosen
  /// and judged on the same trials, hence optimistic.
  RocPoint best;
};

/// @param scores no NaN; infinite ones are allowed
/// @param success whether each trial succeeded; as many as scores
/// @return std::nullopt unless there are successes and failures
/// @throws Error (misuse)
std::optional<Roc> roc_analysis(std::span<const double> scores, const std::vector<bool>& success,
                                ScoreMeaning meaning, double confidence = 0.95);

}  // namespace cairn
