// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"

#include "support/full_file.hpp"
#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/rig_maps.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::refusal;
using testing::TemporaryFolder;

// A camera of 200 x 100 pixels with f = 160; shot b at the origin, shot a turned by 90 degrees about z.
constexpr std::string_view kReconstruction = R"([{
  "cameras": {"cam": {"projection_type": "perspective", "width": 200, "height": 100, "focal": 0.8,
                      "k1": 0.01, "k2": 0.0}},
  "shots": {
    "b.jpg": {"rotation": [0, 0, 0], "translation": [0, 0, 0], "camera": "cam", "capture_time": 5.5,
              "gps_position": [1, 2, 3], "gps_dop": 5.0, "orientation": 6},
    "a.jpg": {"rotation": [0, 0, 1.5707963267948966], "translation": [1, 2, 3], "camera": "cam",
              "capture_time": 0.0}},
  "points": {"10": {"coordinates": [1, 2, 10], "color": [255, 127.6, 0]},
             "9": {"coordinates": [-1, 0, 10], "color": [0, 0, 0]}},
  "reference_lla": {"latitude": 47.0, "longitude": 8.0, "altitude": 400}
}, {"cameras": {}, "shots": {}, "points": {"left": {"coordinates": [7, 8, 9]}}}])";
constexpr std::string_view kTracks =
    "OPENSFM_TRACKS_VERSION_v1\n"
    "b.jpg\t10\t3\t0.08\t0.16\t0.001\t1\t2\t3\n"
    "c.jpg\t10\t3\t0.08\t0.16\t0.001\t1\t2\t3\n"
    "b.jpg\t11\t4\t0.08\t0.16\t0.001\t1\t2\t3\n"
    "a.jpg\t10\t5\t-0.5\t-0.25\t0.001\t1\t2\t3\n";

class OpenSfmTest : public testing::ImportTest {
 protected:
  LandmarkMap read(std::string_view reconstruction = kReconstruction,
                   std::string_view tracks = kTracks, const std::string& part = "") {
    folder_.write("reconstruction.json", reconstruction);
    std::filesystem::remove(folder_ / "tracks.csv");
    if (!tracks.empty()) folder_.write("tracks.csv", tracks);
    return ImportTest::read(folder_ / ("reconstruction.json" + part));
  }
  template <class... Arguments>
  std::string refused(Arguments... arguments) {
    return refusal(ErrorKind::kInput, [&] { read(arguments...); });
  }
};

TEST_F(OpenSfmTest, ShotsBecomeFramesAndPointsLandmarks) {
  const LandmarkMap map = read();
  EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
  EXPECT_THAT(map.frames().image_names, ElementsAre("a.jpg", "b.jpg"));
  EXPECT_THAT(map.frames().timestamps_s, ElementsAre(std::nullopt, 5.5));
  EXPECT_LT((map.world_from_camera(FrameIndex{0}) * Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_LT((map.frames().translations[0] - Eigen::Vector3d(-2, 1, -3)).norm(), 1e-12);
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "RADIAL");
  EXPECT_THAT(map.cameras()[0].parameters, ElementsAre(160, 99.5, 49.5, 0.01, 0));
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{9}, LandmarkId{10}));
  EXPECT_EQ(map.landmarks().colors[1], (Color{255, 128, 0}));
  EXPECT_EQ(map.observation_count(LandmarkIndex{0}), 0U);
  EXPECT_THAT(map.observing_frames(LandmarkIndex{1}), ElementsAre(FrameIndex{1}, FrameIndex{0}));
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{1})[0], (Pixel{115.5, 81.5}));
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{1})[1], (Pixel{-0.5, -0.5})) << "the image's corner";
  EXPECT_EQ(map.observations().keypoints[0], 3U);
  EXPECT_EQ(map.info().georeference, (GeoReference{{47.0, 8.0, 400.0}}));
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("holds 2 reconstructions, of which the first is read")));
}

TEST_F(OpenSfmTest, WhatHasNoPlaceIsALoss) {
  read();
  EXPECT_THAT(remarks_.losses, ElementsAre(HasSubstr("left out: 'orientation'")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("holds 2 reconstructions")));
}

