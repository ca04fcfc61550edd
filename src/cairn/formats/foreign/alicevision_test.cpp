// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/real_data.hpp"
#include "support/temporary_folder.hpp"

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

// The pose of a view on a rig is the rig's, and the camera stands at its subpose.
TEST_F(AliceVisionTest, ViewsOnARigStandAtTheirSubposes) {
  nlohmann::json json = nlohmann::json::parse(alicevision_json("pinhole", "\"\""));
  for (std::size_t i = 0; i < 2; ++i) {
    json["views"][i]["poseId"] = "7";
    json["views"][i]["rigId"] = "3";
    json["views"][i]["subPoseId"] = std::to_string(i);
    json["views"][i]["isPoseIndependant"] = "false";
  }
  const auto upright = nlohmann::json({"1", "0", "0", "0", "1", "0", "0", "0", "1"});
  const auto mount = [&](const char* status, const char* x) {
    return nlohmann::json{{"status", status},
                          {"pose", {{"rotation", upright}, {"center", {x, "0", "0"}}}}};
  };
  json["rigs"] = {
      {{"rigId", "3"}, {"subPoses", {mount("constant", "0"), mount("estimated", "0.5")}}}};
  const LandmarkMap map = read_bytes(json.dump());
  ASSERT_EQ(map.frame_count(), 2U);
  EXPECT_EQ(map.frames().translations[0], Eigen::Vector3d(1, 2, 3));
  // The rig's x is the world's -y: its rotation takes the world's x to its y.
  EXPECT_LT((map.frames().translations[1] - Eigen::Vector3d(1, 1.5, 3)).norm(), 1e-12);
  json["views"][1]["isPoseIndependant"] = true;
  EXPECT_EQ(read_bytes(json.dump()).frames().translations[1], Eigen::Vector3d(1, 2, 3));
  json["views"][1]["isPoseIndependant"] = false;
  json["rigs"][0]["subPoses"][1]["status"] = "uninitialized";
  EXPECT_EQ(read_bytes(json.dump()).frame_count(), 1U);
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 views without a pose")));
  json["views"][1]["subPoseId"] = "2";
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { read_bytes(json.dump()); }),
              HasSubstr("views/1/subPoseId: is no subpose of the rig; expected a number below 2"));
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

// A camera of 200 x 100 pixels with its principal point in the middle, and what else its JSON says.
std::string alicevision_camera(const std::string& version, const std::string& more) {
  return R"({"version": )" + version +
         R"(, "views": [], "poses": "", "intrinsics": [{"intrinsicId": "1",
    "width": "200", "height": "100", "sensorWidth": "8", "sensorHeight": "4", "focalLength": "4",
    "principalPoint": ["0", "0"], )" +
         more + "}]}";
}

TEST_F(AliceVisionTest, NewVersionsNameLensAndDistortion) {
  const auto camera = [&](const std::string& more) {
    const LandmarkMap map = read_bytes(alicevision_camera(R"(["1","2","11"])", more), "a.sfm");
    return map.cameras().empty() ? Camera{} : map.cameras()[0];
  };
  const Camera radial = camera(
      R"("type": "pinhole", "distortionType": "radialk3", "distortionParams": ["0.1","0.2","0.3"])");
  EXPECT_EQ(radial.model, "FULL_OPENCV");
  EXPECT_THAT(radial.parameters, ElementsAre(100, 100, 100, 50, 0.1, 0.2, 0, 0, 0.3, 0, 0, 0));
  const Camera fov =
      camera(R"("type": "pinhole", "distortionType": "fisheye1", "distortionParams": ["0.8"])");
  EXPECT_EQ(fov.model, "FOV");
  EXPECT_THAT(fov.parameters, ElementsAre(100, 100, 100, 50, 0.8));
  // Divided by 1 + k1 + k2 + k3: 1.25.
  const Camera normalised = camera(
      R"("type": "pinhole", "distortionType": "radialk3pt", "distortionParams": ["0.05","0.15","0.05"])");
  EXPECT_NEAR(project(normalised, {0.5, 0.0, 1.0})->u,
              100 + 100 * 0.5 * (1 + 0.05 / 4 + 0.15 / 16 + 0.05 / 64) / 1.25, 1e-9);
  // The focal length is along y, where pixels are higher than wide.
  EXPECT_THAT(
      camera(R"("type": "pinhole", "distortionType": "none", "pixelRatio": "0.8")").parameters,
      ElementsAre(125, 100, 100, 50));
  EXPECT_EQ(camera(R"("type": "pinhole", "distortionType": "none",
                      "undistortionType": "3declassicld")")
                .model,
            "");
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("its undistortion '3declassicld' is none")));
}

TEST_F(AliceVisionTest, EquidistantLensesAreScaledByTheirCircle) {
  // 8 mm / 200 pixels, so 4 mm of focal length; half the field of view is 0.5 * 4 / 4 = 0.5 radians at 60 pixels.
  const LandmarkMap map = read_bytes(
      alicevision_camera(R"(["1","2","8"])", R"("type": "equidistant", "distortionType": "radialk3",
        "distortionParams": ["0.1","0.02","0.003"], "fisheyeCircleRadius": "60")"),
      "a.sfm");
  ASSERT_EQ(map.cameras().size(), 1U);
  const double angle = 0.7;
  const double r = angle / 0.5;
  EXPECT_NEAR(
      project(map.cameras()[0], {std::sin(angle), 0.0, std::cos(angle)})->u,
      100 + 60 * r * (1 + 0.1 * std::pow(r, 2) + 0.02 * std::pow(r, 4) + 0.003 * std::pow(r, 6)),
      1e-9);
}

