// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <numbers>
#include <sstream>
#include <string>

#include "cairn/core/file.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/icp.hpp"

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::AnyOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class AlignTest : public CliTest {
 protected:
  // By the paper's ICP alone, which most tests are about.
  const Words pair_ = {"align",     "source.map", "target.map", "--initial-matrix",
                       "start.txt", "--method",   "icp",        "--no-verdict"};

  Words pair(const Words& more) const {
    Words words = pair_;
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(AlignTest, PrintsEachStrategyOnStdoutAndNothingElse) {
  write_pair();
  const CommandResult result =
      cairn(pair({"--confidence", "base,covariance,observations,distance"}));
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, IsEmpty());
  for (const char* const name : {"base", "covariance", "observations", "distance"}) {
    EXPECT_THAT(result.output,
                ContainsRegex(std::string("\n") + name + " +[15] +(converged|stopped)"));
    EXPECT_THAT(result.output,
                HasSubstr(std::string("\nconfidence ") + name + ":\nnot judged: converged"));
  }
  EXPECT_THAT(result.output, HasSubstr("target_from_source: x "));
  EXPECT_THAT(result.output, HasSubstr("m^2"));
}

TEST_F(AlignTest, JsonHasEveryFieldAndNullWhereThereIsNone) {
  const SyntheticPair maps = write_pair();
  const Json json = document(pair({"--confidence", "base,covariance", "-k", "7"}));
  EXPECT_EQ(json.at("schema"), Json({{"name", "cairn.align"}, {"version", 2}}));
  EXPECT_TRUE(json.at("cairn_version").is_string());
  EXPECT_EQ(json.at("seed"), 0);
  for (const char* const role : {"source", "target"}) {
    const Json& input = json.at("inputs").at(role);
    const std::string name = std::string(role) + ".map";
    EXPECT_EQ(input.at("path"), name);
    EXPECT_EQ(input.at("hash"), hash_file(path(name)));
    EXPECT_EQ(input.at("frames"), 20);
    EXPECT_EQ(input.at("landmarks"), 600);
    EXPECT_GT(input.at("observations"), 600);
    EXPECT_EQ(input.at("kept_landmarks"),
              landmarks_observed(role[0] == 's' ? maps.source : maps.target, 2).size());
  }
  EXPECT_EQ(json.at("options").at("k"), 7);
  EXPECT_EQ(json.at("options").at("max_iterations"), 150);
  EXPECT_EQ(json.at("options").at("min_observations"), 2);
  EXPECT_TRUE(json.at("options").at("max_distance").is_null());
  EXPECT_EQ(json.at("options").at("confidence"), Json({"base", "covariance"}));

  ASSERT_EQ(json.at("results").size(), 2U);
  EXPECT_EQ(json.at("results").at(0).at("confidence"), "base");
  EXPECT_EQ(json.at("results").at(0).at("k"), 1);
  EXPECT_EQ(json.at("results").at(1).at("confidence"), "covariance");
  EXPECT_EQ(json.at("results").at(1).at("k"), 7);
  for (const Json& result : json.at("results")) {
    EXPECT_THAT(result.at("status"), AnyOf("converged", "stopped"));
    EXPECT_TRUE(result.at("verdict").is_null());
    EXPECT_EQ(result.at("method"), "icp");
    EXPECT_EQ(result.at("scale"), 1.0);
    EXPECT_EQ(result.at("length_unit"), "metres");
    EXPECT_THAT(result.at("reason").get<std::string>(), Not(IsEmpty()));
    EXPECT_TRUE(result.at("stop_reason").is_string());
    EXPECT_GT(result.at("score"), 0.0);
    EXPECT_GT(result.at("initial_score"), 0.0);
    EXPECT_GT(result.at("iterations"), 0);
    EXPECT_EQ(result.at("matches"), json.at("inputs").at("source").at("kept_landmarks"));
    EXPECT_GT(result.at("overlap").at("source"), 0.5);
    EXPECT_GT(result.at("overlap").at("target"), 0.5);
    EXPECT_EQ(result.at("overlap").at("radius"), 0.05);
    EXPECT_EQ(result.at("covariance").size(), 6U);
    EXPECT_TRUE(result.at("unobservable").is_array());
    EXPECT_GT(result.at("duration_s"), 0.0);
    // What was not judged is not trusted, but said.
    for (const char* const absent : {"target_from_source", "probability", "error"}) {
      EXPECT_TRUE(result.at(absent).is_null()) << absent;
    }
    EXPECT_EQ(result.at("estimate").size(), 4U);
    EXPECT_EQ(result.at("quaternion").size(), 4U);
    EXPECT_EQ(result.at("candidates"), Json::array());
    EXPECT_FALSE(result.contains("history"));
  }
}

TEST_F(AlignTest, TraceAddsEachIterationWithScoreAndMatches) {
  write_pair();
  const Json result = document(pair({"--trace"})).at("results").at(0);
  ASSERT_EQ(result.at("history").size(), result.at("iterations"));
  const Json& last = result.at("history").back();
  EXPECT_EQ(last.at("target_from_source"), result.at("estimate"));
  EXPECT_TRUE(last.at("mean_squared_distance").is_number());
  EXPECT_EQ(last.at("score"), result.at("score"));
  EXPECT_EQ(last.at("matches").size(), result.at("matches"));
}

TEST_F(AlignTest, JsonGoesToStdoutInsteadOfTheTableAndToAFileBesideIt) {
  write_pair();
  const CommandResult to_file = cairn(pair({"--json", "result.json"}));
  EXPECT_THAT(to_file.output, HasSubstr("score before / after"));
  const Json file = Json::parse(content("result.json"));
  EXPECT_EQ(file.at("results").at(0).at("score"), document(pair_).at("results").at(0).at("score"));
}

TEST_F(AlignTest, AnswersAsTheLibraryDoes) {
  const SyntheticPair maps = write_pair();
  const Json answer_document = document(pair({"--confidence", "covariance"}));
  IcpOptions options;
  options.initial = pose_of(answer_document.at("options").at("initial"));
  const RegistrationResult expected = icp(maps.source, maps.target, covariance_metric(), options);
  const Json& result = answer_document.at("results").at(0);
  // The document's matrix gives the initial rotation up to rounding.
  EXPECT_NEAR(result.at("score").get<double>(), expected.score.value(), 1e-12);
  EXPECT_EQ(result.at("iterations"), expected.iterations);
  const Matrix4d difference =
      pose_of(result.at("estimate")).matrix() - expected.target_from_source.matrix();
  EXPECT_LT(difference.norm(), 1e-12);
}

TEST_F(AlignTest, TruthAddsPoseErrors) {
  const SyntheticPair maps = write_pair();
  const Words words = pair({"--truth", "truth.txt"});
  EXPECT_THAT(answer(words), ContainsRegex("pose error"));
  const Json json = document(words);
  const Json& result = json.at("results").at(0);
  const Eigen::Matrix4d found = pose_of(result.at("estimate")).matrix();
  const Eigen::Matrix4d truth = maps.target_from_source.matrix();
  // The angle of the rotation between both, and how far apart they put the middle of the landmarks that take part.
  const Eigen::Matrix3d between =
      truth.topLeftCorner<3, 3>().transpose() * found.topLeftCorner<3, 3>();
  const Eigen::Vector3d twice_sine(between(2, 1) - between(1, 2), between(0, 2) - between(2, 0),
                                   between(1, 0) - between(0, 1));
  const double angle = std::atan2(twice_sine.norm(), between.trace() - 1.0);
  Eigen::Vector4d middle = Eigen::Vector4d::Zero();
  for (std::uint32_t i = 0; i < maps.source.landmark_count(); ++i) {
    if (maps.source.observation_count(LandmarkIndex{i}) < 2) continue;
    middle += maps.source.landmarks().positions[i].homogeneous();
  }
  middle /= middle.w();
  EXPECT_NEAR(result.at("error").at("rotation_deg").get<double>(), angle * 180.0 / std::numbers::pi,
              1e-9);
  EXPECT_NEAR(result.at("error").at("translation").get<double>(), ((found - truth) * middle).norm(),
              1e-9);
  EXPECT_EQ(json.at("inputs").at("truth").at("path"), "truth.txt");
  EXPECT_FALSE(result.contains("fits_inverse_of_truth"));
}

TEST_F(AlignTest, SaysThatTheTruthIsOfSwappedMaps) {
  const SyntheticPair maps = write_pair();
  write("swapped.txt", matrix_text(maps.target_from_source.inverse()));
  const Words words = pair({"--truth", "swapped.txt"});
  const CommandResult result = cairn(words);
  EXPECT_EQ(result.exit_code, kDone);
  for (const std::string& text : {result.output, result.errors}) {
    EXPECT_THAT(text, HasSubstr("the inverse of the truth fits the pose: the truth seems to be "
                                "source_from_target, of swapped maps"));
  }
  EXPECT_EQ(document(words).at("results").at(0).at("fits_inverse_of_truth"), true);
}

TEST_F(AlignTest, SavedResultServesAsInitialPoseAndAsTruth) {
  write_pair();
  answer(pair({"--json", "result.json"}));
  const Json again = document({"align", "source.map", "target.map", "--initial-matrix",
                               "result.json", "--truth", "result.json", "--method", "icp"});
  const Json saved = Json::parse(content("result.json"));
  EXPECT_TRUE(pose_of(again.at("options").at("initial"))
                  .matrix()
                  .isApprox(pose_of(saved.at("results").at(0).at("estimate")).matrix(), 1e-12));
  EXPECT_LT(again.at("results").at(0).at("error").at("translation"), 1e-6);
}

TEST_F(AlignTest, SaysThatBothMapsAreOne) {
  write_pair();
  answer({"convert", "source.map", "copy.cairn"});
  answer({"convert", "source.map", "part.map", "--frames", "2:30"});
  const auto result = [&](const char* target, const Words& more) {
    Words words = {"align", "source.map", target, "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return document(words).at("results").at(0);
  };
  for (const char* const same : {"source.map", "copy.cairn"}) {
    for (const Words& how : {Words{}, Words{"--method", "icp"}, Words{"--no-verdict"}}) {
      const Json one = result(same, how);
      EXPECT_EQ(one.at("one_map"), true) << same;
      EXPECT_THAT(one.at("reason").get<std::string>(), HasSubstr("are one map")) << same;
    }
  }
  EXPECT_EQ(result("target.map", {}).at("one_map"), false);
  EXPECT_EQ(result("target.map", {}).at("common_images"), 0);
  const Json part = result("part.map", {});
  EXPECT_GT(part.at("common_images"), 5);
  EXPECT_THAT(part.at("reason").get<std::string>(), HasSubstr("images are in both maps"));
}

TEST_F(AlignTest, OutputLiesOnTheTarget) {
  const LandmarkMap map = write_pair().source;
  answer({"convert", "source.map", "moved.map", "--transform", "0.02 -0.01 0.015 1 -1 2"});
  answer({"align", "moved.map", "source.map", "-o", "aligned.map", "--confidence", "none"});
  const LandmarkMap moved = read_map(path("moved.map"));
  const LandmarkMap aligned = read_map(path("aligned.map"));
  ASSERT_EQ(aligned.landmark_count(), map.landmark_count());
  EXPECT_EQ(aligned.observation_count(), map.observation_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const Eigen::Vector3d& target = map.landmarks().positions[i];
    EXPECT_GT((moved.landmarks().positions[i] - target).norm(), 1e-3);
    EXPECT_LT((aligned.landmarks().positions[i] - target).norm(), 1e-6);
  }
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    EXPECT_LT((aligned.frames().translations[i] - map.frames().translations[i]).norm(), 1e-6);
  }
}

TEST_F(AlignTest, MapOnItselfScoresZero) {
  write_pair();
  const Json result =
      document({"align", "source.map", "source.map", "--initial", "0 0 0 0 0 0", "--no-verdict"})
          .at("results")
          .at(0);
  EXPECT_LT(result.at("initial_score"), 1e-20);
  EXPECT_LT(result.at("score"), 1e-20);
  EXPECT_EQ(result.at("overlap").at("source"), 1.0);
}

TEST_F(AlignTest, FailureHasItsExitCodeReasonAndNulls) {
  write_pair();
  const Json json =
      document(pair({"--max-distance", "1e-9", "--truth", "truth.txt"}), kNoAlignment);
  const Json& result = json.at("results").at(0);
  EXPECT_EQ(result.at("status"), "failed");
  EXPECT_THAT(result.at("reason").get<std::string>(), HasSubstr("fewer than 3 matches"));
  for (const char* const absent :
       {"target_from_source", "estimate", "quaternion", "scale", "covariance", "error"}) {
    EXPECT_TRUE(result.at(absent).is_null()) << absent;
  }
  EXPECT_EQ(result.at("unobservable"), Json::array());
  EXPECT_EQ(result.at("iterations"), 0);
}

TEST_F(AlignTest, MapWithNothingToAlignFails) {
  write_pair();
  write("nothing.map", "CAIRN 2\n");
  const CommandResult empty = cairn({"align", "nothing.map", "target.map"});
  EXPECT_EQ(empty.exit_code, kNoAlignment);
  EXPECT_THAT(empty.output, HasSubstr("0 source and 418 target landmarks"));
  const Json json = document(pair({"--min-observations", "1000"}), kNoAlignment);
  EXPECT_EQ(json.at("inputs").at("source").at("kept_landmarks"), 0);
  EXPECT_TRUE(json.at("results").at(0).at("score").is_null());
  EXPECT_TRUE(json.at("results").at(0).at("overlap").is_null());
}

TEST_F(AlignTest, FailureWritesNoMap) {
  write_pair();
  const CommandResult result = cairn(pair({"--max-distance", "1e-9", "-o", "out.map"}));
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(result.errors, HasSubstr("out.map is not written"));
  EXPECT_FALSE(std::filesystem::exists(path("out.map")));
}

TEST_F(AlignTest, MetricWithoutItsInputFailsByName) {
  write_pair();
  answer({"convert", "source.map", "source.ply"});
  expect_refusal({"align", "source.ply", "target.map", "--confidence", "observations"}, kBadInput,
                 {"observations", "the map has no observations"});
  expect_refusal({"align", "source.map", "target.map", "--confidence", "column:sharpness"},
                 kBadInput, {"column:sharpness"});
}

TEST_F(AlignTest, MapsOfDifferentUnitsAreRefused) {
  write_pair();
  write_map(full_map(), path("free.map"));
  for (const char* const rigid : {"--no-scale", "--method=icp"}) {
    expect_refusal({"align", "free.map", "target.map", rigid}, kBadInput,
                   {"free.map", "target.map", "free", "metres"});
  }
}

TEST_F(AlignTest, OverlapOfFreeScaleNeedsARadius) {
  MapTables tables = full_tables();
  tables.landmarks.positions[2] = {0.3, -0.2, 0.1};  // not at 1e8
  write_map(LandmarkMap(std::move(tables)), path("free.map"));
  const Words words = {"align", "free.map",  "free.map",    "--min-observations",
                       "0",     "--initial", "0 0 0 0 0 0", "--no-verdict"};
  const Json without = document(words).at("results").at(0);
  EXPECT_EQ(without.at("length_unit"), "free");
  EXPECT_TRUE(without.at("overlap").is_null());
  Words with_radius = words;
  with_radius.insert(with_radius.end(), {"--overlap-radius", "0.5"});
  EXPECT_EQ(document(with_radius).at("results").at(0).at("overlap").at("radius"), 0.5);
}

TEST_F(AlignTest, NumberOfThreadsDoesNotChangeTheDocument) {
  write_pair();
  const auto without_durations = [](const std::string& text) {
    std::string kept;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = text.find('\n', begin) + 1;
      const std::string line = text.substr(begin, end - begin);
      if (line.find("\"duration_s\"") == std::string::npos) kept += line;
      begin = end;
    }
    return kept;
  };
  std::string first;
  for (const char* const threads : {"1", "0", "2", "99"}) {
    const std::string text = without_durations(answer(
        pair({"--confidence", "base,distance", "--trace", "--json", "-", "--threads", threads})));
    if (first.empty()) first = text;
    EXPECT_EQ(text, first) << threads << " threads";
  }
  EXPECT_THAT(first, HasSubstr("\"history\""));
}

