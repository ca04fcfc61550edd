// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/document.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string document(const std::string& results, int version) {
  return R"({"schema": {"name": "cairn.align", "version": )" + std::to_string(version) +
         R"(}, "results": [)" + results + "]}";
}

AlignmentRecord read_one(const std::string& result, int version = 2) {
  return read_alignments(document(result, version), "r.json").front();
}

void expect_refused(const std::string& text, const std::vector<std::string>& parts) {
  try {
    read_alignments(text, "r.json");
    ADD_FAILURE() << "not refused: " << text;
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("r.json"));
    for (const std::string& part : parts) EXPECT_THAT(error.what(), HasSubstr(part));
  }
}

// What an alignment of two synthetic maps gives, searched for or by ICP.
AlignmentRecord aligned(AlignMethod method, bool judge, std::optional<ScaleRange> scale = {}) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 500, .frames = 16});
  AlignmentRecord record;
  AlignOptions options;
  options.method = method;
  options.judge = judge;
  options.trace = true;
  options.scale = scale;
  record.alignment = align(pair.source, pair.target, options);
  record.method = method;
  record.confidence = "covariance";
  record.k = 7;
  record.overlap_radius = 0.1;
  record.matches = record.alignment.registration.matches.size();
  return record;
}

TEST(AlignmentDocument, IsReadBackWithoutLoss) {
  for (const AlignmentRecord& record :
       {aligned(AlignMethod::kRobust, true), aligned(AlignMethod::kIcp, false),
        aligned(AlignMethod::kIcp, true), aligned(AlignMethod::kRobust, true, ScaleRange())}) {
    for (const HistoryDetail history :
         {HistoryDetail::kNone, HistoryDetail::kPoses, HistoryDetail::kMatches}) {
      const std::string text = to_json(record, history);
      EXPECT_EQ(to_json(read_one(text), history), text);
    }
  }
}

TEST(AlignmentDocument, HoldsTheDeformation) {
  AlignmentRecord record;
  EXPECT_FALSE(read_one(to_json(record)).alignment.deformation);
  record.alignment.deformation =
      MapDeformation{.matches = 120, .rotation_rad = 0.1, .scale_ratio = 1.25, .displacement = 0.5};
  const auto read = read_one(to_json(record)).alignment.deformation;
  ASSERT_TRUE(read);
  EXPECT_EQ(read->matches, 120U);
  EXPECT_NEAR(read->rotation_rad, 0.1, 1e-15);
  EXPECT_EQ(read->scale_ratio, 1.25);
  EXPECT_EQ(read->displacement, 0.5);
}

TEST(AlignmentDocument, PartsAndBendAreReadBackWithoutLoss) {
  Random random(5);
  AlignmentRecord record = aligned(AlignMethod::kIcp, true);
  for (int i = 0; i < 100; ++i) {
    const auto pose = [&] {
      const Eigen::Vector3d t(random.normal(), random.normal(), random.normal());
      const double roll = random.uniform(-3, 3);
      const double yaw = random.uniform(-3, 3);
      const double scale = random.uniform(0.2, 5);
      return Similarity3(scale, Rigid3::from_roll_pitch_yaw(t, roll, 0.4, yaw));
    };
    PartsAlignment parts;
    parts.aligned = 1;
    parts.bend = MapBend{.map = MapRole::kSource,
                         .rotation_rad = random.uniform(0, 3),
                         .first = FrameId{3},
                         .last = FrameId{9},
                         .displacement = random.uniform(0, 1)};
    PartPose& part = parts.parts.emplace_back();
    part.landmarks = 40;
    part.found = pose();
    part.target_from_source = pose();
    parts.parts.emplace_back();  // not placed
    record.alignment.parts = parts;
    const std::string text = to_json(record);
    EXPECT_EQ(to_json(read_one(text)), text);
  }
}

TEST(AlignmentDocument, HoldsTheAlignment) {
  const AlignmentRecord record = aligned(AlignMethod::kRobust, true);
  ASSERT_EQ(record.alignment.verdict, Verdict::kAligned);
  const AlignmentRecord read = read_one(to_json(record, HistoryDetail::kMatches));
  EXPECT_EQ(read.method, AlignMethod::kRobust);
  EXPECT_EQ(read.confidence, "covariance");
  EXPECT_EQ(read.k, 7U);
  EXPECT_EQ(read.matches, record.matches);
  EXPECT_EQ(read.alignment.verdict, Verdict::kAligned);
  EXPECT_EQ(read.alignment.probability, record.alignment.probability);
  EXPECT_EQ(read.alignment.reason, record.alignment.reason);
  EXPECT_EQ(read.alignment.target_from_source->matrix(),
            record.alignment.target_from_source->matrix());
  EXPECT_EQ(*read.alignment.registration.covariance, *record.alignment.registration.covariance);
  ASSERT_EQ(read.alignment.candidates.size(), record.alignment.candidates.size());
  EXPECT_EQ(read.alignment.candidates.front().support.within,
            record.alignment.candidates.front().support.within);
  ASSERT_EQ(read.alignment.registration.history.size(),
            record.alignment.registration.history.size());
  EXPECT_EQ(read.alignment.registration.history.back().matches.size(),
            record.alignment.registration.history.back().matches.size());
}

