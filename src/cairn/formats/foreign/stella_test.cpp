// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::refusal;
using testing::reprojection;
using Json = nlohmann::json;

// A pinhole camera of 200 x 100 pixels; keyframe 3 at the origin, keyframe 12 turned by 90 degrees about z.
// Landmark 5 is seen by both, landmark 40 by keyframe 3.
Json scene() {
  const Json word = Json::array({1, 0, 0, 0, 0, 0, 0, 4278190080U});
  const Json other = Json::array({7, 0, 0, 0, 0, 0, 0, 0});
  const auto keypoint = [](double u, double v, int octave) {
    return Json{{"pt", {u, v}}, {"ang", 10.0}, {"oct", octave}};
  };
  Json result = {{"cameras",
                  {{"cam",
                    {{"model_type", "Perspective"},
                     {"setup_type", "Monocular"},
                     {"cols", 200},
                     {"rows", 100},
                     {"fx", 100.0},
                     {"fy", 100.0},
                     {"cx", 99.5},
                     {"cy", 49.5},
                     {"k1", 0.0},
                     {"k2", 0.0},
                     {"p1", 0.0},
                     {"p2", 0.0},
                     {"k3", 0.0},
                     {"fps", 30.0}}}}},
                 {"keyframe_next_id", 13},
                 {"landmark_next_id", 41},
                 {"orb_params", Json::object()},
                 {"landmarks",
                  {{"40",
                    {{"pos_w", {0.0, 0.0, 4.0}},
                     {"n_vis", 9},
                     {"n_fnd", 3},
                     {"1st_keyfrm", 3},
                     {"ref_keyfrm", 3}}},
                   {"5",
                    {{"pos_w", {1.0, 2.0, 10.0}},
                     {"n_vis", 4},
                     {"n_fnd", 2},
                     {"1st_keyfrm", 3},
                     {"ref_keyfrm", 3}}}}}};
  result["keyframes"]["3"] = {
      {"ts", 1.5},
      {"cam", "cam"},
      {"rot_cw", {0, 0, 0, 1}},
      {"trans_cw", {0.0, 0.0, 0.0}},
      {"n_keypts", 3},
      {"undist_keypts", {keypoint(109.5, 69.5, 2), keypoint(1, 2, 0), keypoint(99.5, 49.5, 1)}},
      {"descs", {word, other, other}},
      {"lm_ids", {5, -1, 40}},
      {"depths", {10.0, -1.0, 0.0}},
      {"x_rights", Json::array()},
      {"span_parent", -1}};
  const double s = std::sqrt(0.5);
  result["keyframes"]["12"] = {{"ts", 2.5},
                               {"cam", "cam"},
                               {"rot_cw", {0.0, 0.0, s, s}},
                               {"trans_cw", {1.0, 2.0, 3.0}},
                               {"undist_keypts", {keypoint(91.8, 72.6, 3)}},
                               {"descs", {word}},
                               {"lm_ids", {5}},
                               {"depths", Json::array()}};
  return result;
}

std::string bytes_of(const Json& json) {
  const std::vector<std::uint8_t> bytes = Json::to_msgpack(json);
  return {bytes.begin(), bytes.end()};
}

class StellaTest : public testing::ImportTest {};

TEST_F(StellaTest, DepthsThatAreNotFiniteAreLeftOut) {
  Json json = scene();
  json["keyframes"]["3"]["depths"] = {10.0, std::nan(""), 1e300};
  const LandmarkMap map = read_bytes(bytes_of(json));
  EXPECT_EQ(map.landmark_count(), 2U);
  EXPECT_EQ(map.observations().depths[0], 10.0);
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("input: 2 depths left out: not finite or beyond 1e+09")));
}

TEST_F(StellaTest, LandmarksThatAreTooFarAwayAreLeftOut) {
  for (const double z : {-572943826944.0, std::nan("")}) {
    Json json = scene();
    json["landmarks"]["5"]["pos_w"][2] = z;
    const LandmarkMap map = read_bytes(bytes_of(json));
    EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{40}));
    EXPECT_EQ(map.observation_count(), 1U);
    EXPECT_THAT(remarks_.texts, Contains(HasSubstr("input: 1 of 2 landmarks left out")));
  }
}