TEST_F(AlignTest, OptionsMayStandBeforeTheMaps) {
  write_pair();
  answer({"align", "--confidence", "base,covariance", "--initial-matrix", "start.txt", "source.map",
          "target.map"});
}

TEST_F(AlignTest, InitialPoseMayStartWithAMinus) {
  write_pair();
  const Json options = document({"align", "source.map", "target.map", "--initial",
                                 "-0.5 0 0 0 0 -90", "--no-verdict"})
                           .at("options");
  EXPECT_EQ(options.at("initial").at(0).at(3), -0.5);
  EXPECT_NEAR(options.at("initial").at(0).at(1).get<double>(), 1.0, 1e-12);
}

TEST_F(AlignTest, BaseIsAnotherNameForNone) {
  write_pair();
  const Json json = document(pair({"--confidence", "base,none"}));
  ASSERT_EQ(json.at("results").size(), 1U);
  EXPECT_EQ(json.at("results").at(0).at("confidence"), "base");
}

TEST_F(AlignTest, FastAlignsSamplesFirst) {
  write_pair(6000);
  const Json json = document(pair({"--fast", "--truth", "truth.txt"}));
  EXPECT_EQ(json.at("options").at("fast"), true);
  const Json& result = json.at("results").at(0);
  EXPECT_GT(result.at("coarse_iterations").get<int>(), 0);
  EXPECT_THAT(result.at("reason").get<std::string>(), HasSubstr("on samples before them"));
  EXPECT_LT(result.at("error").at("rotation_deg").get<double>(), 5.0);
}

