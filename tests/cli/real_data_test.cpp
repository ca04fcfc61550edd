// SPDX-License-Identifier: BSD-3-Clause
// The map of the fr1/desk sequence that the paper's authors published.
#include "support/real_data.hpp"

#include <cstdint>
#include <string>

#include "cli.hpp"

namespace cairn::testing {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ContainsRegex;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;

class RealDataTest : public CliTest {
 protected:
  void SetUp() override {
    const auto folder = real_data();
    if (!folder) GTEST_SKIP() << kNoRealData;
    map_ = (*folder / "map_fr1_desk.txt").string();
    ASSERT_TRUE(std::filesystem::exists(map_)) << map_;
  }

  void cut() const {
    answer({"convert", map_, "earlier.map", "--frames", "0:120"});
    answer({"convert", map_, "later.map", "--frames", "120:240"});
  }

  std::string map_;
};

TEST_F(RealDataTest, InfoCountsTheDeskMap) {
  const Json json = document({"info", map_});
  const Json& input = json.at("inputs").at("map");
  EXPECT_EQ(input.at("frames"), 240);
  EXPECT_EQ(input.at("landmarks"), 22338);
  EXPECT_EQ(json.at("observed_twice_or_more"), 6081);
  EXPECT_EQ(json.at("unobserved"), 630);
  EXPECT_THAT(json.at("warnings"), Contains("landmarks without any observation: 630"));
  EXPECT_TRUE(json.at("confidence").at("reprojection").is_null());
  const std::string text = answer({"info", map_});
  EXPECT_THAT(text, ContainsRegex("frames +240, ids 0 to 239\n"));
  EXPECT_THAT(text, ContainsRegex("landmarks +22338\n"));
  EXPECT_THAT(text, ContainsRegex("observed twice or more +6081,"));
  EXPECT_THAT(text, HasSubstr("warning: landmarks without any observation: 630\n"));
}

TEST_F(RealDataTest, BinaryFormLosesNothing) {
  answer({"convert", map_, "desk.map"});
  answer({"convert", "desk.map", "desk.cairn"});
  answer({"convert", "desk.cairn", "back.map"});
  EXPECT_EQ(content("back.map"), content("desk.map"));
}

TEST_F(RealDataTest, CutIntoHalvesGivesTheMiniMapsOfThePaper) {
  cut();
  EXPECT_EQ(document({"info", "earlier.map"}).at("observed_twice_or_more"), 3050);
  EXPECT_EQ(document({"info", "later.map"}).at("observed_twice_or_more"), 3015);
}

TEST_F(RealDataTest, HalvesAlignFromIdentityByEveryStrategy) {
  cut();
  const Json json =
      document({"align", "later.map", "earlier.map", "--method", "icp", "--no-verdict",
                "--confidence", "base,covariance,observations,distance"});
  EXPECT_EQ(json.at("inputs").at("source").at("kept_landmarks"), 3015);
  EXPECT_EQ(json.at("inputs").at("target").at("kept_landmarks"), 3050);
  ASSERT_EQ(json.at("results").size(), 4U);
  for (const Json& result : json.at("results")) {
    EXPECT_THAT(result.at("status"), ::testing::AnyOf("converged", "stopped"));
    EXPECT_NEAR(result.at("initial_score").get<double>(), 0.01735, 5e-6);
    EXPECT_THAT(result.at("score").get<double>(), AllOf(Ge(0.014), Le(0.031)));
  }
}

// From poses far off too, the answer is a valid result; how right it is, the score does not tell.
TEST_F(RealDataTest, HalvesAlignFromDisplacementsOfThePaper) {
  cut();
  for (const char* const pose : {"0.5 -0.5 0 0 0 0", "0 0 0 0 0 40", "-0.5 0.5 0 0 0 -30"}) {
    const Json json =
        document({"align", "later.map", "earlier.map", "--method", "icp", "--no-verdict",
                  "--initial", pose, "--confidence", "base,covariance,observations,distance"});
    for (const Json& result : json.at("results")) {
      EXPECT_THAT(result.at("status"), ::testing::AnyOf("converged", "stopped"));
      EXPECT_LT(result.at("score"), result.at("initial_score"));
    }
  }
}

#ifdef CAIRN_HAS_ADJUSTMENT
TEST_F(CliTest, AColmapModelGetsCovariancesFromItsObservations) {
  const auto folder = real_data();
  if (!folder) GTEST_SKIP() << kNoRealData;
  const std::string model = (*folder / "foreign" / "colmap_text_and_binary").string();
  ASSERT_TRUE(std::filesystem::exists(model)) << model;
  const Json json = document({"convert", model, "model.cairn", "--estimate-covariances"});
  const LandmarkMap map = read_map(path("model.cairn"));
  ASSERT_TRUE(map.has_covariances());
  std::size_t known = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    known += map.covariance(LandmarkIndex{i}) ? 1 : 0;
  }
  EXPECT_EQ(json.at("covariances").at("known"), known);
  EXPECT_GT(10 * known, 9 * map.landmark_count());
  const double noise = json.at("covariances").at("pixel_noise_px").get<double>();
  EXPECT_GT(noise, 0.1);
  EXPECT_LT(noise, 2.0);
  EXPECT_TRUE(json.at("covariances").at("depth_noise").is_null());
}
#endif

}  // namespace
}  // namespace cairn::testing
