// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/full_file.hpp"
#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::refusal;

// Made by the rules of the format: no real file is at hand. The camera stands at (1, 2, 3) and looks along the
// world's -z with y up.
std::string transforms_json(const std::string& more = "", const std::string& of_frame = "") {
  return R"({"camera_model": "OPENCV", "fl_x": 150.0, "fl_y": 160.0, "cx": 100.0, "cy": 50.0, "w": 200, "h": 100)" +
         more + R"(, "frames": [{"file_path": "images/a.png")" + of_frame +
         R"(, "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]})";
}

class NerfstudioTest : public testing::ImportTest {};

TEST_F(NerfstudioTest, FramesLookAlongTheirMinusZ) {
  const LandmarkMap map = read_bytes(transforms_json(), "transforms.json");
  ASSERT_EQ(map.frame_count(), 1U);
  EXPECT_EQ(map.frames().image_names[0], "images/a.png");
  // What is 5 before the camera and 1 above it.
  const Eigen::Vector3d x =
      map.world_from_camera(FrameIndex{0}).inverse() * Eigen::Vector3d(1, 3, -2);
  EXPECT_LT((x - Eigen::Vector3d(0, -1, 5)).norm(), 1e-12);
  EXPECT_EQ(map.cameras()[0].model, "PINHOLE");
  EXPECT_THAT(map.cameras()[0].parameters, ElementsAre(150, 160, 99.5, 49.5));
  EXPECT_EQ(map.landmark_count(), 0U);
}

TEST_F(NerfstudioTest, CamerasAreOfAFrameOrOfAll) {
  EXPECT_EQ(read_bytes(transforms_json(R"(, "k1": 0.1)")).cameras()[0].model, "OPENCV");
  EXPECT_EQ(read_bytes(transforms_json(R"(, "k1": 0.1, "k3": 0.1)")).cameras()[0].model,
            "FULL_OPENCV");
  EXPECT_EQ(
      read_bytes(transforms_json("", R"(, "camera_model": "OPENCV_FISHEYE")")).cameras()[0].model,
      "OPENCV_FISHEYE");
  EXPECT_EQ(read_bytes(transforms_json("", R"(, "fl_x": 170)")).cameras()[0].parameters[0], 170);
  const LandmarkMap ngp = read_bytes(
      R"({"camera_angle_x": 1.5707963267948966, "w": 200, "h": 100, "frames": [{"file_path": "a",
          "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]})");
  EXPECT_NEAR(ngp.cameras()[0].parameters[0], 100.0, 1e-9);
}

TEST_F(NerfstudioTest, OtherModelsAreNotTakenForPerspective) {
  for (const char* model : {"PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL"}) {
    const auto of_frame = R"(, "camera_model": ")" + std::string(model) + "\"";
    EXPECT_EQ(read_bytes(transforms_json("", of_frame)).cameras()[0].model, "PINHOLE");
    EXPECT_EQ(read_bytes(transforms_json("", of_frame + R"(, "k1": 0.1)")).cameras()[0].model,
              "OPENCV");
  }
  for (const char* of_frame : {R"(, "camera_model": "FISHEYE624", "k1": 0.1)",
                               R"(, "camera_model": "EQUIRECTANGULAR")", R"(, "k4": 0.3)"}) {
    EXPECT_TRUE(read_bytes(transforms_json("", of_frame)).cameras().empty()) << of_frame;
    EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 of 1 frames have no known camera")));
  }
}

