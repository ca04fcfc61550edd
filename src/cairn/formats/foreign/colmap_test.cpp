// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/command.hpp"
#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/rig_maps.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::refusal;
using testing::reprojection;
using testing::TemporaryFolder;

// One camera, two images turned and shifted, two points: (1, 2, 10) is at pixel (100.5, 50.5) + ... of
// image 7, which stands at the origin.
constexpr std::string_view kCameras = "# comment\n3 PINHOLE 200 100 100 100 100 50\n";
constexpr std::string_view kImages =
    "# comment\n"
    "9 0.7071067811865476 0 0 0.7071067811865476 1 2 3 3 a b.png\n"
    "\n"
    "7 1 0 0 0 0 0 0 3 c.png\n"
    "110.5 70.5 4 5.5 6.5 -1 90 50 2\n";
constexpr std::string_view kPoints =
    "4 1 2 10 255 128 0 0.25 7 0\n"
    "2 -1 0 10 1 2 3 -1 7 2\n";

class ColmapTest : public testing::ImportTest {
 protected:
  void write_text(std::string_view cameras = kCameras, std::string_view images = kImages,
                  std::string_view points = kPoints) const {
    folder_.write("cameras.txt", cameras);
    folder_.write("images.txt", images);
    folder_.write("points3D.txt", points);
  }
  // A stereo rig: camera 4 is a unit to the right of camera 3 and turned by a half turn about z.
  void write_rig(std::string_view rigs = kRigs, std::string_view frames = kFrames) const {
    write_text(kStereoCameras, kStereoImages, "4 1 2 10 255 128 0 0.25 7 0\n");
    folder_.write("rigs.txt", rigs);
    folder_.write("frames.txt", frames);
  }
  static constexpr std::string_view kStereoCameras =
      "3 PINHOLE 200 100 100 100 100 50\n4 PINHOLE 200 100 100 100 100 50\n";
  static constexpr std::string_view kStereoImages =
      "7 1 0 0 0 0 0 0 3 l.png\n110.5 70.5 4\n9 0 0 0 1 1 0 0 4 r.png\n\n";
  static constexpr std::string_view kRigs = "# comment\n5 2 CAMERA 3 CAMERA 4 1 0 0 0 1 1 0 0\n";
  static constexpr std::string_view kFrames =
      "# comment\n8 5 1 0 0 0 0 0 0 2 CAMERA 3 7 CAMERA 4 9\n";
  using ImportTest::read;
  LandmarkMap read() { return read(folder_.path()); }
  std::string refused() {
    return refusal(ErrorKind::kInput, [&] { read(); });
  }
};

TEST_F(ColmapTest, ImagesBecomeFramesAndPointsLandmarks) {
  write_text();
  const LandmarkMap map = read();
  EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{7}, FrameId{9}));
  EXPECT_THAT(map.frames().image_names, ElementsAre("c.png", "a b.png"));
  // Image 9: x_cam = Rz(90°) x + (1, 2, 3), so its centre is -Rz(-90°) (1, 2, 3) = (-2, 1, -3).
  EXPECT_LT((map.frames().translations[1] - Eigen::Vector3d(-2, 1, -3)).norm(), 1e-12);
  const Rigid3 pose = map.world_from_camera(FrameIndex{1});
  EXPECT_LT((pose * Eigen::Vector3d(1, 2, 3)).norm(), 1e-12) << "the origin of the world";
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].id, CameraId{3});
  EXPECT_THAT(map.cameras()[0].parameters, ElementsAre(100, 100, 99.5, 49.5));
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{2}, LandmarkId{4}));
  EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(1, 2, 10));
  EXPECT_EQ(map.landmarks().colors[1], (Color{255, 128, 0}));
  EXPECT_TRUE(std::isnan(map.column("reprojection_error")->values[0])) << "-1 is unknown";
  EXPECT_EQ(map.column("reprojection_error")->values[1], 0.25);
  ASSERT_EQ(map.observation_count(), 2U);
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{1})[0], (Pixel{110, 70}));
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{0})[0], (Pixel{89.5, 49.5}));
  EXPECT_EQ(map.observations().keypoints[0], 2U);
  // What the file says is what the camera sees.
  const auto seen = project(map.cameras()[0], map.landmarks().positions[1]);
  EXPECT_NEAR(seen->u, 109.5, 1e-12);
  EXPECT_THAT(remarks_.texts, ElementsAre(HasSubstr("1 of 3 keypoints belong to no 3D point")));
}

