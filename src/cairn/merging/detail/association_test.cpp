// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/association.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

Eigen::Vector3d normal(Random& random, double deviation) {
  const double x = random.normal();
  const double y = random.normal();
  return deviation * Eigen::Vector3d(x, y, random.normal());
}

// Two sets of landmarks, some of which are the same.
struct Scene {
  std::uint32_t add_first(const Eigen::Vector3d& position) {
    first.push_back(position);
    return static_cast<std::uint32_t>(first.size() - 1);
  }
  std::uint32_t add_second(const Eigen::Vector3d& position) {
    second.push_back(position);
    return static_cast<std::uint32_t>(second.size() - 1);
  }
  /// @param variances of the coordinates of each set's landmarks
  AssociationResult associated(double first_variance = 0.0, double second_variance = 0.0,
                               const DescriptorColumn* of_first = nullptr,
                               const DescriptorColumn* of_second = nullptr,
                               double min_probability = 0.5) const {
    const std::vector<Eigen::Matrix3d> a(first.size(),
                                         first_variance * Eigen::Matrix3d::Identity());
    const std::vector<Eigen::Matrix3d> b(second.size(),
                                         second_variance * Eigen::Matrix3d::Identity());
    return associate({first, a, of_first}, {second, b, of_second}, min_probability);
  }
  Scene in_unit(double unit) const {
    Scene scaled = *this;
    for (Eigen::Vector3d& position : scaled.first) position *= unit;
    for (Eigen::Vector3d& position : scaled.second) position *= unit;
    return scaled;
  }
  double share() const {
    return static_cast<double>(same.size()) / static_cast<double>(second.size());
  }

  std::vector<Eigen::Vector3d> first;
  std::vector<Eigen::Vector3d> second;
  Pairs same;  // by ascending second
};

// Landmarks on a surface, about one apart: 3 in 5 in both sets, the others in either.
Scene surface(std::size_t side, double deviation, std::uint64_t seed) {
  Scene scene;
  Random random(seed);
  for (std::size_t i = 0; i < side * side; ++i) {
    const double x = static_cast<double>(i % side) + random.uniform(-0.2, 0.2);
    const double y = static_cast<double>(i / side) + random.uniform(-0.2, 0.2);
    const Eigen::Vector3d position(x, y, 0.1 * std::sin(x));
    const double kind = random.uniform();
    if (kind < 0.6) {
      const std::uint32_t second = scene.add_second(position + normal(random, deviation));
      scene.same.emplace_back(scene.add_first(position), second);
    } else if (kind < 0.8) {
      scene.add_first(position);
    } else {
      scene.add_second(position);
    }
  }
  return scene;
}

Pairs indices(const AssociationResult& result) {
  Pairs pairs;
  for (const Association& pair : result.pairs) pairs.emplace_back(pair.first, pair.second);
  return pairs;
}

TEST(Associate, FindsWhatIsOneAndHowMuchAndHowFarApart) {
  for (const std::size_t side : {8, 40}) {
    for (const double deviation : {0.005, 0.02}) {
      const Scene scene = surface(side, deviation, 1);
      const AssociationResult result = scene.associated();
      const Pairs found = indices(result);
      EXPECT_TRUE(std::includes(scene.same.begin(), scene.same.end(), found.begin(), found.end()))
          << deviation;
      EXPECT_GE(found.size(), scene.same.size() * 199 / 200) << deviation;
      EXPECT_NEAR(result.share, scene.share(), 0.01) << deviation;
      EXPECT_NEAR(result.deviation, deviation, 0.12 * deviation);
      for (const Association& pair : result.pairs) {
        EXPECT_GT(pair.probability, 0.5);
        EXPECT_LE(pair.probability, 1.0);
      }
    }
  }
}