// Two rig cameras of one camera, half a unit left and right of the rig's middle; the rig is at the origin and then a unit
// ahead. Shot s is alone.
constexpr std::string_view kRigReconstruction = R"([{
  "cameras": {"cam": {"width": 200, "height": 100, "focal": 0.8}},
  "rig_cameras": {"left": {"rotation": [0, 0, 0], "translation": [0.5, 0, 0]},
                  "right": {"rotation": [0, 0, 0], "translation": [-0.5, 0, 0]},
                  "cam": {"rotation": [0, 0, 0], "translation": [0, 0, 0]}},
  "rig_instances": {
    "0": {"rotation": [0, 0, 0], "translation": [0, 0, 0],
          "rig_camera_ids": {"l0": "left", "r0": "right"}},
    "1": {"rotation": [0, 0, 0], "translation": [0, 0, -1],
          "rig_camera_ids": {"l1": "left", "r1": "right", "lost": "left"}},
    "2": {"rotation": [0, 0, 0], "translation": [9, 9, 9], "rig_camera_ids": {"s": "cam"}}},
  "shots": {
    "l0": {"rotation": [0, 0, 0], "translation": [0.5, 0, 0], "camera": "cam"},
    "r0": {"rotation": [0, 0, 0], "translation": [-0.5, 0, 0], "camera": "cam"},
    "l1": {"rotation": [0, 0, 0], "translation": [0.5, 0, -1], "camera": "cam"},
    "r1": {"rotation": [0, 0, 0], "translation": [-0.5, 0, -1], "camera": "cam"},
    "s": {"rotation": [0, 0, 0], "translation": [9, 9, 9], "camera": "cam"}}
}])";

TEST_F(OpenSfmTest, RigInstancesSayWhichShotsAreOfOneInstantAndPose) {
  const LandmarkMap map = read(kRigReconstruction, "");
  EXPECT_THAT(map.frames().image_names, ElementsAre("l0", "l1", "r0", "r1", "s"));
  EXPECT_THAT(map.frames().instants,
              ElementsAre(InstantId{0}, InstantId{1}, InstantId{0}, InstantId{1}, std::nullopt));
  ASSERT_EQ(map.cameras().size(), 2U) << "a camera of a rig is in one place of it";
  EXPECT_EQ(map.cameras()[0].parameters, map.cameras()[1].parameters);
  EXPECT_THAT(map.rigs(), ElementsAre(Rig{RigId{0},
                                          {{CameraIndex{0}, {1, 0, 0, 0}, {0.5, 0, 0}},
                                           {CameraIndex{1}, {1, 0, 0, 0}, {-0.5, 0, 0}}}}));
  EXPECT_THAT(remarks_.losses, ElementsAre());
  EXPECT_THAT(remarks_.texts, Not(Contains(HasSubstr("not where their rig"))));
  EXPECT_LT(testing::off_rig(map), 1e-15);
  EXPECT_LT(testing::off_rig(ImportTest::read(write(map, "model/"))), 1e-15);
  const std::string written = write(map, "again.json", {.format = "opensfm"});
  EXPECT_THAT(remarks_.losses, ElementsAre());
  const LandmarkMap again = ImportTest::read(written);
  EXPECT_THAT(again.rigs(), ElementsAreArray(map.rigs()));
  EXPECT_EQ(again.frames().instants, map.frames().instants);
  EXPECT_LT(testing::off_rig(again), 1e-15);
}

TEST_F(OpenSfmTest, RigsAreWritten) {
  const LandmarkMap map = testing::rig_map();
  const std::string written = write(map, "again.json", {.format = "opensfm"});
  EXPECT_THAT(remarks_.losses, Not(Contains(HasSubstr("rig"))));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 instants with one image each are left out")));
  const LandmarkMap again = ImportTest::read(written);
  EXPECT_THAT(remarks_.texts, Not(Contains(HasSubstr("not where their rig"))));
  ASSERT_EQ(again.rigs().size(), 1U);
  for (std::size_t k = 0; k < 2; ++k) {
    const Rig::Mount& before = map.rigs()[0].mounts[k];
    const Rig::Mount& after = again.rigs()[0].mounts[k];
    EXPECT_EQ(intrinsics(again.cameras()[after.camera.value]).fx,
              intrinsics(map.cameras()[before.camera.value]).fx);
    EXPECT_LT(after.camera_from_rig().difference_to(before.camera_from_rig()).norm(), 1e-12);
  }
  EXPECT_LT(testing::off_rig(again), 1e-12);
  std::set<std::optional<InstantId>> instants(again.frames().instants.begin(),
                                              again.frames().instants.end());
  EXPECT_EQ(instants.size(), 8U) << "7 of both images, and none of images alone";
}