TEST_F(AlignTest, AnywhereNeedsNoStartAndGivesAVerdict) {
  const SyntheticPair maps = write_pair();
  const Json json = document({"align", "source.map", "target.map", "--anywhere", "--truth",
                              "truth.txt", "-o", "aligned.map"});
  const Json& result = json.at("results").at(0);
  EXPECT_EQ(result.at("status"), "aligned");
  EXPECT_EQ(result.at("verdict"), "aligned");
  EXPECT_EQ(result.at("method"), "robust");
  EXPECT_THAT(result.at("reason").get<std::string>(),
              ContainsRegex("matches [0-9.]+ % of [0-9]+ landmarks one to one, "));
  EXPECT_LT(result.at("error").at("rotation_deg").get<double>(), 0.5);
  EXPECT_LT(result.at("error").at("translation").get<double>(), 0.005);
  EXPECT_GE(result.at("probability").get<double>(), 0.995);
  EXPECT_EQ(result.at("covariance").size(), 6U);
  const Json& candidates = result.at("candidates");
  ASSERT_GE(candidates.size(), 1U);
  EXPECT_GT(candidates.at(0).at("support").get<double>(), 0.2);
  EXPECT_GT(candidates.at(0).at("matches").get<int>(),
            candidates.at(0).at("close_matches").get<int>());
  EXPECT_GT(candidates.at(0).at("close_matches").get<int>(), 0);
  EXPECT_GT(candidates.at(0).at("evidence").get<double>(),
            candidates.at(0).at("spread_evidence").get<double>());
  EXPECT_LT(candidates.at(0).at("contradicted").get<double>(), 0.05);
  EXPECT_TRUE(candidates.at(0).at("likeness").is_null());  // maps without descriptors
  EXPECT_TRUE(candidates.at(0).at("descriptor_agreement").is_null());
  EXPECT_EQ(candidates.at(0).at("matches_by_radius").at(0), candidates.at(0).at("matches"));
  EXPECT_EQ(candidates.at(0).at("matches_by_radius").size(), 6U);
  EXPECT_GT(candidates.at(0).at("proximity").at("spread_evidence").get<double>(), 50.0);
  EXPECT_EQ(candidates.at(0).at("probability"), result.at("probability"));
  EXPECT_EQ(result.at("deterministic"), true);
  EXPECT_TRUE(files().contains("aligned.map"));
  const std::string text = answer({"align", "source.map", "target.map", "--anywhere"});
  EXPECT_THAT(text, ContainsRegex("\naligned: probability [>0-9.]+ %, at least the required 99 %\n"
                                  "    the best pose matches"));
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
}

