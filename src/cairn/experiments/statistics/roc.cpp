// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/roc.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/distributions.hpp"
#include "cairn/experiments/statistics/moments.hpp"
#include "cairn/experiments/statistics/ranks.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

double square(double x) {
  return x * x;
}

double hanley_mcneil(double auc, double successes, double failures) {
  const double q1 = auc / (2.0 - auc);
  const double q2 = 2.0 * auc * auc / (1.0 + auc);
  const double variance = (auc * (1.0 - auc) + (successes - 1.0) * (q1 - auc * auc) +
                           (failures - 1.0) * (q2 - auc * auc)) /
                          (successes * failures);
  return std::sqrt(std::max(0.0, variance));
}

Interval newcombe_interval(double auc, double successes, double failures, double z) {
  const double m = (successes + failures) / 2.0 - 1.0;
  const auto inside = [&](double a) {
    const double variance = a * (1.0 - a) * (1.0 + m * ((1.0 - a) / (2.0 - a) + a / (1.0 + a))) /
                            (successes * failures);
    return square(auc - a) <= z * z * variance;
  };
  // The end of the interval between the estimate, which is inside (at 0 and 1 on its border), and the
  // end of the range. Halving ends where doubles do.
  const auto end = [&](double in, double out) {
    while (true) {
      const double middle = std::midpoint(in, out);
      if (middle == in || middle == out) return middle;
      (inside(middle) ? in : out) = middle;
    }
  };
  return {auc > 0.0 ? end(auc, 0.0) : 0.0, auc < 1.0 ? end(auc, 1.0) : 1.0};
}

std::vector<RocPoint> curve_of(const std::vector<double>& goodness,
                               const std::vector<bool>& success, double sign, double successes,
                               double failures) {
  std::vector<std::size_t> order(goodness.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return goodness[a] > goodness[b]; });
  std::vector<RocPoint> curve = {{sign * std::numeric_limits<double>::infinity(), 0.0, 1.0}};
  double hits = 0.0;
  double false_alarms = 0.0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    (success[order[i]] ? hits : false_alarms) += 1.0;
    const bool last = i + 1 == order.size() || goodness[order[i + 1]] != goodness[order[i]];
    if (last) {
      curve.push_back(
          {sign * goodness[order[i]], hits / successes, (failures - false_alarms) / failures});
    }
  }
  return curve;
}

}  // namespace

std::optional<Roc> roc_analysis(std::span<const double> scores, const std::vector<bool>& success,
                                ScoreMeaning meaning, double confidence) {
  require_pairs("roc_analysis", scores.size(), success.size());
  require_confidence("roc_analysis", confidence);
  const double sign = meaning == ScoreMeaning::kHigherIsBetter ? 1.0 : -1.0;
  std::vector<double> goodness;
  std::vector<double> of_successes;
  std::vector<double> of_failures;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (std::isnan(scores[i])) {
      throw Error(ErrorKind::kMisuse, "roc_analysis", fmt::format("score {} is NaN", i),
                  "a number");
    }
    goodness.push_back(sign * scores[i]);
    (success[i] ? of_successes : of_failures).push_back(goodness.back());
  }
  if (of_successes.empty() || of_failures.empty()) return std::nullopt;

  Roc roc;
  roc.successes = of_successes.size();
  roc.failures = of_failures.size();
  const auto m = static_cast<double>(roc.successes);
  const auto n = static_cast<double>(roc.failures);
  // How large a share of the other kind each trial is better than, if a success, or worse than, ties
  // counting half: from ranks, as Sun and Xu, IEEE Signal Processing Letters 21, 1389-1393 (2014).
  const Ranks among_all = mid_ranks(goodness);
  const Ranks among_successes = mid_ranks(of_successes);
  const Ranks among_failures = mid_ranks(of_failures);
  std::vector<double> success_shares;
  std::vector<double> failure_shares;
  for (std::size_t i = 0; i < goodness.size(); ++i) {
    if (success[i]) {
      const double within = among_successes.values[success_shares.size()];
      success_shares.push_back((among_all.values[i] - within) / n);
    } else {
      const double within = among_failures.values[failure_shares.size()];
      failure_shares.push_back(1.0 - (among_all.values[i] - within) / m);
    }
  }
  roc.auc = std::clamp(*sample_mean(success_shares), 0.0, 1.0);

  const double z = normal_two_sided_quantile(confidence);
  const auto success_deviation = sample_deviation(success_shares);
  const auto failure_deviation = sample_deviation(failure_shares);
  if (success_deviation && failure_deviation) {
    const double error = std::sqrt(square(*success_deviation) / m + square(*failure_deviation) / n);
    roc.delong_standard_error = error;
    if (error > 0.0) {
      roc.delong_interval =
          Interval{std::max(0.0, roc.auc - z * error), std::min(1.0, roc.auc + z * error)};
    }
  }
  roc.hanley_mcneil_standard_error = hanley_mcneil(roc.auc, m, n);
  roc.score_interval = newcombe_interval(roc.auc, m, n, z);
  roc.curve = curve_of(goodness, success, sign, m, n);
  roc.best = roc.curve.front();
  for (const RocPoint& point : roc.curve) {
    if (point.youden_j() > roc.best.youden_j()) roc.best = point;
  }
  return roc;
}

}  // namespace cairn