// What programs write besides nerfstudio's own fields.
TEST_F(NerfstudioTest, VariantsOfOtherProgramsAreRead) {
  // Polycam: all of a camera in each frame, 4 x 4 poses in single precision, points beside it.
  const LandmarkMap polycam = read_bytes(R"({"camera_model": "OPENCV", "ply_file_path": "none.ply",
    "orientation_override": "none", "auto_scale_poses_override": false, "frames": [
    {"fl_x": 1439.7, "fl_y": 1439.7, "cx": 957.9, "cy": 715.6, "w": 1920, "h": 1440,
     "file_path": "./images/frame_00001.jpg", "depth_file_path": "./depth/frame_00001.png",
     "transform_matrix": [[0.6, -0.8, 0, 1], [0.8, 0.6000001, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]},
    {"fl_x": 1441.2, "fl_y": 1441.2, "cx": 957.1, "cy": 715.2, "w": 1920, "h": 1440,
     "file_path": "./images/frame_00002.jpg",
     "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}]})",
                                         "transforms.json");
  EXPECT_EQ(polycam.frame_count(), 2U);
  ASSERT_EQ(polycam.cameras().size(), 2U);
  EXPECT_THAT(polycam.cameras()[1].parameters, ElementsAre(1441.2, 1441.2, 956.6, 714.7));
  // Record3D: one camera, no model, rows without the last.
  const LandmarkMap record3d =
      read_bytes(R"({"fl_x": 720.5, "fl_y": 720.5, "cx": 360.0, "cy": 480.0,
    "w": 720, "h": 960, "camera_angle_x": 0.92, "aabb_scale": 2, "integer_depth_scale": 0.001,
    "frames": [{"file_path": "images/0.jpg", "sharpness": 20.1, "depth_path": "depth/0.png",
      "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]}]})",
                 "transforms.json");
  EXPECT_THAT(record3d.cameras()[0].parameters, ElementsAre(720.5, 720.5, 359.5, 479.5));
  // nerfstudio: distortion as one list, of all frames or of one.
  const LandmarkMap listed =
      read_bytes(transforms_json(R"(, "distortion_params": [0.1, 0.2, 0, 0, 0.3, 0.4])"));
  EXPECT_EQ(listed.cameras()[0].model, "OPENCV");
  EXPECT_THAT(listed.cameras()[0].parameters,
              ElementsAre(150, 160, 99.5, 49.5, 0.1, 0.2, 0.3, 0.4));
  EXPECT_THAT(refused(transforms_json(R"(, "distortion_params": [0.1])")),
              HasSubstr("/distortion_params: has 1 entries; expected 6 numbers"));
}

TEST_F(NerfstudioTest, PointsLieInAFileBeside) {
  folder_.write(
      "sparse_pc.ply",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
      "float z\nend_header\n1 2 -7\n");
  const LandmarkMap map = read_bytes(transforms_json(R"(, "ply_file_path": "sparse_pc.ply")"));
  EXPECT_EQ(map.landmarks().positions.at(0), Eigen::Vector3d(1, 2, -7));
  EXPECT_FALSE(map.has_observations());
  EXPECT_EQ(read_bytes(transforms_json(R"(, "ply_file_path": "other.ply")")).landmark_count(), 0U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("is not there: the map has no landmarks")));
}

TEST_F(NerfstudioTest, ErrorsNameThePlace) {
  EXPECT_THAT(refused(R"({"fl_x": 1, "frames": [{"transform_matrix": [[1,0],[0,1],[0,0]]}]})"),
              HasSubstr("/frames/0/transform_matrix/0: is no row of a pose"));
  EXPECT_THAT(
      refused(R"({"fl_x": 1, "frames": [{"transform_matrix": [[2,0,0,0],[0,1,0,0],[0,0,1,0]]}]})"),
      HasSubstr("/frames/0/transform_matrix: is no rigid motion"));
  EXPECT_THAT(refused(R"({"fl_x": 1})"), HasSubstr("has no 'frames'"));
}

TEST_F(NerfstudioTest, WhatAKilledWriterLeavesIsWrittenOver) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {{CameraId{0}, "SIMPLE_PINHOLE", 200, 100, {150, 90, 50}}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.frames.image_names = {std::string(2000, 'a') + ".png", "b.png"};
  const LandmarkMap map{std::move(tables)};
  for (const char* const name : {"whole", "killed"}) {
    std::filesystem::create_directory(folder_ / name);
  }
  write(map, "whole/transforms.json");
  const auto size = std::filesystem::file_size(folder_ / "whole/sparse_pc.ply");
  testing::kill_when_a_file_exceeds(size, [&] { write(map, "killed/transforms.json"); });
  EXPECT_FALSE(std::filesystem::exists(folder_ / "killed/sparse_pc.ply"));
  write(map, "killed/transforms.json");
  for (const char* const name : {"transforms.json", "sparse_pc.ply"}) {
    EXPECT_EQ(testing::read_text(folder_ / "killed" / name),
              testing::read_text(folder_ / "whole" / name));
  }
}

TEST_F(NerfstudioTest, WhatIsWrittenIsReadBack) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {
      {CameraId{0}, "OPENCV", 200, 100, {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003}},
      {CameraId{1}, "OPENCV_FISHEYE", 200, 100, {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003}},
      {CameraId{2},
       "RAD_TAN_THIN_PRISM_FISHEYE",
       200,
       100,
       {150, 160, 90, 50, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06}},
      {CameraId{3}, "EQUIRECTANGULAR", 200, 100, {200, 100}}};
  tables.frames.ids = {FrameId{1}, FrameId{2}, FrameId{3}, FrameId{4}};
  tables.frames.translations.resize(4, Eigen::Vector3d(0.0, 0.2, 0.0));
  tables.frames.quaternions.resize(4, {1.0, 0.0, 0.0, 0.0});
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{1}, CameraIndex{2}, CameraIndex{3}};
  tables.frames.image_names = {"a.png", "b.png", "c.png", "d.png"};
  tables.frames.quaternions[1] = {0.8, 0.0, 0.6, 0.0};
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(LandmarkMap(tables), "transforms.json"); }),
              HasSubstr("camera 1: is OPENCV_FISHEYE, and camera 0 is OPENCV; expected cameras of "
                        "one model"));
  const std::vector<Camera> models = tables.cameras;
  for (const Camera& model : models) {
    SCOPED_TRACE(model.model);
    // Twice, because one camera stands for all images.
    tables.cameras.assign(2, model);
    tables.cameras[0].id = CameraId{0};
    tables.cameras[1].id = CameraId{1};
    for (std::uint32_t i = 0; i < 4; ++i) tables.frames.cameras[i] = CameraIndex{i % 2};
    const LandmarkMap map(tables);
    const std::filesystem::path folder = folder_ / model.model;
    std::filesystem::create_directory(folder);
    const std::filesystem::path path = write(map, model.model + "/transforms.json");
    EXPECT_TRUE(nlohmann::json::parse(testing::read_text(path)).contains("camera_model"));
    const LandmarkMap back = read(path);
    ASSERT_FALSE(back.cameras().empty());
    EXPECT_EQ(back.cameras()[0], map.cameras()[0]);
    EXPECT_EQ(back.frames().image_names, map.frames().image_names);
    EXPECT_EQ(back.landmarks().positions, map.landmarks().positions);
    EXPECT_TRUE(back.has_covariances());
    for (std::uint32_t i = 0; i < 4; ++i) {
      const Rigid3 pose = map.world_from_camera(FrameIndex{i});
      EXPECT_LT(pose.difference_to(back.world_from_camera(FrameIndex{i})).norm(), 1e-12);
    }
  }
}

