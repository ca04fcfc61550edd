// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <sys/stat.h>

#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

#include "cli.hpp"
#include "support/mcap_recording.hpp"
#include "support/real_data.hpp"
#include "support/visits.hpp"
#ifdef CAIRN_HAS_POSTGRES
#include "support/postgres_server.hpp"
#endif

namespace cairn::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class AtlasCliTest : public CliTest {
 protected:
  // The words of a verb on town.atlas.
  static Words atlas(Words words) {
    words.insert(words.begin(), "atlas");
    words.insert(words.end(), {"--atlas", "town.atlas"});
    return words;
  }
  // Two sessions of one place, and one of another.
  void fill() const {
    write_pair(900);
    write_map(synthetic_map({.seed = 77, .landmarks = 400, .frames = 10}), path("stranger.map"));
    answer(atlas({"init"}));
    answer(atlas({"add", "target.map", "source.map", "stranger.map"}));
  }
  // Small maps that nothing is known of.
  void fill_small(int maps) const {
    answer(atlas({"init"}));
    for (int i = 1; i <= maps; ++i) {
      write_map(
          synthetic_map({.seed = static_cast<std::uint64_t>(i), .landmarks = 40, .frames = 4}),
          path(std::to_string(i) + ".map"));
      answer(atlas({"add", std::to_string(i) + ".map"}));
    }
  }
};

TEST_F(AtlasCliTest, MakesOneMapOfSessionsAndKeepsHow) {
  const SyntheticPair pair = write_pair(900);
  fill();
  EXPECT_THAT(answer(atlas({"link"})), AllOf(ContainsRegex("target <- source >?99\\.[0-9]+ %"),
                                             HasSubstr("3 pairs tried, 1 aligned\n"),
                                             HasSubstr("hint: 'cairn atlas show --all'")));
  EXPECT_EQ(answer(atlas({"link"})), "0 pairs tried, 0 aligned; 3 tried before\n");
  EXPECT_EQ(answer(atlas({"optimize"})),
            "2 maps in the frame of target\n1 map not placed: no link connects them\n");
  const CommandResult merged = cairn(atlas({"merge", "-o", "town.map"}));
  EXPECT_EQ(merged.exit_code, kNoAlignment);
  EXPECT_THAT(merged.output,
              AllOf(HasSubstr("merged 2 of 3 maps, in the frame of target\n"),
                    HasSubstr("left out stranger: no link places it\n"),
                    HasSubstr("1,800 landmarks became 1,"), HasSubstr("wrote town.map\n")));
  EXPECT_EQ(read_map(path("town.map")).frame_count(), 40U);

  const Json show = document(atlas({"show"}));
  EXPECT_EQ(show.at("schema"), Json({{"name", "cairn.atlas_show"}, {"version", 1}}));
  ASSERT_EQ(show.at("maps").size(), 3U);
  EXPECT_EQ(show.at("maps").at(1).at("frame"), "target");
  EXPECT_TRUE(show.at("maps").at(2).at("frame").is_null());
  EXPECT_EQ(show.at("links").size(), 3U);
  const Rigid3 error =
      pose_of(show.at("maps").at(1).at("frame_from_map")).inverse() * pair.target_from_source;
  EXPECT_LT(error.angle(), 0.003);
  EXPECT_THAT(answer(atlas({"show", "--all"})),
              AllOf(HasSubstr("rejected"), HasSubstr("stranger")));

  const Json route = document(atlas({"path", "source", "target"}));
  EXPECT_EQ(route.at("route"), Json({"source", "target"}));
  EXPECT_LT((pose_of(route.at("target_from_source")) * pair.target_from_source).angle(), 0.003);
  EXPECT_EQ(route.at("covariance").size(), 7U);
  EXPECT_EQ(cairn(atlas({"path", "#1", "stranger"})).exit_code, kNoAlignment);
  EXPECT_THAT(answer(atlas({"verify"})), HasSubstr("sound\n"));
}

TEST_F(AtlasCliTest, AdjustsTheMergedMapIfAsked) {
  write_pair(900);
  answer(atlas({"init"}));
  answer(atlas({"add", "target.map", "source.map"}));
  answer(atlas({"link"}));
  answer(atlas({"optimize"}));
  EXPECT_TRUE(document(atlas({"merge", "-o", "plain.map"})).at("adjustment").is_null());
  const Json adjustment = document(atlas({"merge", "-o", "town.map", "--adjust"})).at("adjustment");
  EXPECT_LT(adjustment.at("final_rms_px").get<double>(),
            adjustment.at("initial_rms_px").get<double>());
  EXPECT_THAT(read_map(path("town.map")).info().provenance.back(), HasSubstr("adjusted: "));
  EXPECT_THAT(answer(atlas({"merge", "-o", "again.map", "--adjust", "--refine-intrinsics"})),
              HasSubstr("adjusted by "));
}

