// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
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

// OpenMVG: u = longitude/2pi * w + w/2, and v with the same scale.
TEST_F(OpenMvgTest, SphericalViewsKeepTheirLinesOfSight) {
  std::string json = openmvg_json("", R"({"key": 9, "value": {"X": [1,2,1], "observations": [
             {"key": 4, "value": {"id_feat": 3, "x": [200, 50]}}]}})");
  const std::size_t begin = json.find(R"("width": 200)");
  const std::size_t end = json.find("[99, 49]") + 8;
  json.replace(begin, end - begin, R"("value0": {"width": 200, "height": 100})");
  const LandmarkMap map = read(json);
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "EQUIRECTANGULAR");
  // The point lies exactly behind the camera, on the border of the image.
  const auto off = cairn::reprojection(map.cameras()[0], {1e-12, 0.0, -2.0},
                                       map.observed_pixels(LandmarkIndex{0})[0]);
  EXPECT_LT(off->norm(), 1e-9);
  testing::expect_same_model(this->ImportTest::read(write(map, "sfm_data.json")), map);
  json.replace(json.find("100}"), 4, "90} ");
  EXPECT_TRUE(read(json).cameras().empty());
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("a sphere that is not twice as wide as high")));
}

TEST_F(OpenMvgTest, EachModelComesBackFromItsWriter) {
  MapTables tables = testing::plain_tables();
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.frames.image_names = {"left/a.jpg", "b.jpg"};
  for (const Camera& camera : std::vector<Camera>{
           {CameraId{3}, "SIMPLE_PINHOLE", 200, 100, {150, 99, 49}},
           {CameraId{3}, "SIMPLE_RADIAL", 200, 100, {150, 99, 49, 0.1}},
           {CameraId{3}, "FULL_OPENCV", 200, 100, {150, 150, 99, 49, 0.1, 0.2, 0, 0, 0.3, 0, 0, 0}},
           {CameraId{3}, "FULL_OPENCV", 200, 100, {150, 150, 99, 49, 0.1, 0.2, 1, 2, 0.3, 0, 0, 0}},
           {CameraId{3}, "OPENCV_FISHEYE", 200, 100, {150, 150, 99, 49, 0.1, 0.2, 0.3, 0.4}},
           {CameraId{3}, "EQUIRECTANGULAR", 200, 100, {200, 100}}}) {
    SCOPED_TRACE(camera.model);
    tables.cameras = {camera};
    const LandmarkMap map{MapTables(tables)};
    testing::expect_same_model(this->ImportTest::read(write(map, "sfm_data.json")), map);
  }
  const auto refusal_of = [&](const Camera& camera) {
    tables.cameras = {camera};
    return testing::message_of(ErrorKind::kInput,
                               [&] { write(LandmarkMap(MapTables(tables)), "sfm_data.json"); });
  };
  EXPECT_THAT(refusal_of({CameraId{4}, "FOV", 200, 100, {150, 150, 99, 49, 0.5}}),
              HasSubstr("camera 4: is of model FOV, which OpenMVG does not have"));
  EXPECT_THAT(refusal_of({CameraId{4}, "PINHOLE", 200, 100, {150, 151, 99, 49}}),
              HasSubstr("camera 4: has focal lengths 150 and 151, and OpenMVG has one"));
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

// Equal as JSON, where numbers may differ by 1e-12.
void expect_same_json(const nlohmann::json& a, const nlohmann::json& b, const std::string& place) {
  if (a.is_number_float() && b.is_number()) {
    EXPECT_NEAR(a.get<double>(), b.get<double>(), 1e-12) << place;
    return;
  }
  if (!a.is_structured()) {
    EXPECT_EQ(a, b) << place;
    return;
  }
  ASSERT_EQ(a.size(), b.size()) << place;
  for (const auto& [key, value] : a.items()) {
    const nlohmann::json* const other = a.is_array()      ? &b[std::stoul(key)]
                                        : b.contains(key) ? &b[key]
                                                          : nullptr;
    ASSERT_NE(other, nullptr) << place << '/' << key;
    expect_same_json(value, *other, place + '/' + key);
  }
}

// The file that OpenMVG wrote, key by key: its library's marks of types and pointers too.
TEST(RealOpenMvg, ComesBackFromItsWriter) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const std::filesystem::path file = *data / "foreign/openmvg/sfm_data.json";
  const testing::TemporaryFolder folder;
  all_formats().write(all_formats().read(file), folder / "sfm_data.json");
  nlohmann::json original = nlohmann::json::parse(testing::read_text(file));
  original["root_path"] = "";
  expect_same_json(original, nlohmann::json::parse(testing::read_text(folder / "sfm_data.json")),
                   "");
}

}  // namespace
}  // namespace cairn::detail
