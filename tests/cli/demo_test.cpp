// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <string>

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;

class DemoTest : public CliTest {
 protected:
  /// Whether the tool was built with what rendering and mapping take.
  bool can_simulate() const {
    return answer({"demo", "--help"}).find("--frames") != std::string::npos;
  }

  /// `cairn align` on what `cairn demo --save a/desk` wrote, as the demo's help says.
  Json align_saved() const {
    return document({"align", "a/desk/source.map", "a/desk/target.map", "--initial-matrix",
                     "a/desk/initial.txt", "--truth", "a/desk/truth.txt", "--confidence",
                     "observations", "--method", "icp", "--no-verdict"})
        .at("results")
        .at(0);
  }

  static void expect_same_alignment(const Json& result, const Json& expected) {
    EXPECT_EQ(expected.at("confidence"), "observations");
    // Not to the last bit: the poses went through text files as matrices.
    EXPECT_NEAR(result.at("score").get<double>(), expected.at("score").get<double>(), 1e-9);
    EXPECT_NEAR(result.at("error").at("translation").get<double>(),
                expected.at("error").at("translation").get<double>(), 1e-6);
  }
};

class SimulatedDemoTest : public DemoTest {
 protected:
  void SetUp() override {
    if (!can_simulate())
      GTEST_SKIP() << "built without OpenCV, Ceres or Embree: the simulated demo was not tested";
  }
};

void drop_durations(Json& json) {
  if (json.is_object()) json.erase("duration_s");
  if (!json.is_structured()) return;
  for (Json& part : json) drop_durations(part);
}

TEST_F(DemoTest, HelpTellsWhatItDoesAndHowToGoOn) {
  const std::string help = answer({"demo", "--help"});
  for (const char* const part : {"--displacement", "--save", "--seed", "--synthetic", "--threads",
                                 "cairn align desk/source.map"}) {
    EXPECT_THAT(help, HasSubstr(part));
  }
}

