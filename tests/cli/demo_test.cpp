// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;

class DemoTest : public CliTest {};

TEST_F(DemoTest, AlignsByAllStrategiesAndComesNearTheTruth) {
  const Json json = document({"demo"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.demo");
  EXPECT_EQ(json.at("seed"), 1);
  ASSERT_EQ(json.at("results").size(), 4U);
  bool any_near = false;
  for (const Json& result : json.at("results")) {
    EXPECT_EQ(result.at("status"), "aligned");
    EXPECT_LT(result.at("score"), result.at("initial_score"));
    any_near = any_near || (result.at("error").at("rotation_deg") < 2.0 &&
                            result.at("error").at("translation") < 0.02);
  }
  EXPECT_TRUE(any_near) << "the start is 15 degrees and 0.2 m off";
}

TEST_F(DemoTest, PrintsATableAndWhatItMeans) {
  const std::string text = answer({"demo"});
  EXPECT_THAT(text, HasSubstr("3000 landmarks"));
  EXPECT_THAT(text, HasSubstr("pose error"));
  EXPECT_THAT(text, HasSubstr("lower score need not mean a smaller error"));
  EXPECT_TRUE(files().empty());
}

TEST_F(DemoTest, SavedMapsAlignAsTheHelpSays) {
  EXPECT_THAT(answer({"demo", "--save", "a/desk"}), HasSubstr("Saved to a/desk"));
  const Json demo = document({"demo"});
  const Json result = document({"align", "a/desk/source.map", "a/desk/target.map",
                                "--initial-matrix", "a/desk/initial.txt", "--truth",
                                "a/desk/truth.txt", "--confidence", "observations"})
                          .at("results")
                          .at(0);
  const Json& expected = demo.at("results").at(2);
  EXPECT_EQ(expected.at("confidence"), "observations");
  // Not to the last bit: the poses went through text files as matrices.
  EXPECT_NEAR(result.at("score").get<double>(), expected.at("score").get<double>(), 1e-9);
  EXPECT_NEAR(result.at("error").at("translation").get<double>(),
              expected.at("error").at("translation").get<double>(), 1e-6);
}

TEST_F(DemoTest, SeedDecidesTheScene) {
  const auto score = [&](const char* seed) {
    return document({"demo", "--seed", seed}).at("results").at(0).at("score").get<double>();
  };
  const double one = score("1");
  EXPECT_EQ(score("1"), one);
  EXPECT_NE(score("2"), one);
}

TEST_F(DemoTest, FolderThatCannotBeMadeIsNamed) {
  write("file", "");
  expect_refusal({"demo", "--save", "file"}, kSystemError, {"--save", "file"});
  expect_refusal({"demo", "--save", "file/below"}, kSystemError, {"--save", "file/below"});
}

}  // namespace
}  // namespace cairn::testing