TEST_F(ColmapTest, AModelIsNamedByItsFolderOrAnyOfItsFiles) {
  write_text();
  const LandmarkMap map = read();
  for (const char* name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    EXPECT_EQ(testing::map_difference(all_formats().read(folder_ / name), map), "") << name;
  }
  const TemporaryFolder elsewhere;
  elsewhere.write("images.txt", "FRAME 1 0 0 0 1 0 0 0\n");
  EXPECT_EQ(all_formats().read(elsewhere / "images.txt").frame_count(), 1U) << "a map of our own";
}

TEST_F(ColmapTest, BothFormsComeBackAsTheyWere) {
  const LandmarkMap map = synthetic_map({.seed = 4, .landmarks = 200, .frames = 12});
  for (const char* form : {"colmap", "colmap-text"}) {
    SCOPED_TRACE(form);
    std::vector<std::string> remarks;
    const fs::path path = folder_ / form;
    all_formats().write(map, path, {.format = form},
                        {.log = [&](std::string_view text) { remarks.emplace_back(text); }});
    const LandmarkMap back = all_formats().read(path);
    ASSERT_EQ(back.frame_count(), map.frame_count());
    ASSERT_EQ(back.landmark_count(), map.landmark_count());
    ASSERT_EQ(back.observation_count(), map.observation_count());
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      const Rigid3 difference =
          back.world_from_camera(FrameIndex{i}).inverse() * map.world_from_camera(FrameIndex{i});
      EXPECT_LT((difference.matrix() - Matrix4d::Identity()).norm(), 1e-12);
    }
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      const LandmarkIndex landmark{i};
      EXPECT_EQ(back.landmarks().positions[i], map.landmarks().positions[i]);
      ASSERT_EQ(back.observation_count(landmark), map.observation_count(landmark));
      for (std::size_t j = 0; j < map.observation_count(landmark); ++j) {
        EXPECT_EQ(back.observing_frames(landmark)[j], map.observing_frames(landmark)[j]);
        EXPECT_NEAR(back.observed_pixels(landmark)[j].u, map.observed_pixels(landmark)[j].u, 1e-12);
        EXPECT_NEAR(back.observed_pixels(landmark)[j].v, map.observed_pixels(landmark)[j].v, 1e-12);
      }
    }
    EXPECT_THAT(remarks, Contains(HasSubstr("COLMAP has no place for: unit of length (metres)")));
  }
  EXPECT_EQ(testing::map_difference(all_formats().read(folder_ / "colmap"),
                                    all_formats().read(folder_ / "colmap-text")),
            "");
}

TEST_F(ColmapTest, WritesIntoNewOrEmptyFoldersOnly) {
  write_text();
  const LandmarkMap map = read();
  fs::create_directory(folder_ / "empty");
  all_formats().write(map, fs::path((folder_ / "empty").string() + "/"));
  EXPECT_EQ(all_formats().read(folder_ / "empty").landmark_count(), 2U);
  const std::string before = testing::read_text(folder_ / "points3D.txt");
  EXPECT_THAT(refusal(ErrorKind::kMisuse,
                      [&] { all_formats().write(map, folder_.path(), {.format = "colmap"}); }),
              HasSubstr("the folder is not empty; expected a new or an empty folder"));
  EXPECT_EQ(testing::read_text(folder_ / "points3D.txt"), before);
  EXPECT_THAT(
      refusal(ErrorKind::kStorage,
              [&] { all_formats().write(map, folder_ / "no/where", {.format = "colmap"}); }),
      HasSubstr("no/where"));
}

