// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/study.hpp"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kFull = R"(name: desks
seed: 7
pairs:
  - name: real
    source: a.map
    target: b.map
    truth: truth.txt
  - name: desk
    simulate: {environment: desk, seeds: [1, 5], path: orbit, frames: 90, rate_hz: 15, changed: 0.25}
initial_poses:
  count: 3
  x_m: [-1, 1]
  yaw_deg: [-60, 60]
methods: [icp, robust]
strategies: [base, observations]
k: [5, 7]
align: {max_iterations: 50, max_distance_m: 0.5, min_observations: 3}
success: {rotation_deg: 3, translation_m: 0.1, score_m2: 0.01}
statistics: {confidence_level: 0.9, equivalence_margin: 0.1}
)";

std::string refusal(const std::string& yaml) {
  return testing::refusal(ErrorKind::kInput, [&] { parse_study(yaml, "study.yaml"); });
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  text.replace(text.find(what), what.size(), by);
  return text;
}

TEST(StudyFile, SaysAllOfAStudy) {
  const Study study = parse_study(kFull, "study.yaml");
  EXPECT_EQ(study.name, "desks");
  EXPECT_EQ(study.seed, 7U);
  ASSERT_EQ(study.pairs.size(), 3U);
  EXPECT_EQ(std::get<PairFiles>(study.pairs[0].maps).truth, "truth.txt");
  EXPECT_EQ(study.pairs[1].name, "desk_1");
  EXPECT_EQ(study.pairs[2].name, "desk_5");
  const auto& simulation = std::get<PairSimulation>(study.pairs[2].maps);
  EXPECT_EQ(simulation.environment, "desk");
  EXPECT_EQ(simulation.seed, 5U);
  EXPECT_EQ(simulation.path, "orbit");
  EXPECT_EQ(simulation.frames, 90U);
  EXPECT_EQ(simulation.rate_hz, 15.0);
  EXPECT_EQ(simulation.changed, 0.25);
  EXPECT_EQ(study.initial_count, 3U);
  EXPECT_EQ(study.initial.low, (Displacement{.x_m = -1.0, .yaw_deg = -60.0}));
  EXPECT_EQ(study.initial.high, (Displacement{.x_m = 1.0, .yaw_deg = 60.0}));
  EXPECT_THAT(study.methods, ::testing::ElementsAre(Method::kIcp, Method::kRobust));
  EXPECT_THAT(study.strategies, ::testing::ElementsAre("base", "observations"));
  EXPECT_THAT(study.k, ::testing::ElementsAre(5U, 7U));
  EXPECT_EQ(study.align.max_iterations, 50);
  EXPECT_EQ(study.align.max_distance, 0.5);
  EXPECT_EQ(study.points.min_observations, 3U);
  EXPECT_EQ(study.success.rotation_deg, 3.0);
  EXPECT_EQ(study.success_score, 0.01);
  EXPECT_EQ(study.confidence_level, 0.9);
  EXPECT_EQ(study.equivalence_margin, 0.1);
}

TEST(StudyFile, HasThePapersDefaults) {
  const Study study = parse_study(
      "{name: s, pairs: [{name: p, source: a, target: b}], initial_poses: {}}", "study.yaml");
  EXPECT_THAT(study.methods, ::testing::ElementsAre(Method::kIcp));
  EXPECT_THAT(study.strategies,
              ::testing::ElementsAre("base", "covariance", "observations", "distance"));
  EXPECT_THAT(study.k, ::testing::ElementsAre(5U));
  EXPECT_EQ(study.align.max_iterations, 150);
}

