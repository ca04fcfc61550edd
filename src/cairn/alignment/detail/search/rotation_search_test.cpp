// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn::detail {
namespace {

// A room's corner without symmetry, seen whole from both sides: source in random order, about its middle.
struct Clouds {
  std::vector<Eigen::Vector3d> source;
  std::vector<Eigen::Vector3d> target;
  std::vector<double> weights;
  Rigid3 truth;
};

Clouds clouds(std::uint64_t seed, std::size_t count) {
  Random random(seed);
  Clouds made;
  made.truth = Rigid3(rotation_exp({0.5, -0.9, 1.3}), {0.3, -0.2, 0.1});
  for (std::size_t i = 0; i < count; ++i) {
    const double along = random.uniform(-1, 1);
    const double across = random.uniform(-0.6, 0.6);
    const Eigen::Vector3d at = i % 3 == 0   ? Eigen::Vector3d(along, across, -0.4)
                               : i % 3 == 1 ? Eigen::Vector3d(along, -0.6, across)
                                            : Eigen::Vector3d(-1.0, across, 0.7 * along);
    made.source.push_back(at);
    made.target.push_back(made.truth * at);
  }
  made.weights.assign(count, 1.0);
  return made;
}

// Among others one that is near the truth.
std::vector<Eigen::Quaterniond> rotations_near(const Rigid3& truth, double degrees) {
  Random random(5);
  std::vector<Eigen::Quaterniond> rotations;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Quaterniond any(random.normal(), random.normal(), random.normal(),
                                 random.normal());
    rotations.push_back(any.normalized());
  }
  const Eigen::Quaterniond off(Eigen::AngleAxisd(radians(degrees), Eigen::Vector3d::UnitY()));
  rotations.push_back(off * truth.quaternion());
  return rotations;
}

constexpr KernelScales kKernel = {.coarse = 0.5, .fine = 0.03};
const auto kAcceptAll = [](const Rigid3&) { return true; };

TEST(SearchPoses, FindsThePoseFromARotationNearIt) {
  const Clouds pair = clouds(1, 900);
  const auto found = search_poses(pair.source, pair.weights, pair.target, pair.weights,
                                  rotations_near(pair.truth, 12.0), kAcceptAll, kKernel, 128);
  ASSERT_FALSE(found.empty());
  const auto off = found.front().target_from_source.difference_to(pair.truth);
  EXPECT_LT(off.head<3>().norm(), 0.01);
  EXPECT_LT(off.tail<3>().norm(), radians(1.0));
  EXPECT_GT(found.front().score, 0.9);
}

TEST(SearchPoses, AreDistinctAndBestFirst) {
  const Clouds pair = clouds(2, 600);
  const auto found = search_poses(pair.source, pair.weights, pair.target, pair.weights,
                                  rotations_near(pair.truth, 5.0), kAcceptAll, kKernel, 16);
  ASSERT_GT(found.size(), 1U);
  EXPECT_LE(found.size(), 16U);
  for (std::size_t i = 1; i < found.size(); ++i) {
    EXPECT_GE(found[i - 1].score, found[i].score);
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GT(found[i].target_from_source.difference_to(found[j].target_from_source).norm(),
                1e-3);
    }
  }
}

TEST(SearchPoses, GivesNoPoseThatIsNotAccepted) {
  const Clouds pair = clouds(3, 600);
  const auto far_from_truth = [&](const Rigid3& pose) {
    return pose.difference_to(pair.truth).norm() > 0.5;
  };
  const auto found = search_poses(pair.source, pair.weights, pair.target, pair.weights,
                                  rotations_near(pair.truth, 5.0), far_from_truth, kKernel, 128);
  for (const SearchCandidate& candidate : found) {
    EXPECT_TRUE(far_from_truth(candidate.target_from_source));
  }
}

TEST(SearchPoses, IsTheSameWithAnyNumberOfThreads) {
  const Clouds pair = clouds(4, 700);
  const auto with_threads = [&](unsigned threads) {
    return search_poses(pair.source, pair.weights, pair.target, pair.weights,
                        rotations_near(pair.truth, 9.0), kAcceptAll, kKernel, 128,
                        {.executor = Executor(threads)});
  };
  const auto one = with_threads(1);
  const auto two = with_threads(2);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].score, two[i].score);
    EXPECT_EQ(one[i].target_from_source.matrix(), two[i].target_from_source.matrix());
  }
}

}  // namespace
}  // namespace cairn::detail
