// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <numbers>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "cairn/confidence/metric.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"

#include "cli.hpp"
#include "support/mcap_recording.hpp"
#include "support/splats.hpp"

namespace cairn::testing {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class ConvertTest : public CliTest {};

TEST_F(ConvertTest, NativeToNativeKeepsEveryBit) {
  write_map(full_map(), path("full.map"));
  EXPECT_THAT(answer({"convert", "full.map", "copy.map"}),
              StartsWith("copy.map: 3 frames, 4 landmarks"));
  EXPECT_THAT(read_map(path("copy.map")), EqualsMap(full_map()));
}

TEST_F(ConvertTest, BinaryMapsKeepEveryBit) {
  write_map(full_map(), path("full.map"));
  EXPECT_EQ(answer({"convert", "full.map", "full.cairn"}), "full.cairn: 3 frames, 4 landmarks\n");
  EXPECT_EQ(content("full.cairn").substr(0, 8),
            "\x89"
            "CAIRN\r\n");
  answer({"convert", "full.cairn", "back.map"});
  EXPECT_EQ(content("back.map"), content("full.map"));
  answer({"convert", "back.map", "again.cairn"});
  EXPECT_EQ(content("again.cairn"), content("full.cairn"));
  EXPECT_EQ(cairn({"convert", "full.map", "full.cairn"}).errors, "") << "nothing is left out";
}

TEST_F(ConvertTest, BinaryMapsAreReadWhereOthersAre) {
  write_pair();
  answer({"convert", "source.map", "source.cairn"});
  answer({"convert", "target.map", "target.cairn"});
  Json from_text = document({"info", "source.map"});
  Json from_binary = document({"info", "source.cairn"});
  from_text.erase("inputs");
  from_binary.erase("inputs");
  EXPECT_EQ(from_binary, from_text);
  const auto pose = [&](const char* source, const char* target) {
    return document({"align", source, target, "--initial-matrix", "start.txt"})
        .at("results")
        .at(0)
        .at("target_from_source");
  };
  EXPECT_EQ(pose("source.cairn", "target.cairn"), pose("source.map", "target.map"));
}

TEST_F(ConvertTest, StrictRefusesWhatWouldBeLeftOut) {
  write_map(full_map(), path("full.map"));
  answer({"convert", "full.map", "copy.cairn", "--strict"});
  expect_refusal({"convert", "full.map", "out.npz", "--strict"}, kBadInput,
                 {"--strict", "holds landmarks only"});
  EXPECT_FALSE(std::filesystem::exists(path("out.npz")));
  MapTables tables = full_tables();
  tables.frames.cameras.assign(3, CameraIndex{0});
  tables.frames.image_names = {"a.png", "b.png", "c.png"};
  write_map(LandmarkMap(tables), path("cameras.map"));
  for (const char* name : {"colmap/", "out.msg", "out.out", "new/reconstruction.json"}) {
    std::filesystem::create_directories(path("new"));
    expect_refusal({"convert", "cameras.map", name, "--strict"}, kBadInput, {"--strict"});
    EXPECT_FALSE(std::filesystem::exists(path(name))) << name;
  }
  EXPECT_FALSE(std::filesystem::exists(path("new/tracks.csv")));
}

TEST_F(ConvertTest, StrictLetsRemarksPassThatTellOfNoLoss) {
  const auto reconstruction = [](std::string_view more) {
    return fmt::format(
        R"([{{"cameras":{{"c":{{"width":200,"height":100,"focal":1}}}},
              "shots":{{"a":{{"rotation":[0,0,0],"translation":[0,0,0],"camera":"c"{}}}}},
              "points":{{"1":{{"coordinates":[0,0,3]}}}},
              "reference_lla":{{"latitude":0,"longitude":0,"altitude":0}}}}])",
        more);
  };
  write("reconstruction.json", reconstruction(""));
  const CommandResult result = cairn({"convert", "reconstruction.json", "out.map", "--strict"});
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, HasSubstr("there is no tracks.csv beside it"));
  EXPECT_THAT(result.errors, HasSubstr("the map has no georeference"));
  write("reconstruction.json", reconstruction(R"(,"orientation":6)"));
  expect_refusal({"convert", "reconstruction.json", "strict.map", "--strict"}, kBadInput,
                 {"--strict", "left out: 'orientation'"});
  EXPECT_FALSE(std::filesystem::exists(path("strict.map")));
}

