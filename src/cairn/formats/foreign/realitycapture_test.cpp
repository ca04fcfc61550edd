// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/map_file.hpp"

#include "support/imported_maps.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kHeader = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n";

// The first bytes of images of 200 x 100 pixels.
const std::string kPng("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\xc8\0\0\0\x64", 24);
const std::string kJpeg("\xff\xd8\xff\xe0\0\4ab\xff\xc0\0\x11\x08\0\x64\0\xc8\3", 18);

class RealityCaptureTest : public testing::ImportTest {
 protected:
  // Where a camera of these angles in degrees looks, and where the top of its image points.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> axes(const std::string& angles) {
    const LandmarkMap map =
        read_bytes(kHeader + "a.jpg,1,2,3," + angles + ",36,0,0,0,0,0,0,0,0\n", "cameras.csv");
    const Eigen::Matrix3d rotation = map.world_from_camera(FrameIndex{0}).rotation();
    return {rotation.col(2), -rotation.col(1)};
  }
};

TEST_F(RealityCaptureTest, AnglesTurnACameraThatLooksDown) {
  const auto expect = [&](const std::string& angles, const Eigen::Vector3d& view,
                          const Eigen::Vector3d& top) {
    const auto [looks, up] = axes(angles);
    EXPECT_LT((looks - view).norm(), 1e-12) << angles;
    EXPECT_LT((up - top).norm(), 1e-12) << angles;
  };
  expect("0,0,0", {0, 0, -1}, {0, 1, 0});    // down, north on top
  expect("90,0,0", {0, 0, -1}, {1, 0, 0});   // down, east on top
  expect("0,90,0", {0, 1, 0}, {0, 0, 1});    // north
  expect("90,90,0", {1, 0, 0}, {0, 0, 1});   // east
  expect("0,90,90", {-1, 0, 0}, {0, 0, 1});  // roll is about the top: west
}

TEST_F(RealityCaptureTest, RowsBecomeFramesWithTheCamerasOfTheirImages) {
  folder_.write("a.png", kPng);
  folder_.write("b.jpg", kJpeg);
  const LandmarkMap map = read_bytes(kHeader +
                                         "a.png,1,2,3,0,0,0,18,0.01,-0.02,0.1,0,0,0,0,0\n"
                                         "b.jpg,4,5,6,0,0,0,18,0.01,-0.02,0.1,0,0,0,0,0\n"
                                         "b.jpg,4,5,6,0,0,0,18,0.01,-0.02,0.1,0,0,0,0.1,0\n"
                                         "c.tif,4,5,6,0,0,0,18,0,0,0,0,0,0,0,0\n",
                                     "cameras.csv");
  EXPECT_EQ(map.frame_count(), 4U);
  EXPECT_THAT(map.frames().image_names, ElementsAre("a.png", "b.jpg", "b.jpg", "c.tif"));
  EXPECT_EQ(map.frames().translations[1], Eigen::Vector3d(4, 5, 6));
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "OPENCV");
  // 18 mm are half of 36 mm: half of 200 pixels. Pixels count from the centre of the first.
  EXPECT_THAT(map.cameras()[0].parameters, ElementsAre(100, 100, 101.5, 45.5, 0.1, 0, 0, 0));
  EXPECT_THAT(map.frames().cameras,
              ElementsAre(CameraIndex{0}, CameraIndex{0}, std::nullopt, std::nullopt));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 of 4 frames have no known camera")));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 cameras are unknown to the map")));
}

TEST_F(RealityCaptureTest, PosesAloneSuffice) {
  const LandmarkMap map =
      read_bytes("#name,x,y,alt,heading,pitch,roll\na.jpg,1,2,3,10,20,30\n", "cameras.csv");
  EXPECT_EQ(map.frame_count(), 1U);
  EXPECT_TRUE(map.cameras().empty());
}

TEST_F(RealityCaptureTest, ErrorsNameTheLine) {
  EXPECT_THAT(refused("#name,x,y,alt,heading,pitch\n"), HasSubstr("input:1: "));
  EXPECT_THAT(refused("#name,x,y,alt,heading,pitch\n"), HasSubstr("there is no roll"));
  const std::string poses = "#name,x,y,alt,heading,pitch,roll\n";
  EXPECT_THAT(refused(poses + "a.jpg,1,2,3,4,5,6\nb.jpg,1,2,up,4,5,6\n"), HasSubstr("input:3: "));
  EXPECT_THAT(refused(poses + "a.jpg,1,2,3,4,5\n"), HasSubstr("input:2: "));
  EXPECT_THAT(refused(poses + "a.jpg,1,2,3,4,5,6,7\n"), HasSubstr("input:2: "));
}

}  // namespace
}  // namespace cairn::detail
