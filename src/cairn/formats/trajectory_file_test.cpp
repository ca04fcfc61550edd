// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/trajectory_file.hpp"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
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

std::string trajectory_text(const Trajectory& trajectory, TrajectoryFormat format) {
  std::string text;
  write_trajectory(trajectory, format, [&](std::string_view piece) { text += piece; });
  return text;
}

struct Read {
  Trajectory trajectory;
  std::vector<std::string> losses;
  std::vector<std::string> remarks;  // that are no losses
};

Read parsed_trajectory(std::string_view text) {
  MemoryReader reader(text, "a.tum");
  Read read;
  read.trajectory = read_trajectory(reader, {}, [&](const Remark& remark) {
    (remark.kind == RemarkKind::kLoss ? read.losses : read.remarks).emplace_back(remark.text);
  });
  return read;
}

std::string trajectory_refusal(std::string_view text) {
  return testing::refusal(ErrorKind::kInput, [&] { parsed_trajectory(text); });
}

std::string refusal_of(const std::filesystem::path& path) {
  return testing::refusal(ErrorKind::kInput, [&] { read_trajectory(path); });
}

TEST(TrajectoryFile, ComesBackInEveryFormat) {
  const TemporaryFolder folder;
  for (const TrajectoryFormat format :
       {TrajectoryFormat::kTum, TrajectoryFormat::kEuroc, TrajectoryFormat::kKitti}) {
    const Trajectory trajectory = wandering(format == TrajectoryFormat::kKitti ? 0.0 : 1.4e9);
    const std::string text = trajectory_text(trajectory, format);
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
    const std::string whole = trajectory_text(wandering(0.0), format);
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
  // All digits, which a double does not hold: image files are named by them.
  const Trajectory moved = transformed(read, Similarity3(Rigid3()));
  EXPECT_THAT(trajectory_text(moved, TrajectoryFormat::kEuroc),
              AllOf(HasSubstr("\n1403636580838555648,"), HasSubstr("\n1403636580843555648,")));
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
  EXPECT_THAT(refusal_of(folder.write("a", good + "noon,1,2,3,1,0,0,0\n")),
              AllOf(HasSubstr("a:2: field 1 (timestamp)"), HasSubstr("'noon' is not a number")));
  EXPECT_THAT(refusal_of(folder.write("a", good + "200,1,2,3,1,0,0,1\n")), HasSubstr("norm"));
  EXPECT_THAT(refusal_of(folder.write("a", good + "200,1,2,3\n")), HasSubstr("4 fields"));
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
  EXPECT_THROW(trajectory_text(Trajectory({{1e15, Rigid3()}}), TrajectoryFormat::kEuroc), Error);
  EXPECT_THROW(trajectory_text(Trajectory({{1.0, Rigid3()}, {1.0 + 1e-12, Rigid3()}}),
                               TrajectoryFormat::kEuroc),
               Error);
}

// --- TUM -------------------------------------------------------------------------------------------

TEST(TumTrajectory, HasTheRealPartOfTheQuaternionLast) {
  const Trajectory trajectory =
      parsed_trajectory("# comment\n\n1.5 1 2 3 0 0 1 0\r\n 2 0 0 0\t0 0 0 1 \n").trajectory;
  ASSERT_EQ(trajectory.size(), 2U);
  const TimedPose& pose = trajectory.poses()[0];
  EXPECT_EQ(pose.timestamp_s, 1.5);
  EXPECT_EQ(pose.world_from_camera.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_LT((pose.world_from_camera * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 2, 3)).norm(),
            1e-12)
      << "half a turn about z";
}

TEST(TumTrajectory, NamesLineAndFieldOfWhatItRefuses) {
  EXPECT_THAT(trajectory_refusal(""), HasSubstr("a.tum: no poses"));
  EXPECT_THAT(trajectory_refusal("# only a comment\n"), HasSubstr("no poses"));
  EXPECT_THAT(trajectory_refusal("1 0 0 0 0 0 1\n"),
              HasSubstr("a.tum:1: 7 fields; expected timestamp tx ty"));
  EXPECT_THAT(trajectory_refusal("1 0 0 0 0 0 0 1 5\n"), HasSubstr("a.tum:1: 9 fields"));
  EXPECT_THAT(trajectory_refusal("#\n1 0 x 0 0 0 0 1\n"),
              HasSubstr("a.tum:2: field 3 (ty): 'x' is not"));
  EXPECT_THAT(trajectory_refusal("1 0 0 1e999 0 0 0 1\n"), HasSubstr("field 4 (tz)"));
  EXPECT_THAT(
      trajectory_refusal("1 0 -1e300 0 0 0 0 1\n"),
      HasSubstr("a.tum:1: field 3 (ty): '-1e300' is beyond the limit; expected numbers from "
                "-1e9 to 1e9"));
  EXPECT_THAT(trajectory_refusal("1e300 0 0 0 0 0 0 1\n"),
              HasSubstr("a.tum:1: field 1 (timestamp): '1e300'; expected seconds"));
  EXPECT_THAT(trajectory_refusal("1 0 0 0 0 0 0 0\n"), HasSubstr("a.tum:1: quaternion of norm 0"));
}

TEST(TumTrajectory, TakesQuaternionsWhoseNormIsWithinAHundredthOfOne) {
  EXPECT_EQ(trajectory_refusal("1 0 0 0 0 0 0 1.0099\n"), "");
  EXPECT_EQ(trajectory_refusal("1 0 0 0 0 0.9901 0 0\n"), "");
  EXPECT_THAT(trajectory_refusal("1 0 0 0 0 0 0 1.0101\n"), HasSubstr("norm 1 within 1e-2"));
  EXPECT_THAT(trajectory_refusal("1 0 0 0 0 0.9899 0 0\n"), HasSubstr("norm 1 within 1e-2"));
  const Trajectory read = parsed_trajectory("1 0 0 0 0 0 0 1.0099\n").trajectory;
  EXPECT_NEAR(read.poses()[0].world_from_camera.quaternion().norm(), 1.0, 1e-15);
}

TEST(TumTrajectory, ReadsTheBenchmarksGroundTruth) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const Trajectory trajectory = read_trajectory(*data / "tum_fr1_desk/groundtruth.txt");
  EXPECT_GT(trajectory.size(), 2000U) << "recorded at 100 Hz";
  EXPECT_NEAR(trajectory.duration_s(), 23.4, 0.2);
  EXPECT_GT(trajectory.length(), 9.0);
}

