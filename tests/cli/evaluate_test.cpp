// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/file.hpp"
#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/point_set.hpp"

#include "cli.hpp"
#include "support/real_data.hpp"

namespace cairn::testing {
namespace {

using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class EvaluateTest : public CliTest {
 protected:
  void write_trajectory(std::string_view name, const Trajectory& trajectory) const {
    std::string text;
    cairn::write_trajectory(trajectory, TrajectoryFormat::kTum,
                            [&](std::string_view bytes) { text += bytes; });
    write(name, text);
  }

  /// Cells of a CSV file's lines, the header first.
  static std::vector<Words> cells(const std::string& csv) {
    std::vector<Words> rows;
    std::istringstream lines(csv);
    for (std::string line; std::getline(lines, line);) {
      Words row;
      std::size_t begin = 0;
      for (;;) {
        const std::size_t end = line.find(',', begin);
        row.push_back(line.substr(begin, end - begin));
        if (end == std::string::npos) break;
        begin = end + 1;
      }
      rows.push_back(std::move(row));
    }
    return rows;
  }
};

// ---- The verb itself

class EvaluateVerbTest : public EvaluateTest,
                         public ::testing::WithParamInterface<std::pair<const char*, Words>> {};
INSTANTIATE_TEST_SUITE_P(All, EvaluateVerbTest,
                         ::testing::Values(std::pair{"trajectory", Words{"a.txt", "b.txt"}},
                                           std::pair{"alignment",
                                                     Words{"a.json", "--truth", "b.txt"}},
                                           std::pair{"map", Words{"a.map"}}),
                         [](const auto& verb) { return std::string(verb.param.first); });

TEST_P(EvaluateVerbTest, HelpHasAnExampleAndTheCommonOptionsAndFitsATerminal) {
  const std::string verb = GetParam().first;
  const std::string help = answer({"evaluate", verb, "--help"});
  EXPECT_THAT(help, HasSubstr("Usage: cairn evaluate " + verb));
  EXPECT_THAT(help, HasSubstr("Example: "));
  EXPECT_THAT(help, HasSubstr("\n  cairn evaluate " + verb + " "));
  for (const char* const option : {"--json", "--csv", "--quiet"}) {
    EXPECT_THAT(help, HasSubstr(option));
  }
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100U) << line;
}

TEST_P(EvaluateVerbTest, MistakesAreNamed) {
  const auto words = [&](const Words& more) {
    Words all = {"evaluate", GetParam().first};
    all.insert(all.end(), GetParam().second.begin(), GetParam().second.end());
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  const std::string help = std::string("'cairn evaluate ") + GetParam().first + " --help'";
  expect_refusal(words({"--colour"}), kWrongUsage, {"--colour", help});
  expect_refusal({"evaluate", GetParam().first}, kWrongUsage, {"not given; expected"});
  expect_refusal(words({}), kBadInput, {"No such file"});
  expect_refusal(words({"--csv", "no/out.csv"}), kSystemError, {"no/out.csv", "no folder no"});
  expect_refusal(words({"--csv", "-", "--json", "-"}), kWrongUsage, {"--csv", "taken by --json"});
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(EvaluateTest, WithoutAVerbOfItsOwnNamesThoseThereAre) {
  expect_refusal(
      {"evaluate"}, kWrongUsage,
      {"no verb; expected one of: trajectory, alignment, map", "Run 'cairn evaluate --help'"});
  expect_refusal({"evaluate", "trajectry", "a", "b"}, kWrongUsage, {"'trajectry'", "trajectory"});
  const std::string help = answer({"evaluate", "--help"});
  for (const char* const verb : {"\n  trajectory ", "\n  alignment ", "\n  map ", "Example: "}) {
    EXPECT_THAT(help, HasSubstr(verb));
  }
}

// ---- Trajectories

// A walk of 6 s with a true pose each 0.05 s and estimates of every second one, 4 ms late, in another
// world and a little off.
struct Walk {
  Trajectory truth;
  Trajectory estimate;
};

Walk walk() {
  const Rigid3 estimate_from_truth = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.4, -0.2, 2.0);
  std::vector<TimedPose> truth;
  std::vector<TimedPose> estimate;
  for (int i = 0; i < 120; ++i) {
    const double t = 0.05 * i;
    const auto pose =
        Rigid3::from_roll_pitch_yaw({std::sin(t), 0.5 * t, 0.1 * t * t}, 0.1 * t, 0, 0.2 * t);
    truth.push_back({100.0 + t, pose});
    if (i % 2 == 0) {
      const Vector6d off =
          (Vector6d() << 0.01 * std::sin(7 * t), 0.01 * std::cos(5 * t), 0, 0, 0.01, 0).finished();
      estimate.push_back({100.004 + t, estimate_from_truth * pose.perturbed(off)});
    }
  }
  return {Trajectory(std::move(truth)), Trajectory(std::move(estimate))};
}

class EvaluateTrajectoryTest : public EvaluateTest {
 protected:
  Walk write_walk() const {
    Walk both = walk();
    write_trajectory("truth.txt", both.truth);
    write_trajectory("estimate.txt", both.estimate);
    return both;
  }
  static Words evaluate(const Words& more = {}) {
    Words words = {"evaluate", "trajectory", "estimate.txt", "truth.txt"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(EvaluateTrajectoryTest, JsonHoldsWhatTheLibraryFinds) {
  const Walk both = write_walk();
  const Json json = document(evaluate());
  EXPECT_EQ(json.at("schema"), Json({{"name", "cairn.evaluate_trajectory"}, {"version", 1}}));
  const Json& estimate = json.at("inputs").at("estimate");
  EXPECT_EQ(estimate.at("path"), "estimate.txt");
  EXPECT_EQ(estimate.at("hash"), hash_file(path("estimate.txt")));
  EXPECT_EQ(estimate.at("poses"), 60);
  EXPECT_NEAR(estimate.at("duration_s").get<double>(), 5.9, 1e-6);
  EXPECT_NEAR(json.at("inputs").at("truth").at("length_m").get<double>(), both.truth.length(),
              1e-9);
  EXPECT_EQ(json.at("options"), Json({{"alignment", "se3"},
                                      {"max_time_difference_s", 0.02},
                                      {"hand_eye", false},
                                      {"max_clock_offset_s", nullptr},
                                      {"strict", false}}));
  EXPECT_EQ(json.at("matched_poses"), 60);
  EXPECT_EQ(json.at("unmatched_poses"), Json({{"estimate", 0}, {"truth", 60}}));
  EXPECT_EQ(json.at("scale"), 1.0);

  const TrajectoryEvaluation expected = evaluate_trajectory(both.estimate, both.truth);
  const Json& ate = json.at("absolute").at("translation_m");
  EXPECT_EQ(ate.at("count"), 60);
  EXPECT_GT(ate.at("rmse"), 0.002);
  EXPECT_NEAR(ate.at("rmse").get<double>(), expected.absolute->translation.rmse, 1e-12);
  EXPECT_NEAR(ate.at("std").get<double>(), expected.absolute->translation.standard_deviation,
              1e-12);
  EXPECT_NEAR(ate.at("max").get<double>(), expected.absolute->translation.highest, 1e-12);
  EXPECT_NEAR(json.at("absolute").at("rotation_deg").at("mean").get<double>(),
              expected.absolute->rotation_rad.mean * 180.0 / std::numbers::pi, 1e-6);
  const auto per = [&](const char* unit) {
    return json.at("relative").at(unit).at("translation_m").at("rmse").get<double>();
  };
  EXPECT_NEAR(per("per_metre"), expected.relative[0]->translation.rmse, 1e-12);
  EXPECT_NEAR(per("per_second"), expected.relative[1]->translation.rmse, 1e-12);
  EXPECT_NEAR(per("per_frame"), expected.relative[2]->translation.rmse, 1e-12);
}

TEST_F(EvaluateTrajectoryTest, TableIsOnStdoutAndNothingElse) {
  write_walk();
  const CommandResult result = cairn(evaluate());
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, IsEmpty());
  EXPECT_THAT(result.output, ContainsRegex("estimate  estimate.txt: 60 poses, 5.90 s, [0-9.]+ m"));
  EXPECT_THAT(result.output, HasSubstr("matched   60 poses"));
  EXPECT_THAT(result.output, HasSubstr("0 of the estimate, 60 of the truth"));
  EXPECT_THAT(result.output, ContainsRegex("absolute \\(ATE\\) +m +60 +0\\.00"));
  for (const char* const unit : {"metre", "second", "frame"}) {
    EXPECT_THAT(result.output, ContainsRegex(std::string("relative \\(RPE\\), a ") + unit));
  }
}

TEST_F(EvaluateTrajectoryTest, AlignmentDecidesWhatCounts) {
  const Walk both = write_walk();
  const auto rmse = [&](const char* alignment) {
    return document(evaluate({"--alignment", alignment}))
        .at("absolute")
        .at("translation_m")
        .at("rmse")
        .get<double>();
  };
  EXPECT_GT(rmse("none"), 1.0) << "the worlds differ";
  EXPECT_GT(rmse("origin"), rmse("se3"));
  EXPECT_GE(rmse("se3"), rmse("sim3"));
  const Trajectory scaled =
      transformed(both.estimate, Similarity3(2.0, Rigid3::from_roll_pitch_yaw({9, 8, 7}, 1, 1, 1)));
  const double before = rmse("sim3");
  write_trajectory("estimate.txt", scaled);
  EXPECT_NEAR(rmse("sim3"), before, 1e-9);
  EXPECT_NEAR(document(evaluate({"--alignment", "sim3"})).at("scale").get<double>(), 0.5, 0.01);
}

TEST_F(EvaluateTrajectoryTest, RemarksThatOrientationsAreTurnedWhereverPositionsFit) {
  const Walk both = write_walk();
  EXPECT_THAT(cairn(evaluate()).errors, IsEmpty());
  std::vector<TimedPose> turned(both.estimate.poses().begin(), both.estimate.poses().end());
  for (TimedPose& pose : turned) {
    pose.world_from_camera =
        pose.world_from_camera * Rigid3::from_roll_pitch_yaw({0, 0, 0}, 2.0, 0, 0);
  }
  write_trajectory("estimate.txt", Trajectory(std::move(turned)));
  EXPECT_THAT(cairn(evaluate()).errors,
              HasSubstr("the orientations differ from the truth's by 11"));
}

TEST_F(EvaluateTrajectoryTest, CsvHasARowForEachComparedPose) {
  write_walk();
  const Json json = document(evaluate({"--csv", "errors.csv"}));
  const auto rows = cells(content("errors.csv"));
  ASSERT_EQ(rows.size(), 61U);
  EXPECT_THAT(rows[0], ElementsAre("timestamp_s", "truth_timestamp_s", "translation_error_m",
                                   "rotation_error_deg", "x_m", "y_m", "z_m", "truth_x_m",
                                   "truth_y_m", "truth_z_m"));
  double squares = 0.0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    std::vector<double> n;
    for (const std::string& cell : rows[i]) n.push_back(std::stod(cell));
    ASSERT_EQ(n.size(), 10U);
    EXPECT_NEAR(n[0] - n[1], 0.004, 1e-6);
    EXPECT_NEAR((Eigen::Vector3d(n[4], n[5], n[6]) - Eigen::Vector3d(n[7], n[8], n[9])).norm(),
                n[2], 1e-12);
    squares += n[2] * n[2];
  }
  EXPECT_NEAR(std::sqrt(squares / 60),
              json.at("absolute").at("translation_m").at("rmse").get<double>(), 1e-12);
  EXPECT_EQ(answer(evaluate({"--csv", "-"})), content("errors.csv")) << "and no table";
}

TEST_F(EvaluateTrajectoryTest, CsvIsWrittenWholeOrNotAtAll) {
  write_walk();
  write("errors.csv", "precious\n");
  write("estimate.txt", "100 0 0 0 0 0 0 1\n101 0 zero 0 0 0 0 1\n");
  expect_refusal(evaluate({"--csv", "errors.csv"}), kBadInput,
                 {"estimate.txt:2: field 3 (ty)", "'zero'"});
  EXPECT_EQ(content("errors.csv"), "precious\n");
  EXPECT_THAT(files(), ElementsAre("errors.csv", "estimate.txt", "truth.txt"));
  write_walk();
  expect_refusal(evaluate({"--csv", "/dev/full"}), kSystemError, {"/dev/full", "No space left"});
}

TEST_F(EvaluateTrajectoryTest, MistakesAreNamed) {
  write_walk();
  expect_refusal(evaluate({"--alignment", "umeyama"}), kWrongUsage,
                 {"--alignment", "'umeyama'", "none, origin, se3, sim3 or poses"});
  for (const char* const value : {"0", "-1"}) {
    expect_refusal(evaluate({"--max-time-difference", value}), kWrongUsage,
                   {"cairn: --max-time-difference: ", value, "a positive number"});
  }
  expect_refusal(evaluate({"--max-time-difference", "0.001"}), kBadInput,
                 {"estimate.txt", "no pose of the estimate is within 0.001 s", "from 100.004"});
  write("estimate.txt", "100 0 0 0 0 0 0 1\n");
  expect_refusal(evaluate(), kBadInput, {"estimate.txt", "1 of the poses paired"});
}

TEST_F(EvaluateTrajectoryTest, HandEyeOffsetIsEstimatedAndTakenOffTheErrors) {
  const Rigid3 offset = Rigid3::from_roll_pitch_yaw({0.01, 0.02, -0.01}, 0.03, -0.02, 0.01);
  std::vector<TimedPose> camera;
  std::vector<TimedPose> body;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.02 * i;
    const Rigid3 pose =
        Rigid3::from_roll_pitch_yaw({std::sin(t), 0.4 * t, 0.2 * std::cos(2.0 * t)},
                                    0.4 * std::sin(1.3 * t), 0.3 * std::sin(0.7 * t), 0.3 * t);
    camera.push_back({t, pose});
    body.push_back({t + 0.01, pose * offset.inverse()});
  }
  write_trajectory("camera.txt", Trajectory(std::move(camera)));
  write_trajectory("body.txt", Trajectory(std::move(body)));
  const Json json = document(
      {"evaluate", "trajectory", "camera.txt", "body.txt", "--hand-eye", "--alignment", "poses"});
  const Json& found = json.at("hand_eye");
  EXPECT_NEAR(found.at("rotation_deg").get<double>(), offset.angle() * 180.0 / std::numbers::pi,
              0.02);
  EXPECT_NEAR(found.at("translation_m").get<double>(), offset.translation().norm(), 5e-4);
  EXPECT_NEAR(found.at("clock_offset_s").get<double>(), 0.01, 5e-4);
  EXPECT_EQ(found.at("covariance").size(), 6U);
  const auto rmse = [](const Json& errors) {
    return errors.at("absolute").at("rotation_deg").at("rmse").get<double>();
  };
  EXPECT_GT(rmse(json), 0.5);
  EXPECT_LT(rmse(found), 0.05);
  EXPECT_TRUE(
      document({"evaluate", "trajectory", "camera.txt", "body.txt"}).at("hand_eye").is_null());
  const std::string text =
      answer({"evaluate", "trajectory", "camera.txt", "body.txt", "--hand-eye"});
  EXPECT_THAT(text, ContainsRegex("rotation 2.[0-9]+ \\+- [0-9.]+ deg"));
  EXPECT_THAT(text, HasSubstr("after this correction:"));
}

TEST_F(EvaluateTrajectoryTest, PosesThatAreLeftOutAreCountedAndRefusedIfStrict) {
  write("gaps.txt",
        "0 nan nan nan nan nan nan nan\n1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n"
        "3 1 1 0 0 0 0 1\n4 0 1 0 0 0 0 1\n");
  const CommandResult read = cairn({"evaluate", "trajectory", "gaps.txt", "gaps.txt"});
  EXPECT_EQ(read.exit_code, kDone);
  EXPECT_THAT(read.output, HasSubstr("gaps.txt: 4 poses"));
  EXPECT_THAT(read.errors, HasSubstr("1 of 6 poses left out, the first in line 1"));
  EXPECT_THAT(read.errors, HasSubstr("1 of 5 poses left out, the first in line 4"));
  expect_refusal({"evaluate", "trajectory", "gaps.txt", "gaps.txt", "--strict"}, kBadInput,
                 {"--strict", "1 of 6 poses left out"});
  expect_refusal({"convert", "gaps.txt", "out.txt", "--strict"}, kBadInput,
                 {"--strict", "1 of 6 poses left out"});
}

TEST_F(EvaluateTrajectoryTest, HandEyeOffsetThatTheMotionDoesNotTellIsRefused) {
  std::vector<TimedPose> straight;
  for (int i = 0; i < 100; ++i)
    straight.push_back({0.05 * i, Rigid3::from_roll_pitch_yaw({0.1 * i, 0, 0}, 0, 0, 0)});
  write_trajectory("a.txt", Trajectory(std::move(straight)));
  expect_refusal({"evaluate", "trajectory", "a.txt", "a.txt", "--hand-eye"}, kBadInput,
                 {"a.txt", "does not determine the hand-eye offset"});
  expect_refusal(
      {"evaluate", "trajectory", "a.txt", "a.txt", "--hand-eye", "--max-clock-offset", "-1"},
      kWrongUsage, {"--max-clock-offset", "0 to 10"});
}

TEST_F(EvaluateTrajectoryTest, RelativeErrorsOfAShortTrajectoryAreNull) {
  write("truth.txt", "1 0 0 0 0 0 0 1\n1.1 0.1 0 0 0 0 0 1\n1.2 0.2 0.1 0 0 0 0 1\n");
  write("estimate.txt", content("truth.txt"));
  const Json json = document(evaluate());
  EXPECT_TRUE(json.at("relative").at("per_metre").is_null());
  EXPECT_TRUE(json.at("relative").at("per_second").is_null());
  EXPECT_FALSE(json.at("relative").at("per_frame").is_null());
  EXPECT_THAT(answer(evaluate()), ContainsRegex("a metre +m +- +- "));
}

// ---- Alignments

class EvaluateAlignmentTest : public EvaluateTest {
 protected:
  SyntheticPair write_result() const {
    SyntheticPair pair = write_pair();
    answer({"align", "source.map", "target.map", "--initial-matrix", "start.txt", "--confidence",
            "base,covariance", "--no-verdict", "--json", "result.json"});
    return pair;
  }
  const Words evaluate_ = {"evaluate", "alignment", "result.json", "--truth", "truth.txt"};

  Words evaluate(const Words& more) const {
    Words words = evaluate_;
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

TEST_F(EvaluateAlignmentTest, ErrorsAreThoseThatTheAlignmentWouldHaveTold) {
  write_result();
  const Json told =
      document({"align", "source.map", "target.map", "--initial-matrix", "start.txt",
                "--confidence", "base,covariance", "--no-verdict", "--truth", "truth.txt"});
  const Json json = document(evaluate_);
  EXPECT_EQ(json.at("schema").at("name"), "cairn.evaluate_alignment");
  EXPECT_EQ(json.at("inputs").at("result").at("hash"), hash_file(path("result.json")));
  EXPECT_EQ(json.at("inputs").at("source").at("path"), "source.map");
  EXPECT_EQ(json.at("inputs").at("truth").at("path"), "truth.txt");
  EXPECT_EQ(json.at("options").at("max_rotation_deg"), 5.0);
  EXPECT_EQ(json.at("options").at("max_translation_m"), 0.05);
  ASSERT_EQ(json.at("results").size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& result = json.at("results").at(i);
    const Json& expected = told.at("results").at(i);
    EXPECT_EQ(result.at("confidence"), expected.at("confidence"));
    EXPECT_EQ(result.at("status"), expected.at("status"));
    for (const char* const error : {"rotation_deg", "translation"}) {
      EXPECT_NEAR(result.at("error").at(error).get<double>(),
                  expected.at("error").at(error).get<double>(), 1e-9);
    }
    EXPECT_EQ(result.at("success"), true);
  }
  EXPECT_EQ(json.at("successes"), 2);
}

TEST_F(EvaluateAlignmentTest, SuccessIsWithinTheLimits) {
  write_result();
  EXPECT_THAT(answer(evaluate_), HasSubstr("at most 5 deg and 0.05 m: 2 of 2"));
  EXPECT_THAT(answer(evaluate({"--max-translation-m", "0"})), HasSubstr("0 of 2"));
  EXPECT_THAT(answer(evaluate({"--max-rotation-deg", "0.0001"})), HasSubstr("0 of 2"));
  expect_refusal(evaluate({"--max-rotation-deg", "-1"}), kWrongUsage,
                 {"--max-rotation-deg", "-1", "0 or more"});
}

TEST_F(EvaluateAlignmentTest, ResultIsATruthToo) {
  write_result();
  const Json json = document({"evaluate", "alignment", "result.json", "--truth", "result.json"});
  EXPECT_LT(json.at("results").at(0).at("error").at("translation"), 1e-12);
}

TEST_F(EvaluateAlignmentTest, TellsWhetherTheTruthIsWhereTheCovarianceSays) {
  write_result();
  Json result = Json::parse(content("result.json"));
  // Held against itself, moved by two centimetres along x.
  Json truth = result.at("results").at(0).at("estimate");
  truth[0][3] = truth[0][3].get<double>() + 0.02;
  const auto write_truth = [&](double scale) {
    std::string text;
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        const bool scaled = row < 3 && column < 3;
        text += Json(truth[row][column].get<double>() * (scaled ? scale : 1.0)).dump() + " ";
      }
    }
    write("moved.txt", text);
  };
  const Words judge = {"evaluate", "alignment", "result.json", "--truth", "moved.txt"};
  const auto judged_with = [&](const std::vector<double>& deviations) {
    Json covariance = Json::array();
    for (std::size_t i = 0; i < deviations.size(); ++i) {
      covariance.push_back(std::vector<double>(deviations.size(), 0.0));
      covariance[i][i] = deviations[i] * deviations[i];
    }
    result.at("results").at(0)["covariance"] = covariance;
    result.at("results").at(1)["covariance"] = nullptr;
    write("result.json", result.dump());
    return document(judge).at("results");
  };
  // Along x alone counts, whatever the others are.
  write_truth(1.0);
  const Json wide = judged_with({0.02, 1.0, 2.0, 3.0, 4.0, 5.0});
  EXPECT_NEAR(wide.at(0).at("normalised_squared_error").get<double>(), 1.0, 1e-9);
  EXPECT_EQ(wide.at(0).at("in_ellipsoid"), true);
  EXPECT_TRUE(wide.at(1).at("normalised_squared_error").is_null());
  EXPECT_TRUE(wide.at(1).at("in_ellipsoid").is_null());
  const Json narrow = judged_with({0.005, 1.0, 2.0, 3.0, 4.0, 5.0});
  EXPECT_NEAR(narrow.at(0).at("normalised_squared_error").get<double>(), 16.0, 1e-9);
  EXPECT_EQ(narrow.at(0).at("in_ellipsoid"), false);
  EXPECT_THAT(answer(judge), HasSubstr("no (16)"));

  // A map aligned to itself has no residuals, and so no spread.
  EXPECT_TRUE(judged_with(std::vector<double>(6, 0.0)).at(0).at("in_ellipsoid").is_null());

  // Six rows say nothing of a scale; seven do.
  write_truth(1.01);
  EXPECT_TRUE(judged_with(std::vector<double>(6, 0.01)).at(0).at("in_ellipsoid").is_null());
  const Json with_scale = judged_with({0.02, 1.0, 1.0, 1.0, 1.0, 1.0, std::log(1.01)});
  EXPECT_NEAR(with_scale.at(0).at("normalised_squared_error").get<double>(), 2.0, 1e-6);
  EXPECT_EQ(with_scale.at(0).at("in_ellipsoid"), true);

  const auto refuses = [&](const Json& covariance) {
    result.at("results").at(0)["covariance"] = covariance;
    write("result.json", result.dump());
    expect_refusal(judge, kBadInput, {"result.json", "results[0]", "covariance", "definite"});
  };
  Json identity = Json::array();
  for (std::size_t i = 0; i < 6; ++i) {
    identity.push_back(std::vector<double>(6, 0.0));
    identity[i][i] = 1.0;
  }
  Json negative = identity;
  negative[0][0] = -1.0;
  refuses(negative);
  Json asymmetric = identity;
  asymmetric[0][1] = 0.5;
  refuses(asymmetric);
  Json ragged = identity;
  ragged[5].push_back(0.0);
  refuses(ragged);
  Json small = identity;
  small.erase(5);
  for (Json& row : small) row.erase(5);
  refuses(small);
  refuses("wide");
}

TEST_F(EvaluateAlignmentTest, WithoutATruthEachPoseIsJudged) {
  const SyntheticPair maps = write_pair();
  // Wrong, and never judged.
  answer({"align", "source.map", "target.map", "--initial", "9 0 0 0 0 90", "--method", "icp",
          "--max-iterations", "1", "--no-verdict", "--json", "wrong.json"});
  const Json wrong = document({"evaluate", "alignment", "wrong.json"}, kNoAlignment);
  EXPECT_EQ(wrong.at("results").at(0).at("verdict"), "rejected");
  EXPECT_TRUE(wrong.at("results").at(0).at("target_from_source").is_null());
  EXPECT_TRUE(wrong.at("inputs").at("truth").is_null());
  // Right, and never judged.
  answer({"align", "source.map", "target.map", "--no-verdict", "--json", "right.json"});
  const Json saved = Json::parse(content("right.json"));
  const Json right = document({"evaluate", "alignment", "right.json"});
  EXPECT_EQ(right.at("results").at(0).at("verdict"), "aligned");
  EXPECT_EQ(right.at("results").at(0).at("target_from_source"),
            saved.at("results").at(0).at("estimate"));
  EXPECT_THAT(answer({"evaluate", "alignment", "right.json", "--csv", "-"}),
              HasSubstr("confidence,status,probability\nbase,aligned,0.99"));
  // Against a truth it need not be judged.
  const Json compared = document({"evaluate", "alignment", "right.json", "--truth", "truth.txt"});
  EXPECT_EQ(compared.at("results").at(0).at("success"), true);
}

TEST_F(EvaluateAlignmentTest, JudgesWithTheOptionsOfTheResult) {
  write_pair();
  answer(
      {"align", "source.map", "target.map", "--no-verdict", "--no-parts", "--json", "right.json"});
  Json saved = Json::parse(content("right.json"));
  saved["options"]["prior_odds"] = 1e-6;
  saved["options"]["min_probability"] = 1.0 - 1e-12;
  write("strict.json", saved.dump());
  const Words judge = {"evaluate", "alignment", "strict.json"};
  const Json strict = document(judge, kNoAlignment);
  EXPECT_NE(strict.at("results").at(0).at("verdict"), "aligned");
  EXPECT_EQ(strict.at("options").at("prior_odds"), 1e-6);
  EXPECT_EQ(strict.at("options").at("parts"), "never");
  saved["options"]["prior_odds"] = 1.0;
  write("strict.json", saved.dump());
  Words lenient = judge;
  lenient.insert(lenient.end(), {"--min-probability", "0.9"});
  EXPECT_EQ(document(lenient).at("results").at(0).at("verdict"), "aligned");
  saved["options"]["prior_odds"] = 0.0;
  write("strict.json", saved.dump());
  expect_refusal(judge, kBadInput, {"strict.json", "options", "prior_odds", "from 1e-6 to 1e6"});
}

// The pose turns the source upside down.
TEST_F(EvaluateAlignmentTest, JudgesWithTheGravityOfTheResult) {
  write_pair();
  answer({"align", "source.map", "target.map", "--initial", "0 0 0 180 0 0", "--method", "icp",
          "--max-iterations", "1", "--no-verdict", "--json", "over.json"});
  Json saved = Json::parse(content("over.json"));
  saved["options"]["gravity"] = true;
  write("over.json", saved.dump());
  const Json judged = document({"evaluate", "alignment", "over.json"}, kNoAlignment);
  EXPECT_EQ(judged.at("options").at("gravity"), true);
  EXPECT_THAT(judged.at("results").at(0).at("reason").get<std::string>(), HasSubstr("gravity"));
}

TEST_F(EvaluateAlignmentTest, PoseThatIsNotTrustedIsNoSuccessHoweverRight) {
  write_result();
  Json result = Json::parse(content("result.json"));
  for (Json& entry : result.at("results")) {
    entry["verdict"] = entry["status"] = "rejected";
    entry["probability"] = 0.5;
    entry["support_radius"] = 0.1;
  }
  write("result.json", result.dump());
  const Json json = document(evaluate({"--max-rotation-deg", "180", "--max-translation-m", "9"}));
  EXPECT_TRUE(json.at("results").at(0).at("error").is_object());
  EXPECT_EQ(json.at("results").at(0).at("success"), false);
}

TEST_F(EvaluateAlignmentTest, TrajectoriesGiveTheTruth) {
  const SyntheticPair maps = write_result();
  // Each camera's path in its map, and in one world.
  const Rigid3 world_from_target(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.0, 2.0, 3.0});
  const auto lines = [](const LandmarkMap& map, const Rigid3& world_from_map) {
    std::string text;
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      const auto& [w, x, y, z] = map.frames().quaternions[i];
      const Rigid3 pose =
          world_from_map * Rigid3(Eigen::Quaterniond(w, x, y, z), map.frames().translations[i]);
      const Eigen::Quaterniond q = pose.quaternion();
      const Eigen::Vector3d& t = pose.translation();
      text += fmt::format("{} {} {} {} {} {} {} {}\n", i, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                          q.w());
    }
    return text;
  };
  write("s.tum", lines(maps.source, Rigid3()));
  write("t.tum", lines(maps.target, Rigid3()));
  write("s_truth.tum", lines(maps.source, world_from_target * maps.target_from_source));
  write("t_truth.tum", lines(maps.target, world_from_target));
  const Words words = {"evaluate", "alignment",      "result.json", "--source-trajectory",
                       "s.tum",    "--source-truth", "s_truth.tum", "--target-trajectory",
                       "t.tum",    "--target-truth", "t_truth.tum"};
  const Json by_paths = document(words);
  const Json by_pose = document(evaluate_);
  for (std::size_t i = 0; i < 2; ++i) {
    for (const char* const part : {"rotation_deg", "translation"}) {
      EXPECT_NEAR(by_paths.at("results").at(i).at("error").at(part).get<double>(),
                  by_pose.at("results").at(i).at("error").at(part).get<double>(), 1e-6);
    }
  }
  // The same as a file, without a result.
  Words to_file = {words.begin(), words.begin() + 2};
  to_file.insert(to_file.end(), words.begin() + 3, words.end());
  to_file.insert(to_file.end(), {"--write-truth", "written.txt"});
  EXPECT_THAT(answer(to_file), HasSubstr("source trajectory  20 poses, 0.00 deg and 0.0000 m"));
  const Json from_file =
      document({"evaluate", "alignment", "result.json", "--truth", "written.txt"});
  EXPECT_TRUE(pose_of(from_file.at("inputs").at("truth").at("target_from_source"))
                  .matrix()
                  .isApprox(maps.target_from_source.matrix(), 1e-6));
  EXPECT_NEAR(from_file.at("results").at(0).at("error").at("translation").get<double>(),
              by_paths.at("results").at(0).at("error").at("translation").get<double>(), 1e-12);
  to_file.back() = "s.tum";
  expect_refusal(to_file, kWrongUsage, {"--write-truth: s.tum is the input --source-trajectory"});
  expect_refusal({"evaluate", "alignment", "result.json", "--write-truth", "t.txt"}, kWrongUsage,
                 {"--write-truth", "--source-trajectory"});
  expect_refusal({"evaluate", "alignment"}, kWrongUsage, {"result: not given", "--write-truth"});
  Words three = words;
  three.resize(three.size() - 2);
  expect_refusal(three, kWrongUsage, {"--source-trajectory", "--target-truth"});
}