TEST_F(StellaTest, KeyframesBecomeFramesInTheOrderOfTheirIds) {
  const LandmarkMap map = read_bytes(bytes_of(scene()));
  EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{3}, FrameId{12}));
  EXPECT_THAT(map.frames().timestamps_s, ElementsAre(1.5, 2.5));
  EXPECT_LT((map.frames().translations[1] - Eigen::Vector3d(-2, 1, -3)).norm(), 1e-12);
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "PINHOLE");
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{5}, LandmarkId{40}));
  EXPECT_EQ(map.landmarks().positions[0], Eigen::Vector3d(1, 2, 10));
  EXPECT_THAT(map.column("visible")->values, ElementsAre(4, 9));
  EXPECT_THAT(map.column("found")->values, ElementsAre(2, 3));
  EXPECT_THAT(map.observing_frames(LandmarkIndex{0}), ElementsAre(FrameIndex{0}, FrameIndex{1}));
  EXPECT_THAT(map.observations().keypoints, ElementsAre(0U, 0U, 2U));
  EXPECT_THAT(map.observations().octaves, ElementsAre(2, 3, 1));
  EXPECT_THAT(map.observations().depths, ElementsAre(10.0, std::nullopt, std::nullopt));
  EXPECT_LT(reprojection(map).worst, 0.1);
}

TEST_F(StellaTest, DescriptorsAreWordsInMemoryOrder) {
  const LandmarkMap map = read_bytes(bytes_of(scene()));
  ASSERT_TRUE(map.landmarks().descriptors);
  EXPECT_EQ(map.landmarks().descriptors->kind, "ORB");
  EXPECT_EQ(map.landmarks().descriptors->bytes[0], 1);
  EXPECT_EQ(map.landmarks().descriptors->bytes[31], 255);
  EXPECT_EQ(map.landmarks().descriptors->bytes[32], 7);
}

TEST_F(StellaTest, KeypointsAreDistortedIntoTheImage) {
  Json json = scene();
  json["cameras"]["cam"]["k1"] = 0.1;
  const LandmarkMap map = read_bytes(bytes_of(json));
  EXPECT_EQ(map.cameras()[0].model, "OPENCV");
  // (0.1, 0.2) times 1 + 0.1 * 0.05.
  EXPECT_NEAR(map.observed_pixels(LandmarkIndex{0})[0].u, 99.5 + 10.05, 1e-9);
  EXPECT_NEAR(map.observed_pixels(LandmarkIndex{0})[0].v, 49.5 + 20.1, 1e-9);
  json["cameras"]["cam"]["k3"] = 0.1;
  EXPECT_EQ(read_bytes(bytes_of(json)).cameras()[0].model, "FULL_OPENCV");
  json["cameras"]["cam"]["model_type"] = "Fisheye";
  const LandmarkMap fisheye = read_bytes(bytes_of(json));
  EXPECT_EQ(fisheye.cameras()[0].model, "OPENCV_FISHEYE");
  EXPECT_LT(reprojection(fisheye).worst, 0.1);
}

TEST_F(StellaTest, StereoMapsAreMetric) {
  Json json = scene();
  json["cameras"]["cam"]["setup_type"] = "Stereo";
  EXPECT_EQ(read_bytes(bytes_of(json)).info().length_unit, LengthUnit::kMetres);
}

TEST_F(StellaTest, CamerasOfNoKnownModelAreUnknown) {
  Json json = scene();
  json["cameras"]["cam"]["model_type"] = "Cubemap";
  const LandmarkMap map = read_bytes(bytes_of(json));
  EXPECT_TRUE(map.cameras().empty());
  EXPECT_EQ(map.observation_count(), 3U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("it is no complete 'Cubemap'")));
}

// stella_vslam takes a pixel of a panorama as an angle, so that landmark 5 of keyframe 3 is where its formula says.
TEST_F(StellaTest, PanoramasKeepTheirLinesOfSight) {
  Json json = scene();
  json["cameras"]["cam"] = {
      {"model_type", "Equirectangular"}, {"setup_type", "Monocular"}, {"cols", 200}, {"rows", 100}};
  json["landmarks"]["5"]["pos_w"] = {1.0, 2.0, -10.0};  // behind the camera
  const double longitude = std::atan2(1.0, -10.0);
  const double latitude = std::asin(2.0 / std::sqrt(105.0));
  const Json seen = {200.0 * (0.5 + longitude / (2.0 * std::numbers::pi)),
                     100.0 * (0.5 + latitude / std::numbers::pi)};
  json["keyframes"]["3"]["undist_keypts"][0]["pt"] = seen;
  const LandmarkMap map = read_bytes(bytes_of(json));
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "EQUIRECTANGULAR");
  const Pixel& pixel = map.observed_pixels(LandmarkIndex{0})[0];
  EXPECT_LT(cairn::reprojection(map.cameras()[0], map.landmarks().positions[0], pixel)->norm(),
            1e-9);
  const LandmarkMap back = read(write(map, "out.msg"));
  EXPECT_EQ(back.cameras()[0], map.cameras()[0]);
  EXPECT_EQ(back.observations().pixels, map.observations().pixels);
}

