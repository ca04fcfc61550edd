// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/trajectory/trajectory_file.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

Trajectory wandering(double start_s) {
  Random random(11);
  std::vector<TimedPose> poses;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d turn(random.normal(), random.normal(), random.normal());
    poses.push_back({start_s + 0.05 * i, Rigid3(rotation_exp(turn), {0.1 * i, -0.2 * i, 1.0})});
  }
  return Trajectory(std::move(poses));
}

std::string written(const Trajectory& trajectory, TrajectoryFormat format) {
  std::string text;
  write_trajectory(trajectory, format, [&](std::string_view piece) { text += piece; });
  return text;
}

std::string refusal_of(const std::filesystem::path& path) {
  return testing::refusal(ErrorKind::kInput, [&] { read_trajectory(path); });
}

TEST(TrajectoryFile, ComesBackInEveryFormat) {
  const TemporaryFolder folder;
  for (const TrajectoryFormat format :
       {TrajectoryFormat::kTum, TrajectoryFormat::kEuroc, TrajectoryFormat::kKitti}) {
    const Trajectory trajectory = wandering(format == TrajectoryFormat::kKitti ? 0.0 : 1.4e9);
    const std::string text = written(trajectory, format);
    EXPECT_EQ(recognised_trajectory(text), format);
    const Trajectory back = read_trajectory(folder.write("poses", text));
    ASSERT_EQ(back.size(), trajectory.size()) << to_string(format);
    for (std::size_t i = 0; i < back.size(); ++i) {
      const TimedPose& pose = back.poses()[i];
      const double time = format == TrajectoryFormat::kKitti ? static_cast<double>(i)
                                                             : trajectory.poses()[i].timestamp_s;
      EXPECT_NEAR(pose.timestamp_s, time, 1e-6) << to_string(format);
      EXPECT_LT(
          pose.world_from_camera.difference_to(trajectory.poses()[i].world_from_camera).norm(),
          1e-12)
          << to_string(format);
    }
    EXPECT_EQ(trajectory_format(to_string(format)), format);
  }
  EXPECT_EQ(trajectory_format("bundler"), std::nullopt);
}

TEST(TrajectoryFile, ReportsALastLineThatMayHaveBeenCutOff) {
  const TemporaryFolder folder;
  for (const TrajectoryFormat format :
       {TrajectoryFormat::kTum, TrajectoryFormat::kEuroc, TrajectoryFormat::kKitti}) {
    std::string losses;
    const LogSink log = [&](const Remark& remark) {
      EXPECT_EQ(remark.kind, RemarkKind::kLoss);
      losses += remark.text;
    };
    const std::string whole = written(wandering(0.0), format);
    read_trajectory(folder.write("poses", whole), log);
    EXPECT_EQ(losses, "");
    const Trajectory cut =
        read_trajectory(folder.write("poses", whole.substr(0, whole.size() - 1)), log);
    EXPECT_EQ(cut.size(), wandering(0.0).size());
    EXPECT_THAT(losses, HasSubstr("the last line does not end")) << to_string(format);
  }
}

TEST(TrajectoryFile, EurocTimesAreWholeNanosecondsAndMoreColumnsArePassedOver) {
  const TemporaryFolder folder;
  const Trajectory read = read_trajectory(folder.write(
      "data.csv",
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], ...\n"
      "1403636580838555648,4.6,-1.8,0.8,0.5,-0.5,0.5,0.5,-0.03,0.02,0.06,-0.002,0.02,0.08\n"
      "1403636580843555648, 4.7, -1.8, 0.8, 1, 0, 0, 0\n"));
  ASSERT_EQ(read.size(), 2U);
  EXPECT_NEAR(read.poses()[0].timestamp_s, 1403636580.838555648, 1e-6);
  EXPECT_NEAR(read.poses()[1].timestamp_s - read.poses()[0].timestamp_s, 0.005, 1e-6);
  EXPECT_EQ(read.poses()[0].world_from_camera.translation(), Eigen::Vector3d(4.6, -1.8, 0.8));
  EXPECT_NEAR(read.poses()[0].world_from_camera.quaternion().x(), -0.5, 1e-15);
  EXPECT_THAT(written(read, TrajectoryFormat::kEuroc), HasSubstr("\n1403636580838555"));
}