TEST_F(EvaluateAlignmentTest, TruthOfATrackedBodyIsHandEyeCorrected) {
  const Rigid3 offset = Rigid3::from_roll_pitch_yaw({0.01, 0.02, -0.01}, 0.05, -0.02, 0.01);
  const Rigid3 target_from_source = Rigid3::from_roll_pitch_yaw({1, 2, 0}, 0, 0, 1.0);
  const auto write_session = [&](const std::string& name, double phase, const Rigid3& moved) {
    std::vector<TimedPose> camera;
    std::vector<TimedPose> body;
    for (int i = 0; i < 400; ++i) {
      const double t = 0.02 * i;
      const Rigid3 pose = Rigid3::from_roll_pitch_yaw(
          {std::sin(t), 0.4 * t, 0.2 * std::cos(2.0 * t)}, 0.4 * std::sin(1.3 * t + phase),
          0.3 * std::sin(0.7 * t), phase + 0.3 * t);
      camera.push_back({t, pose});
      body.push_back({t, moved * pose * offset.inverse()});
    }
    write_trajectory(name + ".tum", Trajectory(std::move(camera)));
    write_trajectory(name + "_truth.tum", Trajectory(std::move(body)));
  };
  write_session("s", 0.0, target_from_source);
  write_session("t", 1.5, Rigid3());
  const auto error_deg = [&](const Words& more) {
    Words words = {"evaluate",       "alignment",   "--source-trajectory", "s.tum",
                   "--source-truth", "s_truth.tum", "--target-trajectory", "t.tum",
                   "--target-truth", "t_truth.tum", "--write-truth",       "truth.txt"};
    words.insert(words.end(), more.begin(), more.end());
    const Json json = document(words);
    const Rigid3 found = pose_of(json.at("inputs").at("truth").at("target_from_source"));
    return (found.inverse() * target_from_source).angle() * 180.0 / std::numbers::pi;
  };
  EXPECT_GT(error_deg({}), 0.5);
  EXPECT_LT(error_deg({"--hand-eye"}), 0.05);
}