TEST_F(AlignTest, AnywhereTellsWhichMatchesLookAlike) {
  MapTables tables = std::move(write_pair().source).tables();
  const std::size_t count = tables.landmarks.ids.size();
  Random random(5);
  DescriptorColumn descriptors{"ORB", 32, std::vector<std::uint8_t>(count, 1), {}};
  for (std::size_t i = 0; i < 32 * count; ++i) {
    descriptors.bytes.push_back(static_cast<std::uint8_t>(random.index(256)));
  }
  tables.landmarks.descriptors = descriptors;
  write_map(LandmarkMap(tables), path("seen.cairn"));
  const Json result =
      document({"align", "seen.cairn", "seen.cairn", "--anywhere"}).at("results").at(0);
  EXPECT_THAT(
      result.at("reason").get<std::string>(),
      HasSubstr("100.0 % of the matches have similar descriptors (1.6 % expected by chance)"));
  const Json& likeness = result.at("candidates").at(0).at("likeness");
  EXPECT_EQ(likeness.at("alike"), likeness.at("compared"));
  EXPECT_GT(likeness.at("compared"), count / 2);
  EXPECT_GT(likeness.at("evidence"), likeness.at("spread_evidence"));
  EXPECT_GT(likeness.at("spread_evidence"), 100.0);
  const Json& agreement = result.at("candidates").at(0).at("descriptor_agreement");
  EXPECT_EQ(agreement.at("agreeing"), agreement.at("matches"));
  EXPECT_GT(agreement.at("matches"), count / 2);
  EXPECT_LT(agreement.at("spread"), agreement.at("agreeing"));
  EXPECT_LT(agreement.at("expected"), 10.0);
  EXPECT_THAT(result.at("reason").get<std::string>(),
              HasSubstr("landmarks that keypoints of common images show agree with it"));
}

TEST_F(AlignTest, PriorOddsLowerTheProbability) {
  write_pair();
  const auto probability = [&](const Words& more) {
    Words words = {"align", "source.map", "target.map", "--anywhere"};
    words.insert(words.end(), more.begin(), more.end());
    return document(words).at("results").at(0).at("probability").get<double>();
  };
  const double even = probability({});
  const double rare = probability({"--prior-odds", "0.0001"});
  EXPECT_LT(rare, even);
  EXPECT_GT(rare, 0.0);
}