TEST(TrajectoryFile, KittiTakesItsTimesFromTheFileBesideIt) {
  const TemporaryFolder folder;
  const auto poses = folder.write("00.txt", "1 0 0 1 0 1 0 2 0 0 1 3\n0 -1 0 4 1 0 0 5 0 0 1 6\n");
  EXPECT_EQ(read_trajectory(poses).poses()[1].timestamp_s, 1.0);
  EXPECT_EQ(read_trajectory(poses).poses()[1].world_from_camera.rotation()(1, 0), 1.0);
  folder.write("times.txt", "0.25\n0.35\n");
  EXPECT_EQ(read_trajectory(poses).poses()[1].timestamp_s, 0.35);
  folder.write("times.txt", "0.25\n");
  EXPECT_THAT(refusal_of(poses), AllOf(HasSubstr("00.txt:2"), HasSubstr("1 times")));
  folder.write("times.txt", "0.25\n0.35\n0.45\n");
  EXPECT_THAT(refusal_of(poses), HasSubstr("2 poses and 3 times"));
  folder.write("times.txt", "0.25\nnoon\n");
  EXPECT_THAT(refusal_of(poses), AllOf(HasSubstr("times.txt:2"), HasSubstr("noon")));
}

TEST(TrajectoryFile, NamesLineAndFieldOfWhatItRefuses) {
  const TemporaryFolder folder;
  const std::string good = "100,1,2,3,1,0,0,0\n";
  EXPECT_THAT(refusal_of(folder.write("a", good + "200,1,x,3,1,0,0,0\n")),
              AllOf(HasSubstr("a:2: field 3"), HasSubstr("'x'")));
  EXPECT_THAT(refusal_of(folder.write("a", good + "200.5,1,2,3,1,0,0,0\n")),
              AllOf(HasSubstr("a:2: field 1"), HasSubstr("whole nanoseconds")));
  EXPECT_THAT(refusal_of(folder.write("a", good + "200,1,2,3,1,0,0,1\n")), HasSubstr("norm"));
  EXPECT_THAT(refusal_of(folder.write("a", good + "200,1,2,3\n")), HasSubstr("4 fields"));
  EXPECT_THAT(refusal_of(folder.write("a", good + "100,1,2,3,1,0,0,0\n")), HasSubstr("ascending"));
  EXPECT_THAT(refusal_of(folder.write("a", good + "200,1e300,2,3,1,0,0,0\n")),
              HasSubstr("beyond the limit"));
  EXPECT_THAT(refusal_of(folder.write("a", "1 0 0 1 0 1 0 2 0 0 1 3\n1 0 0 1 0 2 0 2 0 0 1 3\n")),
              AllOf(HasSubstr("a:2"), HasSubstr("not a rotation")));
  EXPECT_THAT(refusal_of(folder.write("a", "1 2 3\n")), HasSubstr("a:1"));
  EXPECT_THAT(refusal_of(folder.write("a", "")), HasSubstr("no poses"));
}

TEST(TrajectoryFile, TakesRotationsWithinAHundredth) {
  const TemporaryFolder folder;
  const auto euroc = [&](const std::string& quaternion) {
    // The first line tells the format.
    return folder.write("a", "100,1,2,3,1,0,0,0\n200,1,2,3," + quaternion + "\n");
  };
  EXPECT_EQ(read_trajectory(euroc("1.0099,0,0,0")).size(), 2U);
  EXPECT_EQ(read_trajectory(euroc("0,0.9901,0,0")).size(), 2U);
  EXPECT_THAT(refusal_of(euroc("1.0101,0,0,0")), HasSubstr("norm 1 within 1e-2"));
  EXPECT_THAT(refusal_of(euroc("0,0.9899,0,0")), HasSubstr("norm 1 within 1e-2"));

  // R·Rᵀ - I of a rotation times 1 + e has the norm 2·√3·e.
  const auto kitti = [&](const std::string& x) {
    return folder.write(
        "b", "1 0 0 1 0 1 0 2 0 0 1 3\n" + x + " 0 0 1 0 " + x + " 0 2 0 0 " + x + " 3\n");
  };
  const Rigid3 pose = read_trajectory(kitti("1.0028")).poses()[1].world_from_camera;
  EXPECT_NEAR(pose.rotation()(0, 0), 1.0, 1e-15);
  EXPECT_EQ(read_trajectory(kitti("0.9972")).size(), 2U);
  EXPECT_THAT(refusal_of(kitti("1.0030")), HasSubstr("not a rotation"));
  EXPECT_THAT(refusal_of(kitti("0.9970")), HasSubstr("not a rotation"));
  EXPECT_THAT(refusal_of(kitti("-1")), HasSubstr("not a rotation")) << "but a reflection";
}

TEST(TrajectoryFile, RefusesTimesThatNanosecondsDoNotHold) {
  EXPECT_THROW(written(Trajectory({{1e15, Rigid3()}}), TrajectoryFormat::kEuroc), Error);
  EXPECT_THROW(
      written(Trajectory({{1.0, Rigid3()}, {1.0 + 1e-12, Rigid3()}}), TrajectoryFormat::kEuroc),
      Error);
}

}  // namespace
}  // namespace cairn