TEST(Associate, FindsTheDeviationThatCovariancesDoNotExplain) {
  constexpr double kDeviation = 0.03;
  const Scene scene = surface(30, kDeviation, 2);
  const auto deviation = [&](double first, double second) {
    return scene.associated(first * kDeviation * kDeviation, second * kDeviation * kDeviation)
        .deviation;
  };
  EXPECT_NEAR(deviation(0.0, 0.0), kDeviation, 0.1 * kDeviation);
  EXPECT_NEAR(deviation(0.3, 0.2), std::sqrt(0.5) * kDeviation, 0.1 * kDeviation);
  EXPECT_LT(deviation(0.0, 1.0), 0.3 * kDeviation);
  EXPECT_LT(deviation(2.0, 0.0), 1e-5 * kDeviation);
  EXPECT_EQ(indices(scene.associated(1e-3, 1e-3)), scene.same);
}

// Half of the landmarks state a large uncertainty, and are as far off. The others must not count as that far off.
TEST(Associate, FindsTheDeviationInSpiteOfUncertainLandmarks) {
  constexpr double kDeviation = 0.01;
  constexpr double kStated = 0.2;
  Scene scene = surface(20, kDeviation, 4);
  Random random(5);
  std::vector<Eigen::Matrix3d> stated(scene.second.size(), Eigen::Matrix3d::Zero());
  for (std::size_t i = 0; i < stated.size(); i += 2) {
    scene.second[i] += normal(random, kStated);
    stated[i].diagonal().setConstant(kStated * kStated);
  }
  const std::vector<Eigen::Matrix3d> exact(scene.first.size(), Eigen::Matrix3d::Zero());
  const AssociationResult result = associate({scene.first, exact}, {scene.second, stated});
  EXPECT_NEAR(result.deviation, kDeviation, 0.1 * kDeviation);
}

// Of landmarks in pairs, some of which are close, and of another set far away.
TEST(Associate, DeviatesByNoMoreThanTheMedianSpacing) {
  for (const std::size_t close : {45, 55}) {
    Scene scene;
    for (std::size_t i = 0; i < 100; ++i) {
      const double x = 10.0 * static_cast<double>(i);
      scene.add_second({x, 0.0, 0.0});
      scene.add_second({x, 5 * ((7 * i + 3) % 20) < close ? 0.25 : 1.0, 0.0});
      scene.add_first({x, 20.0, 0.0});
      scene.add_first({x, 21.0, 0.0});
    }
    const AssociationResult result = scene.associated();
    EXPECT_NEAR(result.deviation, close > 50 ? 0.25 : 1.0, 1e-9);
    EXPECT_TRUE(result.pairs.empty());
  }
}

TEST(Associate, DoesNotDependOnTheUnitOfLength) {
  for (const double deviation : {0.0, 0.02}) {
    const Scene scene = surface(12, deviation, 3);
    for (const double variance : {0.0, 1e-4}) {
      const AssociationResult expected = scene.associated(variance, variance);
      EXPECT_GT(expected.deviation, 0.0);
      for (const double unit : {1e-4, 1e4}) {
        const AssociationResult result =
            scene.in_unit(unit).associated(unit * unit * variance, unit * unit * variance);
        EXPECT_EQ(indices(result), scene.same);
        EXPECT_NEAR(result.share, expected.share, 1e-6);
        EXPECT_NEAR(result.deviation / unit, expected.deviation, 1e-6 * expected.deviation);
        for (std::size_t i = 0; i < result.pairs.size(); ++i) {
          EXPECT_NEAR(result.pairs[i].probability, expected.pairs[i].probability, 1e-6);
        }
      }
    }
  }
}

// Points at random on a surface, some nearer to another's than to their own.
TEST(Associate, IsRightAboutAsOftenAsItsProbabilitiesSay) {
  double claimed = 0.0;
  double right = 0.0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Scene scene;
    Random random(seed);
    for (int i = 0; i < 1500; ++i) {
      const double x = random.uniform(0.0, 30.0);
      const Eigen::Vector3d position(x, random.uniform(0.0, 30.0), 0.0);
      const bool is_same = random.chance(0.5);
      const std::uint32_t first = scene.add_first(position);
      const double other_x = random.uniform(0.0, 30.0);
      const Eigen::Vector3d other(other_x, random.uniform(0.0, 30.0), 0.0);
      const std::uint32_t second =
          scene.add_second((is_same ? position : other) + normal(random, 0.04));
      if (is_same) scene.same.emplace_back(first, second);
    }
    for (const Association& pair : scene.associated().pairs) {
      claimed += pair.probability;
      right += std::binary_search(scene.same.begin(), scene.same.end(),
                                  std::pair(pair.first, pair.second))
                   ? 1.0
                   : 0.0;
    }
  }
  EXPECT_LT(claimed, right);
  EXPECT_GT(claimed, 0.9 * right);
}