TEST_F(OpenSfmTest, GnssPositionsAreRelativeToTheReference) {
  const LandmarkMap map = read();
  ASSERT_EQ(map.frames().gnss.size(), 2U);
  EXPECT_FALSE(map.frames().gnss[0].has_value());
  const GnssFix fix = map.frames().gnss[1].value();
  EXPECT_EQ(fix.accuracy_m, 5.0);
  const GeoReference& reference = *map.info().georeference;
  EXPECT_LT((reference.in_map(fix.position) - Eigen::Vector3d(1, 2, 3)).norm(), 1e-8);
  EXPECT_NEAR(fix.position.altitude_m, 403.0, 1e-5);
}

TEST_F(OpenSfmTest, FilesBesideStateTheReferenceAndGnssPositions) {
  folder_.write("reference_lla.json", R"({"latitude": 46.0, "longitude": 7.0, "altitude": 300})");
  folder_.write(
      "exif_overrides.json",
      R"({"a.jpg": {"gps": {"latitude": 46.1, "longitude": 7.1, "altitude": 310, "dop": 4}},
                    "b.jpg": {"gps": {"latitude": 1, "longitude": 2, "altitude": 3}},
                    "lost.jpg": {"gps": {}}})");
  const LandmarkMap map = read();
  EXPECT_EQ(map.info().georeference, (GeoReference{{47.0, 8.0, 400.0}})) << "its own comes first";
  EXPECT_EQ(map.frames().gnss[0], (GnssFix{{46.1, 7.1, 310.0}, 4.0}));
  EXPECT_NEAR(map.frames().gnss[1]->position.altitude_m, 403.0, 1e-5) << "its own comes first";
  const LandmarkMap other = read(kRigReconstruction, "");
  EXPECT_EQ(other.info().georeference, (GeoReference{{46.0, 7.0, 300.0}}));
  folder_.write("exif_overrides.json", R"({"a.jpg": {"gps": {"altitude": 310}}})");
  EXPECT_THAT(refused(), HasSubstr("exif_overrides.json: "));
}

TEST_F(OpenSfmTest, WithoutGnssPositionsThereIsNoGeoreference) {
  // As OpenSfM writes it of photographs without GNSS positions.
  const LandmarkMap map = read(
      R"([{"cameras":{"c":{"width":200,"height":100,"focal":1}},
           "shots":{"a":{"rotation":[0,0,0],"translation":[0,0,0],"camera":"c",
                         "gps_dop":999999.0,"gps_position":[0,0,0]}},
           "reference_lla":{"latitude":0.0,"longitude":0.0,"altitude":0}}])",
      "");
  EXPECT_EQ(map.info().georeference, std::nullopt);
  EXPECT_TRUE(map.frames().gnss.empty());
  EXPECT_THAT(remarks_.losses, ElementsAre());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("the map has no georeference")));
}

TEST_F(OpenSfmTest, TheGeoreferenceIsWrittenOfAMapInItsFrame) {
  const LandmarkMap map = read();
  const auto written = [&](const LandmarkMap& given, const std::string& name) {
    remarks_.clear();
    const std::filesystem::path out = folder_ / name / "reconstruction.json";
    std::filesystem::create_directories(out.parent_path());
    all_formats().write(given, out, {}, {.log = remarks_.sink()});
    return all_formats().read(out);
  };
  const LandmarkMap back = written(map, "same");
  EXPECT_EQ(back.info().georeference, map.info().georeference);
  const GnssFix before = map.frames().gnss[1].value();
  const GnssFix after = back.frames().gnss[1].value();
  EXPECT_NEAR(after.position.latitude_deg, before.position.latitude_deg, 1e-13);
  EXPECT_NEAR(after.position.longitude_deg, before.position.longitude_deg, 1e-13);
  EXPECT_NEAR(after.position.altitude_m, before.position.altitude_m, 1e-7);
  EXPECT_EQ(after.accuracy_m, before.accuracy_m);

  // OpenSfM's world is the topocentric frame. A map that lies otherwise keeps its own.
  const LandmarkMap moved = transformed(
      map, Similarity3(3.0, Rigid3::from_roll_pitch_yaw({5.0, 6.0, 7.0}, 0.1, 0.2, 0.3)));
  const LandmarkMap as_moved = written(moved, "moved");
  EXPECT_EQ(as_moved.info().georeference, std::nullopt);
  EXPECT_EQ(as_moved.landmarks().positions, moved.landmarks().positions);
  EXPECT_THAT(remarks_.losses,
              ElementsAre(HasSubstr("no place for: georeference, GNSS positions")));

  const LandmarkMap enu = written(in_enu_frame(moved), "enu");
  EXPECT_EQ(enu.info().georeference, map.info().georeference);
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    EXPECT_LT((enu.landmarks().positions[i] - map.landmarks().positions[i]).norm(), 1e-12);
  }
}