TEST_F(AtlasCliTest, ExportsGraphKeyframesLandmarksAndMaps) {
  fill();
  answer(atlas({"link", "--only", "source"}));
  answer(atlas({"optimize"}));
  answer(atlas({"export", "-o", "town.g2o"}));
  EXPECT_THAT(content("town.g2o"),
              AllOf(HasSubstr("VERTEX_SE3:QUAT 2 "), HasSubstr("EDGE_SE3:QUAT 1 2 ")));
  answer(atlas({"export", "-o", "town.json"}));
  EXPECT_EQ(Json::parse(content("town.json")).at("nodes").size(), 3U);
  answer(atlas({"export", "-o", "town.ply"}));
  EXPECT_EQ(read_map(path("town.ply")).landmark_count(), 1800U);
  answer(atlas({"export", "-o", "all"}));
  EXPECT_TRUE(fs::exists(path("all") / "stranger.cairn"));
  EXPECT_TRUE(fs::exists(path("all") / "graph.json"));
  answer(atlas({"export", "--map", "source", "-o", "again.map"}));
  EXPECT_EQ(read_map(path("again.map")).landmark_count(), 900U);
  const CommandResult recorded = cairn(atlas({"export", "-o", "town.mcap"}));
  EXPECT_EQ(recorded.output, "wrote town.mcap\n") << recorded.errors;
  EXPECT_THAT(recorded.errors,
              HasSubstr("town.mcap: left out 1 of 3 maps, which are not in the frame of target"));
  const McapRecording recording = read_mcap(content("town.mcap"));
  EXPECT_EQ(recording.of_topic("/tf").size(), 2U);
  EXPECT_EQ(recording.of_topic("/map/source/landmarks").size(), 1U);
  EXPECT_EQ(protobuf_fields(recording.of_topic("/links").at(0).data).at(2).size(), 1U);
  answer(atlas({"export", "--map", "stranger", "-o", "one.mcap"}));
  EXPECT_EQ(read_mcap(content("one.mcap")).of_topic("/tf").size(), 10U);
  expect_refusal({"convert", "town.atlas", "direct.mcap"}, kWrongUsage,
                 {"town.atlas: is an atlas, not a map",
                  "cairn atlas export --atlas town.atlas -o direct.mcap"});
  EXPECT_FALSE(fs::exists(path("direct.mcap")));
  expect_refusal(atlas({"export", "-o", "town.xyz"}), kWrongUsage,
                 {".g2o, .json, .tum, .ply, .mcap"});
}

TEST_F(AtlasCliTest, LogsUndoesAndLooksBack) {
  fill_small(3);
  write("pose.txt", "1 0 0 1  0 1 0 0  0 0 1 0  0 0 0 1\n");
  answer(atlas({"link", "--manual", "1", "2", "--pose", "pose.txt"}));
  answer(atlas({"link", "--manual", "2", "#3", "--pose", "pose.txt", "--reason", "seen"}));
  answer(atlas({"optimize"}));
  EXPECT_THAT(answer(atlas({"path", "1", "3"})),
              AllOf(HasSubstr("1 <- 2 <- 3\n"), HasSubstr("optimised:       2.0000 ")));
  EXPECT_THAT(answer(atlas({"undo"})), StartsWith("undid commit 6: optimize 3 of 3 maps placed"));
  EXPECT_THAT(answer(atlas({"undo"})), HasSubstr("commit 5"));
  EXPECT_EQ(document(atlas({"show"})).at("links").size(), 1U);
  EXPECT_EQ(document(atlas({"show", "--at", "6"})).at("links").size(), 2U);
  EXPECT_THAT(answer(atlas({"diff", "6"})),
              AllOf(HasSubstr("no longer linked 2 <- 3"), HasSubstr("no longer placed 1")));
  EXPECT_THAT(answer(atlas({"undo", "--commit", "8"})), HasSubstr("commit 8"));
  EXPECT_EQ(document(atlas({"show"})).at("links").size(), 2U);
  const Json log = document(atlas({"log"}));
  ASSERT_EQ(log.at("commits").size(), 9U);
  EXPECT_EQ(log.at("commits").at(0).at("undoes"), 8);
  EXPECT_EQ(log.at("commits").at(8).at("verb"), "add");
  answer(atlas({"unlink", "3", "2", "--reason", "no"}));
  answer(atlas({"remove", "1"}));
  EXPECT_EQ(document(atlas({"show"})).at("maps").size(), 2U);
  EXPECT_THAT(answer(atlas({"compact", "--keep", "1"})), HasSubstr("no data was dropped"));
  EXPECT_THAT(answer(atlas({"compact", "--keep", "1", "--yes"})), HasSubstr("1 maps"));
  EXPECT_THAT(answer(atlas({"verify"})), HasSubstr("sound"));
  expect_refusal(atlas({"undo", "--commit", "3"}), kWrongUsage, {"no commit 3"});
}