TEST(StudyFile, NamesLineAndKeyOfADefect) {
  EXPECT_THAT(refusal("name: [\n"), HasSubstr("study.yaml:"));
  EXPECT_THAT(refusal(""), HasSubstr("no keys"));
  EXPECT_THAT(refusal("name: s\n"), HasSubstr("pairs is missing"));
  EXPECT_THAT(
      refusal(replaced(kFull, "seed: 7", "sead: 7")),
      AllOf(HasSubstr("study.yaml:2: study: 'sead' is no key"), HasSubstr("initial_poses")));
  EXPECT_THAT(refusal(replaced(kFull, "count: 3", "count: 0")),
              HasSubstr("study.yaml:11: initial_poses.count: '0'; expected a whole number from 1"));
  EXPECT_THAT(refusal(replaced(kFull, "[-1, 1]", "[1, -1]")),
              HasSubstr("initial_poses.x_m: the low end is above the high one"));
  EXPECT_THAT(refusal(replaced(kFull, "[-60, 60]", "[-60, 60, 1]")), HasSubstr("3 numbers"));
  EXPECT_THAT(refusal(replaced(kFull, "yaw_deg: [-60", "yaw_deg: [nan")), HasSubstr("'nan'"));
  EXPECT_THAT(refusal(replaced(kFull, "observations]", "magic]")),
              AllOf(HasSubstr("strategies[1]: 'magic'"), HasSubstr("base, covariance")));
  EXPECT_THAT(refusal(replaced(kFull, "[icp, robust]", "[icp, magic]")),
              AllOf(HasSubstr("methods[1]: 'magic'"), HasSubstr("icp, fast, robust, anywhere")));
  EXPECT_THAT(refusal(replaced(kFull, "[icp, robust]", "[icp, icp]")),
              HasSubstr("each method once"));
  EXPECT_THAT(refusal(replaced(kFull, "[base, observations]", "[base, base]")),
              HasSubstr("given twice"));
  EXPECT_THAT(refusal(replaced(kFull, "k: [5, 7]", "k: 5")), HasSubstr("k: no list"));
  EXPECT_THAT(refusal(replaced(kFull, "source: a.map", "simulate: {environment: desk}")),
              HasSubstr("both files and a simulation"));
  EXPECT_THAT(refusal(replaced(kFull, "source: a.map\n", "\n")), HasSubstr("no maps"));
  EXPECT_THAT(refusal(replaced(kFull, "name: real", "name: desk_5")),
              HasSubstr("'desk_5' names two pairs"));
  EXPECT_THAT(refusal(replaced(kFull, "name: real", "name: ../x")), HasSubstr("letters, digits"));
  EXPECT_THAT(refusal(replaced(kFull, "seed: 7", "seed: 7\nseed: 8")), HasSubstr("twice"));
}