TEST_F(StellaTest, DivisionIsAModelOfCairns) {
  Json json = scene();
  json["cameras"]["cam"]["model_type"] = "RadialDivision";
  json["cameras"]["cam"]["distortion"] = -0.2;
  const LandmarkMap map = read_bytes(bytes_of(json));
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].model, "DIVISION");
  // stella_vslam undistorts by x / (1 + distortion * r^2): back to (0.1, 0.2), where it is without distortion.
  const Pixel& pixel = map.observed_pixels(LandmarkIndex{0})[0];
  const Eigen::Vector2d distorted((pixel.u - 99.5) / 100.0, (pixel.v - 49.5) / 100.0);
  const Eigen::Vector2d undistorted = distorted / (1.0 - 0.2 * distorted.squaredNorm());
  EXPECT_NEAR(undistorted.x(), 0.1, 1e-9);
  EXPECT_NEAR(undistorted.y(), 0.2, 1e-9);
  EXPECT_LT(reprojection(map).worst, 0.1);
  EXPECT_EQ(read(write(map, "out.msg")).cameras()[0], map.cameras()[0]);
}

TEST_F(StellaTest, ObservationsOfMissingLandmarksAreCounted) {
  Json json = scene();
  json["landmarks"].erase("40");
  EXPECT_EQ(read_bytes(bytes_of(json)).observation_count(), 2U);
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("1 observations of landmarks that are not there")));
}

TEST_F(StellaTest, RefusalsNameTheByteAndTheKeyframe) {
  Json json = scene();
  json["keyframes"]["3"]["lm_ids"] = {5};
  EXPECT_THAT(refused(bytes_of(json)),
              HasSubstr("keyframe 3: has 3 keypoints, but 1 landmark ids"));
  json = scene();
  json["keyframes"]["3"].erase("rot_cw");
  EXPECT_THAT(refused(bytes_of(json)), HasSubstr("keyframe 3: has no rot_cw; expected a rotation"));
  json = scene();
  json["keyframes"]["x"] = json["keyframes"]["3"];
  EXPECT_THAT(refused(bytes_of(json)), HasSubstr("keyframe id: 'x' is no id"));
  json = scene();
  json["landmarks"]["5"]["pos_w"] = {1.0, 2.0};
  EXPECT_THAT(refused(bytes_of(json)), HasSubstr("pos_w: has 2 entries; expected 3 of them"));
  json = scene();
  json.erase("landmarks");
  EXPECT_THAT(refused(bytes_of(json)), HasSubstr("has no landmarks"));
  const std::string whole = bytes_of(scene());
  for (std::size_t size = 12; size < whole.size(); size += 7) {
    EXPECT_THAT(refused(whole.substr(0, size)), HasSubstr(": byte ")) << size;
  }
  EXPECT_THAT(refused(whole + "x"), HasSubstr("there are bytes behind the last record"));
  // A map of 2^32 - 1 keyframes in a file of a few bytes.
  EXPECT_THAT(refused(std::string("\x81\xa9keyframes\xdf\xff\xff\xff\xff", 16)),
              HasSubstr("states a size of 4294967295, but 0 bytes are left"));
}

TEST_F(StellaTest, WhatIsWrittenIsReadBack) {
  const LandmarkMap map = read_bytes(bytes_of(scene()));
  const LandmarkMap back = read(write(map, "out.msg"));
  EXPECT_THAT(back.frames().ids, ElementsAre(FrameId{3}, FrameId{12}));
  EXPECT_EQ(back.landmarks().ids, map.landmarks().ids);
  EXPECT_EQ(back.landmarks().positions, map.landmarks().positions);
  EXPECT_EQ(back.landmarks().descriptors->bytes, map.landmarks().descriptors->bytes);
  EXPECT_EQ(back.observations().pixels, map.observations().pixels);
  EXPECT_EQ(back.observations().octaves, map.observations().octaves);
  EXPECT_EQ(back.column("found")->values, map.column("found")->values);
  EXPECT_EQ(back.cameras()[0].parameters, map.cameras()[0].parameters);
  // It is what stella_vslam itself writes: read by another reader of MessagePack.
  const std::string written = testing::read_text(folder_ / "out.msg");
  const Json json = Json::from_msgpack(written.begin(), written.end());
  EXPECT_EQ(json.at("keyframes").at("12").at("span_parent"), 3);
  EXPECT_EQ(json.at("keyframes").at("3").at("span_children"), Json::array({12}));
  EXPECT_EQ(json.at("keyframes").at("3").at("span_parent"), -1);
  EXPECT_EQ(json.at("keyframes").at("3").at("lm_ids"), Json::array({5, 40}));
  EXPECT_EQ(json.at("landmark_next_id"), 41);
  EXPECT_EQ(json.at("landmarks").at("5").at("1st_keyfrm"), 3);
}