TEST_F(AlignTest, AnywhereFindsTheScaleOfAMapInAnotherUnit) {
  const SyntheticPair maps = write_pair();
  constexpr double kUnit = 0.2;  // of the source: free, as from a single camera
  write_map(
      with_length_unit(transformed(maps.source, Similarity3(kUnit, Rigid3())), LengthUnit::kFree),
      path("free.map"));
  const Matrix4d truth = Similarity3(1.0 / kUnit, maps.target_from_source).matrix();
  std::string numbers;
  for (int i = 0; i < 16; ++i) numbers += std::to_string(truth(i / 4, i % 4)) + " ";
  write("truth.txt", numbers);
  expect_refusal({"align", "free.map", "target.map", "--no-scale"}, kBadInput, {"one unit"});
  expect_refusal({"align", "free.map", "target.map", "--no-scale", "--scale"}, kWrongUsage,
                 {"--scale"});
  expect_refusal({"align", "free.map", "target.map", "--pose", "p.txt", "--pose-format", "tum"},
                 kWrongUsage, {"--pose-format", "no scale"});

  const Words words = {"align",   "free.map",  "target.map", "--effort",   "0.25",
                       "--truth", "truth.txt", "-o",         "aligned.map"};
  Words with_report = words;
  with_report.insert(with_report.end(), {"--report", "report.html"});
  const Json json = document(with_report);
  const Json& result = json.at("results").at(0);
  EXPECT_EQ(result.at("verdict"), "aligned");
  EXPECT_EQ(result.at("length_unit"), "metres");
  EXPECT_NEAR(result.at("scale").get<double>(), 1.0 / kUnit, 0.03);
  EXPECT_LT(result.at("error").at("log_scale").get<double>(), 0.01);
  EXPECT_LT(result.at("error").at("translation").get<double>(), 0.02);
  EXPECT_EQ(result.at("covariance").size(), 7U);
  EXPECT_EQ(result.at("covariance").at(6).size(), 7U);
  EXPECT_NEAR(result.at("candidates").at(0).at("scale").get<double>(), 1.0 / kUnit, 0.1);

  // The aligned map lies on the target, in its unit.
  EXPECT_EQ(read_map(path("aligned.map")).info().length_unit, LengthUnit::kMetres);
  const Json again = document({"align", "aligned.map", "target.map"}).at("results").at(0);
  EXPECT_NEAR(again.at("initial_score").get<double>(), result.at("score").get<double>(), 1e-8);
  EXPECT_THAT(answer(words), ContainsRegex("scale of the source: (5|4\\.9)"));

  // Results with a scale can be judged and shown, but are no rigid pose.
  write("result.json", json.dump());
  const Json judged = document({"evaluate", "alignment", "result.json", "--truth", "truth.txt"});
  EXPECT_EQ(judged.at("results").at(0).at("success"), true);
  EXPECT_NEAR(judged.at("results").at(0).at("error").at("log_scale").get<double>(),
              result.at("error").at("log_scale").get<double>(), 1e-9);
  answer({"report", "result.json", "-o", "again.html"});
  const Json strict = document({"evaluate", "alignment", "result.json", "--truth", "truth.txt",
                                "--max-scale-percent", "0.000001"});
  EXPECT_EQ(strict.at("results").at(0).at("success"), false);
  Json spoilt = json;
  spoilt["results"][0]["scale"] = "large";
  write("spoilt.json", spoilt.dump());
  for (const Words& reader :
       {Words{"evaluate", "alignment", "spoilt.json", "--truth", "truth.txt"},
        Words{"report", "spoilt.json", "-o", "spoilt.html"},
        Words{"evaluate", "alignment", "result.json", "--truth", "spoilt.json"}}) {
    expect_refusal(reader, kBadInput, {"spoilt.json", "scale"});
  }

  // Of a target without a known unit, too.
  write_map(with_length_unit(maps.target, LengthUnit::kFree), path("free_target.map"));
  const Json free = document(
      {"align", "free.map", "free_target.map", "--anywhere", "--scale", "--effort", "0.25"});
  EXPECT_EQ(free.at("results").at(0).at("length_unit"), "free");
  EXPECT_EQ(free.at("results").at(0).at("overlap").at("radius"),
            free.at("results").at(0).at("support_radius"));
  const Json unjudged = document({"align", "free.map", "free_target.map", "--anywhere", "--scale",
                                  "--effort", "0.25", "--no-verdict"});
  EXPECT_EQ(unjudged.at("results").at(0).at("overlap"), free.at("results").at(0).at("overlap"));
  expect_refusal({"align", "source.map", "target.map", "--initial-matrix", "result.json"},
                 kBadInput, {"result.json"});
}

TEST_F(AlignTest, AnywhereTakesALimitOfTime) {
  write_pair();
  const std::vector<std::string> command = {"align",      "source.map",   "target.map",
                                            "--anywhere", "--time-limit", "3600"};
  const Json ample = document(command);
  EXPECT_EQ(ample.at("options").at("time_limit_s"), 3600.0);
  EXPECT_EQ(ample.at("results").at(0).at("cut_short"), false);
  EXPECT_EQ(ample.at("results").at(0).at("deterministic"), false);
  EXPECT_EQ(ample.at("results").at(0).at("verdict"), "aligned");
  expect_refusal({"align", "source.map", "target.map", "--anywhere", "--time-limit", "0"},
                 kWrongUsage, {"--time-limit", "a positive number"});
}

TEST_F(AlignTest, AnywhereRefusesMapsOfDifferentScenes) {
  write_map(synthetic_map({.seed = 21, .landmarks = 600, .frames = 20}), path("source.map"));
  write_map(synthetic_map({.seed = 22, .landmarks = 600, .frames = 20}), path("target.map"));
  const Json json =
      document({"align", "source.map", "target.map", "--anywhere", "-o", "no.map"}, kNoAlignment);
  const Json& result = json.at("results").at(0);
  EXPECT_EQ(result.at("verdict"), "rejected");
  EXPECT_TRUE(result.at("target_from_source").is_null());
  EXPECT_TRUE(result.at("estimate").is_array());
  EXPECT_TRUE(result.at("score").is_number());
  EXPECT_FALSE(result.at("candidates").empty());
  EXPECT_FALSE(files().contains("no.map"));
}

