// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/imported_maps.hpp"
#include "support/real_data.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A camera turned by 90 degrees about z, column by column; 8 mm of sensor for 200 pixels.
std::string alicevision_json(const std::string& type, const std::string& distortion,
                             const std::string& structure = "[]") {
  return R"({"version": ["1", "2", "6"], "views": [
    {"viewId": "4", "poseId": "7", "intrinsicId": "1", "path": "a.jpg", "width": "200", "height": "100"},
    {"viewId": "5", "poseId": "8", "intrinsicId": "1", "path": "b.jpg", "width": "200", "height": "100"}],
   "intrinsics": [{"intrinsicId": "1", "width": "200", "height": "100", "sensorWidth": "8", "focalLength": "4",
     "type": ")" +
         type + R"(", "principalPoint": ["-1", "2"], "distortionParams": )" + distortion + R"(}],
   "poses": [{"poseId": "7", "pose": {"transform": {"rotation": ["0","1","0","-1","0","0","0","0","1"],
     "center": ["1", "2", "3"]}}}],
   "structure": )" +
         structure + "}";
}

class AliceVisionTest : public testing::ImportTest {};

TEST_F(AliceVisionTest, ViewsWithAPoseBecomeFrames) {
  const LandmarkMap map =
      read_bytes(alicevision_json("radial3", R"(["0.1","0.2","0.3"])", R"([{"landmarkId": "9",
     "color": ["1","2","3"], "X": ["1","2","13"], "observations": [
       {"observationId": "4", "featureId": "3", "x": ["99", "52"]},
       {"observationId": "5", "featureId": "3", "x": ["1", "2"]}]}])"));
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{4}));
  EXPECT_EQ(map.frames().translations[0], Eigen::Vector3d(1, 2, 3));
  // camera_from_world takes the world's x to the camera's y.
  const Eigen::Vector3d x =
      map.world_from_camera(FrameIndex{0}).inverse() * Eigen::Vector3d(2, 2, 3);
  EXPECT_LT((x - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "FULL_OPENCV");
  EXPECT_THAT(map.cameras()[0].parameters,
              ElementsAre(100, 100, 99, 52, 0.1, 0.2, 0, 0, 0.3, 0, 0, 0));
  EXPECT_EQ(map.landmarks().colors[0], (Color{1, 2, 3}));
  EXPECT_EQ(map.observation_count(), 1U);
  EXPECT_LT(testing::reprojection(map).worst, 1e-9);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 views without a pose")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 observations by views without a pose")));
}

TEST_F(AliceVisionTest, EachTypeHasItsModel) {
  EXPECT_EQ(read_bytes(alicevision_json("pinhole", "\"\"")).cameras()[0].model, "SIMPLE_PINHOLE");
  EXPECT_EQ(read_bytes(alicevision_json("radial1", R"(["0.1"])")).cameras()[0].model,
            "SIMPLE_RADIAL");
  EXPECT_EQ(read_bytes(alicevision_json("fisheye4", R"([0.1,0,0,0])")).cameras()[0].model,
            "OPENCV_FISHEYE");
  EXPECT_THAT(
      read_bytes(alicevision_json("brown", R"([0.1,0.2,0.3,0.4,0.5])")).cameras()[0].parameters,
      ElementsAre(100, 100, 99, 52, 0.1, 0.2, 0.4, 0.5, 0.3, 0, 0, 0));
  EXPECT_TRUE(read_bytes(alicevision_json("3deanamorphic4", R"([0.1])")).cameras().empty());
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("camera 1 is unknown to the map: its type '3deanamorphic4'")));
}

TEST_F(AliceVisionTest, ErrorsNameThePlace) {
  EXPECT_THAT(refused(alicevision_json("radial1", R"(["x"])")),
              HasSubstr("/intrinsics/0/distortionParams/0: 'x' is not a number"));
  EXPECT_THAT(refused(alicevision_json("pinhole", "[]", R"([{"landmarkId": "-1", "X": [1,2,3]}])")),
              HasSubstr("/structure/0/landmarkId: '-1' is no whole number"));
  EXPECT_THAT(refused(alicevision_json("pinhole", "[]", R"([{"landmarkId": "1", "X": [1,2]}])")),
              HasSubstr("/structure/0/X: has 2 entries"));
  const std::string whole = alicevision_json("pinhole", "[]");
  for (std::size_t size = whole.size() / 2; size < whole.size(); size += 3) {
    EXPECT_THAT(refused(whole.substr(0, size)), HasSubstr("is not JSON")) << size;
  }
}

TEST(RealAliceVision, CamerasLookAtOneObject) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/alicevision/cameras.sfm");
  ASSERT_EQ(map.frame_count(), 34U);
  EXPECT_EQ(map.cameras().size(), 1U);
  EXPECT_NEAR(map.cameras()[0].parameters[0], 4000.0 * 5.678361 / 8.126599, 1e-2);
  // The point nearest to all optical axes lies before every camera.
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::uint32_t i = 0; i < 34; ++i) {
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    const Eigen::Vector3d axis = pose.rotation().col(2);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    a += across;
    b += across * pose.translation();
  }
  const Eigen::Vector3d object = a.inverse() * b;
  for (std::uint32_t i = 0; i < 34; ++i) {
    EXPECT_GT((map.world_from_camera(FrameIndex{i}).inverse() * object).z(), 0.0);
  }
}

}  // namespace
}  // namespace cairn::detail