// In pixels of a camera of 200 x 100: (0.08, 0.16) is (115.5, 81.5).
constexpr std::string_view kControlPoints = R"({"points": [
  {"id": "nail 1", "position": {"latitude": 47.25, "longitude": 8.5, "altitude": 402.5},
   "observations": [{"shot_id": "b.jpg", "projection": [0.08, 0.16]},
                    {"shot_id": "c.jpg", "projection": [0, 0]}]},
  {"id": "2", "position": {"latitude": -47, "longitude": 8}, "observations": []},
  {"id": "unplaced", "observations": []}]})";

TEST_F(OpenSfmTest, ControlPointsTravelWithTheMap) {
  folder_.write("ground_control_points.json", kControlPoints);
  const LandmarkMap map = read();
  EXPECT_THAT(remarks_.losses,
              Contains(HasSubstr("1 control points without a position are left out")));
  const ControlPoint nail{"nail 1", 47.25, 8.5, 402.5, {{"b.jpg", {115.5, 81.5}}}};
  const ControlPoint second{"2", -47.0, 8.0, std::nullopt, {}};
  ASSERT_THAT(map.info().control_points, ElementsAre(nail, second));

  const std::filesystem::path out = folder_ / "out/reconstruction.json";
  std::filesystem::create_directories(out.parent_path());
  remarks_.clear();
  all_formats().write(map, out, {}, {.log = remarks_.sink()});
  EXPECT_THAT(remarks_.losses, ElementsAre());
  EXPECT_EQ(all_formats().read(out).info().control_points, map.info().control_points);

  std::filesystem::remove(folder_ / "out/tracks.csv");
  EXPECT_THAT(refusal(ErrorKind::kMisuse, [&] { all_formats().write(map, out); }),
              HasSubstr("ground_control_points.json: is there already"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/tracks.csv"));
}

TEST_F(OpenSfmTest, ControlPointsOfAListAreReadInWgs84) {
  folder_.write("gcp_list.txt",
                "# surveyed\nWGS84\n8.5 47.25 402.5 12.5 40 b.jpg\n\n8.5 47.5 NaN 3 4 c.jpg\n"
                "8.5 47.25 402.5 7 8\ta.jpg more\n");
  const ControlPoint both{
      "unnamed-0", 47.25, 8.5, 402.5, {{"b.jpg", {12.5, 40.0}}, {"a.jpg", {7.0, 8.0}}}};
  const ControlPoint elsewhere{"unnamed-1", 47.5, 8.5, std::nullopt, {}};
  EXPECT_THAT(read().info().control_points, ElementsAre(both, elsewhere));

  folder_.write("gcp_list.txt", "WGS84 UTM 32N\n400000 5200000 402.5 12.5 40 b.jpg\n");
  EXPECT_THAT(read().info().control_points, ElementsAre());
  EXPECT_THAT(remarks_.losses,
              Contains(HasSubstr("control points in 'WGS84 UTM 32N' are left out")));
}

TEST_F(OpenSfmTest, ManyControlPointsOfAListTakeLinearTime) {
  std::string list = "WGS84\n";
  for (int i = 0; i < 100'000; ++i) list += "8 47 " + std::to_string(i) + " 0 0 b.jpg\n";
  folder_.write("gcp_list.txt", list);
  EXPECT_EQ(read().info().control_points.size(), 100'000U);
}

TEST_F(OpenSfmTest, BrokenControlPointsAreRefused) {
  folder_.write("gcp_list.txt", "WGS84\n8.5 47.25 high 12.5 40 b.jpg\n");
  EXPECT_THAT(refused(), HasSubstr("gcp_list.txt:2: altitude: 'high' is not a number"));
  folder_.write("gcp_list.txt", "WGS84\n8.5 47.25 402.5 12.5 40\n");
  EXPECT_THAT(refused(), HasSubstr("gcp_list.txt:2: image: the line ends before it"));
  folder_.write("gcp_list.txt", "WGS84\n8.5 97.25 402.5 12.5 40 b.jpg\n");
  EXPECT_THAT(refused(), HasSubstr("control point 'unnamed-0': latitude 97.25 is out of range"));
  std::filesystem::remove(folder_ / "gcp_list.txt");
  folder_.write("ground_control_points.json",
                R"({"points": [{"id": "a", "position": {"latitude": "47", "longitude": 8}}]})");
  EXPECT_THAT(refused(), HasSubstr("points/0/position/latitude: is of type string"));
  folder_.write("ground_control_points.json", R"({"points": {}})");
  EXPECT_THAT(refused(), HasSubstr("ground_control_points.json"));
}

TEST_F(OpenSfmTest, APlaceThatIsNoneIsRefused) {
  const auto text = [](std::string_view latitude) {
    return fmt::format(
        R"([{{"cameras":{{}},"shots":{{}},"reference_lla":{{"latitude":{},"longitude":8,"altitude":4}}}}])",
        latitude);
  };
  EXPECT_THAT(refused(text("95"), ""),
              HasSubstr("reconstruction.json: georeference: latitude 95 is out of range"));
  EXPECT_THAT(refused(text("\"north\""), ""),
              HasSubstr("/0/reference_lla/latitude: is of type string; expected a number"));
}

TEST_F(OpenSfmTest, PartNamesAReconstruction) {
  const LandmarkMap second = read(kReconstruction, kTracks, "#1");
  EXPECT_EQ(second.landmarks().positions.at(0), Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(second.frame_count(), 0U);
  EXPECT_EQ(read(kReconstruction, kTracks, "#0").frame_count(), 2U);
  EXPECT_THAT(refused(kReconstruction, kTracks, "#2"),
              HasSubstr("has no reconstruction '2'; expected #0 to #1"));
  EXPECT_THAT(refused(kReconstruction, kTracks, "#x"), HasSubstr("has no reconstruction 'x'"));
}

TEST_F(OpenSfmTest, TracksMayBeMissing) {
  const LandmarkMap map = read(kReconstruction, "");
  EXPECT_FALSE(map.has_observations());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("there is no tracks.csv beside it")));
}

TEST_F(OpenSfmTest, TracksMayHaveNoHeader) {
  EXPECT_EQ(read(kReconstruction, "b.jpg\t10\t3\t0.08\t0.16\t1\t2\t3\n").observation_count(), 1U);
}

TEST_F(OpenSfmTest, LastLinesThatMayHaveBeenCutOffAreALoss) {
  EXPECT_EQ(read(kReconstruction, kTracks.substr(0, kTracks.size() - 1)).observation_count(), 2U);
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("tracks.csv:5: the last line does not end")));
  folder_.write("gcp_list.txt", "WGS84\n8.5 47.25 402.5 12.5 40 b.jpg");
  read();
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("gcp_list.txt:2: the last line does not end")));
}