TEST_F(DemoTest, SyntheticMapsAlignByAllStrategiesNearTheTruth) {
  const Json json = document({"demo", "--synthetic"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.demo");
  EXPECT_EQ(json.at("seed"), 1);
  EXPECT_EQ(json.at("options").at("synthetic"), true);
  // Last the pose that is searched for, and judged.
  ASSERT_EQ(json.at("results").size(), 5U);
  EXPECT_EQ(json.at("results").at(4).at("verdict"), "aligned");
  EXPECT_LT(json.at("results").at(4).at("error").at("rotation_deg"), 0.5);
  bool any_near = false;
  for (std::size_t i = 0; i < 4; ++i) {
    const Json& result = json.at("results").at(i);
    EXPECT_TRUE(result.at("verdict").is_null());
    EXPECT_THAT(result.at("status"), ::testing::AnyOf("converged", "stopped"));
    EXPECT_LT(result.at("score"), result.at("initial_score"));
    any_near = any_near || (result.at("error").at("rotation_deg") < 2.0 &&
                            result.at("error").at("translation") < 0.02);
  }
  EXPECT_TRUE(any_near) << "the start is 15 degrees and 0.2 m off";
}

TEST_F(DemoTest, PrintsATableAndWhatItMeans) {
  const std::string text = answer({"demo", "--synthetic"});
  EXPECT_THAT(text, HasSubstr("3000 landmarks"));
  EXPECT_THAT(text, HasSubstr("pose error"));
  EXPECT_THAT(text, HasSubstr("a lower score does not always mean a smaller error"));
  EXPECT_TRUE(files().empty());
}

TEST_F(DemoTest, SavedSyntheticMapsAlignAsTheHelpSays) {
  EXPECT_THAT(answer({"demo", "--synthetic", "--save", "a/desk"}), HasSubstr("Saved to a/desk"));
  expect_same_alignment(align_saved(), document({"demo", "--synthetic"}).at("results").at(2));
}

TEST_F(DemoTest, SeedDecidesTheScene) {
  const auto score = [&](const char* seed) {
    const Json json = document({"demo", "--synthetic", "--seed", seed});
    return json.at("results").at(0).at("score").get<double>();
  };
  const double one = score("1");
  EXPECT_EQ(score("1"), one);
  EXPECT_NE(score("2"), one);
}

TEST_F(DemoTest, FolderThatCannotBeMadeIsNamed) {
  write("file", "");
  expect_refusal({"demo", "--save", "file"}, kWrongUsage, {"file"});
  expect_refusal({"demo", "--save", "file/below"}, kSystemError, {"file/below"});
}

TEST_F(DemoTest, OverwritesAndMixesNothing) {
  std::filesystem::create_directory(path("desk"));
  write("desk/truth.txt", "mine");
  expect_refusal({"demo", "--synthetic", "--save", "desk"}, kWrongUsage,
                 {"desk", "the folder is not empty"});
  EXPECT_EQ(content("desk/truth.txt"), "mine");
  EXPECT_FALSE(std::filesystem::exists(path("desk/source.map")));
}

// A sanitizer makes the frames take twenty times as long.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
const Words kRun = {"demo", "--frames", "40"};
constexpr std::size_t kFrames = 40;
#else
const Words kRun = {"demo"};
constexpr std::size_t kFrames = 150;
#endif

TEST_F(SimulatedDemoTest, MapsTwoSessionsAndAlignsThemNearTheTruth) {
  Words words = kRun;
  words.insert(words.end(), {"--save", "a/desk", "--json", "demo.json"});
  const std::string text = answer(words);
  for (const char* const part :
       {"Simulated two sessions of one desk", "movable things were moved", "ATE", "pose error",
        "Saved to a/desk: source.map target.map truth.txt initial.txt source.tum"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
  const Json json = Json::parse(content("demo.json"));
  EXPECT_EQ(json.at("schema").at("name"), "cairn.demo");
  EXPECT_EQ(json.at("options").at("synthetic"), false);
  EXPECT_EQ(json.at("options").at("frames"), kFrames);
  for (const char* const role : {"source", "target"}) {
    const Json& session = json.at("sessions").at(role);
    EXPECT_EQ(session.at("tracked"), kFrames) << role;
    EXPECT_EQ(session.at("lost"), 0) << role;
    EXPECT_LT(session.at("ate_m").at("rmse"), 0.01) << role;
    EXPECT_GT(session.at("landmarks"), 500) << role;
  }
  EXPECT_EQ(json.at("sessions").at("target").at("objects").at("moved"), 0);
  EXPECT_GT(json.at("sessions").at("source").at("objects").at("moved"), 0);

  ASSERT_EQ(json.at("results").size(), 5U);
  EXPECT_EQ(json.at("results").at(4).at("status"), "aligned");
  EXPECT_THAT(text, HasSubstr("found without an initial pose"));
  for (const Json& result : json.at("results")) {
    EXPECT_THAT(result.at("status"), ::testing::AnyOf("converged", "stopped", "aligned"));
    EXPECT_LT(result.at("error").at("rotation_deg"), 2.0) << result.at("confidence");
    EXPECT_LT(result.at("error").at("translation"), 0.05) << result.at("confidence");
  }
  expect_same_alignment(align_saved(), json.at("results").at(2));

  // The trajectories are what the document says they are.
  const Json evaluation =
      document({"evaluate", "trajectory", "a/desk/source.tum", "a/desk/source_truth.tum"});
  EXPECT_NEAR(evaluation.at("absolute").at("translation_m").at("rmse").get<double>(),
              json.at("sessions").at("source").at("ate_m").at("rmse").get<double>(), 1e-9);
}

TEST_F(SimulatedDemoTest, SameBytesWithAnyNumberOfThreads) {
  const auto run = [&](const char* threads) {
    Json json = document({"demo", "--frames", "40", "--threads", threads, "--save", threads});
    drop_durations(json);
    return json.dump();
  };
  EXPECT_EQ(run("1"), run("2"));
  for (const char* const file :
       {"source.map", "target.map", "truth.txt", "initial.txt", "source.tum", "target.tum",
        "source_truth.tum", "target_truth.tum"}) {
    // Not EXPECT_EQ, which would print both.
    EXPECT_TRUE(content(std::string("1/") + file) == content(std::string("2/") + file)) << file;
  }
}

TEST_F(SimulatedDemoTest, TooFewFramesAreNamed) {
  expect_refusal({"demo", "--frames", "9"}, kWrongUsage, {"--frames", "9", "10"});
  expect_refusal({"demo", "--frames", "-1"}, kWrongUsage, {"--frames", "-1"});
  EXPECT_EQ(cairn({"demo", "--synthetic", "--frames", "50"}).exit_code, kWrongUsage);
}

}  // namespace
}  // namespace cairn::testing
