// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <concepts>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::refusal;
using testing::reprojection;
using testing::TemporaryFolder;

// A scene written in both formats by their own rules: two cameras with f = 500 and k1, k2; points in
// front of both.
struct Scene {
  double k1 = 0.1;
  double k2 = -0.05;
  std::vector<Eigen::Vector3d> points = {{0, 0, 5}, {1, -0.5, 6}, {-1, 0.7, 4}, {0.5, 1, 7}};
  // camera_from_world in Cairn's axes.
  std::vector<Eigen::AngleAxisd> turns = {{0.1, Eigen::Vector3d(1, 2, 3).normalized()},
                                          {-0.2, Eigen::Vector3d(3, -1, 1).normalized()}};
  std::vector<Eigen::Vector3d> shifts = {{0.1, 0.2, 0.3}, {-0.4, 0.1, -0.2}};

  Eigen::Vector2d offset(std::size_t camera, std::size_t point) const {
    const Eigen::Vector3d x = turns[camera] * points[point] + shifts[camera];
    const Eigen::Vector2d p = x.head<2>() / x.z();
    const double r2 = p.squaredNorm();
    return 500.0 * (1.0 + k1 * r2 + k2 * r2 * r2) * p;
  }
  // x to the right, y up, looking along -z.
  Eigen::Matrix3d upright_rotation(std::size_t camera) const {
    return Eigen::Vector3d(1, -1, -1).asDiagonal() * turns[camera].toRotationMatrix();
  }
  Eigen::Vector3d upright_shift(std::size_t camera) const {
    return Eigen::Vector3d(1, -1, -1).asDiagonal() * shifts[camera];
  }

  std::string bundler() const {
    // An unregistered camera stands between the two.
    std::string text = fmt::format("# Bundle file v0.3\n3 {}\n", points.size());
    for (std::size_t c = 0; c < 2; ++c) {
      const Eigen::Matrix3d r = upright_rotation(c);
      const Eigen::Vector3d t = upright_shift(c);
      text += fmt::format("500 {} {}\n", k1, k2);
      for (int i = 0; i < 3; ++i) text += fmt::format("{} {} {}\n", r(i, 0), r(i, 1), r(i, 2));
      text += fmt::format("{} {} {}\n", t[0], t[1], t[2]);
      if (c == 0) text += "0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n";
    }
    for (std::size_t p = 0; p < points.size(); ++p) {
      text += fmt::format("{} {} {}\n10 20 30\n2", points[p][0], points[p][1], points[p][2]);
      for (std::size_t c = 0; c < 2; ++c) {
        text += fmt::format(" {} {} {} {}", 2 * c, p + 7, offset(c, p)[0], -offset(c, p)[1]);
      }
      text += "\n";
    }
    return text;
  }

  std::string nvm() const {
    std::string text = "NVM_V3 \n\n2\n";
    for (std::size_t c = 0; c < 2; ++c) {
      const Eigen::Quaterniond q(turns[c]);
      const Eigen::Vector3d centre = -(q.conjugate() * shifts[c]);
      text += fmt::format("a photo {}.jpg\t500 {} {} {} {} {} {} {} 0 0\n", c, q.w(), q.x(), q.y(),
                          q.z(), centre[0], centre[1], centre[2]);
    }
    text += fmt::format("\n{}\n", points.size());
    for (std::size_t p = 0; p < points.size(); ++p) {
      text += fmt::format("{} {} {} 10 20 30 2", points[p][0], points[p][1], points[p][2]);
      for (std::size_t c = 0; c < 2; ++c) {
        text += fmt::format(" {} {} {} {}", c, p + 7, offset(c, p)[0], offset(c, p)[1]);
      }
      text += "\n";
    }
    return text + "\n\n0\n\n#the last part\n0\n";
  }
};

