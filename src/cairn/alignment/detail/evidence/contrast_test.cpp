// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/contrast.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/alignment/detail/evidence/support_counter.hpp"
#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<Eigen::Vector3d> random_points(std::size_t count, Random& random) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < count; ++i) {
    points.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
  }
  return points;
}

std::vector<double> random_lightness(std::size_t count, Random& random) {
  std::vector<double> lightness;
  for (std::size_t i = 0; i < count; ++i) lightness.push_back(random.uniform(0, 255));
  return lightness;
}

std::vector<double> ranks_of(const std::vector<Eigen::Vector3d>& points,
                             const std::vector<double>& lightness) {
  return contrast_ranks(lightness, points, BatchTree(points), Executor());
}

TEST(ContrastRanks, AreThoseOfTheDifferenceToTheEightNearest) {
  Random random(1);
  const auto points = random_points(200, random);
  const auto lightness = random_lightness(200, random);
  std::vector<double> contrasts;
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::vector<std::size_t> by_distance(points.size());
    std::iota(by_distance.begin(), by_distance.end(), 0U);
    std::sort(by_distance.begin(), by_distance.end(), [&](std::size_t a, std::size_t b) {
      return (points[a] - points[i]).norm() < (points[b] - points[i]).norm();
    });
    double sum = 0.0;
    for (std::size_t j = 1; j <= 8; ++j) sum += lightness[by_distance[j]];
    contrasts.push_back(lightness[i] - sum / 8.0);
  }
  const std::vector<double> ranks = ranks_of(points, lightness);
  ASSERT_EQ(ranks.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto below = std::count_if(contrasts.begin(), contrasts.end(),
                                     [&](double other) { return other < contrasts[i]; });
    EXPECT_NEAR(ranks[i], (2.0 * static_cast<double>(below) + 1.0) / 200.0 - 1.0, 1e-12);
  }
}

TEST(ContrastRanks, IgnoreExposureAndWhatIsDarkAsAWhole) {
  Random random(2);
  auto points = random_points(300, random);
  for (std::size_t i = 0; i < 150; ++i) points[i].x() += 10.0;  // another part
  const auto lightness = random_lightness(300, random);
  std::vector<double> other;
  for (std::size_t i = 0; i < lightness.size(); ++i) {
    other.push_back(0.4 * lightness[i] + (i < 150 ? 60.0 : 150.0));
  }
  const auto ranks = ranks_of(points, lightness);
  const auto of_other = ranks_of(points, other);
  ASSERT_EQ(ranks.size(), 300U);
  ASSERT_EQ(of_other.size(), 300U);
  for (std::size_t i = 0; i < ranks.size(); ++i) EXPECT_NEAR(ranks[i], of_other[i], 1e-12);
}

TEST(ContrastRanks, AreUnknownWithoutColoursOfTheirOwn) {
  Random random(3);
  const auto points = random_points(100, random);
  EXPECT_TRUE(ranks_of(points, std::vector<double>(100, 255.0)).empty()) << "one colour";
  EXPECT_TRUE(ranks_of(points, {}).empty());
  auto lightness = random_lightness(100, random);
  std::fill(lightness.begin(), lightness.begin() + 60, kNan);
  EXPECT_TRUE(ranks_of(points, lightness).empty()) << "most unknown";
  std::fill(lightness.begin(), lightness.begin() + 60, 10.0);
  lightness[0] = kNan;
  const auto ranks = ranks_of(points, lightness);
  ASSERT_EQ(ranks.size(), 100U);
  EXPECT_TRUE(std::isnan(ranks[0]));
  EXPECT_EQ(std::count_if(ranks.begin(), ranks.end(), [](double r) { return std::isnan(r); }), 1);
}

TEST(ContrastPairs, SumsGiveTheCorrelationOfTheListedPairs) {
  Random random(4);
  ContrastPairs a;
  ContrastPairs b;
  ContrastPairs all;
  for (int i = 0; i < 100; ++i) {
    const double x = random.normal();
    const double y = 0.6 * x + 0.8 * random.normal();
    (i < 40 ? a : b).add(x, y);
    all.add(x, y);
  }
  ContrastPairs sum = a;
  sum += b;
  EXPECT_EQ(sum.count(), 100U);
  EXPECT_NEAR(sum.correlation(), all.correlation(), 1e-12);
  EXPECT_NEAR((all - b).correlation(), a.correlation(), 1e-12);
  EXPECT_NEAR(all.correlation(), 0.6, 0.15);
  EXPECT_NEAR(all.evidence(), -50.0 * std::log(1.0 - std::pow(all.correlation(), 2)), 1e-9);
  ContrastPairs opposite;
  for (int i = 0; i < 50; ++i) opposite.add(i, -i);
  EXPECT_EQ(opposite.evidence(), 0.0) << "a negative correlation is no evidence";
  EXPECT_EQ(ContrastPairs().correlation(), 0.0);
}