TEST_F(OpenSfmTest, EachProjectionHasItsModel) {
  struct Case {
    std::string camera, model;
    std::vector<double> parameters;
  };
  for (
      const Case& c : std::vector<Case>{
          {R"("projection_type":"fisheye","focal":0.5,"k1":0.1,"k2":0.2)",
           "RADIAL_FISHEYE",
           {100, 99.5, 49.5, 0.1, 0.2}},
          {R"("projection_type":"brown","focal_x":0.5,"focal_y":0.6,"c_x":0.01,"c_y":-0.02,"k1":1,)"
           R"("k2":2,"k3":3,"p1":4,"p2":5)",
           "FULL_OPENCV",
           {100, 120, 101.5, 45.5, 1, 2, 4, 5, 3, 0, 0, 0}},
          {R"("projection_type":"radial","focal_x":0.5,"focal_y":0.5,"k1":1,"k2":2)",
           "OPENCV",
           {100, 100, 99.5, 49.5, 1, 2, 0, 0}},
          {R"("projection_type":"fisheye_opencv","focal_x":0.5,"focal_y":0.5,"k1":1,"k2":2,"k3":3,"k4":4)",
           "OPENCV_FISHEYE",
           {100, 100, 99.5, 49.5, 1, 2, 3, 4}},
          {R"("projection_type":"fisheye624","focal_x":0.5,"focal_y":0.5,"k1":1,"k2":2,"k3":3,"k4":4,)"
           R"("p1":5,"p2":6,"s0":7,"s2":8)",
           "THIN_PRISM_FISHEYE",
           {100, 100, 99.5, 49.5, 1, 2, 5, 6, 3, 4, 7, 8}},
          {R"("projection_type":"fisheye62","focal_x":0.5,"focal_y":0.5,"k1":1,"k6":6)",
           "RAD_TAN_THIN_PRISM_FISHEYE",
           {100, 100, 99.5, 49.5, 1, 0, 0, 0, 0, 6, 0, 0, 0, 0, 0, 0}},
          {R"("projection_type":"dual","focal":0.5,"transition":1,"k1":0.1)",
           "RADIAL",
           {100, 99.5, 49.5, 0.1, 0}},
          {R"("projection_type":"dual","focal":0.5,"transition":0,"k1":0.1)",
           "RADIAL_FISHEYE",
           {100, 99.5, 49.5, 0.1, 0}},
          {R"("projection_type":"equirectangular")", "EQUIRECTANGULAR", {200, 100}}}) {
    const LandmarkMap map = read(
        R"([{"cameras":{"c":{"width":200,"height":100,)" + c.camera + R"(}},"shots":{}}])", "");
    ASSERT_EQ(map.cameras().size(), 1U) << c.camera;
    EXPECT_EQ(map.cameras()[0].model, c.model);
    ASSERT_EQ(map.cameras()[0].parameters.size(), c.parameters.size());
    for (std::size_t i = 0; i < c.parameters.size(); ++i) {
      EXPECT_NEAR(map.cameras()[0].parameters[i], c.parameters[i], 1e-12) << c.model << ' ' << i;
    }
  }
}

