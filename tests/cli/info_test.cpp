// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "cairn/core/file.hpp"
#include "cairn/map/synthetic.hpp"

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class InfoTest : public CliTest {};

TEST_F(InfoTest, CountsWhatTheMapHoldsAndWarnsOfTheRest) {
  write_plain();
  const CommandResult result = cairn({"info", "plain.map"});
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_THAT(result.output, ContainsRegex("frames +2, ids 1 to 2\n"));
  EXPECT_THAT(result.output, ContainsRegex("landmarks +3\n"));
  EXPECT_THAT(result.output, ContainsRegex("observations +3\n"));
  EXPECT_THAT(result.output, ContainsRegex("observed twice or more +1,"));
  EXPECT_THAT(result.output, ContainsRegex("observations +2 +2 +2 +2\n"));
  EXPECT_THAT(result.output, HasSubstr("warning: landmarks without any observation: 1\n"));
}

TEST_F(InfoTest, SaysWhereOnTheEarthTheMapIs) {
  // A unit of two metres; the landmark is 5 m east, 7 m north and 9 m above the origin.
  write("placed.map",
        "CAIRN 2\nMETA georeference 47.37 8.54 408 2 1 0 0 0 1 1 1\nMETA control_point 47 8 - "
        "nail\nMETA control_view 1 2 a.jpg\nFRAME 1 0 0 0 1 0 0 0\n"
        "FRAME 2 0 0 0 1 0 0 0\nGNSS 2 47.37 8.54 410 -\nLANDMARK 3 2 3 4 - 2 1 0 0 2 0 0\n");
  const std::string text = answer({"info", "placed.map"});
  EXPECT_THAT(text, ContainsRegex("georeference +latitude 47.3700000, longitude 8.5400000, "
                                  "altitude 408.00 m\n"));
  EXPECT_THAT(text, ContainsRegex("metres per unit +2\n"));
  EXPECT_THAT(text, ContainsRegex("centre on the Earth +latitude 47.37006[0-9]+, longitude "
                                  "8.54006[0-9]+, altitude 417.00 m\n"));
  EXPECT_THAT(text, ContainsRegex("GNSS positions +of 1 of 2 frames\n"));
  const Json json = document({"info", "placed.map"});
  EXPECT_EQ(json.at("georeference").at("latitude_deg"), 47.37);
  EXPECT_NEAR(json.at("georeference").at("centre").at("altitude_m").get<double>(), 417.0, 1e-3);
  EXPECT_EQ(json.at("gnss_positions"), 1);
  EXPECT_THAT(text, ContainsRegex("control points +1, 1 views"));
  EXPECT_EQ(json.at("control_points"), 1);
  write_plain();
  EXPECT_EQ(document({"info", "plain.map"}).at("georeference"), nullptr);
}

TEST_F(InfoTest, CountsRigs) {
  write_map(testing::several_map(), path("rig.map"));
  EXPECT_THAT(answer({"info", "rig.map"}), ContainsRegex("rigs +1, of 2 cameras\n"));
  EXPECT_EQ(document({"info", "rig.map"}).at("rigs"), 1);
}

TEST_F(InfoTest, MetricWithoutItsInputShowsDashesAndHowToGetIt) {
  write_plain();
  const std::string text = answer({"info", "plain.map"});
  EXPECT_THAT(text, ContainsRegex("reprojection +- +- +- +-\n"));
  EXPECT_THAT(text, HasSubstr("--camera"));
}

TEST_F(InfoTest, CameraGivesReprojectionErrors) {
  write_plain();
  const std::string camera = "PINHOLE 640 480 517.3 516.5 318.6 255.3";
  const std::string text = answer({"info", "plain.map", "--camera", camera});
  EXPECT_THAT(text, ContainsRegex("reprojection +median"));
  EXPECT_THAT(text, Not(ContainsRegex("reprojection +-")));
  const Json json = document({"info", "plain.map", "--camera", camera});
  EXPECT_EQ(json.at("options").at("camera"), camera);
  // Two observations of that map are exact; the third is of another landmark.
  EXPECT_NEAR(json.at("reprojection_px").at("lowest").get<double>(), 0.0, 1e-9);
}