TEST_F(AtlasCliTest, DiffOfTheWorldNamesTheThingThatMoved) {
  const Rigid3 motion = Rigid3::from_roll_pitch_yaw({-0.9, 0.2, 0.1}, 0.0, 0.0, 0.3);
  write_map(visit(with(wall(), box_at(0.3)), 11), path("monday.cairn"));
  write_map(visit(with(wall(), moved(box_at(0.3), motion)), 12), path("tuesday.cairn"));
  write("pose.txt", "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n");
  answer(atlas({"init"}));
  answer(atlas({"add", "monday.cairn", "tuesday.cairn"}));
  const Words diff = atlas({"diff", "--world", "monday", "tuesday"});
  expect_refusal(diff, kWrongUsage, {"monday has no pose", "'optimize' placed"});
  answer(atlas({"link", "--manual", "monday", "tuesday", "--pose", "pose.txt"}));
  answer(atlas({"optimize"}));

  const std::string text = answer(diff);
  EXPECT_THAT(text,
              AllOf(ContainsRegex("^[0-9,]+ and [0-9,]+ landmarks are comparable, [0-9.]+ % of "
                                  "them were found again; in the frame of monday\n"),
                    ContainsRegex("moved .* at 0\\.[0-9]+ .*; now at -?[0-9.]+ ")));
  const Json json = document(diff);
  EXPECT_EQ(json.at("schema").at("name"), "cairn.atlas_diff_world");
  EXPECT_EQ(json.at("frame"), "monday");
  ASSERT_EQ(json.at("changes").size(), 1U);
  const Json& change = json.at("changes").at(0);
  EXPECT_EQ(change.at("kind"), "moved");
  const auto position = [](const Json& place) {
    return Eigen::Vector3d(place.at("position").at(0), place.at("position").at(1),
                           place.at("position").at(2));
  };
  const Eigen::Vector3d before = position(change.at("before"));
  EXPECT_LT((before - Eigen::Vector3d(0.45, 0.05, 2.05)).norm(), 0.06);
  EXPECT_LT((position(change.at("after")) - motion * before).norm(), 0.06);
  EXPECT_LT((pose_of(change.at("after_from_before")) * before - motion * before).norm(), 0.02);

  EXPECT_THAT(answer(atlas({"diff", "--world", "monday", "tuesday", "--min-size", "0.6"})),
              HasSubstr("no changes found\n"));
  // After the maps were added and before they were linked, nothing said how they lie.
  expect_refusal(atlas({"diff", "--world", "monday", "tuesday", "--at", "2"}), kWrongUsage,
                 {"monday has no pose"});
  expect_refusal(atlas({"diff", "--world", "monday"}), kWrongUsage,
                 {"--world", "two sessions or maps"});
  expect_refusal(atlas({"diff", "--world", "monday", "monday"}), kWrongUsage,
                 {"monday is on both sides"});
  expect_refusal(atlas({"diff", "--world", "monday", "sunday"}), kWrongUsage, {"no map 'sunday'"});
  expect_refusal(atlas({"diff", "--world", "monday", "tuesday", "--min-confidence", "1"}),
                 kWrongUsage, {"--min-confidence: 1"});
  expect_refusal(atlas({"diff", "1", "--at", "2"}), kWrongUsage, {"--at", "--world"});
}