TEST(Associate, TakesASingleLandmarkForTheOther) {
  const Scene scene = {{{1.0, 2.0, 3.0}}, {{1.01, 2.0, 3.0}}, {{0, 0}}};
  const AssociationResult result = scene.associated(1e-4, 0.0);
  EXPECT_EQ(indices(result), scene.same);
  EXPECT_NEAR(result.pairs.at(0).probability, 1.0, 1e-9);
  EXPECT_GT(result.share, 0.99);
  EXPECT_NEAR(result.deviation, 0.0, 1e-12) << "nothing says that the covariance is too small";
}

TEST(Associate, FindsNothingInEmptySets) {
  const Scene scene = {{{1.0, 2.0, 3.0}}, {}, {}};
  EXPECT_TRUE(scene.associated().pairs.empty());
  EXPECT_EQ(scene.associated().share, 0.0);
  const AssociationResult with_empty = Scene({{}, scene.first, {}}).associated();
  EXPECT_TRUE(with_empty.pairs.empty());
  EXPECT_EQ(with_empty.share, 0.0);
}

TEST(Associate, FindsNothingWhereNothingSaysHowNearIsNear) {
  const Scene scene = {{{1.0, 2.0, 3.0}}, {{1.0, 2.0, 3.0}}, {}};
  EXPECT_TRUE(scene.associated().pairs.empty());
}

TEST(Associate, AssociatesWithinTheGateNotBeyond) {
  const auto is_associated = [](double distance) {
    const Scene scene = {{{0.0, 0.0, 0.0}}, {{0.0, distance, 0.0}}, {}};
    return !scene.associated(0.75, 0.25).pairs.empty();
  };
  const double gate = std::sqrt(kAssociationGate);
  EXPECT_TRUE(is_associated(0.99 * gate));
  EXPECT_FALSE(is_associated(1.01 * gate));
  EXPECT_TRUE(is_associated(0.0)) << "what coincides";
}

// So far away that no likelihood is left.
TEST(Associate, IsNotMisledByALandmarkFarAway) {
  const Scene scene = {{{0.0, 0.0, 0.0}}, {{1000.0, 0.0, 0.0}, {0.01, 0.0, 0.0}}, {{0, 1}}};
  const AssociationResult result = scene.associated(1e-4, 1e-4);
  EXPECT_EQ(indices(result), scene.same);
  EXPECT_NEAR(result.share, 0.5, 1e-9);
}

TEST(Associate, AssociatesEachLandmarkAtMostOnce) {
  // Two of the second set at one of the first: the nearer.
  Scene scene = {
      {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {-1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}, {0.0, 0.0, 0.0}},
      {{0.1, 0.0, 0.0}, {0.0, 0.05, 0.0}},
      {{4, 1}}};
  EXPECT_EQ(indices(scene.associated(0.0025, 0.0)), scene.same);
  // As near: the first.
  scene.second[0] = {-0.05, 0.0, 0.0};
  EXPECT_EQ(indices(scene.associated(0.0025, 0.0)), Pairs({{4, 0}}));
  // Two of the first at one place.
  scene = {{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}, {{0.0, 0.0, 0.0}}, {{0, 0}}};
  const AssociationResult result = scene.associated(0.01, 0.0);
  EXPECT_EQ(indices(result), scene.same);
  EXPECT_EQ(result.pairs.at(0).probability, 0.5);
}