// --- What other programs write -----------------------------------------------------------------------

TEST(ForeignTrajectory, KeepsTheFirstOfPosesOfOneTimeAndCountsTheOthers) {
  const Read read = parsed_trajectory(
      "1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n3 3 0 0 0 0 0 1\n3 4 0 0 0 0 0 1\n");
  ASSERT_EQ(read.trajectory.size(), 3U);
  EXPECT_EQ(read.trajectory.poses()[2].world_from_camera.translation().x(), 3.0);
  EXPECT_THAT(read.losses,
              ElementsAre(HasSubstr("a.tum: 2 of 5 poses left out, the first in line 3: "
                                    "they have the time of one before")));
}

TEST(ForeignTrajectory, IsRefusedIfMostPosesHaveTheTimeOfAnother) {
  EXPECT_THAT(trajectory_refusal("0 1 0 0 0 0 0 1\n0 2 0 0 0 0 0 1\n0 3 0 0 0 0 0 1\n"),
              HasSubstr("a.tum: 2 of 3 poses have the time of another pose"));
  // The same pose again contradicts nothing.
  EXPECT_EQ(
      parsed_trajectory("0 1 0 0 0 0 0 1\n0 1 0 0 0 0 0 1\n0 1 0 0 0 0 0 1\n").trajectory.size(),
      1U);
}

TEST(ForeignTrajectory, IsSortedByTime) {
  const Read read = parsed_trajectory("2 2 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n");
  ASSERT_EQ(read.trajectory.size(), 2U);
  EXPECT_EQ(read.trajectory.poses()[0].world_from_camera.translation().x(), 1.0);
  EXPECT_THAT(read.remarks, ElementsAre(HasSubstr("not in the order of time; sorted")));
  EXPECT_THAT(read.losses, IsEmpty());
}

TEST(ForeignTrajectory, LeavesOutAndCountsPosesWithUnknownNumbers) {
  const std::string unknown = "0 NaN NaN NaN NaN NaN NaN NaN\n";
  const Read tum =
      parsed_trajectory(unknown + "1 1 0 0 0 0 0 1\n2 -nan 0 0 0 0 0 1\n3 inf 0 0 0 0 0 1\n");
  ASSERT_EQ(tum.trajectory.size(), 1U);
  EXPECT_THAT(tum.losses, ElementsAre(HasSubstr("3 of 4 poses left out, the first in line 1: their "
                                                "numbers are unknown")));
  EXPECT_EQ(recognised_trajectory(unknown + "1 1 0 0 0 0 0 1\n"), TrajectoryFormat::kTum);
  EXPECT_EQ(recognised_trajectory(unknown), TrajectoryFormat::kTum);
  EXPECT_EQ(recognised_trajectory(unknown + "1 1 0"), TrajectoryFormat::kTum) << "cut off";
  EXPECT_THAT(trajectory_refusal(unknown), HasSubstr("no poses"));

  const Read cells = parsed_trajectory("t,x,y,z,qx,qy,qz,qw\n0.5,,,,,,,\n1.5,1,0,0,0,0,0,1\n");
  EXPECT_EQ(cells.trajectory.size(), 1U);
  EXPECT_THAT(cells.losses, ElementsAre(HasSubstr("1 of 2 poses left out")));

  // The times of the poses that are known stay theirs.
  const std::string lost = "nan nan nan nan nan nan nan nan nan nan nan nan\n";
  const Read kitti = parsed_trajectory(lost + "1 0 0 7 0 1 0 2 0 0 1 3\n");
  ASSERT_EQ(kitti.trajectory.size(), 1U);
  EXPECT_EQ(kitti.trajectory.poses()[0].timestamp_s, 1.0);
  EXPECT_THAT(kitti.losses, ElementsAre(HasSubstr("1 of 2 poses left out")));
}