TEST_F(AtlasCliTest, DiffOfTheWorldTakesAllMapsOfASession) {
  for (const auto& [session, box] : {std::pair("monday", true), std::pair("tuesday", false)}) {
    fs::create_directory(path(session));
    for (std::uint64_t part = 0; part < 2; ++part) {
      write_map(visit(box ? with(wall(), box_at(0.2)) : wall(), 11 + 2 * part + (box ? 0 : 1)),
                path(session) / fmt::format("{}.cairn", part));
    }
  }
  write("pose.txt", "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n");
  answer(atlas({"init"}));
  answer(atlas({"add", "monday", "tuesday"}));
  for (const std::string other : {"monday/1", "tuesday/0", "tuesday/1"}) {
    answer(atlas({"link", "--manual", "monday/0", other, "--pose", "pose.txt"}));
  }
  answer(atlas({"optimize"}));
  for (const bool reversed : {false, true}) {
    const Json json = document(reversed ? atlas({"diff", "--world", "tuesday", "monday"})
                                        : atlas({"diff", "--world", "monday", "tuesday"}));
    ASSERT_EQ(json.at("changes").size(), 1U);
    EXPECT_EQ(json.at("changes").at(0).at("kind"), reversed ? "appeared" : "vanished");
  }
}

TEST_F(AtlasCliTest, TakesMiniMapsOfAFolderAsASession) {
  fs::create_directory(path("robot"));
  for (const std::uint64_t seed : {1, 2}) {
    write_map(synthetic_map({.seed = seed, .landmarks = 40, .frames = 4}),
              path("robot") / fmt::format("{}.cairn", seed));
  }
  answer(atlas({"init"}));
  EXPECT_THAT(answer(atlas({"add", "robot"})),
              HasSubstr("added robot/2: 40 landmarks, 4 keyframes\n"));
  EXPECT_THAT(answer(atlas({"add", "robot"})), HasSubstr("is in the atlas already, as robot/2\n"));
  EXPECT_EQ(document(atlas({"show"})).at("maps").at(1).at("session"), "robot");
  answer(atlas({"add", "robot/1.cairn", "--name", "one more"}));
  EXPECT_EQ(document(atlas({"show"})).at("maps").size(), 2U);
}

#ifdef CAIRN_HAS_ODOMETRY
// Mini-maps of a real session, as if they were strangers: in any order, and in an atlas, they become the same map.
TEST_F(AtlasCliTest, MergesRealMiniMapsAsMergeDoesInAnyOrder) {
  const auto data = real_data();
  if (!data) GTEST_SKIP() << kNoRealData;
  answer({"map", (*data / "tum_fr1_xyz").string(), "--camera", "fr1", "-o", "xyz",
          "--mini-map-length", "100f"});
  std::vector<std::string> maps;
  for (const auto& entry : fs::directory_iterator(path("xyz"))) {
    if (entry.path().extension() == ".map")
      maps.push_back("xyz/" + entry.path().filename().string());
  }
  std::sort(maps.begin(), maps.end());
  ASSERT_GE(maps.size(), 4U);
  // Its landmarks in the frame of the first mini-map.
  const auto positions = [&](const std::string& merged, const std::string& result) {
    Similarity3 first_from_world;
    for (const Json& one :
         result.empty() ? Json::array() : Json::parse(content(result)).at("maps")) {
      if (one.at("name") == fs::path(maps[0]).stem().string()) {
        first_from_world = Similarity3(pose_of(one.at("world_from_map")).inverse());
      }
    }
    return transformed(read_map(path(merged)), first_from_world).landmarks().positions;
  };
  const auto merged = [&](std::vector<std::string> order) {
    order.insert(order.begin(), "merge");
    order.insert(order.end(), {"-o", "merged.map", "--json", "merged.json"});
    answer(order);
    return positions("merged.map", "merged.json");
  };
  const std::vector<Eigen::Vector3d> expected = merged(maps);
  std::vector<std::string> other = maps;
  std::reverse(other.begin(), other.end());
  std::swap(other[0], other[1]);
  std::vector<std::vector<Eigen::Vector3d>> found = {merged(other)};
  std::rotate(other.begin(), std::find(other.begin(), other.end(), maps[0]), other.end());
  answer(atlas({"init"}));
  other.insert(other.begin(), "add");
  answer(atlas(other));
  answer(atlas({"link"}));
  answer(atlas({"optimize"}));
  answer(atlas({"merge", "-o", "town.map"}));
  found.push_back(positions("town.map", ""));
  for (const auto& one : found) {
    ASSERT_EQ(one.size(), expected.size());
    double most = 0.0;
    for (std::size_t i = 0; i < one.size(); ++i) {
      most = std::max(most, (one[i] - expected[i]).norm());
    }
    EXPECT_LT(most, 1e-4);
  }
}
#endif