TEST_F(AliceVisionTest, OldVersionsCountFromTheCornerAndDivideByTheRatio) {
  const auto parameters = [&](const std::string& version) {
    return read_bytes(alicevision_camera(version, R"("type": "pinhole", "pixelRatio": "0.8")"),
                      "a.sfm")
        .cameras()[0]
        .parameters;
  };
  EXPECT_THAT(parameters(R"(["1","2","0"])"), ElementsAre(100, 125, 0, 0));
  EXPECT_THAT(parameters(R"(["1","2","4"])"), ElementsAre(100, 125, 100, 50));
  EXPECT_THAT(parameters(R"(["1","2","6"])"), ElementsAre(100, 80, 100, 50));
}

TEST_F(AliceVisionTest, EachModelComesBackFromItsWriter) {
  MapTables tables = testing::plain_tables();
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.frames.image_names = {"a.jpg", "b.jpg"};
  for (const Camera& camera : std::vector<Camera>{
           {CameraId{3}, "SIMPLE_PINHOLE", 200, 100, {150, 99, 49}},
           {CameraId{3}, "PINHOLE", 200, 100, {150, 160, 99, 49}},
           {CameraId{3}, "SIMPLE_RADIAL", 200, 100, {150, 99, 49, 0.1}},
           {CameraId{3}, "FULL_OPENCV", 200, 100, {150, 160, 99, 49, 0.1, 0.2, 0, 0, 0.3, 0, 0, 0}},
           {CameraId{3}, "FULL_OPENCV", 200, 100, {150, 160, 99, 49, 0.1, 0.2, 1, 2, 0.3, 0, 0, 0}},
           {CameraId{3}, "OPENCV_FISHEYE", 200, 100, {150, 160, 99, 49, 0.1, 0.2, 0.3, 0.4}},
           {CameraId{3}, "FOV", 200, 100, {150, 160, 99, 49, 0.8}}}) {
    SCOPED_TRACE(camera.model);
    tables.cameras = {camera};
    const LandmarkMap map{MapTables(tables)};
    testing::expect_same_model(read(write(map, "out.sfm")), map);
  }
  tables.cameras = {{CameraId{4}, "EQUIRECTANGULAR", 200, 100, {200, 100}}};
  EXPECT_THAT(testing::message_of(ErrorKind::kInput,
                                  [&] { write(LandmarkMap(MapTables(tables)), "out.sfm"); }),
              HasSubstr("camera 4: is of model EQUIRECTANGULAR, which AliceVision does not have"));
}

TEST_F(AliceVisionTest, WritingSaysWhatHasNoPlace) {
  MapTables tables = testing::full_tables();
  EXPECT_THAT(
      testing::message_of(ErrorKind::kInput,
                          [&] { write(LandmarkMap(MapTables(tables)), "out.sfm"); }),
      HasSubstr("frame 18446744073709551615: has no camera, and a view of AliceVision needs"));
  tables.frames.cameras.assign(3, CameraIndex{0});
  const LandmarkMap map{MapTables(tables)};
  const LandmarkMap back = read(write(map, "out.sfm"));
  EXPECT_EQ(back.landmark_count(), map.landmark_count());
  EXPECT_EQ(back.observations().pixels, map.observations().pixels);
  write(map, "out.sfm");
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("AliceVision has no place for: ")));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("ids of frames are too large for AliceVision")));
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

// What the file of AliceVision says of views, lens and poses; its metadata have no place in a map.
TEST(RealAliceVision, ComesBackFromItsWriter) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const std::filesystem::path file = *data / "foreign/alicevision/cameras.sfm";
  const testing::TemporaryFolder folder;
  const LandmarkMap map = all_formats().read(file);
  all_formats().write(map, folder / "out.sfm");
  testing::expect_same_model(all_formats().read(folder / "out.sfm"), map);
  const nlohmann::json original = nlohmann::json::parse(testing::read_text(file));
  const nlohmann::json written = nlohmann::json::parse(testing::read_text(folder / "out.sfm"));
  std::size_t views = 0;
  for (const nlohmann::json& view : written.at("views")) {
    for (const nlohmann::json& other : original.at("views")) {
      if (other.at("viewId") != view.at("viewId")) continue;
      ++views;
      for (const char* key : {"intrinsicId", "path", "width", "height"}) {
        EXPECT_EQ(view.at(key), other.at(key)) << key;
      }
    }
  }
  EXPECT_EQ(views, 34U);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto parameter = [&](const nlohmann::json& json) {
      const auto& text = json.at("intrinsics").at(0).at("distortionParams").at(i);
      return std::stod(text.get<std::string>());
    };
    EXPECT_EQ(parameter(written), parameter(original));
  }
  for (const char* key : {"type", "width", "height", "pixelRatio"}) {
    EXPECT_EQ(written.at("intrinsics").at(0).at(key), original.at("intrinsics").at(0).at(key))
        << key;
  }
}

}  // namespace
}  // namespace cairn::detail