TEST_F(EvaluateAlignmentTest, SaysThatTheTruthIsOfSwappedMaps) {
  const SyntheticPair maps = write_result();
  write("swapped.txt", matrix_text(maps.target_from_source.inverse()));
  const Words words = {"evaluate", "alignment", "result.json", "--truth", "swapped.txt"};
  const CommandResult result = cairn(words);
  EXPECT_EQ(result.exit_code, kDone);
  for (const std::string& text : {result.output, result.errors}) {
    EXPECT_THAT(text, HasSubstr("the inverse of the truth fits the pose"));
  }
  EXPECT_EQ(document(words).at("results").at(0).at("fits_inverse_of_truth"), true);
  EXPECT_THAT(answer(evaluate_), ::testing::Not(HasSubstr("inverse")));
}

TEST_F(EvaluateAlignmentTest, CsvHasARowForEachResult) {
  write_result();
  const auto rows = cells(answer(evaluate({"--csv", "-"})));
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_THAT(rows[0], ElementsAre("confidence", "status", "rotation_error_deg",
                                   "translation_error", "length_unit", "success", "log_scale_error",
                                   "normalised_squared_error", "in_ellipsoid"));
  EXPECT_EQ(rows[1][0], "base");
  EXPECT_EQ(rows[2][0], "covariance");
  EXPECT_EQ(rows[2][4], "metres");
  EXPECT_EQ(rows[2][5], "yes");
  EXPECT_EQ(rows[2][6], "0");
}