class BundleFilesTest : public testing::ImportTest {
 protected:
  using ImportTest::read;
  template <std::convertible_to<std::string_view> Text>
  LandmarkMap read(const Text& text) {
    return read_bytes(text, "scene");
  }
  std::string refused(std::string_view text) { return ImportTest::refused(text, "scene"); }
  void expect_scene(const LandmarkMap& map, const Scene& scene) {
    ASSERT_EQ(map.frame_count(), 2U);
    ASSERT_EQ(map.landmark_count(), scene.points.size());
    ASSERT_EQ(map.observation_count(), 2 * scene.points.size());
    EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
    for (std::uint32_t c = 0; c < 2; ++c) {
      const Eigen::Vector3d centre = scene.turns[c].inverse() * -scene.shifts[c];
      EXPECT_LT((map.frames().translations[c] - centre).norm(), 1e-9);
    }
    EXPECT_LT(reprojection(map).worst, 1e-6);
    EXPECT_EQ(reprojection(map).count, 2 * scene.points.size());
    EXPECT_THAT(remarks_.texts, Contains(HasSubstr("states no image sizes")));
    for (const Pixel& pixel : map.observations().pixels) {
      EXPECT_GE(pixel.u, 0.0);
      EXPECT_GE(pixel.v, 0.0);
    }
  }
};

TEST_F(BundleFilesTest, BundlerIsReadInCairnsAxes) {
  const Scene scene;
  const LandmarkMap map = read(scene.bundler());
  expect_scene(map, scene);
  EXPECT_EQ(map.frames().ids[1], FrameId{2})
      << "an unregistered camera has no frame but its number";
  EXPECT_EQ(map.landmarks().colors[0], (Color{10, 20, 30}));
  EXPECT_EQ(map.observations().keypoints[0], 7U);
}

TEST_F(BundleFilesTest, AListBesideABundleNamesItsImages) {
  const Scene scene;
  std::filesystem::create_directory(folder_ / "bundle");
  for (const auto& [list, bundle] : {std::pair{"list.txt", "a.out"},
                                     {"list.txt", "bundle/bundle.out"},
                                     {"b.list.txt", "b.bundle.out"}}) {
    folder_.write(list, "./first.jpg\nunused.jpg 0 512.5\n\nthe last.jpg 0 500\n");
    const auto file = folder_.write(bundle, scene.bundler());
    EXPECT_THAT(all_formats().read(file).frames().image_names,
                ::testing::ElementsAre("first.jpg", "the last.jpg"))
        << "camera 1 has no pose";
  }
  folder_.write("list.txt", "first.jpg\n");
  EXPECT_THAT(read(scene.bundler()).frames().image_names, ::testing::IsEmpty());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("names 1, but there are 3 cameras")));
}

TEST_F(BundleFilesTest, SizesThatNoFileStatedAreMentionedAgainWhenTheyAreWritten) {
  const LandmarkMap map = read(Scene().bundler());
  const auto remarks_of = [&](const LandmarkMap& written, const char* name) {
    remarks_.clear();
    all_formats().write(written, folder_ / name, {}, {.log = remarks_.sink()});
    return remarks_.texts;
  };
  const auto invented = Contains(HasSubstr("The sizes of images are invented"));
  EXPECT_THAT(remarks_of(map, "model/"), invented);
  all_formats().write(map, folder_ / "kept.map", {});
  EXPECT_THAT(remarks_of(all_formats().read(folder_ / "kept.map"), "reconstruction.json"),
              invented);
  EXPECT_THAT(remarks_of(map, "out.out"), Not(invented)) << "it states none";
  const Camera camera{CameraId{0}, "PINHOLE", 640, 480, {500, 500, 320, 240}};
  EXPECT_THAT(remarks_of(with_camera(map, camera), "other/"), Not(invented));
}

TEST_F(BundleFilesTest, NvmIsReadInCairnsAxes) {
  const Scene scene{.k1 = 0.0, .k2 = 0.0};
  const LandmarkMap map = read(scene.nvm());
  expect_scene(map, scene);
  EXPECT_EQ(map.frames().image_names[1], "a photo 1.jpg");
}

TEST_F(BundleFilesTest, ObservationsAreUnknownIfThereIsNone) {
  const LandmarkMap map = read("# Bundle file v0.3\n0 1\n1 2 3\n0 0 0\n0\n");
  EXPECT_EQ(map.landmark_count(), 1U);
  EXPECT_FALSE(map.has_observations());
}

TEST_F(BundleFilesTest, ALastLineThatMayHaveBeenCutOffIsMentioned) {
  const Scene scene{.k1 = 0.0, .k2 = 0.0};
  // Of NVM without the parts that are not read.
  const std::string nvm = scene.nvm().substr(0, scene.nvm().find("\n\n0\n") + 1);
  for (std::string text : {scene.bundler(), nvm}) {
    read(text);
    EXPECT_THAT(remarks_.texts, Not(Contains(HasSubstr("does not end"))));
    while (text.ends_with('\n')) text.pop_back();
    read(text);
    EXPECT_THAT(remarks_.texts, Contains(HasSubstr("the last line does not end")));
  }
}

