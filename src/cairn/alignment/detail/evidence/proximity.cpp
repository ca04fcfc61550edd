// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/proximity.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/alignment/detail/cloud_scales.hpp"

namespace cairn::detail {
namespace {

constexpr double kBinsPerOctave = 4.0;
constexpr double kLeastOctave = -6.0;
// Weight of the prior, in pairs. The prior is the distribution for points on surfaces; it is added to that
// of the other poses.
constexpr double kPriorPairs = 40.0;
// For mutual nearest neighbours, the circles around both are empty. Their union is larger than one circle by
// this factor, (4·π/3 + √3/2) / π.
constexpr double kBothEmpty = 1.609;

using Counts = Proximity::Counts;

double upper_edge(std::size_t bin) {
  return std::exp2(kLeastOctave + static_cast<double>(bin) / kBinsPerOctave);
}

// Shares of the bins for a cumulative distribution; the last bin has the rest.
template <class Distribution>
Counts shares(const Distribution& cumulative) {
  Counts result{};
  double below = 0.0;
  for (std::size_t bin = 0; bin < Proximity::kBins; ++bin) {
    const double up_to = bin + 1 < Proximity::kBins ? cumulative(upper_edge(bin)) : 1.0;
    result[bin] = std::max(up_to - below, 1e-12);
    below = up_to;
  }
  return result;
}

// Shares for mutual nearest neighbours among independent points on one surface.
const Counts& shares_on_surface() {
  static const Counts result =
      shares([](double ratio) { return chance_on_surface(ratio * ratio); });
  return result;
}

// Shares for the distance of two points whose difference is Gaussian with this standard deviation per axis
// (Maxwell's distribution).
Counts shares_of_same(double deviation) {
  return shares([deviation](double ratio) {
    const double x = ratio / deviation;
    return std::erf(x / std::numbers::sqrt2) -
           std::sqrt(2.0 / std::numbers::pi) * x * std::exp(-0.5 * x * x);
  });
}

// Standard deviations to try. Larger ones would also explain the fit of surfaces, which wrong poses share.
constexpr std::array<double, 8> kDeviations = {0.015, 0.02,  0.03, 0.04,
                                               0.055, 0.075, 0.1,  ProximityEvidence::kWidest};
constexpr std::array<double, 11> kShares = {0.01, 0.02, 0.05, 0.1, 0.15, 0.2,
                                            0.3,  0.4,  0.5,  0.6, 0.8};

const std::array<Counts, kDeviations.size()>& same_by_deviation() {
  static const auto result = [] {
    std::array<Counts, kDeviations.size()> all{};
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = shares_of_same(kDeviations[i]);
    return all;
  }();
  return result;
}

}  // namespace

double chance_on_surface(double squared_ratio) {
  return -std::expm1(-kBothEmpty * static_cast<double>(kSpacingNeighbors) * squared_ratio);
}

void Proximity::add(double ratio, std::size_t group) {
  const double octave = std::log2(std::max(ratio, 1e-9)) - kLeastOctave;
  const double bin =
      std::clamp(std::ceil(kBinsPerOctave * octave), 0.0, static_cast<double>(kBins - 1));
  ++counts_[group][static_cast<std::size_t>(bin)];
}

Proximity::Counts Proximity::counts(std::size_t group) const {
  Counts result{};
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    result[bin] = static_cast<double>(counts_[group][bin]);
  }
  return result;
}

Proximity::Counts Proximity::counts() const {
  Counts result{};
  for (std::size_t group = 0; group < kGroups; ++group) {
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      result[bin] += static_cast<double>(counts_[group][bin]);
    }
  }
  return result;
}

ProximityEvidence proximity_evidence(const Proximity& at_pose,
                                     std::span<const Proximity* const> others) {
  Counts chance = shares_on_surface();
  double total = kPriorPairs;
  for (double& share : chance) share *= kPriorPairs;
  for (const Proximity* const other : others) {
    const Counts counts = other->counts();
    for (std::size_t bin = 0; bin < Proximity::kBins; ++bin) {
      chance[bin] += counts[bin];
      total += counts[bin];
    }
  }
  for (double& share : chance) share /= total;

  const Counts counts = at_pose.counts();
  ProximityEvidence result;
  Counts gains{};  // of the likeliest mixture, per pair
  for (std::size_t d = 0; d < kDeviations.size(); ++d) {
    const Counts& same = same_by_deviation()[d];
    for (const double share : kShares) {
      double sum = 0.0;
      Counts gain{};
      for (std::size_t bin = 0; bin < Proximity::kBins; ++bin) {
        gain[bin] = std::log1p(share * (same[bin] / chance[bin] - 1.0));
        sum += counts[bin] * gain[bin];
      }
      if (sum <= result.all) continue;
      result.all = sum;
      result.share = share;
      result.deviation = kDeviations[d];
      gains = gain;
    }
  }
  double most = 0.0;
  for (std::size_t group = 0; group < Proximity::kGroups; ++group) {
    const Counts part = at_pose.counts(group);
    double sum = 0.0;
    for (std::size_t bin = 0; bin < Proximity::kBins; ++bin) sum += part[bin] * gains[bin];
    most = std::max(most, sum);
  }
  result.spread = std::max(result.all - most, 0.0);
  return result;
}

}  // namespace cairn::detail