TEST_F(ConvertTest, EnuMovesAMapIntoTheFrameOfItsGeoreference) {
  write("placed.map",
        "CAIRN 2\nMETA length_unit free\nMETA georeference 47.37 8.54 408 2 1 0 0 0 1 1 1\n"
        "LANDMARK 3 2 3 4 - -\n");
  answer({"convert", "placed.map", "enu.map", "--enu"});
  EXPECT_EQ(content("enu.map"),
            "CAIRN 2\nMETA georeference 47.37 8.54 408 1 1 0 0 0 0 0 0\nLANDMARK 3 5 7 9 - -\n");
  write("by.txt", "0 -2 0 1\n2 0 0 0\n0 0 2 0\n0 0 0 1\n");
  answer({"convert", "placed.map", "moved.map", "--apply", "by.txt"});
  answer({"convert", "moved.map", "back.map", "--enu"});
  const LandmarkMap back = read_map(path("back.map"));
  EXPECT_EQ(back.info().georeference, GeoReference({.origin = {47.37, 8.54, 408.0}}));
  EXPECT_LT((back.landmarks().positions[0] - Eigen::Vector3d(5, 7, 9)).norm(), 1e-12);
  write_plain();
  expect_refusal({"convert", "plain.map", "out.map", "--enu"}, kBadInput,
                 {"plain.map", "has no georeference"});
  expect_refusal({"convert", "placed.map", "out.map", "--enu", "--apply", "by.txt"}, kWrongUsage,
                 {"--enu"});
}

TEST_F(ConvertTest, ApplyMovesWhatBelongsToAMap) {
  // Twice the size, turned by 90 degrees about z, one to the right.
  write("by.txt", "0 -2 0 1\n2 0 0 0\n0 0 2 0\n0 0 0 1\n");
  write("mesh.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty "
        "double "
        "z\nproperty uchar alpha\nelement face 1\nproperty list uchar int "
        "vertex_indices\nend_header\n"
        "0 0 3 9\n1 0\n");
  EXPECT_EQ(answer({"convert", "mesh.ply", "moved.ply", "--apply", "by.txt"}),
            "moved.ply: moved\n");
  EXPECT_THAT(content("moved.ply"), HasSubstr("end_header\n1 0 6 9\n1 0\n"));
  write("poses.txt", "5 0 0 3 0 0 0 1\n");
  answer({"convert", "poses.txt", "moved.txt", "--apply", "by.txt"});
  EXPECT_THAT(content("moved.txt"), HasSubstr("5 1 0 6 0 0 0.7071067811865"));
  write_plain();
  answer({"convert", "plain.map", "moved.map", "--apply", "by.txt"});
  EXPECT_LT(
      (read_map(path("moved.map")).landmarks().positions[0] - Eigen::Vector3d(1, 1, 4)).norm(),
      1e-12);
  expect_refusal(
      {"convert", "plain.map", "no.map", "--apply", "by.txt", "--transform", "0 0 0 0 0 0"},
      kWrongUsage, {"--apply", "given with --transform"});
  expect_refusal({"convert", "mesh.ply", "no.ply", "--apply", "none.json"}, kBadInput,
                 {"none.json"});
}

TEST_F(ConvertTest, SplatsTurnAlikeHoweverItIsAsked) {
  const LandmarkMap splats = random_splats(20, 2, 1);
  write_map(splats, path("splat.ply"));
  write("by.txt", "0 -1 0 0\n1 0 0 0\n0 0 1 0\n0 0 0 1\n");
  answer({"convert", "splat.ply", "one.ply", "--transform", "0 0 0 0 0 90"});
  answer({"convert", "splat.ply", "two.ply", "--transform-matrix", "by.txt"});
  answer({"convert", "splat.ply", "three.ply", "--apply", "by.txt"});
  const LandmarkMap one = read_map(path("one.ply"));
  EXPECT_NE(one.column("f_rest_0")->values, splats.column("f_rest_0")->values);
  for (const char* const other : {"two.ply", "three.ply"}) {
    const LandmarkMap map = read_map(path(other));
    for (const NamedColumn& column : one.landmarks().columns) {
      for (std::size_t i = 0; i < column.values.size(); ++i) {
        EXPECT_NEAR(map.column(column.name)->values[i], column.values[i], 1e-6) << column.name;
      }
    }
  }
}