TEST_F(ColmapTest, FramesWithoutCamerasAreNotWritten) {
  const LandmarkMap map = testing::plain_map();
  EXPECT_THAT(refusal(ErrorKind::kInput,
                      [&] { all_formats().write(map, folder_ / "out", {.format = "colmap"}); }),
              HasSubstr("has no camera, and an image of COLMAP needs one"));
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(ColmapTest, OneNameOfTwoImagesIsNotWritten) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {{CameraId{0}, "PINHOLE", 640, 480, {500, 500, 320, 240}}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.frames.image_names = {"a.jpg", "a.jpg"};
  const LandmarkMap map(std::move(tables));
  for (const char* name : {"model/", "transforms.json", "reconstruction.json"}) {
    EXPECT_THAT(refusal(ErrorKind::kInput, [&] { all_formats().write(map, folder_ / name); }),
                HasSubstr("frame 2: image name 'a.jpg' is that of frame 1 too"))
        << name;
    EXPECT_FALSE(fs::exists(folder_ / name));
  }
}

// As RealityCapture, Metashape and scripts for ARKit write models.
TEST_F(ColmapTest, ObservationsAreUnknownIfNoPointHasATrack) {
  write_text();
  folder_.write("images.txt", "1 1 0 0 0 0 0 0 3 a.jpg\n\n");
  folder_.write("points3D.txt", "2 1 2 3 0 0 0 0.5\n1 1 2 4 0 0 0 0.5\n");
  const LandmarkMap map = read();
  EXPECT_EQ(map.landmark_count(), 2U);
  EXPECT_EQ(map.frame_count(), 1U);
  EXPECT_FALSE(map.has_observations());
  EXPECT_THAT(remarks_.texts, ElementsAre(HasSubstr("no point has a track")));
  write_colmap(map, folder_ / "model", ColmapForm::kBinary);
  EXPECT_FALSE(all_formats().read(folder_ / "model").has_observations());
}

TEST_F(ColmapTest, MissingImagesLeaveThePoints) {
  write_text();
  fs::remove(folder_ / "images.txt");
  const LandmarkMap map = read();
  EXPECT_EQ(map.frame_count(), 0U);
  EXPECT_EQ(map.landmark_count(), 2U);
  EXPECT_FALSE(map.has_observations());
  EXPECT_THAT(remarks_.texts, ElementsAre(HasSubstr("there is no file of images")));
}

TEST_F(ColmapTest, MissingCamerasLeaveThePoses) {
  write_text();
  fs::remove(folder_ / "cameras.txt");
  const LandmarkMap map = read();
  EXPECT_EQ(map.frame_count(), 2U);
  EXPECT_EQ(map.observation_count(), 2U);
  EXPECT_TRUE(map.frames().cameras.empty());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("there is no file of cameras")));
}

TEST_F(ColmapTest, CamerasThatCairnCannotProjectWithAreUnknown) {
  write_text("3 DOUBLE_SPHERE 200 100 100 100 100 50 0.5 1\n");
  EXPECT_TRUE(read().frames().cameras.empty());
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("camera 3 is unknown to the map: camera model 'DOUBLE_SPHERE'")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("2 of 2 frames have no known camera")));
}

TEST_F(ColmapTest, RigsSayWhichImagesAreOfOneInstantAndPose) {
  write_rig();
  const LandmarkMap map = read();
  EXPECT_THAT(map.rigs(), ElementsAre(Rig{RigId{5},
                                          {{CameraIndex{0}, {1, 0, 0, 0}, {0, 0, 0}},
                                           {CameraIndex{1}, {0, 0, 0, 1}, {1, 0, 0}}}}));
  EXPECT_THAT(map.frames().instants, ElementsAre(InstantId{8}, InstantId{8}));
  EXPECT_EQ(map.frames().translations[1], Eigen::Vector3d(1, 0, 0));
  EXPECT_THAT(remarks_.texts, IsEmpty());
}

template <class... Numbers>
std::string raw_bytes(Numbers... numbers) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&numbers), sizeof numbers), ...);
  return bytes;
}

// By COLMAP's own description of its files.
TEST_F(ColmapTest, RigsAreWrittenAsTheyWereRead) {
  write_rig();
  const LandmarkMap map = read();
  write(map, "model", {.format = "colmap"});
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("has rigs, which COLMAP reads from 3.12 on")));
  const auto u32 = [](std::uint32_t number) { return number; };
  EXPECT_EQ(testing::read_text(folder_ / "model/rigs.bin"),
            raw_bytes(std::uint64_t{1}, u32(5), u32(2), 0, u32(3), 0, u32(4), std::uint8_t{1}, 0.0,
                      0.0, 0.0, 1.0, 1.0, 0.0, 0.0));
  const std::string frames = testing::read_text(folder_ / "model/frames.bin");
  EXPECT_EQ(frames.substr(0, 16), raw_bytes(std::uint64_t{1}, u32(8), u32(5)));
  EXPECT_EQ(frames.substr(72),
            raw_bytes(u32(2), 0, u32(3), std::uint64_t{7}, 0, u32(4), std::uint64_t{9}));
  for (int i = 0; i < 7; ++i) {
    double part = 0.0;
    std::memcpy(&part, frames.data() + 16 + 8 * i, sizeof part);
    EXPECT_NEAR(part, i == 0 ? 1.0 : 0.0, 1e-15);
  }
  const LandmarkMap binary = read(folder_ / "model");
  EXPECT_THAT(remarks_.texts, IsEmpty());
  write(map, "text", {.format = "colmap-text"});
  EXPECT_THAT(read(folder_ / "text"), testing::EqualsMap(binary));
  EXPECT_THAT(binary.rigs(), ElementsAreArray(map.rigs()));
  EXPECT_EQ(binary.frames().instants, map.frames().instants);
}

