// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory/tum.hpp"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/real_data.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

Trajectory parsed(std::string_view text) {
  MemoryReader reader(text, "a.tum");
  return read_tum_trajectory(reader);
}

std::string refusal(std::string_view text) {
  return testing::refusal(ErrorKind::kInput, [&] { parsed(text); });
}

TEST(TumTrajectory, HasTheRealPartOfTheQuaternionLast) {
  const Trajectory trajectory = parsed("# comment\n\n1.5 1 2 3 0 0 1 0\r\n 2 0 0 0\t0 0 0 1 \n");
  ASSERT_EQ(trajectory.size(), 2U);
  const TimedPose& pose = trajectory.poses()[0];
  EXPECT_EQ(pose.timestamp_s, 1.5);
  EXPECT_EQ(pose.world_from_camera.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_LT((pose.world_from_camera * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 2, 3)).norm(),
            1e-12)
      << "half a turn about z";
}

TEST(TumTrajectory, ComesBackAsWritten) {
  const Trajectory before =
      parsed("1305031453.374112 0.1 -0.2 0.3 0.1 0.2 0.3 0.9273618495495704\n");
  std::string text;
  write_tum_trajectory(before, [&](std::string_view bytes) { text += bytes; });
  const Trajectory after = parsed(text);
  EXPECT_EQ(after.poses()[0].timestamp_s, before.poses()[0].timestamp_s);
  EXPECT_LT(
      after.poses()[0].world_from_camera.difference_to(before.poses()[0].world_from_camera).norm(),
      1e-15);
}

TEST(TumTrajectory, NamesLineAndFieldOfWhatItRefuses) {
  EXPECT_THAT(refusal(""), HasSubstr("a.tum: no poses"));
  EXPECT_THAT(refusal("# only a comment\n"), HasSubstr("no poses"));
  EXPECT_THAT(refusal("1 0 0 0 0 0 1\n"), HasSubstr("a.tum:1: field 8 (qw): missing"));
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 1 5\n"), HasSubstr("a.tum:1: more than eight fields"));
  EXPECT_THAT(refusal("#\n1 0 x 0 0 0 0 1\n"), HasSubstr("a.tum:2: field 3 (ty): 'x' is not"));
  EXPECT_THAT(refusal("1 0 0 nan 0 0 0 1\n"), HasSubstr("field 4 (tz)"));
  EXPECT_THAT(
      refusal("1 0 -1e300 0 0 0 0 1\n"),
      HasSubstr("a.tum:1: field 3 (ty): '-1e300' is beyond the limit; expected numbers from "
                "-1e9 to 1e9"));
  EXPECT_THAT(refusal("1e300 0 0 0 0 0 0 1\n"),
              HasSubstr("a.tum:1: field 1 (timestamp): '1e300'; expected seconds"));
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 0\n"), HasSubstr("quaternion of norm 0"));
  EXPECT_THAT(refusal("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n"),
              HasSubstr("a.tum:2: field 1 (timestamp): 1.000000 does not come after 2.000000"));
}

TEST(TumTrajectory, TakesQuaternionsWhoseNormIsWithinAHundredthOfOne) {
  EXPECT_EQ(refusal("1 0 0 0 0 0 0 1.0099\n"), "");
  EXPECT_EQ(refusal("1 0 0 0 0 0.9901 0 0\n"), "");
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 1.0101\n"), HasSubstr("norm 1 within 1e-2"));
  EXPECT_THAT(refusal("1 0 0 0 0 0.9899 0 0\n"), HasSubstr("norm 1 within 1e-2"));
  const Trajectory read = parsed("1 0 0 0 0 0 0 1.0099\n");
  EXPECT_NEAR(read.poses()[0].world_from_camera.quaternion().norm(), 1.0, 1e-15);
}

TEST(TumTrajectory, RefusesATimeThatComesTwice) {
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n"),
              HasSubstr("1.000000 does not come after 1.000000"));
  EXPECT_EQ(refusal("1 0 0 0 0 0 0 1\n1.000001 0 0 0 0 0 0 1\n"), "");
}

TEST(TumTrajectory, ReadsTheBenchmarksGroundTruth) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  FileReader file(*data / "tum_fr1_desk/groundtruth.txt");
  const Trajectory trajectory = read_tum_trajectory(file);
  EXPECT_GT(trajectory.size(), 2000U) << "recorded at 100 Hz";
  EXPECT_NEAR(trajectory.duration_s(), 23.4, 0.2);
  EXPECT_GT(trajectory.length(), 9.0);
}

}  // namespace
}  // namespace cairn