TEST_F(AlignTest, AnywhereIsTheSameForAnyNumberOfThreads) {
  write_pair();
  const auto pose = [&](const char* threads) {
    return document({"align", "source.map", "target.map", "--anywhere", "--threads", threads})
        .at("results")
        .at(0)
        .at("target_from_source");
  };
  EXPECT_EQ(pose("1"), pose("2"));
}

TEST_F(AlignTest, GuessIsRefinedRobustlyUnlessIcpIsAskedFor) {
  write_pair();
  const Words words = {"align",     "source.map", "target.map", "--initial-matrix",
                       "start.txt", "--truth",    "truth.txt"};
  const Json answered = document(words);
  const Json& result = answered.at("results").at(0);
  EXPECT_EQ(answered.at("options").at("method"), "robust");
  EXPECT_EQ(result.at("method"), "robust");
  EXPECT_EQ(result.at("verdict"), "aligned");
  EXPECT_TRUE(result.at("candidates").is_array());
  EXPECT_LT(result.at("error").at("translation").get<double>(), 0.005);
  const auto method_with = [&](const Words& more) {
    Words all = words;
    all.emplace_back("--no-verdict");
    all.insert(all.end(), more.begin(), more.end());
    return document(all).at("options").at("method");
  };
  EXPECT_EQ(method_with({"--method", "robust"}), "robust");
  EXPECT_EQ(method_with({"--method", "icp"}), "icp");
  // What only ICP has can only mean ICP.
  EXPECT_EQ(method_with({"--neighbors", "5"}), "icp");
  EXPECT_EQ(method_with({"--fast"}), "icp");
  EXPECT_EQ(method_with({"--one-to-one"}), "robust");
}

TEST_F(AlignTest, RefusesWhatDoesNotGoWithAnywhere) {
  write_pair();
  expect_refusal(pair({"--anywhere"}), kWrongUsage, {"--initial-matrix", "--anywhere"});
  expect_refusal({"align", "source.map", "target.map", "--max-iterations", "5"}, kWrongUsage,
                 {"--max-iterations", "--initial"});
  expect_refusal({"align", "source.map", "target.map", "--min-probability", "0.2"}, kWrongUsage,
                 {"--min-probability", "at least 0.5"});
  expect_refusal({"align", "source.map", "target.map", "--anywhere", "--effort", "0"}, kWrongUsage,
                 {"--effort", "1/16"});
  expect_refusal({"align", "source.map", "target.map", "--anywhere", "--prior-odds", "0"},
                 kWrongUsage, {"--prior-odds", "1e-6"});
  expect_refusal({"align", "source.map", "target.map", "--method", "magic"}, kWrongUsage,
                 {"--method", "robust"});
}

TEST_F(AlignTest, SearchesAndJudgesUnlessToldOtherwise) {
  write_pair();
  const Json json = document({"align", "source.map", "target.map", "--truth", "truth.txt"});
  const Json& result = json.at("results").at(0);
  EXPECT_EQ(json.at("options").at("anywhere"), true);
  EXPECT_EQ(result.at("verdict"), "aligned");
  EXPECT_LT(result.at("error").at("rotation_deg").get<double>(), 1.0);
}

TEST_F(AlignTest, NothingOfDifferentPlacesIsAlignedHoweverItIsAsked) {
  write_map(synthetic_pair({.seed = 61}).source, path("here.map"));
  write_map(synthetic_pair({.seed = 62}).target, path("elsewhere.map"));
  for (const Words& how : {Words{}, Words{"--initial", "0.3 0 0 0 0 50"}, Words{"--method", "icp"},
                           Words{"-k", "3", "--confidence", "observations"}}) {
    Words words = {"align", "here.map", "elsewhere.map", "-o", "out.map", "--json", "r.json"};
    words.insert(words.end(), how.begin(), how.end());
    const CommandResult result = cairn(words);
    EXPECT_EQ(result.exit_code, kNoAlignment) << result.output;
    EXPECT_THAT(result.output, HasSubstr("not trusted"));
    EXPECT_THAT(result.output, HasSubstr("\n  hint: "));
    EXPECT_FALSE(std::filesystem::exists(path("out.map")));
    const Json entry = Json::parse(content("r.json")).at("results").at(0);
    EXPECT_NE(entry.at("verdict"), "aligned");
    EXPECT_TRUE(entry.at("estimate").is_array());
  }
}

// The 16 numbers of a pose file.
Matrix4d matrix_of(const std::string& text) {
  std::istringstream stream(text);
  Matrix4d matrix;
  for (int i = 0; i < 16; ++i) stream >> matrix(i / 4, i % 4);
  EXPECT_TRUE(stream) << text;
  return matrix;
}

TEST_F(AlignTest, PoseIsWrittenForOtherPrograms) {
  const SyntheticPair maps = write_pair();
  const Json json = document({"align", "source.map", "target.map", "--pose", "pose.txt"});
  const Matrix4d pose = matrix_of(content("pose.txt"));
  EXPECT_EQ(Similarity3::from_matrix(pose).scale(), 1.0);
  EXPECT_EQ(Json(pose(0, 3)), json.at("results").at(0).at("target_from_source").at(0).at(3));
  EXPECT_LT((pose - maps.target_from_source.matrix()).norm(), 0.02);
  // It serves as a truth.
  const Json again =
      document({"align", "source.map", "target.map", "--truth", "pose.txt"}).at("results").at(0);
  EXPECT_LT(again.at("error").at("translation"), 1e-9);

  // To stdout: what people read goes to stderr.
  const CommandResult piped =
      cairn({"align", "source.map", "target.map", "--pose", "-", "--pose-format", "tum"});
  EXPECT_EQ(piped.exit_code, kDone);
  EXPECT_THAT(piped.errors, HasSubstr("target_from_source"));
  std::istringstream line(piped.output);
  std::vector<double> numbers;
  for (double number = 0.0; line >> number;) numbers.push_back(number);
  ASSERT_EQ(numbers.size(), 8U);
  EXPECT_EQ(numbers[0], 0.0);
  EXPECT_EQ(numbers[1], pose(0, 3));
  const Eigen::Quaterniond q(numbers[7], numbers[4], numbers[5], numbers[6]);
  EXPECT_LT((q.toRotationMatrix() - pose.topLeftCorner<3, 3>()).norm(), 1e-12);
}