TEST_F(ColmapTest, AMovedRigIsWrittenWhereItsImagesAre) {
  const LandmarkMap map =
      transformed(testing::rig_map(),
                  Similarity3(2.5, Rigid3::from_roll_pitch_yaw({5.0, 6.0, 7.0}, 0.1, 0.2, 0.3)));
  const LandmarkMap back = read(write(map, "model/"));
  // Frames state the poses of rigs beside those of images: the reader compares them.
  EXPECT_THAT(remarks_.texts, IsEmpty());
  EXPECT_LT(testing::off_rig(back), 1e-12);
  ASSERT_EQ(back.frame_count(), map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    EXPECT_LT((back.world_from_camera(FrameIndex{i}).matrix() -
               map.world_from_camera(FrameIndex{i}).matrix())
                  .norm(),
              1e-12);
  }
  // COLMAP has each image in a frame and each camera in a rig.
  EXPECT_EQ(back.rigs().size(), 2U);
  EXPECT_EQ(back.rigs()[1].mounts, (std::vector<Rig::Mount>{{.camera = CameraIndex{2}}}));
  EXPECT_TRUE(back.frames().instants.back().has_value());
  MapTables tables = LandmarkMap(back).tables();
  tables.rigs.pop_back();
  tables.frames.instants.back().reset();
  EXPECT_THAT(tables.rigs, ElementsAreArray(map.rigs()));
  EXPECT_EQ(tables.frames.instants, map.frames().instants);
}

TEST_F(ColmapTest, RigsWithoutAReferenceCameraAreReferredToTheirFirst) {
  write_rig("5 3 IMU 1 CAMERA 3 1 0 1 0 0 0 0 -2 CAMERA 4 1 0 0 1 0 1 0 -2\n",
            "8 5 0 -1 0 0 0 0 -2 3 CAMERA 3 7 CAMERA 4 9 IMU 1 4\n");
  const LandmarkMap map = read();
  EXPECT_THAT(remarks_.losses, ElementsAre(HasSubstr("1 sensors of rigs are left out"),
                                           HasSubstr("1 data of rigs are left out")));
  EXPECT_EQ(remarks_.texts, remarks_.losses) << "the images are where the rig has them";
  EXPECT_LT(testing::off_rig(map), 1e-15);
  const LandmarkMap back = read(write(map, "model/"));
  EXPECT_THAT(remarks_.texts, IsEmpty());
  EXPECT_EQ(back.rigs()[0].mounts[0], Rig::Mount{.camera = CameraIndex{0}});
  EXPECT_LT(testing::off_rig(back), 1e-15);
}

TEST_F(ColmapTest, ImagesThatAreNotWhereTheirRigIsAreMentioned) {
  write_rig("5 2 CAMERA 3 CAMERA 4 1 0 0 0 1 1.25 0 0\n");
  const LandmarkMap map = read();
  EXPECT_THAT(remarks_.texts, ElementsAre(HasSubstr("1 of 2 images of rigs are not where their rig "
                                                    "has them, up to 0.25 away")));
  EXPECT_EQ(map.frames().translations[1], Eigen::Vector3d(1, 0, 0));
  // COLMAP reads the poses of the rigs, so such an image gets a frame of its own.
  const LandmarkMap back = read(write(map, "model/"));
  EXPECT_THAT(remarks_.texts, IsEmpty()) << "all images are where their frames have them";
  EXPECT_LT((back.frames().translations[1] - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_NE(back.frames().instants[0], back.frames().instants[1]);
  write(map, "text", {.format = "colmap-text"});
  EXPECT_THAT(remarks_.losses,
              Contains(HasSubstr("1 images are not where their rig has them, up to 0.25 away")));
}

// COLMAP ends the name at the blank.
TEST_F(ColmapTest, NamesWithBlanksAreWrittenInTheBinaryFormOnly) {
  write_text();
  const LandmarkMap map = read();
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(map, "text", {.format = "colmap-text"}); }),
              HasSubstr("image name 'a b.png'; expected a name without blanks"));
  EXPECT_EQ(read(write(map, "model/")).frames().image_names, map.frames().image_names);
}