// VisualSFM's distortion is of the measurement: m becomes m (1 + k |m|² / f²).
TEST_F(BundleFilesTest, NvmMeasurementsAreUndistorted) {
  const Scene scene{.k1 = 0.0, .k2 = 0.0};
  std::string text = scene.nvm();
  const auto offset = [&](const LandmarkMap& map) {
    const Intrinsics k = intrinsics(map.cameras()[0]);
    const Pixel pixel = map.observed_pixels(LandmarkIndex{1})[0];
    return Eigen::Vector2d(pixel.u - k.cx, pixel.v - k.cy);
  };
  const Eigen::Vector2d plain = offset(read(text));
  text.replace(text.find(" 0 0\n"), 5, " 0.1 0\n");
  const LandmarkMap map = read(text);
  EXPECT_TRUE(map.frames().cameras[0].has_value());
  const double factor = 1.0 + 0.1 * plain.squaredNorm() / (500.0 * 500.0);
  EXPECT_LT((offset(map) - plain * factor).norm(), 1e-9);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("observations are undistorted")));
}

// COLMAP's exporter: pixels from the corner, the centre of the first being (0.5, 0.5), and k of the opposite sign.
std::string nvm_of_colmap(double k, double width, double height) {
  const Scene scene{.k1 = k, .k2 = 0.0};
  std::string text = "NVM_V3 \n \n2  \n";
  for (std::size_t c = 0; c < 2; ++c) {
    const Eigen::Quaterniond q(scene.turns[c]);
    const Eigen::Vector3d centre = -(q.conjugate() * scene.shifts[c]);
    text += fmt::format("{}.jpg 500 {} {} {} {} {} {} {} {} 0\n", c, q.w(), q.x(), q.y(), q.z(),
                        centre[0], centre[1], centre[2], -k);
  }
  text += fmt::format("\n{}\n", 25);
  for (int p = 0; p < 25; ++p) {
    const Eigen::Vector3d x(0.5 * (p % 5) - 1.0, 0.4 * (p / 5) - 0.8, 5.0 + 0.1 * (p % 3));
    text += fmt::format("{} {} {} 10 20 30 2", x[0], x[1], x[2]);
    for (std::size_t c = 0; c < 2; ++c) {
      const Eigen::Vector3d y = scene.turns[c] * x + scene.shifts[c];
      const Eigen::Vector2d n = y.head<2>() / y.z();
      const Eigen::Vector2d pixel = 500.0 * (1.0 + k * n.squaredNorm()) * n;
      text += fmt::format(" {} {} {} {}", c, p, pixel[0] + 0.5 * width, pixel[1] + 0.5 * height);
    }
    text += "\n";
  }
  return text + "0\n";
}

TEST_F(BundleFilesTest, NvmOfColmapIsReadFromTheCornerOfItsImages) {
  for (const double k : {0.0, -0.15}) {
    const LandmarkMap map = read(nvm_of_colmap(k, 601, 440));
    EXPECT_THAT(remarks_.texts,
                Contains(HasSubstr("from the corner of the images, as COLMAP writes")));
    EXPECT_LT(reprojection(map).worst, 1e-9) << "also if the images are distorted";
    EXPECT_EQ(map.cameras()[1].width, 601U);
    EXPECT_EQ(map.cameras()[1].height, 440U);
    EXPECT_EQ(map.cameras()[1].parameters, (std::vector<double>{500, 300, 219.5, k, 0}));
  }
}

TEST_F(BundleFilesTest, NvmIsNotTakenForColmapsWhereTheCentreExplainsItToo) {
  // All points are in the lower right quarter: no measurement from the centre is negative.
  const Scene scene{
      .k1 = 0.0, .k2 = 0.0, .points = std::vector<Eigen::Vector3d>(12, {2.0, 2.5, 5.0})};
  const LandmarkMap map = read(scene.nvm());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("states no image sizes")));
  EXPECT_LT(reprojection(map).worst, 1e-6);
}

TEST_F(BundleFilesTest, CutFilesAreRefused) {
  const Scene scene;
  const Scene plain{.k1 = 0.0, .k2 = 0.0};
  std::string nvm = plain.nvm();
  nvm.resize(nvm.find("\n\n0\n"));
  for (const std::string& whole : {scene.bundler(), nvm}) {
    // The last number may be cut without a trace.
    for (std::size_t lines = std::count(whole.begin(), whole.end(), '\n') - 1; lines > 2; --lines) {
      std::size_t end = 0;
      for (std::size_t i = 0; i < lines; ++i) end = whole.find('\n', end) + 1;
      EXPECT_THAT(refused(whole.substr(0, end)), HasSubstr("scene:")) << lines;
    }
  }
}