TEST_F(EvaluateAlignmentTest, FailedResultHasNoErrorAndIsNoSuccess) {
  write_pair();
  EXPECT_EQ(cairn({"align", "source.map", "target.map", "--max-distance", "1e-9", "--json",
                   "result.json"})
                .exit_code,
            kNoAlignment);
  const Json json = document(evaluate_);
  EXPECT_EQ(json.at("results").at(0).at("status"), "failed");
  EXPECT_TRUE(json.at("results").at(0).at("error").is_null());
  EXPECT_EQ(json.at("results").at(0).at("success"), false);
  EXPECT_EQ(json.at("successes"), 0);
}

TEST_F(EvaluateAlignmentTest, LimitsInMetresSayNothingOfFreeScale) {
  write_result();
  Json result = Json::parse(content("result.json"));
  for (Json& entry : result.at("results")) entry["length_unit"] = "free";
  write("result.json", result.dump());
  const Json json = document(evaluate_);
  EXPECT_TRUE(json.at("results").at(0).at("success").is_null());
  EXPECT_FALSE(json.at("results").at(0).at("error").is_null());
  EXPECT_TRUE(json.at("successes").is_null());
  EXPECT_THAT(answer(evaluate_), HasSubstr("success            unknown"));
}

TEST_F(EvaluateAlignmentTest, CsvQuotesTextWithCommasAndQuotes) {
  write_result();
  Json result = Json::parse(content("result.json"));
  result.at("results").at(0)["confidence"] = "a,\"b\"";
  write("result.json", result.dump());
  EXPECT_THAT(answer(evaluate({"--csv", "-"})), HasSubstr("\n\"a,\"\"b\"\"\",converged,"));
}