TEST_F(ConvertTest, SplatsInNoKnownLayoutAreNotTurned) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float f_dc_0\nproperty float rot_0\nend_header\n";
  write("splat.ply", header + "1 2 3 4 5\n");
  write("by.txt", "0 -1 0 0\n1 0 0 0\n0 0 1 0\n0 0 0 1\n");
  const Words pose = {"--transform", "0 0 0 0 0 90"};
  for (const Words& how :
       {pose, Words{"--transform-matrix", "by.txt"}, Words{"--apply", "by.txt"}}) {
    for (const char* name : {"out.ply", "out.pcd"}) {
      expect_refusal({"convert", "splat.ply", name, how[0], how[1]}, kBadInput,
                     {"splat.ply", "has Gaussian splats"});
      EXPECT_FALSE(std::filesystem::exists(path(name)));
    }
  }
  write("other.ply", header + "2 2 3 4 5\n");
  expect_refusal({"merge", "splat.ply", "other.ply", "-o", "out.ply"}, kBadInput,
                 {"splat", "has Gaussian splats"});
}

TEST_F(ConvertTest, TrajectoriesGoFromFormatToFormat) {
  write("poses.txt", "# a comment\n10.5 1 2 3 0 0 0 1\n10.75 1 2 4 0 0 1 0\n");
  EXPECT_EQ(answer({"convert", "poses.txt", "poses.csv"}), "poses.csv: 2 poses\n");
  EXPECT_THAT(content("poses.csv"),
              HasSubstr("\n10500000000,1,2,3,1,0,0,0\n10750000000,1,2,4,0,0,0,1\n"));
  EXPECT_EQ(answer({"convert", "poses.csv", "kitti.txt", "--format", "kitti", "--transform",
                    "10 0 0 0 0 0"}),
            "kitti.txt: 2 poses, moved\n");
  EXPECT_EQ(content("kitti.txt"), "1 0 0 11 0 1 0 2 0 0 1 3\n-1 0 0 11 0 -1 0 2 0 0 1 4\n");
  answer({"convert", "kitti.txt", "back.txt"});
  EXPECT_THAT(content("back.txt"), HasSubstr("\n1 11 2 4 "));
  expect_refusal({"convert", "poses.txt", "poses.ply", "--format", "ply"}, kWrongUsage,
                 {"--format", "ply", "tum, euroc or kitti"});
  for (const char* name :
       {"poses.map", "poses.ply", "poses.cairn", "poses.json", "poses.g2o", "model/"}) {
    expect_refusal({"convert", "poses.txt", name}, kWrongUsage,
                   {name, "does not name a trajectory", "poses.txt is one"});
    EXPECT_FALSE(std::filesystem::exists(path(name)));
  }
  // What would have no effect, and what has no place.
  expect_refusal({"convert", "poses.txt", "x.txt", "--frames", "0:1"}, kWrongUsage,
                 {"--frames", "given for a trajectory", "an input that is a map"});
  expect_refusal({"convert", "poses.txt", "x.txt", "--json", "x.json"}, kWrongUsage, {"--json"});
  expect_refusal({"convert", "poses.txt", "x.txt", "--format", "kitti", "--strict"}, kBadInput,
                 {"KITTI has no place for: times"});
  EXPECT_FALSE(std::filesystem::exists(path("x.txt")));
  write("broken.txt", "10.5 1 2 3 0 0 0 1\n10.75 1 2 4 0 0 1\n");
  expect_refusal({"convert", "broken.txt", "out.csv"}, kBadInput, {"broken.txt:2"});
}

