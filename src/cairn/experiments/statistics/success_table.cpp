// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/success_table.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/experiments/statistics/validation.hpp"

namespace cairn {
namespace {

// Which of the bins between ascending edges holds a value.
std::optional<std::size_t> bin_of(double value, std::span<const double> edges) {
  if (value < edges.front() || value > edges.back()) return std::nullopt;
  const auto above = std::upper_bound(edges.begin(), edges.end(), value) - edges.begin();
  return std::min(static_cast<std::size_t>(above), edges.size() - 1) - 1;
}

void require_level(std::string_view where, double level) {
  const bool is_share = level >= 0.0 && level <= 1.0;
  if (!is_share) {
    throw Error(ErrorKind::kMisuse, where, fmt::format("a level of {}", level), "0 to 1");
  }
}

}  // namespace

SuccessTable success_table(std::span<const DisplacedTrial> trials,
                           std::span<const double> rotation_edges,
                           std::span<const double> translation_edges, double confidence) {
  require_edges("success_table, rotation", rotation_edges);
  require_edges("success_table, translation", translation_edges);
  require_confidence("success_table", confidence);
  SuccessTable table;
  table.rotation_edges.assign(rotation_edges.begin(), rotation_edges.end());
  table.translation_edges.assign(translation_edges.begin(), translation_edges.end());
  std::vector<SuccessCount> counts(table.rows() * table.columns());
  for (const DisplacedTrial& trial : trials) {
    require_finite("success_table", std::array{trial.rotation, trial.translation});
    const auto row = bin_of(trial.rotation, rotation_edges);
    const auto column = bin_of(trial.translation, translation_edges);
    if (!row || !column) {
      ++table.outside;
      continue;
    }
    SuccessCount& count = counts[*row * table.columns() + *column];
    ++count.trials;
    if (trial.success) ++count.successes;
  }
  table.cells.reserve(counts.size());
  for (const SuccessCount& count : counts) {
    table.cells.push_back(estimate_proportion(count, confidence));
  }
  return table;
}

std::vector<SuccessBin> success_bins(std::span<const double> offsets,
                                     const std::vector<bool>& success,
                                     std::span<const double> edges, double confidence) {
  require_pairs("success_bins", offsets.size(), success.size());
  require_finite("success_bins", offsets);
  require_edges("success_bins", edges);
  require_confidence("success_bins", confidence);
  std::vector<SuccessCount> counts(edges.size() - 1);
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    if (const auto bin = bin_of(offsets[i], edges)) {
      ++counts[*bin].trials;
      if (success[i]) ++counts[*bin].successes;
    }
  }
  std::vector<SuccessBin> bins;
  bins.reserve(counts.size());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    bins.push_back({edges[i], edges[i + 1], estimate_proportion(counts[i], confidence)});
  }
  return bins;
}

std::optional<double> convergence_radius(std::span<const SuccessBin> bins, double level,
                                         RadiusCriterion criterion) {
  require_level("convergence_radius", level);
  std::optional<double> radius;
  for (const SuccessBin& bin : bins) {
    if (!bin.rate.estimate) break;
    const double reached =
        criterion == RadiusCriterion::kRate ? *bin.rate.estimate : bin.rate.interval.low;
    if (reached < level) break;
    radius = bin.high;
  }
  return radius;
}

std::optional<SuccessRadius> success_radius(std::span<const double> offsets,
                                            const std::vector<bool>& success, double level,
                                            double confidence) {
  require_pairs("success_radius", offsets.size(), success.size());
  require_finite("success_radius", offsets);
  require_level("success_radius", level);
  require_confidence("success_radius", confidence);
  std::vector<std::size_t> order(offsets.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return offsets[a] < offsets[b]; });
  if (!order.empty() && offsets[order.front()] < 0.0) {
    throw Error(ErrorKind::kMisuse, "success_radius",
                fmt::format("an offset of {}", offsets[order.front()]), "at least 0");
  }
  std::optional<SuccessRadius> result;
  SuccessCount count;
  for (std::size_t i = 0; i < order.size(); ++i) {
    ++count.trials;
    if (success[order[i]]) ++count.successes;
    const bool last = i + 1 == order.size() || offsets[order[i + 1]] != offsets[order[i]];
    if (last && *count.rate() >= level) {
      result = SuccessRadius{offsets[order[i]], estimate_proportion(count, confidence)};
    }
  }
  return result;
}

}  // namespace cairn