TEST(StudyFile, TakesMemoryInProportionToItsText) {
  const auto refusal = [](const std::string& yaml) -> std::string {
    try {
      parse_study(yaml, "s.yaml");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal("name: &a b\nseed: *a\n"), "s.yaml:2: an alias; expected values written out");
  std::string many = "name: [";
  for (int i = 0; i < 200'000; ++i) many += "a,";
  EXPECT_EQ(refusal(many + "a]\n"),
            "s.yaml:1: too many values; expected at most 100000 in a study");
  EXPECT_NE(refusal(std::string(100'000, '[')), "accepted");
}

TEST(StudyPlan, CrossesPairsPosesMethodsAndStrategies) {
  const auto name_of = [](const Trial& trial) {
    return approach_name(trial.method, trial.strategy);
  };
  const StudyPlan plan(parse_study(kFull, "study.yaml"));
  // Base ICP and the robust method have no use for a second k.
  EXPECT_EQ(plan.runs_per_pair(), 3U * 5U);
  EXPECT_EQ(plan.size(), 45U);
  std::set<std::string> keys;
  for (std::size_t i = 0; i < plan.size(); ++i) {
    const Trial trial = plan.trial(i);
    EXPECT_EQ(trial.pair, plan.study().pairs[i / 15].name);
    EXPECT_EQ(trial.number, i % 15 / 5 + 1);
    EXPECT_EQ(trial.initial, plan.trial(i - i % 5).initial) << "strategies share the poses";
    EXPECT_LE(std::abs(trial.initial.x_m), 1.0);
    EXPECT_LE(std::abs(trial.initial.yaw_deg), 60.0);
    EXPECT_EQ(trial.initial.roll_deg, 0.0);
    keys.insert(trial.pair + "/" + std::to_string(trial.number) + "/" + name_of(trial) + "/" +
                std::to_string(trial.k));
  }
  EXPECT_EQ(keys.size(), plan.size());
  EXPECT_EQ(name_of(plan.trial(1)), "observations");
  EXPECT_EQ(name_of(plan.trial(2)), "robust");
  EXPECT_NE(plan.trial(0).initial, plan.trial(5).initial);
  EXPECT_NE(plan.trial(0).initial, plan.trial(15).initial);
}

TEST(StudyPlan, HasASeedForEachStartOfEachPair) {
  Study study = parse_study(kFull, "study.yaml");
  const StudyPlan plan(study);
  std::set<std::uint64_t> seeds;
  for (std::size_t i = 0; i < plan.size(); ++i) {
    seeds.insert(plan.seed_of(i));
    EXPECT_EQ(plan.seed_of(i), plan.seed_of(i - i % 5));
  }
  EXPECT_EQ(seeds.size(), 9U);
  study.seed = 8;
  EXPECT_FALSE(seeds.contains(StudyPlan(study).seed_of(0)));
}

TEST(StudyPlan, KeepsItsPosesWhenThereAreMoreOfThem) {
  Study study = parse_study(kFull, "study.yaml");
  const StudyPlan few(study);
  study.initial_count = 50;
  const StudyPlan many(study);
  EXPECT_EQ(few.trial(5).initial, many.trial(5).initial);
  EXPECT_EQ(few.trial(15).initial, many.trial(many.runs_per_pair()).initial);
}

TEST(StudyPlan, HasATextThatDiffersWithWhateverChangesTheRuns) {
  std::set<std::string> texts = {canonical_text(parse_study(kFull, "study.yaml"))};
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"seed: 7", "seed: 8"},
      {"a.map", "c.map"},
      {"[1, 5]", "[1, 6]"},
      {"count: 3", "count: 4"},
      {"[-1, 1]", "[-1, 2]"},
      {"[icp, robust]", "[icp, fast]"},
      {"k: [5, 7]", "k: [5]"},
      {"frames: 90", "frames: 91"},
      {"truth.txt", "other.txt"},
      {"orbit", "sweep"},
      {"_distance_m: 0.5", "_distance_m: 0.6"},
      {"observations: 3", "observations: 2"}};
  for (const auto& [what, by] : changes) {
    EXPECT_TRUE(texts.insert(canonical_text(parse_study(replaced(kFull, what, by), "s"))).second)
        << what;
  }
  // How runs are judged is no part of them.
  EXPECT_FALSE(texts
                   .insert(canonical_text(
                       parse_study(replaced(kFull, "rotation_deg: 3", "rotation_deg: 4"), "s")))
                   .second);
}

TEST(Displaced, MovesTheCentroidFromWhereTheTruthPutsIt) {
  const Rigid3 truth = Rigid3::from_roll_pitch_yaw({1, 2, 3}, 0.3, -0.2, 1.0);
  const Eigen::Vector3d centroid(10.0, -4.0, 2.0);
  const Displacement displacement{.x_m = 0.5, .z_m = -0.25, .pitch_deg = 20.0, .yaw_deg = 30.0};
  const Rigid3 initial = displaced(displacement, truth, centroid);
  EXPECT_TRUE((initial * centroid - truth * centroid).isApprox(Eigen::Vector3d(0.5, 0.0, -0.25)));
  EXPECT_NEAR((initial * truth.inverse()).angle(), displacement.pose().angle(), 1e-12);
  EXPECT_TRUE(displaced({}, truth, centroid).matrix().isApprox(truth.matrix(), 1e-12));
  EXPECT_TRUE((displaced(displacement, std::nullopt, centroid) * centroid - centroid)
                  .isApprox(Eigen::Vector3d(0.5, 0.0, -0.25)));
}

}  // namespace
}  // namespace cairn