TEST_F(ConvertTest, PoseGraphsAreTakenInG2oAndJson) {
  write_mini_maps("minis");
  const std::string json = "minis/pose_graph.json";
  EXPECT_EQ(answer({"convert", json, "graph.g2o"}), "graph.g2o: 2 nodes, 1 links\n");
  answer({"convert", "graph.g2o", "back.json"});
  EXPECT_THAT(content("back.json"), HasSubstr("\"covariance\": ["));
  for (const std::string& graph : {json, std::string("graph.g2o")}) {
    answer({"convert", graph, "poses.txt", "--format", "kitti"});
    EXPECT_EQ(content("poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 0\n");
    const std::string text = answer({"info", graph});
    EXPECT_THAT(text, ContainsRegex("vertices +2\n"));
    EXPECT_THAT(text, ContainsRegex("edges +1, 1 of them"));
    EXPECT_THAT(text, ContainsRegex("length unit +not stated"));
    const Json info = document({"info", graph});
    EXPECT_EQ(info.at("vertices"), 2);
    EXPECT_EQ(info.at("edges"), 1);
    expect_refusal({"convert", graph, "out.map"}, kWrongUsage,
                   {"output", "'out.map' of a pose graph", ".g2o or .json, or --format kitti"});
    expect_refusal({"convert", graph, "out.txt", "--format", "tum"}, kWrongUsage, {"no times"});
    expect_refusal({"convert", graph, "out.g2o", "--transform", "1 0 0 0 0 0"}, kWrongUsage,
                   {"--transform", "of a pose graph"});
  }
  // Every number of a g2o file stays, however ill-conditioned its information.
  const std::string edge =
      "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0.6 0.8 1e12 0.5 0 0 0 0 1e-4 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  write("ill.g2o",
        "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0.6 0.8\nFIX 0\n" + edge);
  answer({"convert", "ill.g2o", "same.g2o", "--strict"});
  answer({"convert", "same.g2o", "again.g2o", "--strict"});
  EXPECT_EQ(content("again.g2o"), content("same.g2o"));
  EXPECT_THAT(content("same.g2o"), AllOf(HasSubstr("FIX 0\n"), HasSubstr(" 0.6 0.8 1e+12 0.5 ")));
  expect_refusal({"convert", "ill.g2o", "x.g2o", "--json", "x.json"}, kWrongUsage, {"--json"});
  write("fixed.g2o", content("graph.g2o") + "FIX 1\n");
  EXPECT_THAT(answer({"info", "fixed.g2o"}), ContainsRegex("fixed vertices +1\n"));
  EXPECT_THAT(cairn({"convert", "fixed.g2o", "out.json"}).errors, HasSubstr("FIX of 1 vertices"));
  expect_refusal({"convert", "fixed.g2o", "no.json", "--strict"}, kBadInput, {"FIX of 1 vertices"});
  write("planar.g2o", "VERTEX_SE2 1 0 0 0\n");
  expect_refusal({"info", "planar.g2o"}, kBadInput,
                 {"planar.g2o:1: field 1 (tag): 'VERTEX_SE2' is not read"});
}

TEST_F(ConvertTest, DamagedBinaryMapIsRefused) {
  write_plain();
  answer({"convert", "plain.map", "plain.cairn"});
  const std::string whole = content("plain.cairn");
  write("cut.cairn", whole.substr(0, whole.size() / 2));
  expect_refusal({"convert", "cut.cairn", "out.map"}, kBadInput,
                 {fmt::format("cut.cairn: byte 16: size: the file ends after {} bytes; expected {} "
                              "bytes, as it states",
                              whole.size() / 2, whole.size())});
  std::string damaged = whole;
  damaged[whole.size() / 2] ^= 1;
  write("damaged.cairn", damaged);
  expect_refusal({"info", "damaged.cairn"}, kBadInput,
                 {"damaged.cairn: byte ", "checksum: the bytes before are damaged"});
  EXPECT_FALSE(files().contains("out.map"));
}

TEST_F(ConvertTest, OptionsOfOtherFormatsAreRefusedForBinaryMaps) {
  write_plain();
  expect_refusal({"convert", "plain.map", "out.cairn", "--ascii"}, kWrongUsage,
                 {"--ascii: out.cairn is neither PLY nor PCD"});
  expect_refusal({"convert", "plain.map", "out.cairn", "--format-version", "2"}, kWrongUsage,
                 {"--format-version: out.cairn is not in the text format"});
}

TEST_F(ConvertTest, PointCloudsKeepPositionsAndCovariances) {
  const LandmarkMap map = write_pair().source;
  const std::vector<std::pair<const char*, Words>> outputs = {{"a.ply", {}},
                                                              {"b.ply", {"--ascii"}},
                                                              {"c.pcd", {"--double"}},
                                                              {"d.pcd", {"--double", "--ascii"}}};
  for (const auto& [name, options] : outputs) {
    Words words = {"convert", "source.map", name};
    words.insert(words.end(), options.begin(), options.end());
    EXPECT_EQ(answer(words), std::string(name) + ": 600 landmarks\n");
    answer({"convert", name, "back.map"});
    const LandmarkMap back = read_map(path("back.map"));
    ASSERT_EQ(back.landmark_count(), map.landmark_count());
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      EXPECT_EQ(back.landmarks().positions[i], map.landmarks().positions[i]);
      EXPECT_EQ(back.covariance(LandmarkIndex{i}), map.covariance(LandmarkIndex{i}));
    }
  }
  EXPECT_THAT(content("b.ply"), HasSubstr("format ascii"));
  EXPECT_THAT(content("d.pcd"), HasSubstr("DATA ascii"));
}