TEST_F(InfoTest, JsonHoldsAllThatIsPrinted) {
  write_plain();
  const Json json = document({"info", "plain.map"});
  EXPECT_EQ(json.at("schema"), Json({{"name", "cairn.info"}, {"version", 1}}));
  EXPECT_TRUE(json.at("cairn_version").is_string());
  EXPECT_EQ(json.at("seed"), 0);
  const Json& input = json.at("inputs").at("map");
  EXPECT_EQ(input.at("path"), "plain.map");
  EXPECT_EQ(input.at("hash"), hash_file(path("plain.map")));
  EXPECT_EQ(input.at("frames"), 2);
  EXPECT_EQ(input.at("landmarks"), 3);
  EXPECT_EQ(input.at("observations"), 3);
  EXPECT_EQ(json.at("observed_twice_or_more"), 1);
  EXPECT_EQ(json.at("unobserved"), 1);
  EXPECT_EQ(json.at("length_unit"), "metres");
  EXPECT_EQ(json.at("extent").at("low"), Json({0.5, 0.0, 2.0}));
  EXPECT_EQ(json.at("confidence").at("observations").at("median"), 2.0);
  for (const char* const absent : {"world_frame", "gravity", "uuid", "reprojection_px"}) {
    EXPECT_TRUE(json.at(absent).is_null()) << absent;
  }
  EXPECT_TRUE(json.at("confidence").at("reprojection").is_null());
  EXPECT_THAT(json.at("warnings"), ::testing::Contains("landmarks without any observation: 1"));
}

TEST_F(InfoTest, PointCloudDoesNotKnowItsObservations) {
  write_pair();
  answer({"convert", "source.map", "source.ply"});
  const std::string text = answer({"info", "source.ply"});
  EXPECT_THAT(text, ContainsRegex("observations +unknown\n"));
  EXPECT_THAT(text, ContainsRegex("columns +observations\n"));
  EXPECT_THAT(text, HasSubstr("warning: the map has no observations"));
  const Json json = document({"info", "source.ply"});
  EXPECT_TRUE(json.at("inputs").at("map").at("observations").is_null());
  EXPECT_TRUE(json.at("observed_twice_or_more").is_null());
  EXPECT_TRUE(json.at("confidence").at("distance").is_null());
  EXPECT_FALSE(json.at("confidence").at("covariance").is_null());
}

TEST_F(InfoTest, MapOfNothingIsNoError) {
  write("nothing.map", "CAIRN 2\n");
  EXPECT_THAT(answer({"info", "nothing.map"}), HasSubstr("warning: the map has no landmarks"));
  EXPECT_TRUE(document({"info", "nothing.map"}).at("extent").is_null());
}

TEST_F(InfoTest, OptionalPartsOfAMapAreListed) {
  write_map(full_map(), path("full.map"));
  const std::string text = answer({"info", "full.map"});
  EXPECT_THAT(text, ContainsRegex("cameras +2\n"));
  EXPECT_THAT(text, ContainsRegex("descriptors +ORB, 2 bytes each\n"));
  write_map(testing::several_map(), path("several.map"));
  EXPECT_THAT(answer({"info", "several.map"}),
              ContainsRegex("descriptors +ORB, 2 bytes each; 2 landmarks have 5, up to 3 each\n"));
  EXPECT_THAT(answer({"info", "several.map"}),
              ContainsRegex("pose uncertainty +up to 9.9 deg and 0.17 units, of keyframe .+ to the "
                            "first\n  grows most +by 9.9 deg and 0.17 units, between keyframes"));
  EXPECT_THAT(text, ContainsRegex("columns +confidence, never_set\n"));
  EXPECT_THAT(text, ContainsRegex("world frame +desk\n"));
  EXPECT_THAT(text, ContainsRegex("length unit +free\n"));
}

// A map of which the cameras look along -z with y up, as in OpenGL.
LandmarkMap backward_map() {
  MapTables tables = synthetic_map({.landmarks = 400, .frames = 12}).tables();
  const Eigen::Quaterniond turn(0.0, 1.0, 0.0, 0.0);
  for (auto& q : tables.frames.quaternions) {
    const Eigen::Quaterniond turned = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * turn;
    q = {turned.w(), turned.x(), turned.y(), turned.z()};
  }
  return LandmarkMap(std::move(tables));
}

TEST_F(InfoTest, ConventionsAreThoseThatTheDataObey) {
  write_map(backward_map(), path("gl.map"));
  EXPECT_THAT(
      answer({"info", "gl.map"}),
      HasSubstr(
          "the data obey another convention than the format: cameras look along -z with y up"));
  const Json json = document({"info", "gl.map"});
  EXPECT_EQ(json.at("conventions").at("verdict"), "other");
  EXPECT_LT(json.at("reprojection_px").at("median"), 2.0) << "read by the data's";
  const Json format = document({"info", "gl.map", "--convention", "format"});
  EXPECT_TRUE(format.at("reprojection_px").is_null() ||
              format.at("reprojection_px").at("median") > 20.0);
  const CommandResult converted = cairn({"convert", "gl.map", "cv.map"});
  EXPECT_THAT(converted.errors, HasSubstr("read with these conventions"));
  EXPECT_EQ(document({"info", "cv.map"}).at("conventions").at("verdict"), "as_format");
  answer({"convert", "gl.map", "same.map", "--convention", "format"});
  EXPECT_EQ(content("same.map"), content("gl.map"));
  expect_refusal({"info", "gl.map", "--convention", "mine"}, kWrongUsage,
                 {"--convention", "'mine'"});
}

}  // namespace
}  // namespace cairn::testing