TEST_F(AtlasCliTest, SaysWhichLinksAreNoIndependentEvidence) {
  write_pair(900);
  answer({"convert", "target.map", "part.map", "--frames", "0:12"});
  answer(atlas({"init"}));
  answer(atlas({"add", "target.map", "source.map", "part.map"}));
  const std::string text = answer(atlas({"link"}));
  EXPECT_THAT(text, ContainsRegex("target <- part >?99\\.[0-9]+ %, no independent evidence: .*12 "
                                  "images are in both maps"));
  EXPECT_THAT(text, ContainsRegex("target <- source >?99\\.[0-9]+ %\n"));
}

TEST_F(AtlasCliTest, KeepsTheLinksOfARunsOdometry) {
  const Similarity3 first_from_second = write_mini_maps("run");
  answer(atlas({"init"}));
  EXPECT_THAT(answer(atlas({"add", "run"})), HasSubstr("linked 1 pair by odometry\n"));
  EXPECT_THAT(answer(atlas({"add", "run"})), Not(HasSubstr("by odometry")));
  EXPECT_THAT(answer(atlas({"link"})), HasSubstr("1 pair tried, 0 aligned\n"));
  EXPECT_EQ(answer(atlas({"optimize"})), "2 maps in the frame of run/1\n");
  EXPECT_EQ(answer(atlas({"optimize", "--update"})), "2 maps in the frame of run/1\n");
  const Json show = document(atlas({"show", "--all"}));
  EXPECT_EQ(show.at("links").at(0).at("kind"), "odometry");
  EXPECT_TRUE(pose_of(show.at("maps").at(1).at("frame_from_map"))
                  .matrix()
                  .isApprox(first_from_second.matrix(), 1e-9));
}

TEST_F(AtlasCliTest, SplitsAMap) {
  write_map(synthetic_map({.seed = 5, .landmarks = 500, .frames = 30}), path("long.map"));
  answer(atlas({"init"}));
  answer(atlas({"add", "long.map"}));
  EXPECT_THAT(answer(atlas({"split", "long", "--keyframes", "10"})), HasSubstr("long/3: "));
  EXPECT_EQ(document(atlas({"show"})).at("maps").size(), 3U);
}

TEST_F(AtlasCliTest, RefusesWhatCannotBe) {
  expect_refusal({"atlas", "show"}, kWrongUsage, {"--atlas", "not given"});
  expect_refusal(atlas({"show"}), kBadInput, {"town.atlas", "no such file", "atlas init"});
  expect_refusal({"atlas", "rename"}, kWrongUsage, {"expected one of", "init"});
  fill_small(2);
  expect_refusal(atlas({"init"}), kWrongUsage, {"town.atlas", "exists already"});
  expect_refusal({"atlas", "init", "town.atlas"}, kWrongUsage,
                 {"not expected: town.atlas (the atlas is named by --atlas)"});
  expect_refusal({"atlas", "show", "--atlas", "1.map"}, kBadInput, {"1.map", "no SQLite database"});
  expect_refusal(atlas({"path", "1", "kitchen"}), kWrongUsage, {"no map 'kitchen'", "1, 2"});
  expect_refusal(atlas({"merge", "-o", "a.map"}), kWrongUsage, {"no two maps are in one frame"});
  expect_refusal(atlas({"merge"}), kWrongUsage, {"--output"});
  expect_refusal(atlas({"show", "--at", "9"}), kWrongUsage, {"commit 9", "the last of which is 2"});
  expect_refusal(atlas({"link", "--manual", "1", "2"}), kWrongUsage, {"--pose"});
  expect_refusal(atlas({"link", "--shard", "3/2"}), kWrongUsage, {"--shard", "'3/2'"});
  expect_refusal(atlas({"link", "--min-probability", "2"}), kWrongUsage, {"--min-probability"});
  write("pose.txt", "1 0 0 1");
  expect_refusal(atlas({"link", "--manual", "1", "2", "--pose", "pose.txt"}), kBadInput,
                 {"pose.txt"});
  fs::copy_file(path("1.map"), path("other.map"));
  write_map(synthetic_map({.seed = 9, .landmarks = 40, .frames = 4}), path("1.map"));
  expect_refusal(atlas({"add", "1.map"}), kWrongUsage, {"another map is called '1'"});
  EXPECT_EQ(document(atlas({"show"})).at("maps").size(), 2U);
}

