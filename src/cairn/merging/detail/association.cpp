// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/association.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <Eigen/LU>

#include "cairn/core/statistics.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/detail/descriptor_difference.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kCandidates = 4;   // nearest landmarks that may be the partner
constexpr std::size_t kSurrounding = 8;  // nearest landmarks, for the density
constexpr std::size_t kBlock = 512;
constexpr std::size_t kSample = 20'000;  // landmarks that share and deviation are estimated from
constexpr int kRounds = 12;
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

// Whether two landmarks look alike, by their best pair of descriptors.
class Likeness {
 public:
  Likeness(const DescriptorColumn& first, const DescriptorColumn& second, std::uint64_t seed)
      : first_(first),
        second_(second),
        norm_(descriptor_norm(first.kind)),
        most_(largest_alike(first, second, seed)) {}

  bool knows_second(std::uint32_t second) const { return second_.known[second] != 0; }
  /// False only if both descriptors are known and differ.
  bool may_be_one(std::uint32_t first, std::uint32_t second) const {
    if (first_.known[first] == 0 || second_.known[second] == 0) return true;
    return least_difference(first_, first, second_, second, norm_) <= most_;
  }

 private:
  const DescriptorColumn& first_;
  const DescriptorColumn& second_;
  DescriptorNorm norm_;
  std::uint64_t most_;
};

// Neighbours, in the first set, of a landmark of the second.
struct Surroundings {
  std::array<std::uint32_t, kCandidates> candidates;  // kNone: fewer, or their descriptors differ
  float farthest = 0.0F;  // distance of the farthest neighbour; 0: too few neighbours
};

struct Model {
  double share;
  double variance;  // that the covariances do not explain
};

// A candidate partner.
struct Hypothesis {
  double likelihood = 0.0;
  double mahalanobis = 0.0;  // squared
  double squared_distance = 0.0;
  double stated = 0.0;  // trace of the stated covariance of the difference
};

class Associator {
 public:
  Associator(const LandmarkSet& first, const LandmarkSet& second, const Execution& execution)
      : first_(first), second_(second), executor_(execution.executor) {
    if (first.descriptors != nullptr && second.descriptors != nullptr &&
        comparable(*first.descriptors, *second.descriptors)) {
      likeness_.emplace(*first.descriptors, *second.descriptors, execution.seed);
    }
    look_around();
  }

  Model estimate() const;
  // The likeliest partner of each landmark of the second set; probability 0: none.
  std::vector<Association> likeliest(const Model& model) const;

 private:
  void look_around();
  Hypothesis hypothesis(std::uint32_t candidate, std::uint32_t second, double variance) const;
  // Median distance of the second set's landmarks from their nearest.
  double spacing() const;
  // Likelihood that a landmark of the first set is where a candidate is by chance.
  double by_chance(std::uint32_t second, double trace) const;
  double nearest_distance(double quantile) const;

  const LandmarkSet& first_;
  const LandmarkSet& second_;
  const Executor& executor_;
  std::optional<Likeness> likeness_;
  std::vector<Surroundings> around_;
};

void Associator::look_around() {
  const BatchTree tree(first_.positions);
  around_.resize(second_.positions.size());
  tree.batch(kSurrounding)
      .for_each(second_.positions, executor_, [&](std::size_t i, const NearestList auto& nearest) {
        Surroundings& around = around_[i];
        around.candidates.fill(kNone);
        const std::size_t found = nearest.size();
        if (found > 1) {
          around.farthest = static_cast<float>(std::sqrt(nearest.squared_distance(found - 1)));
        }
        for (std::size_t j = 0; j < std::min(found, kCandidates); ++j) {
          const std::uint32_t candidate = nearest.index(j);
          if (!likeness_ || likeness_->may_be_one(candidate, static_cast<std::uint32_t>(i))) {
            around.candidates[j] = candidate;
          }
        }
      });
}

Hypothesis Associator::hypothesis(std::uint32_t candidate, std::uint32_t second,
                                  double variance) const {
  const Eigen::Vector3d apart = second_.positions[second] - first_.positions[candidate];
  Eigen::Matrix3d covariance = first_.covariances[candidate] + second_.covariances[second];
  Hypothesis result;
  result.stated = covariance.trace();
  result.squared_distance = apart.squaredNorm();
  covariance.diagonal().array() += variance;
  const double determinant = covariance.determinant();
  if (!(determinant > 0.0)) {
    result.mahalanobis = std::numeric_limits<double>::infinity();
    return result;
  }
  result.mahalanobis = apart.dot(covariance.inverse() * apart);
  constexpr double kTwoPi = 2.0 * std::numbers::pi;
  result.likelihood =
      std::exp(-0.5 * result.mahalanobis) / std::sqrt(kTwoPi * kTwoPi * kTwoPi * determinant);
  return result;
}

// Landmarks lie on surfaces, so their number in a small ball is proportional to the square of its radius.
double Associator::by_chance(std::uint32_t second, double trace) const {
  const double r = around_[second].farthest;
  if (!(r > 0.0)) return 0.0;
  const auto others = static_cast<double>(std::min(first_.positions.size(), kSurrounding) - 1);
  const double reach = std::min(r, 2.0 * std::sqrt(trace / 3.0));
  const double density = others / (4.0 / 3.0 * std::numbers::pi * r * r * reach);
  const bool compared = likeness_ && likeness_->knows_second(second);
  return compared ? kAlikeByChance * density : density;
}

