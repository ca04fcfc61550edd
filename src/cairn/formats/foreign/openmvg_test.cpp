// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/imported_maps.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string openmvg_json(const std::string& intrinsics, const std::string& structure) {
  return R"({"sfm_data_version": "0.3", "views": [
    {"key": 0, "value": {"ptr_wrapper": {"data": {"filename": "a.jpg", "id_view": 4, "id_intrinsic": 1, "id_pose": 7}}}},
    {"key": 1, "value": {"ptr_wrapper": {"data": {"filename": "b.jpg", "id_view": 5, "id_intrinsic": 1, "id_pose": 4294967295}}}}],
   "intrinsics": [{"key": 1, "value": {"ptr_wrapper": {"data": {"width": 200, "height": 100,
     "focal_length": 100, "principal_point": [99, 49])" +
         intrinsics + R"(}}}}],
   "extrinsics": [{"key": 7, "value": {"rotation": [[0,-1,0],[1,0,0],[0,0,1]], "center": [1,2,3]}}],
   "structure": [)" +
         structure + R"(], "control_points": []})";
}

class OpenMvgTest : public testing::ImportTest {
 protected:
  LandmarkMap read(const std::string& text) { return read_bytes(text, "scene.json"); }
  std::string refused(const std::string& text) { return ImportTest::refused(text, "scene.json"); }
};

TEST_F(OpenMvgTest, ViewsWithAPoseBecomeFrames) {
  const LandmarkMap map =
      read(openmvg_json("", R"({"key": 9, "value": {"X": [1,2,13], "observations": [
             {"key": 4, "value": {"id_feat": 3, "x": [99, 49]}},
             {"key": 5, "value": {"id_feat": 3, "x": [1, 2]}}]}})"));
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{4}));
  EXPECT_THAT(map.frames().image_names, ElementsAre("a.jpg"));
  EXPECT_EQ(map.frames().translations[0], Eigen::Vector3d(1, 2, 3));
  // The rotation is camera_from_world: the world's x is the camera's y.
  const Eigen::Vector3d x =
      map.world_from_camera(FrameIndex{0}).inverse() * Eigen::Vector3d(2, 2, 3);
  EXPECT_LT((x - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
  EXPECT_EQ(map.cameras()[0].model, "SIMPLE_PINHOLE");
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{9}));
  ASSERT_EQ(map.observation_count(), 1U);
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{0})[0], (Pixel{99, 49}));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 views without a pose are left out")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 observations by views without a pose")));
}

TEST_F(OpenMvgTest, DistortionNamesTheModel) {
  const auto camera = [&](const std::string& distortion) {
    return read(openmvg_json(distortion, "")).cameras().front();
  };
  EXPECT_EQ(camera(R"(, "disto_k1": [0.1])").model, "SIMPLE_RADIAL");
  EXPECT_THAT(camera(R"(, "disto_k3": [0.1, 0.2, 0.3])").parameters,
              ElementsAre(100, 100, 99, 49, 0.1, 0.2, 0, 0, 0.3, 0, 0, 0));
  EXPECT_THAT(camera(R"(, "disto_t2": [0.1, 0.2, 0.3, 0.4, 0.5])").parameters,
              ElementsAre(100, 100, 99, 49, 0.1, 0.2, 0.4, 0.5, 0.3, 0, 0, 0));
  EXPECT_EQ(camera(R"(, "fisheye": [0.1, 0.2, 0.3, 0.4])").model, "OPENCV_FISHEYE");
}

TEST_F(OpenMvgTest, ErrorsSayWhere) {
  EXPECT_THAT(refused(openmvg_json(R"(, "disto_k3": [0.1])", "")),
              HasSubstr("scene.json: /intrinsics/0/value/ptr_wrapper/data/disto_k3: has 1 entries; "
                        "expected 3 numbers"));
  EXPECT_THAT(refused(openmvg_json("", R"({"key": 9, "value": {"X": [1,2], "observations": []}})")),
              HasSubstr("/structure/0/value/X: has 2 entries"));
  EXPECT_THAT(refused(openmvg_json("", R"({"key": 9, "value": {"X": [1,2,3]}})")),
              HasSubstr("/structure/0/value: has no 'observations'"));
  const std::string whole = openmvg_json("", "");
  for (std::size_t size = whole.size() / 2; size < whole.size(); ++size) {
    EXPECT_THAT(refused(whole.substr(0, size)), HasSubstr("is not JSON")) << size;
  }
}

TEST(RealOpenMvg, ReprojectsOntoItsObservations) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/openmvg/sfm_data.json");
  EXPECT_EQ(map.frame_count(), 4U);
  EXPECT_EQ(map.landmark_count(), 365U);
  const testing::Reprojection errors = testing::reprojection(map);
  ASSERT_GT(errors.count, 700U);
  EXPECT_LT(errors.median, 1.0);
}

}  // namespace
}  // namespace cairn::detail