TEST(Associate, LeavesOutWhatIsLessProbableThanDemanded) {
  // Of the second set, one may be either of two; the others are where those of the first are.
  Scene scene = {{{0.0, 0.0, 0.0}, {0.3, 0.0, 0.0}}, {{0.1, 0.0, 0.0}}, {}};
  for (int i = 1; i <= 8; ++i) {
    scene.add_first({2.0 * i, 2.0, 0.0});
    scene.add_second({2.0 * i, 2.0, 0.0});
  }
  const auto associated = [&](double least) {
    return scene.associated(0.01, 0.0, nullptr, nullptr, least);
  };
  const AssociationResult result = associated(0.5);
  ASSERT_EQ(result.pairs.size(), 9U);
  EXPECT_EQ(result.pairs[0].first, 0U);
  const double probability = result.pairs[0].probability;
  EXPECT_LT(probability, 0.9);
  EXPECT_EQ(associated(probability).pairs.size(), 9U);
  EXPECT_EQ(associated(std::nextafter(probability, 1.0)).pairs.size(), 8U);
}

// So near another landmark that chance may have put one there.
TEST(Associate, IsLessCertainWhereLandmarksAreDense) {
  const auto probability = [](double apart) {
    const Scene scene = {
        {{0.0, 0.0, 0.0}, {apart, 0.0, 0.0}}, {{0.0, 0.0, 0.0}, {0.0, 100.0, 0.0}}, {}};
    return scene.associated(0.01, 0.0).pairs.at(0).probability;
  };
  EXPECT_GT(probability(5.0), 0.99);
  EXPECT_LT(probability(1.0), probability(2.0));
  EXPECT_LT(probability(2.0), probability(5.0));
}

// Random descriptors of landmarks.
DescriptorColumn descriptors(const char* kind, std::size_t count, std::uint64_t seed) {
  constexpr std::size_t kBytes = 32;
  Random random(seed);
  DescriptorColumn column{kind, kBytes, std::vector<std::uint8_t>(count, 1), {}};
  for (std::size_t i = 0; i < count * kBytes; ++i) {
    column.bytes.push_back(static_cast<std::uint8_t>(random.index(256)));
  }
  return column;
}

// A landmark of the second set at each of the first's even ones, farther from it than from the odd one.
struct Twins {
  explicit Twins(const char* kind)
      : of_first(descriptors(kind, 2 * kCount, 1)), of_second(descriptors(kind, kCount, 2)) {
    for (std::size_t i = 0; i < kCount; ++i) {
      const Eigen::Vector3d position(static_cast<double>(i % 10), static_cast<double>(i / 10), 0.0);
      scene.add_first(position);
      scene.add_first(position + Eigen::Vector3d(0.05, 0.0, 0.0));
      const std::uint32_t second = scene.add_second(position + Eigen::Vector3d(0.03, 0.0, 0.0));
      scene.same.emplace_back(2 * second, second);
    }
  }
  /// Gives the second set's the descriptors of their own, with these bits of each byte changed.
  void look_alike(std::uint8_t changed) {
    for (std::size_t i = 0; i < of_second.bytes.size(); ++i) {
      of_second.bytes[i] = of_first.bytes[i / 32 * 64 + i % 32] ^ changed;
    }
  }
  static void forget(DescriptorColumn& column, std::size_t landmark) {
    column.known[landmark] = 0;
    std::fill_n(column.bytes.begin() + static_cast<std::ptrdiff_t>(landmark * 32), 32,
                std::uint8_t{0});
  }
  Pairs found() const { return indices(scene.associated(0.0, 0.0, &of_first, &of_second)); }
  /// Of these pairs, those found.
  std::size_t found_of(const Pairs& pairs) const {
    const Pairs all = found();
    return static_cast<std::size_t>(std::count_if(
        pairs.begin(), pairs.end(),
        [&](const auto& pair) { return std::binary_search(all.begin(), all.end(), pair); }));
  }

  static constexpr std::size_t kCount = 100;
  // By chance, 2 % of the others look alike, too.
  static constexpr std::size_t kNearlyAll = 94;
  static constexpr std::size_t kNearlyNone = 6;
  Scene scene;
  DescriptorColumn of_first;
  DescriptorColumn of_second;
};

TEST(Associate, TakesForOneOnlyWhatLooksAlike) {
  Twins twins("ORB");
  twins.look_alike(0x20);
  EXPECT_GT(twins.found_of(twins.scene.same), Twins::kNearlyAll);
  twins.of_second = descriptors("ORB", Twins::kCount, 3);
  EXPECT_LT(twins.found().size(), Twins::kNearlyNone);
}