double Associator::nearest_distance(double quantile) const {
  std::vector<double> distances;
  for (std::uint32_t i = 0; i < around_.size(); ++i) {
    const std::uint32_t nearest = around_[i].candidates[0];
    if (nearest == kNone) continue;
    distances.push_back((second_.positions[i] - first_.positions[nearest]).norm());
  }
  if (distances.empty()) return 0.0;
  return lower_quantile(distances, quantile);
}

double Associator::spacing() const {
  const BatchTree tree(second_.positions);
  if (tree.size() < 2) return 0.0;
  const std::size_t stride = std::max<std::size_t>(1, around_.size() / kSample);
  std::vector<Eigen::Vector3d> sample;
  for (std::size_t i = 0; i < around_.size(); i += stride) sample.push_back(second_.positions[i]);
  std::vector<double> distances(sample.size());
  tree.batch(2).for_each(sample, executor_, [&](std::size_t i, const NearestList auto& nearest) {
    distances[i] = std::sqrt(nearest.squared_distance(1));
  });
  return upper_median(distances);
}

Model Associator::estimate() const {
  // Starts from the nearest quarter, which contains the common landmarks if they are that many. They cannot
  // be farther apart than the spacing, or they could not be distinguished. The lower bound is rounding.
  const double most = spacing();
  const double near = std::min(nearest_distance(0.25), most);
  double scale = 0.0;
  for (const Surroundings& around : around_) scale = std::max(scale, double{around.farthest});
  const double least = 1e-16 * scale * scale + std::numeric_limits<double>::min();
  Model model = {.share = 0.5, .variance = std::max(least, near * near)};
  const std::size_t stride = std::max<std::size_t>(1, around_.size() / kSample);
  const std::size_t count = (around_.size() + stride - 1) / stride;
  struct Sums {
    double same = 0.0;
    double weight = 0.0;
    double excess = 0.0;
  };
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Sums> sums((count + kBlock - 1) / kBlock);
    executor_.for_blocks(count, kBlock, [&](std::size_t begin, std::size_t end) {
      Sums& sum = sums[begin / kBlock];
      for (std::size_t k = begin; k < end; ++k) {
        const auto i = static_cast<std::uint32_t>(k * stride);
        std::array<Hypothesis, kCandidates> all;
        double any = 0.0;
        double trace = 0.0;
        for (std::size_t j = 0; j < kCandidates; ++j) {
          const std::uint32_t candidate = around_[i].candidates[j];
          if (candidate == kNone) continue;
          all[j] = hypothesis(candidate, i, model.variance);
          any += all[j].likelihood;
          trace = std::max(trace, all[j].stated + 3.0 * model.variance);
        }
        const double none = (1.0 - model.share) * by_chance(i, trace);
        const double total = model.share * any + none;
        if (!(total > 0.0)) continue;
        for (const Hypothesis& each : all) {
          const double probability = model.share * each.likelihood / total;
          if (probability <= 0.0) continue;
          sum.same += probability;
          const double t = each.stated + 3.0 * model.variance;
          const double weight = probability / (t * t);
          sum.weight += weight;
          sum.excess += weight * (each.squared_distance - each.stated);
        }
      }
    });
    Sums sum;
    for (const Sums& each : sums) {
      sum.same += each.same;
      sum.weight += each.weight;
      sum.excess += each.excess;
    }
    model.share = std::clamp(sum.same / static_cast<double>(count), 1e-3, 0.999);
    if (sum.weight > 0.0) model.variance = sum.excess / (3.0 * sum.weight);
    model.variance = std::max(least, std::min(most * most, model.variance));
  }
  return model;
}

std::vector<Association> Associator::likeliest(const Model& model) const {
  std::vector<Association> best(around_.size());
  executor_.for_blocks(around_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto i = static_cast<std::uint32_t>(k);
      double any = 0.0;
      double trace = 0.0;
      double highest = 0.0;
      bool within = false;
      for (const std::uint32_t candidate : around_[k].candidates) {
        if (candidate == kNone) continue;
        const Hypothesis each = hypothesis(candidate, i, model.variance);
        any += each.likelihood;
        trace = std::max(trace, each.stated + 3.0 * model.variance);
        if (each.likelihood <= highest) continue;
        highest = each.likelihood;
        best[k] = {candidate, i, 0.0};
        within = each.mahalanobis <= kAssociationGate;
      }
      const double total = model.share * any + (1.0 - model.share) * by_chance(i, trace);
      if (within) best[k].probability = model.share * highest / total;
    }
  });
  return best;
}

}  // namespace

AssociationResult associate(const LandmarkSet& first, const LandmarkSet& second,
                            double min_probability, const Execution& execution) {
  AssociationResult result;
  if (first.positions.empty() || second.positions.empty()) return result;
  const Associator associator(first, second, execution);
  const Model model = associator.estimate();
  result.deviation = std::sqrt(model.variance);
  result.share = model.share;
  const std::vector<Association> best = associator.likeliest(model);
  // Each landmark of the first set keeps the likeliest of those that chose it; ties: the first.
  std::vector<std::uint32_t> chosen(first.positions.size(), kNone);
  for (std::uint32_t i = 0; i < best.size(); ++i) {
    if (best[i].probability <= 0.0) continue;
    std::uint32_t& other = chosen[best[i].first];
    if (other == kNone || best[i].probability > best[other].probability) other = i;
  }
  for (std::uint32_t i = 0; i < best.size(); ++i) {
    if (best[i].probability < min_probability) continue;
    if (chosen[best[i].first] == i) result.pairs.push_back(best[i]);
  }
  return result;
}

}  // namespace cairn::detail