TEST(ForeignTrajectory, HasTheColumnsThatItsHeaderNames) {
  for (const char* const text :
       {"timestamp,tx,ty,tz,qx,qy,qz,qw\n1.5,1,2,3,0,0,1,0\n",
        "timestamp tx ty tz qx qy qz qw\n1.5 1 2 3 0 0 1 0\n",
        "# made by hand\nnum,t,x,y,z,qx,qy,qz,qw\n7,1.5,1,2,3,0,0,1,0\n",
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
        "q_RS_z [],v_RS_R_x [m s^-1],b_w_RS_S_x [rad s^-1]\n1500000000,1,2,3,0,0,0,1,9,9\n",
        "# timestamp_ms tx ty tz qw qx qy qz\n1500 1 2 3 0 0 0 1\n",
        "%time,field.header.frame_id,field.pose.position.x,field.pose.position.y,"
        "field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,"
        "field.pose.orientation.z,field.pose.orientation.w,field.pose.covariance0\n"
        "1.5,map,1,2,3,0,0,1,0,0\n"}) {
    const Read read = parsed_trajectory(text);
    ASSERT_EQ(read.trajectory.size(), 1U) << text;
    const TimedPose& pose = read.trajectory.poses()[0];
    EXPECT_EQ(pose.timestamp_s, 1.5) << text;
    EXPECT_EQ(pose.world_from_camera.translation(), Eigen::Vector3d(1, 2, 3)) << text;
    EXPECT_NEAR(std::abs(pose.world_from_camera.quaternion().z()), 1.0, 1e-15) << text;
    EXPECT_THAT(read.remarks, IsEmpty()) << text;
    EXPECT_TRUE(recognised_trajectory(text)) << text;
  }
  EXPECT_THAT(trajectory_refusal("Zeit Ort\n1 2\n"),
              HasSubstr("a.tum:1: neither a pose nor the names"));
  EXPECT_EQ(recognised_trajectory("x,y,z\n1,2,3\n"), std::nullopt);
  EXPECT_THAT(trajectory_refusal("t,x,y,z,qx,qy,qz,qw\n1,2,3\n"),
              HasSubstr("a.tum:2: 3 fields; expected as many as there are names of columns"));
  EXPECT_THAT(trajectory_refusal("t x y z qx qy qz qw\nt x y z qx qy qz qw\n"),
              HasSubstr("a.tum:2: field 1"));
}

TEST(ForeignTrajectory, TellsHowUnnamedColumnsBetweenCommasAreRead) {
  const Read tum = parsed_trajectory("0,1,2,3,0,0,1,0\n0.5,1,2,3,0,0,1,0\n");
  EXPECT_EQ(tum.trajectory.duration_s(), 0.5);
  EXPECT_NEAR(tum.trajectory.poses()[0].world_from_camera.quaternion().z(), 1.0, 1e-15);
  EXPECT_THAT(tum.remarks, ElementsAre(HasSubstr("read as timestamp tx ty tz qx qy qz qw")));
  const Read euroc = parsed_trajectory("0,1,2,3,0,0,0,1\n500000000,1,2,3,0,0,0,1\n");
  EXPECT_EQ(euroc.trajectory.duration_s(), 0.5);
  EXPECT_NEAR(euroc.trajectory.poses()[0].world_from_camera.quaternion().z(), 1.0, 1e-15);
  EXPECT_THAT(euroc.remarks, ElementsAre(HasSubstr("nanoseconds px py pz qw qx qy qz")));
}