TEST(AlignmentDocument, HistoryIsThereOnlyWhereAskedFor) {
  const AlignmentRecord record = aligned(AlignMethod::kIcp, false);
  EXPECT_THAT(to_json(record), Not(HasSubstr("history")));
  EXPECT_THAT(to_json(record, HistoryDetail::kPoses), Not(HasSubstr("\"matches\": [")));
  EXPECT_THAT(to_json(record, HistoryDetail::kMatches), HasSubstr("\"matches\": ["));
}

constexpr const char* kPose = "[[1,0,0,5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

TEST(AlignmentDocument, PoseOfVersion1IsTheEstimateAndTrustedOnlyIfAligned) {
  const auto entry = [](const std::string& verdict) {
    return R"({"status": "aligned", "verdict": )" + verdict +
           R"(, "probability": 0.5, "support_radius": 0.1, "stop_reason": "cycle", "scale": 2.0,)" +
           R"( "target_from_source": )" + kPose + "}";
  };
  const Alignment unjudged = read_one(entry("\"none\""), 1).alignment;
  EXPECT_FALSE(unjudged.verdict);
  EXPECT_FALSE(unjudged.target_from_source);
  EXPECT_EQ(status_of(unjudged), "stopped");
  EXPECT_EQ(unjudged.estimate->scale(), 2.0);
  EXPECT_EQ(unjudged.estimate->translation().x(), 5.0);
  EXPECT_FALSE(read_one(entry("\"ambiguous\""), 1).alignment.target_from_source);
  const Alignment trusted = read_one(entry("\"aligned\""), 1).alignment;
  EXPECT_EQ(trusted.target_from_source->scale(), 2.0);
}

TEST(AlignmentDocument, BaseWasNone) {
  AlignmentRecord record = aligned(AlignMethod::kIcp, false);
  for (const char* const name : {"base", "none"}) {
    record.confidence = name;
    EXPECT_EQ(read_one(to_json(record), kAlignmentVersion).confidence, "base");
  }
}

// Version 1 may state the pose by two matrices, of which each is off a rotation by its own rounding.
TEST(AlignmentDocument, TwoStatementsOfAPoseAreOne) {
  const auto entry = [](const std::string& estimate) {
    return R"({"status": "aligned", "verdict": "aligned", "probability": 0.5, "support_radius": 0.1,)"
           R"( "stop_reason": "cycle", "target_from_source": [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0],)"
           R"( [0, 0, 0, 1]], "estimate": [[1, 0, 0, 5], [)" +
           estimate + ", 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}";
  };
  const Alignment one = read_one(entry("1e-11"), 1).alignment;
  EXPECT_EQ(one.target_from_source->matrix(), one.estimate->matrix());
  EXPECT_THROW(read_one(entry("1e-7"), 1), Error);
}

TEST(AlignmentDocument, MatrixWithoutAQuaternionIsAPose) {
  const Alignment alignment =
      read_one(
          R"({"target_from_source": null, "estimate": [[2,0,0,5],[0,2,0,0],[0,0,2,0],[0,0,0,1]]})")
          .alignment;
  EXPECT_NEAR(alignment.estimate->scale(), 2.0, 1e-12);
}

TEST(AlignmentDocument, WrongFieldsAreNamed) {
  const std::string pose = std::string(R"("target_from_source": )") + kPose;
  expect_refused("", {"no JSON"});
  expect_refused("{}", {"no results"});
  expect_refused(R"({"results": 7})", {"results is 7", "a list"});
  expect_refused(R"({"results": []})", {"at least one"});
  expect_refused(document("{}", 3), {"schema.version is 3", "at most 2"});
  expect_refused(document("7", 2), {"results[0] is 7", "an object"});
  expect_refused(document("{}", 2), {"results[0]", "target_from_source"});
  expect_refused(document(R"({"target_from_source": [1]})", 2), {"target_from_source", "4 rows"});
  expect_refused(document("{" + pose + R"(, "k": -1})", 2), {"results[0].k is -1"});
  expect_refused(document("{" + pose + R"(, "status": "fine"})", 2), {"status", "converged"});
  expect_refused(document("{" + pose + R"(, "scale": 1, "quaternion": [0, 1, 0, 0]})", 2),
                 {"target_from_source", "quaternion"});
  expect_refused(document("{" + pose + R"(, "covariance": [[1]]})", 2), {"covariance", "6x6"});
  // An aligned pair has a pose.
  expect_refused(document(R"({"target_from_source": null, "verdict": "aligned", "probability": 1,)"
                          R"( "support_radius": 1})",
                          2),
                 {"target_from_source is null"});
}

}  // namespace
}  // namespace cairn