TEST_F(EvaluateAlignmentTest, SourceIsFoundBesideTheResultOrAsGiven) {
  write_result();
  std::filesystem::create_directory(path("elsewhere"));
  for (const char* const name : {"result.json", "source.map", "truth.txt"}) {
    std::filesystem::rename(path(name), path("elsewhere") / name);
  }
  answer({"evaluate", "alignment", "elsewhere/result.json", "--truth", "elsewhere/truth.txt"});
  std::filesystem::rename(path("elsewhere/source.map"), path("moved.map"));
  const Words words = {"evaluate", "alignment", "elsewhere/result.json", "--truth",
                       "elsewhere/truth.txt"};
  expect_refusal(words, kBadInput, {"elsewhere/result.json", "source.map", "--source"});
  Words given = words;
  given.insert(given.end(), {"--source", "moved.map"});
  EXPECT_EQ(cairn(given).errors, "");
  given.back() = "target.map";
  EXPECT_THAT(cairn(given).errors, HasSubstr("target.map is not the file that was aligned"));
}

TEST_F(EvaluateAlignmentTest, DocumentsOfOtherKindsAreRefused) {
  write_result();
  const std::string pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
  const std::vector<std::pair<std::string, const char*>> wrong = {
      {"", "no JSON"},
      {"16 numbers", "no JSON"},
      {"{}", "no results"},
      {"[]", "no results"},
      {R"({"results": []})", "at least one"},
      {R"({"results": 7})", "a list"},
      {R"({"results": [{}]})", "target_from_source"},
      {R"({"results": [{"target_from_source": [1]}]})", "4 rows"},
      {R"({"results": [{"target_from_source": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})",
       "rotation"},
      {R"({"results": [{"target_from_source": )" + pose + "}]}", "does not name the source map"}};
  for (const auto& [text, fragment] : wrong) {
    write("result.json", text);
    expect_refusal(evaluate_, kBadInput, {"result.json", fragment});
  }
}