TEST_F(NerfstudioTest, NamesThatAreNoUtf8AreRefused) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {{CameraId{0}, "PINHOLE", 200, 100, {150, 160, 90, 50}}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.frames.image_names = {"a.png", "caf\xe9.png"};
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(LandmarkMap(tables), "transforms.json"); }),
              HasSubstr("frame 2: image name 'caf\\xe9.png'; expected a name in UTF-8"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "sparse_pc.ply"));
}

TEST_F(NerfstudioTest, WritingReplacesNoPoints) {
  MapTables tables = testing::plain_tables();
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(LandmarkMap(tables), "transforms.json"); }),
              HasSubstr("frame 1: has no camera"));
  tables.cameras = {{CameraId{3}, "FOV", 200, 100, {150, 160, 90, 50, 0.1}}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(LandmarkMap(tables), "transforms.json"); }),
              HasSubstr("camera 3: is of model FOV"));
  tables.cameras[0] = {CameraId{3}, "SIMPLE_PINHOLE", 200, 100, {150, 90, 50}};
  folder_.write("sparse_pc.ply", "mine");
  EXPECT_THAT(refusal(ErrorKind::kMisuse, [&] { write(LandmarkMap(tables), "transforms.json"); }),
              HasSubstr("sparse_pc.ply: is there already"));
  EXPECT_EQ(testing::read_text(folder_ / "sparse_pc.ply"), "mine");
}

}  // namespace
}  // namespace cairn::detail
