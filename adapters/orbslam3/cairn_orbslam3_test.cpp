// SPDX-License-Identifier: BSD-3-Clause
#include "adapters/orbslam3/cairn_orbslam3.hpp"

#include <array>
#include <map>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;

// Stand-ins with the accessors that the header calls, named as in ORB-SLAM3.
// NOLINTBEGIN(readability-identifier-naming)
struct Pose {
  Eigen::Quaternionf q = Eigen::Quaternionf::Identity();
  Eigen::Vector3f t = Eigen::Vector3f::Zero();
  Eigen::Vector3f translation() const { return t; }
  Eigen::Quaternionf unit_quaternion() const { return q; }
};
struct Keypoint {
  struct {
    float x, y;
  } pt;
  int octave;
};
struct Descriptors {
  int cols = 32;
  std::vector<std::array<unsigned char, 32>> rows;
  const unsigned char* ptr(int row) const { return rows[static_cast<std::size_t>(row)].data(); }
};
struct Keyframe {
  unsigned long mnId = 0;
  double mTimeStamp = 0.0;
  float fx = 500.0F, fy = 501.0F, cx = 320.0F, cy = 240.0F;
  bool bad = false;
  Pose pose;
  std::vector<Keypoint> mvKeysUn;
  Descriptors mDescriptors;
  bool isBad() const { return bad; }
  Pose GetPoseInverse() const { return pose; }
};
struct MapPoint {
  unsigned long mnId = 0;
  bool bad = false;
  Eigen::Vector3f x = Eigen::Vector3f::Zero();
  std::map<Keyframe*, std::tuple<int, int>> observations;
  Descriptors descriptor = {32, {{}}};
  bool isBad() const { return bad; }
  Eigen::Vector3f GetWorldPos() const { return x; }
  std::map<Keyframe*, std::tuple<int, int>> GetObservations() const { return observations; }
  Descriptors GetDescriptor() const { return descriptor; }
};
struct StandIn {
  std::vector<Keyframe*> keyframes;
  std::vector<MapPoint*> points;
  std::vector<Keyframe*> GetAllKeyFrames() const { return keyframes; }
  std::vector<MapPoint*> GetAllMapPoints() const { return points; }
};
// NOLINTEND(readability-identifier-naming)

TEST(OrbSlam3, AMapIsWrittenAsCairnReadsIt) {
  Keyframe first;
  first.mnId = 4;
  first.mTimeStamp = 1305031102.175304;
  first.pose.t = {1.0F, 2.0F, 3.0F};
  first.mvKeysUn = {{{10.5F, 20.25F}, 2}, {{30.0F, 40.0F}, 0}};
  Keyframe second;
  second.mnId = 9;
  second.pose.q = Eigen::Quaternionf(0.8F, 0.0F, 0.6F, 0.0F);
  second.mvKeysUn = {{{50.0F, 60.0F}, 5}};
  Keyframe bad;
  bad.mnId = 11;
  bad.bad = true;
  bad.mvKeysUn = second.mvKeysUn;
  bad.mDescriptors.rows = {{9, 9, 9}};
  MapPoint point;
  point.mnId = 7;
  point.x = {0.5F, -0.25F, 4.0F};
  point.observations = {{&second, {0, -1}}, {&first, {1, -1}}, {&bad, {0, -1}}};
  point.descriptor.rows[0][31] = 0xab;
  first.mDescriptors.rows = {{1, 2, 3}, {4, 5, 6}};
  second.mDescriptors.rows = {{0xff, 0xff, 0xff}};
  MapPoint gone = point;
  gone.mnId = 8;
  gone.bad = true;
  StandIn map{{&first, &second, &bad}, {&point, nullptr, &gone}};

  std::ostringstream out;
  write_orbslam3_map(map, {640, 480}, true, out);
  const std::string text = out.str();
  MemoryReader source(text, "orbslam3.map");
  const LandmarkMap read = read_native(source);
  EXPECT_EQ(read.info().length_unit, LengthUnit::kFree);
  EXPECT_THAT(read.frames().ids, ElementsAre(FrameId{4}, FrameId{9}));
  EXPECT_EQ(read.frames().timestamps_s[0], 1305031102.175304);
  EXPECT_EQ(read.frames().translations[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(read.frames().quaternions[1][2], 0.6, 1e-6);
  ASSERT_EQ(read.cameras().size(), 1U);
  EXPECT_THAT(read.cameras()[0].parameters, ElementsAre(500, 501, 320, 240));
  EXPECT_THAT(read.landmarks().ids, ElementsAre(LandmarkId{7}));
  EXPECT_EQ(read.landmarks().positions[0], Eigen::Vector3d(0.5, -0.25, 4));
  EXPECT_THAT(read.observing_frames(LandmarkIndex{0}), ElementsAre(FrameIndex{0}, FrameIndex{1}));
  EXPECT_EQ(read.observed_pixels(LandmarkIndex{0})[0], (Pixel{30, 40}));
  EXPECT_THAT(read.observations().keypoints, ElementsAre(1U, 0U));
  EXPECT_THAT(read.observations().octaves, ElementsAre(0, 5));
  const DescriptorColumn& column = *read.landmarks().descriptors;
  EXPECT_EQ(column.bytes[31], 0xab);
  // Of the keyframes that are not bad, the one that differs most first.
  ASSERT_EQ(column.count(0), 3U);
  EXPECT_EQ(column.descriptor(0, 1)[0], 0xff);
  EXPECT_EQ(column.descriptor(0, 2)[0], 4);
  std::ostringstream again;
  write_orbslam3_map(map, {640, 480}, false, again);
  EXPECT_NE(again.str().find("META length_unit metres"), std::string::npos);
}

}  // namespace
}  // namespace cairn