TEST_F(ConvertTest, PcdHasPositionsInSinglePrecisionByDefault) {
  const LandmarkMap map = write_pair().source;
  answer({"convert", "source.map", "a.pcd"});
  const LandmarkMap back = read_map(path("a.pcd"));
  ASSERT_EQ(back.landmark_count(), map.landmark_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    EXPECT_EQ(back.landmarks().positions[i],
              map.landmarks().positions[i].cast<float>().cast<double>());
  }
}

TEST_F(ConvertTest, ColmapModelsAreFoldersAndReadWhereMapsAre) {
  write_pair();
  const CommandResult result = cairn({"convert", "source.map", "model/"});
  EXPECT_EQ(result.exit_code, kDone) << result.errors;
  EXPECT_THAT(result.output, StartsWith("model/: 20 frames, 600 landmarks"));
  EXPECT_THAT(result.errors, HasSubstr("model/: COLMAP has no place for: unit of length (metres)"));
  answer({"convert", "source.map", "text", "--format", "colmap-text"});
  EXPECT_TRUE(std::filesystem::exists(path("model/points3D.bin")));
  EXPECT_TRUE(std::filesystem::exists(path("text/points3D.txt")));
  for (const char* model : {"model", "text", "text/images.txt"}) {
    const Json info = document({"info", model});
    EXPECT_EQ(info.at("inputs").at("map").at("landmarks"), 600) << model;
    EXPECT_EQ(info.at("length_unit"), "free") << model;
  }
}

TEST_F(ConvertTest, FolderFormatsTakeNewOrEmptyFoldersOnly) {
  write_pair();
  std::filesystem::create_directory(path("full"));
  write("full/precious", "text");
  const CommandResult result = cairn({"convert", "source.map", "full/"});
  EXPECT_NE(result.exit_code, kDone);
  EXPECT_THAT(result.errors, HasSubstr("full/: cannot be written: the folder is not empty"));
  EXPECT_EQ(content("full/precious"), "text");
  expect_refusal({"convert", "source.map", "out", "--format", "colmapp"}, kWrongUsage,
                 {"--format: 'colmapp'; expected text, binary, ply, pcd"});
}

TEST_F(ConvertTest, SaysWhatAPointCloudCannotHold) {
  write_plain();
  const CommandResult result = cairn({"convert", "plain.map", "plain.ply"});
  EXPECT_THAT(result.errors,
              HasSubstr("plain.ply holds landmarks only: 2 frames and 3 observations"));
  EXPECT_EQ(cairn({"convert", "plain.map", "plain.ply", "--quiet"}).errors, "");
  const Json output = document({"convert", "plain.map", "plain.ply"}).at("output");
  EXPECT_TRUE(output.at("frames").is_null());
  EXPECT_TRUE(output.at("observations").is_null());
  EXPECT_EQ(output.at("landmarks"), 3);
}

TEST_F(ConvertTest, RecordingsAreForOtherViewers) {
  const LandmarkMap map = write_pair().source;
  const CommandResult result =
      cairn({"convert", "source.map", "source.mcap", "--confidence", "covariance"});
  EXPECT_EQ(result.output, "source.mcap: 20 frames, 600 landmarks\n") << result.errors;
  EXPECT_THAT(result.errors, HasSubstr("MCAP has no place for: "));
  const McapRecording recording = read_mcap(content("source.mcap"));
  EXPECT_EQ(recording.of_topic("/tf").size(), map.frame_count());
  EXPECT_THAT(recording.of_topic("/landmarks").at(0).data, HasSubstr("confidence_covariance"));
  EXPECT_EQ(
      answer({"convert", "source.map", "-", "--format", "mcap", "--confidence", "covariance"}),
      content("source.mcap"));

  expect_refusal({"convert", "source.map", "strict.mcap", "--strict"}, kBadInput,
                 {"--strict", "MCAP has no place for: "});
  expect_refusal({"convert", "source.mcap", "back.map"}, kBadInput,
                 {"source.mcap: is an MCAP recording; expected a map"});
  expect_refusal({"convert", "source.map", "source.mcab"}, kWrongUsage, {"source.mcab", ".mcap"});
  expect_refusal({"convert", "source.map", "nowhere/source.mcap"}, kSystemError, {"nowhere"});
  expect_refusal({"convert", "source.map", "a.mcap", "--ascii"}, kWrongUsage,
                 {"--ascii: a.mcap is neither PLY nor PCD"});
  EXPECT_THAT(files(), ::testing::UnorderedElementsAre("source.map", "target.map", "source.mcap",
                                                       "truth.txt", "start.txt"));
}