TEST_F(AtlasCliTest, TellsDamageAndSavesTheRest) {
  fill_small(3);
  std::string bytes = content("town.atlas");
  const std::size_t at = bytes.find(
      "\x89"
      "CAIRN\r\n");
  ASSERT_NE(at, bytes.npos);
  bytes[at + 700] = static_cast<char>(bytes[at + 700] ^ 0x40);
  write("town.atlas", bytes);
  const CommandResult verified = cairn(atlas({"verify"}));
  EXPECT_EQ(verified.exit_code, kBadInput);
  EXPECT_THAT(verified.output, AllOf(HasSubstr("is damaged"), HasSubstr("atlas salvage")));
  EXPECT_THAT(answer(atlas({"salvage", "-o", "saved.atlas"})),
              AllOf(HasSubstr("lost nodes "), HasSubstr("saved 2 maps, 0 links")));
  EXPECT_EQ(document({"atlas", "verify", "--atlas", "saved.atlas"}).at("sound"), true);
  EXPECT_EQ(content("town.atlas"), bytes);
}

TEST_F(AtlasCliTest, SaysThatTheDiskIsFullAndLosesNothing) {
  fill_small(1);
  write_map(synthetic_map({.seed = 2, .landmarks = 5000, .frames = 10}), path("big.cairn"));
  // A limit on the size of files is as good as a full disk.
  const CommandResult result = run_command(
      {"/bin/sh", "-c",
       fmt::format("trap '' XFSZ; ulimit -f 300; '{}' atlas add big.cairn --atlas town.atlas",
                   CAIRN_TOOL)},
      {.folder = path(".")});
  EXPECT_EQ(result.exit_code, kSystemError);
  EXPECT_THAT(result.errors, AllOf(StartsWith("cairn: town.atlas: "), Not(HasSubstr("internal"))));
  EXPECT_EQ(document(atlas({"verify"})).at("sound"), true);
  answer(atlas({"add", "big.cairn"}));
  EXPECT_EQ(document(atlas({"show"})).at("maps").size(), 2U);
}

// Killed at random moments, an atlas holds all that was acknowledged. CAIRN_KILLS says how often.
TEST_F(AtlasCliTest, HoldsWhatWasAcknowledgedWhenKilled) {
  const char* const wish = std::getenv("CAIRN_KILLS");
  const int kills = wish == nullptr ? 12 : std::stoi(wish);
  fill_small(6);
  write("pose.txt", "1 0 0 1  0 1 0 0  0 0 1 0  0 0 0 1\n");
  answer(atlas({"link", "--manual", "1", "2", "--pose", "pose.txt"}));
  Random random(1);
  std::uint64_t acknowledged = 7;
  int killed = 0;
  double longest = 0.3;  // Seconds until the kill; it follows the speed of the machine.
  for (int i = 0; i < kills; ++i) {
    const std::string added = fmt::format("new{}.map", i);
    const int kind = i % 4;
    if (kind == 0) {
      write_map(synthetic_map(
                    {.seed = 1000 + static_cast<std::uint64_t>(i), .landmarks = 40, .frames = 4}),
                path(added));
    }
    const Words words = atlas(kind == 0   ? Words{"add", added}
                              : kind == 1 ? Words{"link", "--effort", "0.0625", "--retry"}
                              : kind == 2 ? Words{"optimize"}
                                          : Words{"undo"});
    std::string line;
    for (const std::string& word : words) line += " '" + word + "'";
    const std::string tool(CAIRN_TOOL);
    const CommandResult result =
        run_command({"/bin/sh", "-c",
                     fmt::format("'{}'{} & p=$!; sleep {:.4f}; kill -9 $p 2>/dev/null; wait $p",
                                 tool, line, random.uniform(0.0, longest))},
                    {.folder = path(".")});
    const bool was_killed = result.exit_code == 137;
    killed += was_killed ? 1 : 0;
    longest *= was_killed ? 1.5 : 0.5;
    const Json verified = document(atlas({"verify"}));
    ASSERT_EQ(verified.at("sound"), true) << i << ": " << verified.at("problems");
    const std::uint64_t commits = verified.at("commits").get<std::uint64_t>();
    ASSERT_GE(commits, acknowledged) << i;
    if (kind == 0 && result.output.find("added ") != std::string::npos) {
      ASSERT_GT(commits, acknowledged) << i;
    }
    acknowledged = commits;
  }
  EXPECT_GT(killed, 0);
  answer(atlas({"optimize"}));
}