TEST_F(BundleFilesTest, ErrorsNameLineAndField) {
  EXPECT_THAT(refused("# Bundle file v0.3\n1 0\n500 0 0\n1 0 0\n0 1 0\n0 0 2\n0 0 0\n"),
              HasSubstr("scene:7: rotation of camera 0: is none; expected a rotation matrix"));
  EXPECT_THAT(refused("# Bundle file v0.3\n0 1\n1 2 3\n0 0 0\n1 0 0 1 1\n"),
              HasSubstr("scene:5: camera of an observation: 0 of 0"));
  EXPECT_THAT(refused("# Bundle file v0.3\n4294967296 1\n"),
              HasSubstr("scene:2: number of cameras: '4294967296' is not a whole number"));
  EXPECT_THAT(refused("NVM_V3\n1\na.jpg 500 0 0 0 0 0 0 0 0 0\n0\n"),
              HasSubstr("scene:3: quaternion: has no direction"));
  EXPECT_THAT(refused("NVM_V3\n1\n500 0 0 0 0 0 0 0 0 0\n0\n"),
              HasSubstr("scene:3: camera: 10 words; expected a file name and 10 numbers"));
  EXPECT_THAT(refused("NVM_V3\n0\n1\n1 2 3 4 5 6 0 7\n"),
              HasSubstr("scene:4: end of the line: '7' stands there"));
}

TEST_F(BundleFilesTest, WhatIsWrittenIsReadBack) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {
      {CameraId{0}, "RADIAL", 640, 480, {500, 318.6, 255.3, 0.1, -0.02}},
      {CameraId{1}, "OPENCV", 640, 480, {500, 510, 318.6, 255.3, 0.1, -0.02, 0.01, 0.0}}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{1}};
  tables.frames.image_names = {"a b.png", "c.png"};
  tables.frames.quaternions[1] = {0.8, 0.0, 0.6, 0.0};
  const LandmarkMap plain{MapTables(tables)};
  // Observations where the landmarks appear.
  for (std::size_t k = 0; k < 3; ++k) {
    const FrameIndex frame = tables.observations.frames[k];
    const std::size_t landmark = k < 2 ? 0 : 1;
    tables.landmarks.positions[landmark] = {0.4, 0.1, 2.0};
    tables.observations.pixels[k] =
        *project(tables.cameras[frame.value],
                 plain.world_from_camera(frame).inverse() * tables.landmarks.positions[landmark]);
  }
  const LandmarkMap map{std::move(tables)};
  ASSERT_LT(reprojection(map).worst, 1e-6);
  const auto file = write(map, "out.out");
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("observations are written undistorted")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("covariances")));
  const LandmarkMap back = read(file);
  EXPECT_EQ(back.landmarks().positions, map.landmarks().positions);
  EXPECT_EQ(back.observation_count(), map.observation_count());
  EXPECT_LT(reprojection(back).worst, 2e-3);
  EXPECT_EQ(reprojection(back).count, 3U);
  for (std::uint32_t i = 0; i < 2; ++i) {
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    EXPECT_LT(pose.difference_to(back.world_from_camera(FrameIndex{i})).norm(), 1e-12);
  }
}

TEST_F(BundleFilesTest, FramesNeedCameras) {
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(testing::plain_map(), "out.out"); }),
              HasSubstr("frame 1: has no camera"));
}

TEST(RealBundleFiles, ReprojectOntoTheirObservations) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap bundler = all_formats().read(*data / "foreign/bundler/Balbianello.out");
  EXPECT_EQ(bundler.frame_count(), 5U);
  EXPECT_EQ(bundler.landmark_count(), 544U);
  EXPECT_LT(reprojection(bundler).median, 1.0);
  const LandmarkMap nvm = all_formats().read(*data / "foreign/nvm/model.nvm");
  EXPECT_EQ(nvm.frame_count(), 22U);
  EXPECT_EQ(nvm.landmark_count(), 853U);
  EXPECT_NEAR(reprojection(nvm).median, 0.7616, 1e-3);
}

}  // namespace
}  // namespace cairn::detail