// A landmark seen in so many keyframes, the first 200 + i with descriptors of bytes i.
Json seen_often(std::size_t count) {
  Json json = scene();
  const Json keyframe = json["keyframes"]["12"];
  for (std::size_t i = 0; i < count; ++i) {
    Json& one = json["keyframes"][std::to_string(200 + i)];
    one = keyframe;
    one["descs"] = {std::vector<std::uint64_t>(8, i < 3 ? (1U << (8 * i)) - 1U : 7U)};
    one["lm_ids"] = {40};
  }
  return json;
}

TEST_F(StellaTest, DistinctDescriptorsOfAllKeyframesAreKept) {
  const LandmarkMap map = read_bytes(bytes_of(seen_often(7)));
  const DescriptorColumn& column = *map.landmarks().descriptors;
  ASSERT_EQ(map.landmark_count(), 2U);
  EXPECT_EQ(column.count(0), 1U) << "both keyframes have the same";
  ASSERT_EQ(column.count(1), 4U);
  EXPECT_EQ(column.descriptor(1, 0)[0], 7) << "the medoid";
  EXPECT_EQ(column.descriptor(1, 1)[1], 255) << "the one that differs most";
}

TEST_F(StellaTest, SeveralDescriptorsAreSpreadOverTheKeyframes) {
  const LandmarkMap map = read_bytes(bytes_of(seen_often(7)));
  const LandmarkMap back = read(write(map, "out.msg"));
  EXPECT_EQ(back.landmarks().descriptors->bytes, map.landmarks().descriptors->bytes);
  EXPECT_EQ(back.landmarks().descriptors->further, map.landmarks().descriptors->further);
  EXPECT_THAT(remarks_.texts, Not(Contains(HasSubstr("further descriptors"))));
  // Too few keyframes for all of them.
  MapTables tables = testing::full_tables();
  tables.frames.cameras.assign(3, CameraIndex{0});
  tables.landmarks.descriptors =
      DescriptorColumn{"ORB",           32,
                       {1, 0, 0, 0},    std::vector<std::uint8_t>(128),
                       {0, 2, 2, 2, 2}, std::vector<std::uint8_t>(64, 9)};
  write(LandmarkMap(std::move(tables)), "few.msg");
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("further descriptors of a landmark")));
}

TEST_F(StellaTest, AVeryOftenSeenLandmarkTakesNoQuadraticTime) {
  MapTables tables = testing::full_tables();
  tables.cameras = {{CameraId{0}, "PINHOLE", 200, 100, {150, 160, 90, 50}}};
  tables.frames.cameras.assign(tables.frames.ids.size(), CameraIndex{0});
  constexpr std::size_t kCount = 200'000;
  tables.landmarks = {};
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{0.0, 0.0, 5.0}};
  tables.observations = {};
  tables.observations.offsets = {0, kCount};
  tables.observations.frames.assign(kCount, FrameIndex{1});
  tables.observations.pixels.assign(kCount, Pixel{90.0, 50.0});
  EXPECT_EQ(read(write(LandmarkMap(std::move(tables)), "out.msg")).observation_count(), kCount);
}

TEST_F(StellaTest, DistortedPixelsReturnThroughTheUndistortedImage) {
  Json json = scene();
  json["cameras"]["cam"]["k1"] = 0.1;
  json["cameras"]["cam"]["k3"] = -0.05;
  const LandmarkMap map = read_bytes(bytes_of(json));
  const LandmarkMap back = read(write(map, "out.msg"));
  EXPECT_EQ(back.cameras()[0], map.cameras()[0]);
  for (std::size_t i = 0; i < map.observation_count(); ++i) {
    EXPECT_NEAR(back.observations().pixels[i].u, map.observations().pixels[i].u, 1e-3);
    EXPECT_NEAR(back.observations().pixels[i].v, map.observations().pixels[i].v, 1e-3);
  }
}

TEST_F(StellaTest, WritingSaysWhatHasNoPlace) {
  MapTables tables = testing::full_tables();
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { write(LandmarkMap(tables), "out.msg"); }),
              HasSubstr("frame 18446744073709551615: has no camera"));
  tables.frames.cameras.assign(3, CameraIndex{0});
  write(LandmarkMap(tables), "out.msg");
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("has no place for: name of the world frame")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 landmarks without an observation")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("no ORB descriptors")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("ids are too large")));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("keyframes without a time get the time 0")));
  const LandmarkMap back = read(folder_ / "out.msg");
  EXPECT_EQ(back.landmark_count(), 3U);
  EXPECT_EQ(back.observation_count(), 5U);
}

TEST(RealStella, ReprojectsOntoItsKeypoints) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/stella/map.msg");
  EXPECT_EQ(map.frame_count(), 2U);
  EXPECT_EQ(map.landmark_count(), 296U);
  EXPECT_EQ(reprojection(map).count, map.observation_count());
  EXPECT_LT(reprojection(map).median, 1.0);
  EXPECT_TRUE(map.landmarks().descriptors);
}

}  // namespace
}  // namespace cairn::detail