TEST_F(AtlasCliTest, ReadsAnAtlasInAFolderThatCannotBeWritten) {
  if (::geteuid() == 0) GTEST_SKIP() << "root can write everywhere";
  fill_small(2);
  fs::permissions(path("."), fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(answer(atlas({"show"})), HasSubstr("2 maps"));
  expect_refusal(atlas({"remove", "1"}), kSystemError, {"town.atlas"});
  fs::permissions(path("."), fs::perms::owner_all);
}

#ifdef CAIRN_HAS_POSTGRES
// What `show` says of the links, whatever their numbers.
std::set<std::string> links_of(const Json& show) {
  std::set<std::string> links;
  for (Json link : show.at("links")) {
    link.erase("id");
    links.insert(link.dump());
  }
  return links;
}

TEST_F(AtlasCliTest, ProcessesOnOneServerGiveTogetherWhatOneGives) {
  if (const auto why = PostgresServer::missing()) GTEST_SKIP() << *why;
  const PostgresServer server;
  const auto on_server = [&](Words words) {
    words.insert(words.begin(), "atlas");
    words.insert(words.end(), {"--atlas", server.url()});
    return words;
  };
  answer(atlas({"init"}));
  EXPECT_THAT(answer(on_server({"init"})), StartsWith("created postgresql:///postgres?"));
  for (int i = 0; i < 3; ++i) {
    const SyntheticPair pair = synthetic_pair(
        {.seed = 40 + static_cast<std::uint64_t>(i), .landmarks = 300, .frames = 10});
    write_map(pair.source, path(fmt::format("s{}.map", i)));
    write_map(pair.target, path(fmt::format("t{}.map", i)));
    for (const Words& add : {atlas({}), on_server({})}) {
      Words words = add;
      words.insert(words.begin() + 1,
                   {"add", fmt::format("s{}.map", i), fmt::format("t{}.map", i)});
      answer(words);
    }
  }
  answer(atlas({"link"}));
  {
    std::vector<std::unique_ptr<Command>> processes;
    for (int i = 0; i < 8; ++i) {
      processes.push_back(std::make_unique<Command>(command(on_server({"link", "--threads", "1"})),
                                                    CommandOptions{.folder = path(".")}));
    }
    // One is killed; what it had in work is left to whoever comes.
    processes.back()->send(SIGKILL);
    for (auto& process : processes) process->wait();
  }
  answer(on_server({"link"}));
  const Json alone = document(atlas({"show", "--all"}));
  const Json together = document(on_server({"show", "--all"}));
  EXPECT_EQ(alone.at("links").size(), 15U);
  EXPECT_EQ(links_of(together), links_of(alone));
  const std::string placed = answer(atlas({"optimize"}));
  EXPECT_EQ(answer(on_server({"optimize"})), placed);
  // Maps of other places are left out.
  EXPECT_EQ(cairn(atlas({"merge", "-o", "alone.map"})).exit_code, kNoAlignment);
  EXPECT_EQ(cairn(on_server({"merge", "-o", "together.map"})).exit_code, kNoAlignment);
  EXPECT_EQ(content("alone.map"), content("together.map"));
  EXPECT_THAT(answer(on_server({"verify"})), HasSubstr("sound\n"));
  expect_refusal(on_server({"salvage", "-o", "saved.atlas"}), kWrongUsage, {"the path of a file"});
}
#endif

TEST_F(AtlasCliTest, EveryVerbHasHelpWithAnExample) {
  for (const std::string verb :
       {"init", "add", "link", "optimize", "merge", "show", "path", "export", "remove", "split",
        "unlink", "log", "undo", "diff", "verify", "compact", "salvage"}) {
    const std::string help = answer({"atlas", verb, "--help"});
    EXPECT_THAT(help, AllOf(HasSubstr("Example"), HasSubstr("--atlas"))) << verb;
    for (std::size_t begin = 0; begin < help.size();) {
      const std::size_t end = help.find('\n', begin);
      EXPECT_LE(end - begin, 100U) << help.substr(begin, end - begin);
      begin = end + 1;
    }
  }
}

}  // namespace
}  // namespace cairn::testing