TEST_F(ConvertTest, AMapOfNothingIsARecording) {
  write("empty.map", "CAIRN 2\n");
  EXPECT_EQ(answer({"convert", "empty.map", "empty.mcap"}), "empty.mcap: 0 frames, 0 landmarks\n");
  EXPECT_EQ(read_mcap(content("empty.mcap")).messages.size(), 1U);
}

TEST_F(ConvertTest, FramesCutAMiniMap) {
  const LandmarkMap map = write_pair().source;
  answer({"convert", "source.map", "first.map", "--frames", "0:8"});
  EXPECT_THAT(read_map(path("first.map")),
              EqualsMap(with_content_uuid(cut_frames(map, FrameId{0}, FrameId{8}))));
}

TEST_F(ConvertTest, FramesThatTheMapDoesNotHaveAreRefused) {
  write_plain();
  expect_refusal({"convert", "plain.map", "out.map", "--frames", "100:200"}, kWrongUsage,
                 {"cairn: --frames: ", "100", "200"});
  EXPECT_THAT(files(), ElementsAre("plain.map"));
}

TEST_F(ConvertTest, FramesOfAPointCloudAreRefused) {
  write_plain();
  answer({"convert", "plain.map", "plain.ply"});
  expect_refusal({"convert", "plain.ply", "out.map", "--frames", "0:1"}, kBadInput,
                 {"plain.ply", "observations", "--frames"});
}

TEST_F(ConvertTest, MinObservationsLeavesOutLandmarks) {
  write_plain();
  answer({"convert", "plain.map", "one.map", "--min-observations", "1"});
  answer({"convert", "plain.map", "two.map", "--min-observations", "2"});
  EXPECT_THAT(read_map(path("one.map")).landmarks().ids, ElementsAre(LandmarkId{1}, LandmarkId{2}));
  EXPECT_THAT(read_map(path("two.map")).landmarks().ids, ElementsAre(LandmarkId{1}));
}

TEST_F(ConvertTest, TransformMovesTheMapByMetresAndDegrees) {
  const LandmarkMap map = write_plain();
  answer({"convert", "plain.map", "moved.map", "--transform", "1 2 3 0 0 90"});
  const LandmarkMap moved = read_map(path("moved.map"));
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const Eigen::Vector3d& x = map.landmarks().positions[i];
    const Eigen::Vector3d expected(1.0 - x.y(), 2.0 + x.x(), 3.0 + x.z());
    EXPECT_LT((moved.landmarks().positions[i] - expected).norm(), 1e-12);
  }
}