// As COLMAP makes them of all cameras and images.
TEST_F(ColmapTest, RigsOfOneCameraEachSayNothing) {
  write_rig("3 1 CAMERA 3\n4 1 CAMERA 4\n",
            "7 3 1 0 0 0 0 0 0 1 CAMERA 3 7\n9 4 0 0 0 1 1 0 0 1 CAMERA 4 9\n");
  const LandmarkMap map = read();
  EXPECT_THAT(remarks_.texts, IsEmpty());
  fs::remove(folder_ / "rigs.txt");
  fs::remove(folder_ / "frames.txt");
  EXPECT_THAT(map, testing::EqualsMap(read()));
  write(map, "model/");
  EXPECT_FALSE(fs::exists(folder_ / "model/rigs.bin"));
  EXPECT_FALSE(fs::exists(folder_ / "model/frames.bin"));
}

TEST_F(ColmapTest, WrongRigsAreRefused) {
  struct Case {
    std::string_view rigs, frames, message;
  };
  for (const Case& c :
       std::vector<Case>{{kRigs, "8 6 1 0 0 0 0 0 0 1 CAMERA 3 7\n",
                          "frames.txt:1: rig id: rig 6 is not among the rigs"},
                         {kRigs, "8 5 1 0 0 0 0 0 0 1 CAMERA 4 7\n",
                          "frames.txt:1: data id: image 7 is not of camera 4"},
                         {kRigs, "8 5 0 0 0 0 0 0 0 1 CAMERA 3 7\n",
                          "frames.txt:1: quaternion: has no direction"},
                         {kRigs, "8 5 1 0 0 0 0 0 0 3 CAMERA 3 7\n",
                          "frames.txt:1: type of sensor: the line ends before it"},
                         {"5 2 CAMERA 3 CAMERA 4 2\n", kFrames,
                          "rigs.txt:1: whether the sensor has a pose: '2' is not a whole number"},
                         {"5 2 CAMERA 3 CAMERA 3 1 1 0 0 0 0 0 0\n", kFrames,
                          "rigs.txt: rig 5: camera 3 is in a rig already"},
                         {"5 2 CAMERA 3 CAMERA 4 1 0 0 0 1 1e10 0 0\n", kFrames,
                          "rigs.txt: rig 5: translation"}}) {
    write_rig(c.rigs, c.frames);
    EXPECT_THAT(refused(), HasSubstr(std::string(c.message)));
  }
}

TEST_F(ColmapTest, APipeBesideIsNotWaitedFor) {
  write_text();
  ASSERT_EQ(::mkfifo((folder_ / "rigs.txt").c_str(), 0600), 0);
  EXPECT_EQ(read().frame_count(), 2U);
}

TEST_F(ColmapTest, PointsWithoutPositionAreLeftOut) {
  write_text(kCameras, kImages, "4 nan 2 10 255 128 0 0.25 7 0\n2 -1 0 10 1 2 3 nan 7 2\n");
  const LandmarkMap map = read();
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{2}));
  EXPECT_EQ(map.observation_count(), 1U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 points without a finite position")));
}