TEST_F(AlignTest, PoseIsNotWrittenUntrusted) {
  write_map(synthetic_map({.seed = 21, .landmarks = 600, .frames = 20}), path("a.map"));
  write_map(synthetic_map({.seed = 22, .landmarks = 600, .frames = 20}), path("b.map"));
  const CommandResult result = cairn({"align", "a.map", "b.map", "--pose", "pose.txt"});
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(result.errors, HasSubstr("pose.txt is not written"));
  EXPECT_FALSE(files().contains("pose.txt"));
  // Not judged, it is.
  answer({"align", "a.map", "b.map", "--no-verdict", "--pose", "pose.txt"});
  EXPECT_TRUE(files().contains("pose.txt"));
}

TEST_F(AlignTest, OutputsThatDoNotGoTogetherAreRefused) {
  write_pair();
  const auto refused = [&](const Words& more, std::initializer_list<std::string_view> parts) {
    Words words = {"align", "source.map", "target.map"};
    words.insert(words.end(), more.begin(), more.end());
    expect_refusal(words, kWrongUsage, parts);
  };
  refused({"-o", "-"}, {"--format", "stdout"});
  refused({"-o", "-", "--format", "zip"}, {"--format", "zip"});
  refused({"-o", "a.map", "--format", "text"}, {"--format", "a.map"});
  refused({"--format", "text"}, {"--format", "--output"});
  refused({"-o", "-", "--format", "text", "--json", "-"}, {"--output", "stdout", "--json"});
  refused({"--pose", "-", "--json", "-"}, {"--pose", "stdout", "--json"});
  refused({"--pose", "p.txt", "--pose-format", "evo"}, {"--pose-format", "evo", "tum"});
  refused({"--pose", "p.txt", "--pose-format", "tum", "--scale"}, {"--pose-format", "no scale"});
  refused({"--pose", "p.txt", "--confidence", "base,distance"}, {"--pose", "several"});
  expect_refusal({"align", "-", "-"}, kWrongUsage, {"target", "stdin"});
}