TEST_F(OpenSfmTest, CamerasWithoutAModelAreUnknown) {
  for (
      const std::string camera :
      {R"("projection_type":"spherical","height":90)",
       R"("projection_type":"dual","height":100,"focal":0.5)",
       R"("projection_type":"fisheye62","height":100,"focal_x":0.5,"focal_y":0.5,"k6":1,"p1":1)"}) {
    const LandmarkMap map = read(R"([{"cameras":{"c":{"width":200,)" + camera + R"(}},
           "shots":{"a":{"rotation":[0,0,0],"translation":[0,0,0],"camera":"c"}}}])",
                                 "");
    EXPECT_EQ(map.frame_count(), 1U);
    EXPECT_TRUE(map.frames().cameras.empty()) << camera;
    EXPECT_THAT(remarks_.losses, Contains(HasSubstr("has no model in Cairn"))) << camera;
    remarks_.clear();
  }
}

TEST_F(OpenSfmTest, ErrorsSayWhere) {
  const std::string shot = R"([{"cameras":{"c":{"width":2,"height":1,"focal":1}},"shots":{"a":)";
  EXPECT_THAT(refused(R"([{"cameras": )", ""),
              HasSubstr("reconstruction.json: byte 14: is not JSON"));
  EXPECT_THAT(refused(R"([{"shots": {}}])", ""),
              HasSubstr("reconstruction.json: /0: has no 'cameras'"));
  EXPECT_THAT(refused(shot + R"({"rotation":[0,0],"translation":[0,0,0],"camera":"c"}}}])", ""),
              HasSubstr("/0/shots/a/rotation: has 2 entries; expected 3 numbers"));
  EXPECT_THAT(refused(shot + R"({"rotation":[0,0,"x"],"translation":[0,0,0],"camera":"c"}}}])", ""),
              HasSubstr("/0/shots/a/rotation/2: is of type string; expected a number"));
  EXPECT_THAT(refused(shot + R"({"rotation":[0,0,0],"translation":[0,0,0],"camera":"d"}}}])", ""),
              HasSubstr("/0/shots/a/camera: 'd' is not among the cameras"));
  EXPECT_THAT(refused(std::string(R"([{"cameras":{"c":{"width":-2,"height":1}},"shots":{}}])"), ""),
              HasSubstr("/0/cameras/c/width: is no whole number"));
  EXPECT_THAT(refused(std::string(R"([{"cameras":)") + std::string(100000, '['), ""),
              HasSubstr("lists and objects are nested too deeply"));
  EXPECT_THAT(refused(R"([{"cameras":1e999}])", ""), HasSubstr("out of range"));
  EXPECT_THAT(refused(kReconstruction, "b.jpg\t10\t3\t0.08\n"),
              HasSubstr("tracks.csv:1: y: the line ends before it"));
  EXPECT_THAT(refused(kReconstruction, "b.jpg\t10\tx\t0.08\t1\n"),
              HasSubstr("tracks.csv:1: feature: 'x' is not a whole number"));
  EXPECT_THAT(refused(kReconstruction, "b.jpg\t10\t3\tnan\t1\n"),
              HasSubstr("tracks.csv:1: x: 'nan' is not a number"));
}

TEST_F(OpenSfmTest, EveryCutOfTheFileIsRefused) {
  for (std::size_t size = 100; size + 1 < kReconstruction.size(); ++size) {
    EXPECT_THAT(refused(kReconstruction.substr(0, size), ""), HasSubstr("reconstruction.json"))
        << size;
  }
}