TEST_F(ColmapTest, TextErrorsNameFileLineAndField) {
  struct Case {
    std::string_view cameras, images, points, message;
  };
  for (const Case& c : std::vector<Case>{
           {"3 PINHOLE 200 100 100 x 100 50\n", kImages, kPoints,
            "cameras.txt:1: camera parameter: 'x' is not a number; expected a finite decimal "
            "number"},
           {"3 PINHOLE 200 100 100 100 100\n", kImages, kPoints,
            "cameras.txt:1: camera parameters: 3 of them; expected 4, as PINHOLE has"},
           {"3 PINHOLE 1 1 1 1 1 1\n3 PINHOLE 1 1 1 1 1 1\n", kImages, kPoints,
            "cameras.txt: camera 3: the id occurs twice"},
           {kCameras, "7 1 0 0 0 0 0 0 3 c.png\n", kPoints,
            "images.txt:1: keypoints of image 7: the file ends before them"},
           {kCameras, "7 1 0 0 0 0 0 0 3 c.png\n1 2 -1 3\n", kPoints,
            "images.txt:2: keypoint y: the line ends before it"},
           {kCameras, "7 0 0 0 0 0 0 0 3 c.png\n\n", kPoints,
            "images.txt:1: pose: image 7: the quaternion has no direction"},
           {kCameras, kImages, "4 1 2 10 256 128 0 0.25 7 0\n",
            "points3D.txt:1: red: '256' is not a whole number; expected a whole number from 0 to "
            "255"},
           {kCameras, kImages, "4 1 2 10 255 128 0 0.25 8 0\n",
            "points3D.txt:1: track of point 4: image 8 is not among the images"},
           {kCameras, kImages, "4 1 2 10 255 128 0 0.25 7 3\n",
            "points3D.txt:1: track of point 4: keypoint 3 of image 7, which has 3"},
           {kCameras, kImages, "4 1 2 10 255 128 0 0.25 7 0\n4 1 2 10 255 128 0 0.25\n",
            "points3D.txt: landmark 4: the id occurs twice"}}) {
    write_text(c.cameras, c.images, c.points);
    EXPECT_THAT(refused(), HasSubstr(std::string(c.message)));
  }
}

TEST_F(ColmapTest, EveryCutOfABinaryModelIsRefused) {
  write_rig();
  const LandmarkMap map = read();
  const fs::path model = folder_ / "model";
  write_colmap(map, model, ColmapForm::kBinary);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin"}) {
    const std::string whole = testing::read_text(model / name);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      std::ofstream(model / name, std::ios::binary) << whole.substr(0, size);
      EXPECT_THAT(refusal(ErrorKind::kInput, [&] { all_formats().read(model); }),
                  HasSubstr(fmt::format("{}: byte ", name)))
          << size;
    }
    std::ofstream(model / name, std::ios::binary) << whole << "x";
    EXPECT_THAT(refusal(ErrorKind::kInput, [&] { all_formats().read(model); }),
                HasSubstr("there are bytes behind the last record"));
    std::ofstream(model / name, std::ios::binary) << whole;
  }
}

TEST_F(ColmapTest, CountsBeyondTheFileAreRefusedBeforeAnythingIsMade) {
  write_rig();
  const fs::path model = folder_ / "model";
  write_colmap(read(), model, ColmapForm::kBinary);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin"}) {
    std::string bytes = testing::read_text(model / name);
    const std::string whole = bytes;
    for (const std::uint64_t count : {std::uint64_t{1} << 32, ~std::uint64_t{0}}) {
      std::memcpy(bytes.data(), &count, sizeof count);
      std::ofstream(model / name, std::ios::binary) << bytes;
      EXPECT_THAT(refusal(ErrorKind::kInput, [&] { all_formats().read(model); }),
                  HasSubstr(fmt::format("{}: byte 0: number of ", name)));
    }
    std::ofstream(model / name, std::ios::binary) << whole;
  }
}

TEST_F(ColmapTest, StopsWhenAskedTo) {
  write_text();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(refusal(ErrorKind::kCancelled,
                      [&] { all_formats().read(folder_.path(), {.stop = stop.get_token()}); }),
              HasSubstr("reading was cancelled"));
}

// --- Models that COLMAP made, and COLMAP's own opinion of what Cairn writes ------------------------

// The mean distance of each landmark's projections to its observations, in pixels.
std::vector<double> point_errors(const LandmarkMap& map) {
  std::vector<double> errors;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto frames = map.observing_frames(LandmarkIndex{i});
    double sum = 0.0;
    for (std::size_t j = 0; j < frames.size(); ++j) {
      const auto camera = map.frames().cameras[frames[j].value];
      const auto pixel =
          project(map.cameras()[camera->value],
                  map.world_from_camera(frames[j]).inverse() * map.landmarks().positions[i]);
      const Pixel seen = map.observed_pixels(LandmarkIndex{i})[j];
      sum += pixel ? std::hypot(pixel->u - seen.u, pixel->v - seen.v) : 1e9;
    }
    errors.push_back(sum / static_cast<double>(frames.size()));
  }
  return errors;
}