// A step of half the range changes one bit of eight; one between 127 and 128 changes all.
TEST(Associate, ComparesDescriptorsByTheirKindInBitsOrBytes) {
  Twins bits("ORB");
  Twins bytes("SIFT");
  for (Twins* const twins : {&bits, &bytes}) twins->look_alike(0x80);
  EXPECT_GT(bits.found_of(bits.scene.same), Twins::kNearlyAll);
  EXPECT_LT(bytes.found().size(), Twins::kNearlyNone);
  for (Twins* const twins : {&bits, &bytes}) twins->look_alike(0x0f);
  EXPECT_LT(bits.found().size(), Twins::kNearlyNone);
  EXPECT_GT(bytes.found_of(bytes.scene.same), Twins::kNearlyAll);
}

TEST(Associate, ComparesDescriptorsInAnyUnitOfLength) {
  Twins twins("ORB");
  twins.look_alike(0x20);
  const Pairs expected = twins.found();
  for (const double unit : {1e-4, 1e4}) {
    Twins scaled = twins;
    scaled.scene = twins.scene.in_unit(unit);
    EXPECT_EQ(scaled.found(), expected);
  }
}

TEST(Associate, ExcludesNoLandmarkWithoutDescriptor) {
  Twins twins("ORB");
  twins.look_alike(0x20);
  for (std::size_t i = 0; i < Twins::kCount; i += 2) Twins::forget(twins.of_first, 2 * i);
  EXPECT_GT(twins.found_of(twins.scene.same), Twins::kNearlyAll);
  // Those of the second set without one are taken for the nearer.
  Pairs expected = twins.scene.same;
  for (std::size_t i = 1; i < Twins::kCount; i += 2) {
    Twins::forget(twins.of_second, i);
    ++expected[i].first;
  }
  EXPECT_GT(twins.found_of(expected), Twins::kNearlyAll);
  // Without any, all is as it is without descriptors.
  for (std::size_t i = 0; i < Twins::kCount; ++i) Twins::forget(twins.of_second, i);
  const Scene& scene = twins.scene;
  const AssociationResult unknown = scene.associated(0.0, 0.0, &twins.of_first, &twins.of_second);
  const AssociationResult without = scene.associated();
  ASSERT_EQ(indices(unknown), indices(without));
  for (std::size_t i = 0; i < Twins::kCount; ++i) {
    EXPECT_EQ(unknown.pairs[i].probability, without.pairs[i].probability);
  }
}

TEST(Associate, DoesWithoutDescriptorsThatCannotBeCompared) {
  Twins twins("ORB");
  const Scene& scene = twins.scene;
  const Pairs expected = indices(scene.associated());
  EXPECT_EQ(expected.size(), Twins::kCount);
  EXPECT_NE(expected, scene.same) << "the nearer ones";
  EXPECT_EQ(indices(scene.associated(0.0, 0.0, &twins.of_first, nullptr)), expected);
  EXPECT_EQ(indices(scene.associated(0.0, 0.0, nullptr, &twins.of_second)), expected);
  twins.of_second.kind = "BRISK";
  EXPECT_EQ(twins.found(), expected);
}

TEST(Associate, IsMoreCertainOfWhatLooksAlike) {
  Scene scene = surface(12, 0.15, 5);
  DescriptorColumn of_first = descriptors("ORB", scene.first.size(), 6);
  DescriptorColumn of_second = descriptors("ORB", scene.second.size(), 7);
  for (const auto& [first, second] : scene.same) {
    std::copy_n(of_first.bytes.begin() + 32 * first, 32, of_second.bytes.begin() + 32 * second);
  }
  const auto mean = [](const AssociationResult& result) {
    double sum = 0.0;
    for (const Association& pair : result.pairs) sum += pair.probability;
    return sum / static_cast<double>(result.pairs.size());
  };
  const AssociationResult alike = scene.associated(0.0, 0.0, &of_first, &of_second);
  EXPECT_GT(mean(alike), 0.99);
  EXPECT_LT(mean(scene.associated()), 0.97);
}

}  // namespace
}  // namespace cairn::detail