TEST_F(OpenSfmTest, WhatIsWrittenIsReadBack) {
  const LandmarkMap map = read();
  const std::filesystem::path out = folder_ / "out/reconstruction.json";
  std::filesystem::create_directories(out.parent_path());
  all_formats().write(map, out);
  const LandmarkMap back = all_formats().read(out);
  EXPECT_EQ(back.frames().image_names, map.frames().image_names);
  EXPECT_EQ(back.frames().timestamps_s, map.frames().timestamps_s);
  EXPECT_EQ(back.landmarks().ids, map.landmarks().ids);
  EXPECT_EQ(back.landmarks().positions, map.landmarks().positions);
  EXPECT_EQ(back.landmarks().colors, map.landmarks().colors);
  EXPECT_EQ(back.cameras()[0], map.cameras()[0]);
  EXPECT_EQ(back.observations().offsets, map.observations().offsets);
  EXPECT_EQ(back.observations().frames, map.observations().frames);
  EXPECT_EQ(back.observations().keypoints, map.observations().keypoints);
  for (std::size_t i = 0; i < map.observation_count(); ++i) {
    EXPECT_NEAR(back.observations().pixels[i].u, map.observations().pixels[i].u, 1e-10);
    EXPECT_NEAR(back.observations().pixels[i].v, map.observations().pixels[i].v, 1e-10);
  }
  for (std::uint32_t i = 0; i < 2; ++i) {
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    EXPECT_LT(pose.difference_to(back.world_from_camera(FrameIndex{i})).norm(), 1e-12);
  }
  EXPECT_THAT(refusal(ErrorKind::kMisuse, [&] { all_formats().write(map, out); }),
              HasSubstr("tracks.csv: is there already"));
}

// OpenSfM reads no point without a colour, and takes a time of 0 for unknown.
TEST_F(OpenSfmTest, EachPointHasAColourAndATimeOfZeroIsALoss) {
  MapTables tables = LandmarkMap(read()).tables();
  tables.landmarks.colors = {};
  std::filesystem::create_directory(folder_ / "out");
  tables.frames.timestamps_s.assign(tables.frames.ids.size(), 0.0);
  const std::string path =
      write(LandmarkMap(std::move(tables)), "out/black.json", {.format = "opensfm"});
  const auto json = nlohmann::json::parse(testing::read_text(path));
  for (const auto& point : json[0]["points"]) {
    EXPECT_EQ(point.at("color"), nlohmann::json({0, 0, 0}));
  }
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("2 shots at time 0 lose it")));
}

TEST_F(OpenSfmTest, ImagesThatAreNotWhereTheirRigIsAreWrittenAlone) {
  MapTables tables = LandmarkMap(testing::rig_map()).tables();
  const std::uint32_t moved = tables.frames.ids.size() > 1 ? 1 : 0;
  ASSERT_EQ(tables.frames.instants[0], tables.frames.instants[moved]);
  tables.frames.translations[moved] += Eigen::Vector3d(0.25, 0.0, 0.0);
  const LandmarkMap map(std::move(tables));
  const auto json =
      nlohmann::json::parse(testing::read_text(write(map, "moved.json", {.format = "opensfm"})));
  EXPECT_THAT(remarks_.losses,
              Contains(HasSubstr("1 images are not where their rig has them, up to 0.25 away")));
  for (const auto& instance : json[0]["rig_instances"]) {
    EXPECT_FALSE(instance["rig_camera_ids"].contains(map.frames().image_names[moved]));
  }
}

TEST_F(OpenSfmTest, WhatAKilledWriterLeavesIsWrittenOver) {
  const LandmarkMap map = read();
  for (const char* const name : {"whole", "killed"})
    std::filesystem::create_directory(folder_ / name);
  all_formats().write(map, folder_ / "whole/reconstruction.json");
  const auto size = std::filesystem::file_size(folder_ / "whole/tracks.csv");
  testing::kill_when_a_file_exceeds(
      size, [&] { all_formats().write(map, folder_ / "killed/reconstruction.json"); });
  EXPECT_FALSE(std::filesystem::exists(folder_ / "killed/tracks.csv"));
  all_formats().write(map, folder_ / "killed/reconstruction.json");
  for (const char* const name : {"reconstruction.json", "tracks.csv"}) {
    EXPECT_EQ(testing::read_text(folder_ / "killed" / name),
              testing::read_text(folder_ / "whole" / name));
  }
}

TEST_F(OpenSfmTest, NamesThatAreNoUtf8AreRefused) {
  MapTables tables = testing::plain_tables();
  tables.cameras = {{CameraId{0}, "PINHOLE", 200, 100, {150, 160, 90, 50}}};
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  tables.frames.image_names = {"caf\xe9.png", "b.png"};
  const auto path = folder_ / "reconstruction.json";
  const auto refused_message = [&] {
    return refusal(ErrorKind::kInput, [&] { all_formats().write(LandmarkMap(tables), path); });
  };
  EXPECT_THAT(refused_message(), HasSubstr("frame 1: image name 'caf\\xe9.png'; expected"));
  tables.frames.image_names[0] = "caf\u00e9.png";
  tables.info.control_points = {{"p\xff", 47.0, 8.0, std::nullopt, {}}};
  EXPECT_THAT(refused_message(), HasSubstr("control point 'p\\xff': is no UTF-8"));
  tables.info.control_points.clear();
  all_formats().write(LandmarkMap(tables), path);
  EXPECT_THAT(all_formats().read(path).frames().image_names, ElementsAre("b.png", "caf\u00e9.png"));
}