TEST(RealColmapModel, TextAndBinaryOfOneModelAreIdentical) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const fs::path model = *data / "foreign/colmap_text_and_binary";
  const LandmarkMap text = all_formats().read(model / "images.txt");
  const LandmarkMap binary = all_formats().read(model / "images.bin");
  ASSERT_EQ(text.observation_count(), binary.observation_count());
  // The two files are of different runs: a few pixels of theirs differ in the last bits.
  for (std::size_t i = 0; i < text.observation_count(); ++i) {
    ASSERT_NEAR(text.observations().pixels[i].u, binary.observations().pixels[i].u, 2e-13);
    ASSERT_NEAR(text.observations().pixels[i].v, binary.observations().pixels[i].v, 2e-13);
  }
  MapTables tables = LandmarkMap(text).tables();
  tables.observations.pixels = binary.observations().pixels;
  EXPECT_EQ(testing::map_difference(LandmarkMap(std::move(tables)), binary), "");
  EXPECT_EQ(binary.landmark_count(), 2254U);
  EXPECT_EQ(binary.observation_count(), 5252U);
}

TEST(RealColmapModel, ReprojectsOntoItsObservations) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  for (const char* name :
       {"foreign/colmap_text_and_binary", "foreign/colmap_binary", "foreign/colmap_rigs_binary",
        "foreign/pairs/sceaux/even", "colmap_office"}) {
    const LandmarkMap map = all_formats().read(*data / name);
    EXPECT_LT(reprojection(map).median, 1.1) << name;
    // COLMAP states each point's mean error: half a pixel of difference in convention would show.
    const NamedColumn* const stated = map.column("reprojection_error");
    ASSERT_NE(stated, nullptr);
    const std::vector<double> errors = point_errors(map);
    double difference = 0.0;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      difference += std::abs(errors[i] - stated->values[i]) / static_cast<double>(errors.size());
    }
    RecordProperty(std::string(name) + " mean difference", std::to_string(difference));
    EXPECT_LT(difference, 0.05) << name;
  }
}

TEST(RealColmapModel, DamagedModelGivesItsPoints) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/colmap_rigs_text");
  EXPECT_EQ(map.frame_count(), 0U);
  EXPECT_GT(map.landmark_count(), 1000U);
  EXPECT_FALSE(map.has_observations());
}

// What `colmap model_analyzer` prints from "Cameras" on.
std::string analysis(const fs::path& model) {
  const testing::CommandResult result =
      testing::run_command({"/usr/bin/colmap", "model_analyzer", "--path", model.string()});
  EXPECT_EQ(result.exit_code, 0) << result.errors;
  const std::string all = result.output + result.errors;
  const std::size_t start = all.find("Cameras");
  return start == std::string::npos ? all : all.substr(start);
}

TEST(RealColmapModel, ColmapReadsWhatCairnWrites) {
  if (!fs::exists("/usr/bin/colmap")) {
    GTEST_SKIP() << "NOT TESTED: there is no /usr/bin/colmap (Debian: colmap)";
  }
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const TemporaryFolder folder;
  for (const char* name : {"foreign/colmap_text_and_binary", "foreign/pairs/sceaux/even"}) {
    SCOPED_TRACE(name);
    const LandmarkMap map = all_formats().read(*data / name);
    const std::string stem = fs::path(name).filename().string();
    const fs::path binary = folder / (stem + "_binary");
    const fs::path text = folder / (stem + "_text");
    all_formats().write(map, binary, {.format = "colmap"});
    all_formats().write(map, text, {.format = "colmap-text"});
    const std::string original = analysis(*data / name);
    EXPECT_THAT(original, HasSubstr("Mean reprojection error"));
    EXPECT_EQ(analysis(binary), original);
    EXPECT_EQ(analysis(text), original);
    // COLMAP's own conversion to text of its model is read as the same map to the last bit.
    const auto as_text = [&](const fs::path& model, const std::string& end) {
      const fs::path converted = folder / (stem + end);
      fs::create_directory(converted);
      const testing::CommandResult result = testing::run_command(
          {"/usr/bin/colmap", "model_converter", "--input_path", model.string(), "--output_path",
           converted.string(), "--output_type", "TXT"});
      EXPECT_EQ(result.exit_code, 0) << result.errors;
      return all_formats().read(converted);
    };
    EXPECT_EQ(testing::map_difference(as_text(*data / name, "_as_text"), map), "");
    const LandmarkMap back = as_text(binary, "_converted");
    EXPECT_EQ(back.landmark_count(), map.landmark_count());
    EXPECT_EQ(back.observation_count(), map.observation_count());
    EXPECT_NEAR(reprojection(back).median, reprojection(map).median, 1e-6);
  }
}

}  // namespace
}  // namespace cairn::detail