TEST(ForeignTrajectory, HasNanosecondsIfItsTimesAreTooLargeForSeconds) {
  const Read read = parsed_trajectory(
      "1754101837906459648.000000 0 0 0 0 0 0 1\n1754101838906459648.000000 0 0 0 0 0 0 1\n");
  EXPECT_NEAR(read.trajectory.poses()[0].timestamp_s, 1754101837.906459648, 1e-6);
  EXPECT_NEAR(read.trajectory.duration_s(), 1.0, 1e-6);
  EXPECT_THAT(read.remarks, ElementsAre(HasSubstr("read as nanoseconds")));
  EXPECT_THAT(
      parsed_trajectory("1754101837906 0 0 0 0 0 0 1\n").remarks,
      ElementsAre(AllOf(HasSubstr("1.754e+12 are read as seconds"), HasSubstr("timestamp_ms"))));
  EXPECT_THAT(parsed_trajectory("1754101837.906 0 0 0 0 0 0 1\n").remarks, IsEmpty());
  EXPECT_THAT(trajectory_refusal("# time_ms tx ty tz qx qy qz qw\n1e20 0 0 0 0 0 0 1\n"),
              HasSubstr("less than 1e17 s"))
      << "written in seconds, it would be read as nanoseconds";
}

TEST(ForeignTrajectory, OfRealUsersIsRead) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  struct Case {
    const char* file;
    std::size_t poses;
    std::size_t losses;
  };
  for (const Case& expected :
       {Case{"trajectory_duplicate_times/Cam.txt", 3719, 1},
        Case{"trajectory_duplicate_times/ihk.txt", 689, 1},
        Case{"trajectory_duplicate_times/shye.txt", 496, 1},
        Case{"trajectory_nan_header_comma_ns/comma.csv", 827, 0},
        Case{"trajectory_nan_header_comma_ns/head.csv", 827, 0},
        Case{"trajectory_nan_header_comma_ns/khash_groundtruth.txt", 3000, 0},
        Case{"trajectory_nan_header_comma_ns/mcd.csv", 827, 0},
        Case{"trajectory_nan_header_comma_ns/nan.txt", 810, 1},
        Case{"trajectory_nan_header_comma_ns/nothand_cam.txt", 3678, 0},
        Case{"trajectory_nan_header_comma_ns/unsorted.txt", 827, 0}}) {
    std::size_t losses = 0;
    const Trajectory trajectory =
        read_trajectory(*data / "cases" / expected.file,
                        [&](const Remark& remark) { losses += remark.kind == RemarkKind::kLoss; });
    EXPECT_EQ(trajectory.size(), expected.poses) << expected.file;
    EXPECT_EQ(losses, expected.losses) << expected.file;
    EXPECT_LT(trajectory.duration_s(), 600.0) << expected.file;
  }
  EXPECT_THAT(refusal_of(*data / "cases/trajectory_duplicate_times/StereoKF.txt"),
              HasSubstr("248 of 249 poses have the time of another pose"));
}

TEST(Trajectory7Scenes, IsAFileForEachPose) {
  const testing::TemporaryFolder folder;
  folder.write("frame-000012.pose.txt",
               "0\t-1\t0\t1.5\t\n1\t0\t0\t-2\t\n0\t0\t1\t3e-001\t\n0\t0\t0\t1\t\n");
  folder.write("frame-000002.pose.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  folder.write("frame-000003.pose.txt", "nan 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  testing::Remarks remarks;
  const Trajectory read = read_trajectory(folder.path(), remarks.sink());
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read.poses()[1].timestamp_s, 12.0);
  EXPECT_LT((read.poses()[1].world_from_camera * Eigen::Vector3d(1, 2, 3) -
             Eigen::Vector3d(-0.5, -1, 3.3))
                .norm(),
            1e-12);
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("1 of 3 poses left out")));
  folder.write("frame-000003.pose.txt", "1 0 0 0\n");
  EXPECT_THAT(testing::message_of(ErrorKind::kInput, [&] { read_trajectory(folder.path()); }),
              HasSubstr("frame-000003.pose.txt: 4 fields"));
  const testing::TemporaryFolder empty;
  EXPECT_THAT(testing::message_of(ErrorKind::kInput, [&] { read_trajectory(empty.path()); }),
              HasSubstr("no poses"));
}

// A point at (x, y, z) of a camera with y down is at (x, -y, z) of one with y up; so it is in the two worlds.
TEST(TrajectoryIcl, IsBroughtToCamerasWithYDown) {
  const testing::TemporaryFolder folder;
  const char* const pose = "7 0.1 0.2 0.3 0.18257419 0.36514837 0.54772256 0.73029674\n";
  folder.write("livingRoom1.gt.freiburg", pose);
  folder.write("other.txt", pose);
  testing::Remarks remarks;
  const Rigid3 down = read_trajectory(folder / "livingRoom1.gt.freiburg", remarks.sink())
                          .poses()[0]
                          .world_from_camera;
  const Rigid3 up = read_trajectory(folder / "other.txt").poses()[0].world_from_camera;
  const Eigen::DiagonalMatrix<double, 3> mirror(1.0, -1.0, 1.0);
  const Eigen::Vector3d x(0.4, -0.7, 2.0);
  EXPECT_LT((down * x - mirror * (up * (mirror * x))).norm(), 1e-12);
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("ICL-NUIM, whose y points up")));
}

}  // namespace
}  // namespace cairn