TEST_F(ConvertTest, TransformByRollPitchYawIsYawTimesPitchTimesRoll) {
  const LandmarkMap map = write_plain();
  answer({"convert", "plain.map", "moved.map", "--transform", "-0.1 0 0 10 -20 30"});
  constexpr double kDegree = std::numbers::pi / 180.0;
  const Rigid3 pose =
      Rigid3::from_roll_pitch_yaw({-0.1, 0, 0}, 10 * kDegree, -20 * kDegree, 30 * kDegree);
  const Eigen::Matrix3d rotation = (Eigen::AngleAxisd(30 * kDegree, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(-20 * kDegree, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(10 * kDegree, Eigen::Vector3d::UnitX()))
                                       .toRotationMatrix();
  EXPECT_LT((pose.matrix().topLeftCorner<3, 3>() - rotation).norm(), 1e-12);
  const LandmarkMap moved = read_map(path("moved.map"));
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    EXPECT_LT((moved.landmarks().positions[i] - pose * map.landmarks().positions[i]).norm(), 1e-12);
  }
}

TEST_F(ConvertTest, ConfidencesBecomeColumnsThatAlignmentCanUse) {
  const LandmarkMap map = write_pair().source;
  answer({"convert", "source.map", "source.ply", "--confidence", "covariance,distance"});
  answer({"convert", "target.map", "target.pcd", "--confidence", "covariance,distance"});
  const LandmarkMap cloud = read_map(path("source.ply"));
  const NamedColumn* const column = cloud.column("confidence_distance");
  ASSERT_NE(column, nullptr);
  EXPECT_EQ(column->values, distance_metric().evaluate(map));
  ASSERT_NE(cloud.column("confidence_covariance"), nullptr);

  answer({"align", "source.ply", "target.pcd", "--confidence", "column:confidence_distance",
          "--initial-matrix", "start.txt"});
}

TEST_F(ConvertTest, VersionOneIsRefusedWhereItWouldLoseSomething) {
  write_map(full_map(), path("full.map"));
  expect_refusal({"convert", "full.map", "out.map", "--format-version", "1"}, kWrongUsage,
                 {"version 1", "would lose"});
  EXPECT_THAT(files(), ElementsAre("full.map"));
  write_plain();
  answer({"convert", "plain.map", "two.map", "--format-version", "2"});
  EXPECT_THAT(content("two.map"), StartsWith("CAIRN 2\n"));
  answer({"convert", "two.map", "one.map", "--format-version", "1"});
  EXPECT_EQ(content("one.map"), content("plain.map"));
}

TEST_F(ConvertTest, AnOutputThatIsAnInputIsRefused) {
  write_plain();
  const std::string before = content("plain.map");
  std::filesystem::create_symlink("plain.map", path("link.map"));
  std::filesystem::create_hard_link(path("plain.map"), path("hard.map"));
  std::filesystem::create_directory(path("folder"));
  std::filesystem::create_directory_symlink(".", path("here"));
  for (const char* const output : {"plain.map", "./plain.map", "link.map", "hard.map",
                                   "folder/../plain.map", "here/plain.map"}) {
    expect_refusal({"convert", "plain.map", output, "--min-observations", "2"}, kWrongUsage,
                   {"output", output, "the input too"});
    expect_refusal({"info", "plain.map", "--json", output}, kWrongUsage,
                   {"--json", output, "the map too"});
  }
  write("turn.txt", "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n");
  expect_refusal(
      {"convert", "plain.map", "out.map", "--transform-matrix", "turn.txt", "--json", "turn.txt"},
      kWrongUsage, {"--json", "turn.txt", "--transform-matrix"});
  EXPECT_EQ(content("plain.map"), before);
}

TEST_F(ConvertTest, TwoOutputsInOneFileAreRefused) {
  write_plain();
  std::filesystem::create_directory_symlink(".", path("here"));
  for (const char* const json : {"out.map", "here/out.map"}) {
    expect_refusal({"convert", "plain.map", "out.map", "--json", json}, kWrongUsage,
                   {json, "the output", "--json"});
  }
  EXPECT_FALSE(std::filesystem::exists(path("out.map")));
  // A device holds nothing that could be lost.
  EXPECT_EQ(cairn({"evaluate", "map", "plain.map", "--json", "/dev/null", "--csv", "/dev/null"})
                .errors.find("/dev/null is"),
            std::string::npos);
}

TEST_F(ConvertTest, AByteOrderMarkIsAcceptedInEachTextFile) {
  write_plain();
  const std::string mark = "\xEF\xBB\xBF";
  write("marked.map", mark + content("plain.map"));
  answer({"convert", "marked.map", "out.map"});
  EXPECT_EQ(content("out.map"), content("plain.map"));
  for (const std::string name : {"plain.ply", "plain.pcd"}) {
    answer({"convert", "plain.map", name, "--ascii"});
    write("marked", mark + content(name));
    answer({"convert", "marked", "out.map"});
    EXPECT_EQ(read_map(path("out.map")).landmark_count(), 3U);
  }
  const std::string matrix = "1 0 0 5  0 1 0 0  0 0 1 0  0 0 0 1\n";
  write("moved.txt", mark + matrix);
  answer({"convert", "plain.map", "moved.map", "--transform-matrix", "moved.txt"});
}

TEST_F(ConvertTest, LandmarksBeyondTheLimitAreLeftOutAndCounted) {
  write("far.map",
        "LANDMARK 1 0 0 0 0 0 0 0 0 0 0 0 0 0\nLANDMARK 2 0 1e40 0 0 0 0 0 0 0 0 0 0 0\n");
  const CommandResult read = cairn({"info", "far.map"});
  EXPECT_EQ(read.exit_code, 0);
  EXPECT_THAT(read.errors, HasSubstr("far.map: 1 of 2 landmarks left out"));
  EXPECT_THAT(read.errors, HasSubstr("beyond 1e+09"));
  expect_refusal({"convert", "far.map", "out.ply", "--strict"}, kBadInput,
                 {"far.map: 1 of 2 landmarks left out"});
}

TEST_F(ConvertTest, MetricWithoutItsInputFailsByNameAndWritesNothing) {
  write_plain();
  expect_refusal({"convert", "plain.map", "out.ply", "--confidence", "reprojection"}, kBadInput,
                 {"reprojection", "camera"});
  EXPECT_THAT(files(), ElementsAre("plain.map"));
}

TEST_F(ConvertTest, JsonSaysWhatWasAskedAndWritten) {
  write_plain();
  const Json json = document({"convert", "plain.map", "out.map", "--frames", "1:2",
                              "--min-observations", "1", "--transform", "1 0 0 0 0 0"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.convert");
  EXPECT_EQ(json.at("inputs").at("map").at("landmarks"), 3);
  EXPECT_EQ(json.at("options").at("frames"), "1:2");
  EXPECT_EQ(json.at("options").at("min_observations"), 1);
  EXPECT_EQ(json.at("options").at("transform").at(0), Json({1.0, 0.0, 0.0, 1.0}));
  EXPECT_EQ(json.at("output").at("path"), "out.map");
  EXPECT_EQ(json.at("output").at("frames"), 1);
}

#ifdef CAIRN_HAS_ADJUSTMENT
TEST_F(ConvertTest, EstimatesCovariancesFromObservations) {
  write_pair();
  const std::string text = answer({"convert", "source.map", "with.map", "--estimate-covariances"});
  EXPECT_THAT(text, HasSubstr("covariances of 600 of 600 landmarks, by pixel noise of 0."));
  const LandmarkMap before = read_map(path("source.map"));
  const LandmarkMap map = read_map(path("with.map"));
  ASSERT_TRUE(map.has_covariances());
  EXPECT_EQ(map.landmarks().positions, before.landmarks().positions);
  EXPECT_NE(map.landmarks().covariances, before.landmarks().covariances);
  const Json json = document({"convert", "source.map", "more.map", "--estimate-covariances",
                              "--pixel-noise", "7", "--threads", "1"});
  EXPECT_EQ(json.at("covariances").at("known"), 600);
  EXPECT_EQ(json.at("covariances").at("pixel_noise_px"), 7.0);
  answer({"convert", "source.map", "again.map", "--estimate-covariances", "--threads", "1"});
  EXPECT_EQ(content("again.map"), content("with.map"));
}

TEST_F(ConvertTest, SaysWhyCovariancesCannotBeEstimated) {
  write_pair();
  answer({"convert", "source.map", "points.ply"});
  expect_refusal({"convert", "points.ply", "out.map", "--estimate-covariances"}, kBadInput,
                 {"has no observations"});
  expect_refusal({"convert", "source.map", "out.map", "--pixel-noise", "1"}, kWrongUsage,
                 {"--pixel-noise", "--estimate-covariances"});
  expect_refusal(
      {"convert", "source.map", "out.map", "--estimate-covariances", "--pixel-noise", "0"},
      kWrongUsage, {"--pixel-noise", "a positive number"});
  EXPECT_FALSE(std::filesystem::exists(path("out.map")));
}
#endif

TEST_F(ConvertTest, AMapMadeOfAnotherHasAUuidOfItsOwn) {
  write_pair();
  answer({"convert", "source.map", "same.cairn"});
  answer({"convert", "source.map", "part.cairn", "--min-observations", "4"});
  answer({"convert", "source.map", "again.cairn", "--min-observations", "4"});
  const auto uuid = [&](const char* file) { return read_map(path(file)).info().uuid; };
  EXPECT_EQ(uuid("same.cairn"), uuid("source.map"));
  ASSERT_TRUE(uuid("part.cairn"));
  EXPECT_NE(uuid("part.cairn"), uuid("source.map"));
  EXPECT_EQ(uuid("part.cairn"), uuid("again.cairn"));
}

}  // namespace
}  // namespace cairn::testing
