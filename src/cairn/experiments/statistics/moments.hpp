// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

/// Mean and standard deviation of a sample; quantile() is in core/statistics.hpp.
namespace cairn {

/// std::nullopt for no values.
std::optional<double> sample_mean(std::span<const double> values);

/// The standard deviation of the population that the values are a sample of: over n - 1. Exactly 0 if
/// all are equal. std::nullopt for fewer than two.
std::optional<double> sample_deviation(std::span<const double> values);

}  // namespace cairn