// ---- Maps

class EvaluateMapTest : public EvaluateTest {
 protected:
  const SyntheticOptions options_ = {.seed = 6, .landmarks = 1500, .frames = 30};

  // map.map, noisy, and true.map, exact.
  void write_maps() const {
    SyntheticOptions exact = options_;
    exact.pixel_noise_px = exact.depth_noise_m = 0.0;
    write_map(synthetic_map(options_), path("map.map"));
    write_map(synthetic_map(exact), path("true.map"));
  }
};

TEST_F(EvaluateMapTest, ExactMapHasNoErrors) {
  write_maps();
  const Json json = document({"evaluate", "map", "true.map"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.evaluate_map");
  EXPECT_LT(json.at("reprojection").at("px").at("max"), 1e-6);
  EXPECT_EQ(json.at("reprojection").at("px").at("inlier_share"), 1.0);
  EXPECT_TRUE(json.at("reprojection").at("missing").is_null());
  EXPECT_LT(json.at("depth").at("error").at("max"), 1e-9);
  EXPECT_TRUE(json.at("calibration").is_null());
  EXPECT_EQ(json.at("length_unit"), "metres");
}

TEST_F(EvaluateMapTest, NoisyMapIsJudgedByPixelsDepthsAndTruth) {
  write_maps();
  const Json json = document({"evaluate", "map", "map.map", "--truth-map", "true.map"});
  const LandmarkMap map = synthetic_map(options_);
  const std::size_t kept = landmarks_observed(map, 2).size();
  EXPECT_EQ(json.at("inputs").at("map").at("kept_landmarks"), kept);
  EXPECT_EQ(json.at("inputs").at("truth_map").at("path"), "true.map");
  const Json& px = json.at("reprojection").at("px");
  EXPECT_THAT(px.at("rmse").get<double>(),
              ::testing::AllOf(::testing::Gt(0.6), ::testing::Lt(1.1)));
  EXPECT_LT(px.at("median"), px.at("percentile_95"));
  EXPECT_GT(json.at("depth").at("error").at("rmse"), 0.001);
  const Json& calibration = json.at("calibration");
  EXPECT_EQ(calibration.at("all").at("count"), kept);
  EXPECT_NEAR(calibration.at("all").at("mean").get<double>(), 3.0, 0.4);
  EXPECT_NEAR(calibration.at("all").at("inside_95").get<double>(), 0.95, 0.03);
  std::size_t in_bins = 0;
  ASSERT_EQ(calibration.at("by_observations").size(), 5U);
  for (const Json& bin : calibration.at("by_observations")) in_bins += bin.at("count").get<int>();
  EXPECT_EQ(in_bins, kept) << "all have two observations or more";
  EXPECT_EQ(calibration.at("by_depth").at(4).at("from"), 4.0);
  EXPECT_TRUE(calibration.at("by_depth").at(4).at("to").is_null());
}

TEST_F(EvaluateMapTest, WorldFramesOfMapAndTruthMayDiffer) {
  write_maps();
  answer({"convert", "map.map", "moved.map", "--transform", "5 -3 2 40 20 -70"});
  const Json here = document({"evaluate", "map", "map.map", "--truth-map", "true.map"});
  const Json there = document({"evaluate", "map", "moved.map", "--truth-map", "true.map"});
  EXPECT_NEAR(here.at("calibration").at("all").at("mean").get<double>(),
              there.at("calibration").at("all").at("mean").get<double>(), 1e-6);
}

TEST_F(EvaluateMapTest, WrongCovariancesShow) {
  write_maps();
  MapTables tables = synthetic_map(options_).tables();
  for (Eigen::Matrix3d& covariance : tables.landmarks.covariances) covariance *= 4.0;
  write_map(LandmarkMap(std::move(tables)), path("map.map"));
  const Json json = document({"evaluate", "map", "map.map", "--truth-map", "true.map"});
  EXPECT_NEAR(json.at("calibration").at("all").at("mean").get<double>(), 0.75, 0.1);
  EXPECT_GT(json.at("calibration").at("all").at("inside_95"), 0.99);
}

TEST_F(EvaluateMapTest, TrueTrajectoryGivesThePosesByTime) {
  write_maps();
  MapTables tables = synthetic_map(options_).tables();
  tables.frames.timestamps_s.clear();
  write_map(LandmarkMap(tables), path("untimed.map"));
  std::vector<TimedPose> poses;
  for (std::uint32_t i = 0; i < tables.frames.ids.size(); ++i) {
    tables.frames.timestamps_s.emplace_back(50.0 + i);
    const auto& q = tables.frames.quaternions[i];
    poses.push_back({50.001 + i, Rigid3(Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                                        tables.frames.translations[i])});
  }
  write_map(LandmarkMap(std::move(tables)), path("timed.map"));
  write_trajectory("groundtruth.txt", Trajectory(std::move(poses)));
  const Json by_id = document({"evaluate", "map", "map.map", "--truth-map", "true.map"});
  const Json by_time = document({"evaluate", "map", "timed.map", "--truth-map", "true.map",
                                 "--truth-trajectory", "groundtruth.txt"});
  EXPECT_EQ(by_time.at("inputs").at("truth_trajectory").at("path"), "groundtruth.txt");
  EXPECT_NEAR(by_time.at("calibration").at("all").at("mean").get<double>(),
              by_id.at("calibration").at("all").at("mean").get<double>(), 1e-6);
  expect_refusal({"evaluate", "map", "timed.map", "--truth-map", "true.map", "--truth-trajectory",
                  "groundtruth.txt", "--max-time-difference", "0.0001"},
                 kBadInput, {"true.map", "no landmark can be judged"});
  expect_refusal({"evaluate", "map", "timed.map", "--truth-trajectory", "groundtruth.txt"},
                 kWrongUsage, {"--truth-trajectory", "--truth-map"});
  expect_refusal({"evaluate", "map", "untimed.map", "--truth-map", "true.map", "--truth-trajectory",
                  "groundtruth.txt"},
                 kBadInput, {"timestamps of its frames"});
}

TEST_F(EvaluateMapTest, TableSaysWhatIsMeasuredAndWhatIsMissing) {
  write_maps();
  const std::string text = answer({"evaluate", "map", "map.map", "--truth-map", "true.map"});
  EXPECT_THAT(text, ContainsRegex("reprojection +px +[0-9]+ "));
  EXPECT_THAT(text, ContainsRegex("depth +m +[0-9]+ "));
  EXPECT_THAT(text, ContainsRegex("if they are right +3.000 +2.366 +95.0 %"));
  for (const char* const row :
       {"\nall ", "\ndepth 0-1 m ", "\ndepth 4\\+ m ", "\nobserved 2 times ",
        "\nobserved 3-4 times ", "\nobserved 20\\+ times "}) {
    EXPECT_THAT(text, ContainsRegex(row));
  }
  write_plain();
  EXPECT_THAT(answer({"evaluate", "map", "plain.map", "--camera",
                      "PINHOLE 640 480 517.3 516.5 318.6 255.3"}),
              HasSubstr("no depth errors: the map has no depths of its observations"));
}

TEST_F(EvaluateMapTest, MapThatCannotBeJudgedSaysWhatItLacks) {
  write_plain();
  expect_refusal({"evaluate", "map", "plain.map"}, kBadInput,
                 {"plain.map", "no cameras of its frames and no depths of its observations",
                  "--camera", "--truth-map"});
  write_maps();
  answer({"convert", "map.map", "map.ply", "--quiet"});
  expect_refusal({"evaluate", "map", "map.ply"}, kBadInput, {"map.ply", "no observations"});
  expect_refusal({"evaluate", "map", "map.ply", "--truth-map", "true.map"}, kBadInput,
                 {"covariance calibration", "no observations"});
  expect_refusal(
      {"evaluate", "map", "map.map", "--truth-map", "plain.map", "--min-observations", "1000"},
      kBadInput, {"map.map", "1000 or more observations"});
  write("none.map", "CAIRN 2\n");
  expect_refusal({"evaluate", "map", "map.map", "--truth-map", "none.map"}, kBadInput,
                 {"none.map", "no landmark can be judged"});
  for (const char* const option : {"--inlier-px", "--max-time-difference"}) {
    expect_refusal({"evaluate", "map", "map.map", option, "0"}, kWrongUsage,
                   {std::string("cairn: ") + option + ": 0", "a positive number"});
  }
}

TEST_F(EvaluateMapTest, CsvHasARowForEachLandmark) {
  write_maps();
  const auto rows =
      cells(answer({"evaluate", "map", "map.map", "--truth-map", "true.map", "--csv", "-"}));
  const LandmarkMap map = synthetic_map(options_);
  const auto kept = landmarks_observed(map, 2);
  ASSERT_EQ(rows.size(), kept.size() + 1);
  EXPECT_THAT(rows[0],
              ElementsAre("landmark", "observations", "first_keyframe", "depth", "reprojection_px",
                          "depth_error", "error_x", "error_y", "error_z", "nees"));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const Words& row = rows[i + 1];
    ASSERT_EQ(row.size(), 10U);
    EXPECT_EQ(row[0], std::to_string(map.landmarks().ids[kept[i].value].value));
    EXPECT_EQ(row[1], std::to_string(map.observation_count(kept[i])));
    const auto keyframe = first_keyframe(map, kept[i]);
    EXPECT_EQ(row[2], std::to_string(map.frames().ids[keyframe->value].value));
    EXPECT_GT(std::stod(row[9]), 0.0);
  }
  const auto without = cells(answer({"evaluate", "map", "map.map", "--csv", "-"}));
  EXPECT_EQ(without[1][9], "") << "unknown is empty";
}

// ---- Real data

class EvaluateRealDataTest : public EvaluateTest {
 protected:
  void SetUp() override {
    const auto folder = real_data();
    if (!folder) GTEST_SKIP() << kNoRealData;
    folder_ = folder->string();
  }
  std::string folder_;
};

TEST_F(EvaluateRealDataTest, GroundTruthIsItsOwnTruthWhereverItIsMoved) {
  const std::string truth = folder_ + "/tum_fr1_desk/groundtruth.txt";
  const auto highest = [&](const Words& words) {
    return document(words).at("absolute").at("translation_m").at("max").get<double>();
  };
  EXPECT_LT(highest({"evaluate", "trajectory", truth, truth, "--alignment", "none"}), 1e-12);
  FileReader file(truth);
  const Rigid3 motion = Rigid3::from_roll_pitch_yaw({10, -20, 5}, 0.5, -1.0, 2.5);
  write_trajectory("moved.txt", transformed(read_trajectory(file), Similarity3(1.0, motion)));
  for (const char* const alignment : {"origin", "se3", "sim3"}) {
    EXPECT_LT(highest({"evaluate", "trajectory", "moved.txt", truth, "--alignment", alignment}),
              1e-9);
  }
  const Json json = document({"evaluate", "trajectory", "moved.txt", truth});
  EXPECT_EQ(json.at("matched_poses"), 2335);
  for (const char* const unit : {"per_metre", "per_second", "per_frame"}) {
    EXPECT_LT(json.at("relative").at(unit).at("translation_m").at("max"), 1e-9);
  }
  EXPECT_GT(highest({"evaluate", "trajectory", "moved.txt", truth, "--alignment", "none"}), 10.0);
}

TEST_F(EvaluateRealDataTest, DeskMapNeedsACameraAndFitsItsImagesWithIt) {
  const std::string map = folder_ + "/map_fr1_desk.txt";
  expect_refusal({"evaluate", "map", map}, kBadInput, {"no cameras of its frames", "--camera"});
  const Json json = document({"evaluate", "map", map, "--camera",
                              "PINHOLE 640 480 517.306408 516.469215 318.643040 255.313989"});
  EXPECT_EQ(json.at("inputs").at("map").at("kept_landmarks"), 6081);
  EXPECT_EQ(json.at("reprojection").at("px").at("count"), 15860);
  EXPECT_LT(json.at("reprojection").at("px").at("median"), 0.5);
  EXPECT_GT(json.at("reprojection").at("px").at("inlier_share"), 0.95);
  EXPECT_EQ(json.at("depth").at("missing"), "depths of its observations");
}

}  // namespace
}  // namespace cairn::testing