TEST(ContrastAgreement, OfUnrelatedLandmarksHardlyExceedsWhatTheVerdictTakesForChance) {
  Random random(5);
  int beyond = 0;
  constexpr int kTrials = 4000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::array<ContrastPairs, 16> groups;
    for (std::size_t i = 0; i < 150; ++i) {
      groups[i % 16].add(random.uniform(-1, 1), random.uniform(-1, 1));
    }
    const ContrastAgreement agreement = contrast_agreement(groups);
    EXPECT_EQ(agreement.compared, 150U);
    if (agreement.spread > 5.0) ++beyond;
  }
  EXPECT_LE(beyond, kTrials / 200);
}

TEST(ContrastAgreement, IsNotDecidedByOnePartOfTheMap) {
  Random random(6);
  std::array<ContrastPairs, 16> groups;
  for (std::size_t i = 0; i < 300; ++i) {
    const double x = random.uniform(-1, 1);
    groups[i % 16].add(x, i % 16 == 3 ? x : random.uniform(-1, 1));
  }
  ContrastPairs all;
  ContrastPairs others;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    all += groups[g];
    if (g != 3) others += groups[g];
  }
  const ContrastAgreement agreement = contrast_agreement(groups);
  EXPECT_NEAR(agreement.spread, others.evidence(), 1e-9);
  EXPECT_LT(agreement.spread, all.evidence());
}

// A cloud of which half the landmarks are in another cloud too, with noise of a hundredth of the spacing.
struct Clouds {
  LandmarkCloud source;
  LandmarkCloud target;
};

Clouds half_in_common(bool same_colours) {
  Random random(7);
  Clouds clouds;
  const auto shared = random_points(400, random);
  const auto shared_lightness = random_lightness(400, random);
  for (LandmarkCloud* const cloud : {&clouds.source, &clouds.target}) {
    cloud->positions = random_points(400, random);
    cloud->lightness = random_lightness(400, random);
    for (std::size_t i = 0; i < shared.size(); ++i) {
      cloud->positions.push_back(
          shared[i] + 0.001 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
      cloud->lightness.push_back(same_colours ? 0.5 * shared_lightness[i] + 20.0
                                              : random.uniform(0, 255));
    }
  }
  return clouds;
}

Support support_of(const Clouds& clouds) {
  const PreparedCloud source(clouds.source);
  const PreparedCloud target(clouds.target);
  const SupportCounter counter(source, target, source.size(), Random(1));
  return counter(centred_pose(source, target, Similarity3()), 0.1);
}

TEST(Contrast, RaisesTheProbabilityOfAPoseThatBringsEqualContrastsTogether) {
  const Support same = support_of(half_in_common(true));
  const Support other = support_of(half_in_common(false));
  ASSERT_TRUE(same.contrast && other.contrast);
  EXPECT_GT(same.contrast->compared, 300U);
  EXPECT_GT(same.contrast->correlation, 0.5);
  EXPECT_LT(std::abs(other.contrast->correlation), 0.2);
  const auto probability = [](Support support) {
    support.spread_evidence = 60.0;  // neither certain nor impossible
    support.proximity.spread = 0.0;
    const PlacementCandidate candidate = {.target_from_source = {}, .support = support};
    return probabilities({{candidate}})[0];
  };
  Support without = other;
  without.contrast.reset();
  EXPECT_EQ(probability(other), probability(without)) << "colours that differ are no evidence";
  EXPECT_GT(probability(same), probability(without));
  Support described = same;
  described.agreement.emplace();
  Support described_only = described;
  described_only.contrast.reset();
  EXPECT_EQ(probability(described), probability(described_only)) << "descriptors say more";
}

TEST(Contrast, IsNotComparedIfAMapHasNoColours) {
  Clouds clouds = half_in_common(true);
  clouds.target.lightness.clear();
  EXPECT_FALSE(support_of(clouds).contrast);
}

}  // namespace
}  // namespace cairn::detail
