// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "cairn/experiments/paper.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

TEST(CommonView, OfAMapAndItselfIsTheFrameThatSeesMost) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 300, .frames = 15});
  std::vector<std::size_t> seen(map.frame_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    for (const FrameIndex frame : map.observing_frames(LandmarkIndex{i})) {
      ++seen[frame.value];
    }
  }
  const auto view = find_common_view(map, map, Rigid3(), 1e-6);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->source, view->target);
  EXPECT_EQ(view->landmarks, *std::max_element(seen.begin(), seen.end()));
  EXPECT_EQ(seen[view->source.value], view->landmarks);
}

TEST(CommonView, NeedsTheMapsToBeAligned) {
  const SyntheticPair pair = synthetic_pair({.seed = 2, .landmarks = 300, .frames = 15});
  const auto aligned = find_common_view(pair.source, pair.target, pair.target_from_source, 0.03);
  ASSERT_TRUE(aligned);
  const Rigid3 far(Eigen::Quaterniond::Identity(), {100, 0, 0});
  EXPECT_FALSE(find_common_view(pair.source, pair.target, far, 0.03));
}

TEST(CommonView, NeedsObservations) {
  const LandmarkMap map = synthetic_map({.seed = 2, .landmarks = 50, .frames = 5});
  EXPECT_FALSE(find_common_view(map, LandmarkMap(), Rigid3(), 0.1));
}

}  // namespace
}  // namespace cairn