TEST_F(AlignTest, ScreenShowsThePoseWholeAndWhatWouldHelp) {
  write_pair();
  const std::string text = answer({"align", "source.map", "target.map"});
  for (const char* const part :
       {"quaternion (qw qx qy qz)", "standard deviation at the source's centre: x y z",
        "other candidate", "probability"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
  // Millimetres against metres.
  write_map(transformed(write_pair().source, Similarity3(1000.0, Rigid3())), path("mm.map"));
  const CommandResult other = cairn({"align", "mm.map", "target.map"});
  EXPECT_EQ(other.exit_code, kNoAlignment);
  EXPECT_THAT(
      other.output,
      ContainsRegex("hint: Check the units: the source's landmarks extend [0-9.e+]+ "
                    "times as far as the target's. With --scale, scales from 1/20 to 20 are "
                    "searched"));
  // Feet: nothing but the scale that fits tells it, as the maps have no descriptors.
  write_map(transformed(write_pair().source, Similarity3(1.0 / 0.3048, Rigid3())), path("ft.map"));
  const CommandResult feet = cairn({"align", "ft.map", "target.map"});
  EXPECT_EQ(feet.exit_code, kNoAlignment);
  EXPECT_THAT(feet.output, HasSubstr("hint: Add --scale if one map may be in another unit"));
  EXPECT_THAT(answer({"align", "ft.map", "target.map", "--scale"}), Not(HasSubstr("hint:")));
}

TEST_F(AlignTest, HintsNameOnlyWhatWouldChangeTheResult) {
  write_pair(100);
  const auto hints = [&](const Words& how) {
    Words words = {"align", "source.map", "target.map"};
    words.insert(words.end(), how.begin(), how.end());
    const CommandResult result = cairn(words);
    EXPECT_EQ(result.exit_code, kNoAlignment) << result.errors;
    const std::size_t first = result.output.find("  hint: ");
    return first == std::string::npos ? "no hint" : result.output.substr(first);
  };
  // ICP from the identity, which nobody gave.
  EXPECT_THAT(hints({"--method", "icp", "--max-iterations", "3"}), Not(HasSubstr("--initial")));
  EXPECT_THAT(hints({"--min-observations", "50"}),
              AllOf(HasSubstr("Lower --min-observations, now 50"),
                    HasSubstr("of the source's 100 landmarks"), Not(HasSubstr("same place"))));
  EXPECT_THAT(hints({"--min-observations", "50", "--initial-matrix", "start.txt"}),
              HasSubstr("Lower --min-observations, now 50"));
  EXPECT_THAT(hints({"--initial", "500 0 0 0 0 0", "--method", "icp", "--max-distance", "0.1"}),
              HasSubstr("Align without --initial and the options of icp"));
  write_map(synthetic_map({.seed = 3, .landmarks = 15, .frames = 20}), path("source.map"));
  EXPECT_THAT(hints({}), HasSubstr("Use a source map with at least 20 landmarks: it has"));
}

TEST_F(AlignTest, RefusesOptionsOfAnotherMethod) {
  write_pair();
  const std::vector<Words> of_icp = {
      {"--fast"},        {"--neighbors", "3"},       {"--max-distance", "1"}, {"--reciprocal"},
      {"--trim", "0.1"}, {"--weight-by-confidence"}, {"--stop-as-pcl"}};
  for (Words words : of_icp) {
    const std::string option = words.front();
    words.insert(words.begin(), {"align", "source.map", "target.map"});
    words.insert(words.end(), {"--method", "robust"});
    expect_refusal(words, kWrongUsage, {option, "robust", "--method icp"});
  }
  expect_refusal(pair({"--one-to-one"}), kWrongUsage, {"--one-to-one", "--method robust"});
  expect_refusal({"align", "source.map", "target.map", "--one-to-one", "--fast"}, kWrongUsage,
                 {"--one-to-one", "only icp has"});
  expect_refusal({"align", "source.map", "target.map", "--method", "icp", "--by-parts"},
                 kWrongUsage, {"--by-parts", "icp", "--method robust"});
  expect_refusal({"align", "source.map", "target.map", "--anywhere", "--stop-as-pcl"}, kWrongUsage,
                 {"--stop-as-pcl", "--anywhere"});
}

TEST_F(AlignTest, ListWithoutAPairIsRefused) {
  write("pairs.csv", "source,target\n\n");
  expect_refusal({"align", "--pairs", "pairs.csv", "--json", "all.json"}, kBadInput,
                 {"pairs.csv", "lists no pair"});
  EXPECT_THAT(files(), ::testing::ElementsAre("pairs.csv"));
}

TEST_F(AlignTest, AlignsManyPairsAsItDoesEach) {
  write_pair();
  write_map(synthetic_map({.seed = 77, .landmarks = 400, .frames = 10}), path("stranger.map"));
  write("pairs.csv",
        "weather,target,source\nsun,target.map,source.map\n\nrain,target.map,stranger.map\n"
        "fog,source.map,target.map\nsnow,target.map,none.map");
  const Words words = {"align", "--pairs", "pairs.csv", "--seed", "5", "--json", "all.json"};
  const CommandResult result = cairn(words);
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(
      result.output,
      AllOf(ContainsRegex("source.map -> target.map: aligned >?99\\.9"),
            ContainsRegex("stranger.map -> target.map: (rejected|ambiguous).*: .* one to one"),
            HasSubstr("none.map -> target.map: failed: none.map"),
            HasSubstr("2 of 4 pairs aligned")));
  EXPECT_EQ(Json::parse(content("all.json")).at("interrupted"), false);
  const Json all = Json::parse(content("all.json")).at("results");
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ(all.at(3).at("status"), "failed");
  for (std::size_t i = 0; i < 3; ++i) {
    const Json& one = all.at(i);
    cairn({"align", one.at("source").get<std::string>(), one.at("target").get<std::string>(),
           "--seed", "5", "--json", "one.json"});
    const Json alone = Json::parse(content("one.json")).at("results").at(0);
    for (const char* const key : {"status", "probability", "reason", "target_from_source",
                                  "estimate", "covariance", "matches"}) {
      EXPECT_EQ(one.at(key), alone.at(key)) << i << " " << key;
    }
  }
  Words other = words;
  other.insert(other.end(), {"--threads", "1"});
  other[6] = "all1.json";
  cairn(other);
  Json again = Json::parse(content("all1.json")).at("results");
  Json before = all;
  for (Json* const results : {&again, &before}) {
    for (Json& one : *results) one.erase("duration_s");
  }
  EXPECT_EQ(again, before);
  write("right.csv", "source,target\nsource.map,target.map\n");
  EXPECT_THAT(answer({"align", "--pairs", "right.csv"}), HasSubstr("1 of 1 pairs aligned"));
}

TEST_F(AlignTest, InterruptedListsKeepThePairsThatWereDone) {
  write_pair();
  std::string list = "source,target\n";
  for (int i = 0; i < 2000; ++i) list += "source.map,target.map\n";
  write("pairs.csv", list);
  Command running(command({"align", "--pairs", "pairs.csv", "--json", "all.json"}),
                  {.folder = path("."), .output_to = path("output.txt")});
  while (!std::filesystem::exists(path("output.txt")) || content("output.txt").empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  running.send(SIGINT);
  EXPECT_EQ(running.wait().exit_code, 128 + SIGINT);
  const Json json = Json::parse(content("all.json"));
  EXPECT_EQ(json.at("interrupted"), true);
  EXPECT_GT(json.at("results").size(), 0U);
  EXPECT_LT(json.at("results").size(), 2000U);
  EXPECT_EQ(json.at("results").at(0).at("status"), "aligned");
}

TEST_F(AlignTest, RefusesListsThatAreNone) {
  write_pair();
  write("list.csv", "from,target\na,b\n");
  expect_refusal({"align", "--pairs", "list.csv"}, kBadInput, {"list.csv:1", "source"});
  write("list.csv", "");
  expect_refusal({"align", "--pairs", "list.csv"}, kBadInput, {"list.csv:1", "source"});
  write("list.csv", "source,target\nsource.map,target.map\nsource.map\n");
  expect_refusal({"align", "--pairs", "list.csv"}, kBadInput, {"list.csv:3", "two maps"});
  expect_refusal({"align", "--pairs", "none.csv"}, kBadInput, {"none.csv"});
  expect_refusal({"align", "--pairs", "list.csv", "source.map"}, kWrongUsage, {"--pairs"});
  expect_refusal({"align", "--pairs", "list.csv", "-o", "out.map"}, kWrongUsage, {"--output"});
  expect_refusal({"align", "--pairs", "list.csv", "--no-verdict"}, kWrongUsage, {"--no-verdict"});
  expect_refusal({"align", "--pairs", "list.csv", "--fast"}, kWrongUsage, {"--fast"});
  expect_refusal({"align", "source.map"}, kWrongUsage, {"target", "not given"});
  expect_refusal({"align"}, kWrongUsage, {"source", "not given"});
}

}  // namespace
}  // namespace cairn::testing