TEST_F(OpenSfmTest, CamerasAreWrittenAsModelsOfOpenSfm) {
  MapTables tables = testing::plain_tables();
  tables.frames.cameras = {CameraIndex{0}, CameraIndex{0}};
  const Eigen::Vector3d x(0.3, -0.2, 1.0);
  for (const Camera& camera : std::vector<Camera>{
           {CameraId{0}, "SIMPLE_PINHOLE", 200, 100, {150, 99.5, 49.5}},
           {CameraId{0}, "RADIAL", 200, 100, {150, 90, 50, 0.1, 0.02}},
           {CameraId{0}, "PINHOLE", 200, 100, {150, 160, 90, 50}},
           {CameraId{0},
            "FULL_OPENCV",
            200,
            100,
            {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003, 0.02, 0, 0, 0}},
           {CameraId{0}, "OPENCV_FISHEYE", 200, 100, {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003}},
           {CameraId{0}, "RADIAL_FISHEYE", 200, 100, {150, 99.5, 49.5, 0.1, 0.02}},
           {CameraId{0}, "SIMPLE_RADIAL_FISHEYE", 200, 100, {150, 99, 49.5, 0.1}},
           {CameraId{0}, "SIMPLE_FISHEYE", 200, 100, {150, 99, 49.5}},
           {CameraId{0}, "FISHEYE", 200, 100, {150, 160, 99, 49.5}},
           {CameraId{0},
            "THIN_PRISM_FISHEYE",
            200,
            100,
            {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003, 0.02, 0.01, 0.004, 0.005}},
           {CameraId{0},
            "RAD_TAN_THIN_PRISM_FISHEYE",
            200,
            100,
            {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003, 0.02, 0.01, 0, 0, 0, 0, 0, 0}},
           {CameraId{0}, "EQUIRECTANGULAR", 200, 100, {200, 100}}}) {
    SCOPED_TRACE(camera.model);
    tables.cameras = {camera};
    const std::filesystem::path out = folder_ / ("out" + camera.model) / "reconstruction.json";
    std::filesystem::create_directories(out.parent_path());
    all_formats().write(LandmarkMap(tables), out);
    const LandmarkMap back = all_formats().read(out);
    ASSERT_EQ(back.cameras().size(), 1U);
    const auto a = project(camera, x);
    const auto b = project(back.cameras()[0], x);
    ASSERT_TRUE(a && b);
    EXPECT_NEAR(a->u, b->u, 1e-9);
    EXPECT_NEAR(a->v, b->v, 1e-9);
  }
  // Tangential terms of a lens with high powers are OpenSfM's own.
  tables.cameras = {{CameraId{5},
                     "RAD_TAN_THIN_PRISM_FISHEYE",
                     200,
                     100,
                     {150, 160, 90, 50, 0.1, 0.02, 0.01, 0.003, 0.02, 0.01, 0.1, 0, 0, 0, 0, 0}}};
  const auto refused = [&] {
    return refusal(ErrorKind::kInput, [&] {
      std::filesystem::remove(folder_ / "tracks.csv");
      all_formats().write(LandmarkMap(tables), folder_ / "reconstruction.json");
    });
  };
  EXPECT_THAT(refused(),
              HasSubstr("camera 5: is of model RAD_TAN_THIN_PRISM_FISHEYE, which OpenSfM"));
  tables.cameras = {{CameraId{4}, "FOV", 200, 100, {150, 150, 99, 49, 0.5}}};
  EXPECT_THAT(refused(), HasSubstr("camera 4: is of model FOV, which OpenSfM does not have"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "tracks.csv"));
}

TEST(RealOpenSfm, ReprojectsOntoItsObservations) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/opensfm/reconstruction.json");
  EXPECT_EQ(map.frame_count(), 19U);
  EXPECT_EQ(map.landmark_count(), 1191U);
  const testing::Reprojection errors = testing::reprojection(map);
  ASSERT_GT(errors.count, 2900U);
  EXPECT_LT(errors.median, 2.0);
}

}  // namespace
}  // namespace cairn::detail
