// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/report.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

#include "cairn/core/file.hpp"

#ifdef CAIRN_HAS_SEQUENCE
#include "cairn/vision/sequence.hpp"
#endif

#include "cli.hpp"
#include "support/report_page.hpp"

namespace cairn::testing {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kNoViewer =
    "*** BUILT WITHOUT THE VIEWER (CAIRN_WITH_VIEWER=OFF): NO REPORT WAS TESTED ***";

class ReportTest : public CliTest {
 protected:
  static Words align(const Words& more) {
    Words words = {"align",     "source.map", "target.map", "--initial-matrix",
                   "start.txt", "--method",   "icp",        "--no-verdict"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  ReportPage page(std::string_view name) const { return ReportPage(content(name)); }

  /// What a report's section of that id holds.
  static const Json& section(const ReportPage& page, std::string_view id) {
    for (const Json& one : page.document.at("sections")) {
      if (one.at("id") == id) return one;
    }
    throw std::runtime_error("no section " + std::string(id));
  }

  static std::vector<std::string> section_ids(const ReportPage& page) {
    std::vector<std::string> ids;
    for (const Json& one : page.document.at("sections")) ids.push_back(one.at("id"));
    return ids;
  }

  /// Matches of a result with a trace, iteration by iteration, as a reader must get them: what is
  /// shown is what was aligned, in its order.
  static std::vector<std::vector<std::int32_t>> traced(const Json& result, std::size_t landmarks) {
    std::vector<std::vector<std::int32_t>> iterations;
    for (const Json& iteration : result.at("history")) {
      std::vector<std::int32_t>& list = iterations.emplace_back(landmarks, -1);
      for (const Json& match : iteration.at("matches")) {
        list.at(match.at(0).get<std::size_t>()) = match.at(1).get<std::int32_t>();
      }
    }
    return iterations;
  }
};

/// Tests that need a viewer in the build.
class WrittenReportTest : public ReportTest {
 protected:
  void SetUp() override {
    if (!report::has_viewer()) GTEST_SKIP() << kNoViewer;
  }
};

TEST_F(ReportTest, WithoutAViewerTheErrorNamesTheOptionBeforeAnyWork) {
  if (report::has_viewer()) return;  // nothing to refuse
  // The maps do not even exist.
  for (const Words& words :
       {Words{"align", "a.map", "b.map", "--report", "r.html"}, Words{"demo", "--report", "r.html"},
        Words{"report", "result.json", "-o", "r.html"}}) {
    expect_refusal(words, kWrongUsage, {"r.html", "no viewer", "CAIRN_WITH_VIEWER=ON"});
  }
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(ReportTest, APageDoesNotGoToStdout) {
  expect_refusal({"align", "a.map", "b.map", "--report", "-"}, kWrongUsage, {"--report", "a file"});
}

TEST_F(ReportTest, ResultsAndOutputMustBeGiven) {
  expect_refusal({"report", "-o", "r.html"}, kWrongUsage, {"result"});
  expect_refusal({"report", "result.json"}, kWrongUsage, {"--output"});
  expect_refusal({"report", "", "-o", "r.html"}, kWrongUsage, {"result", "expected a value"});
}

TEST_F(WrittenReportTest, AlignShowsEachIterationOfEachStrategy) {
  write_pair();
  const std::string text =
      answer(align({"--confidence", "base,observations", "--truth", "truth.txt", "--report",
                    "r.html", "--trace", "--json", "result.json"}));
  EXPECT_THAT(text, HasSubstr("\nwrote r.html\n"));
  const Json json = Json::parse(content("result.json"));
  const ReportPage report = page("r.html");
  const Json& document = report.document;
  EXPECT_EQ(document.at("title"), "source.map to target.map");
  EXPECT_THAT(document.at("subtitle").get<std::string>(),
              StartsWith("The lowest score is that of"));
  EXPECT_THAT(section_ids(report), ElementsAre("answer", "scene", "strategies", "convergence",
                                               "translation-error", "rotation-error"));

  const Json& provenance = document.at("provenance");
  EXPECT_EQ(provenance.at("command").at(0), "cairn");
  EXPECT_EQ(provenance.at("command").at(1), "align");
  EXPECT_EQ(provenance.at("inputs").at(0).at("role"), "source");
  EXPECT_EQ(provenance.at("inputs").at(0).at("hash"), hash_file(path("source.map")));
  EXPECT_EQ(provenance.at("inputs").at(0).at("details").at("landmarks"), 600);
  EXPECT_EQ(provenance.at("options"), json.at("options"));

  const auto landmarks = json.at("inputs").at("source").at("kept_landmarks").get<std::size_t>();
  EXPECT_EQ(document.at("maps").at(0).at("count"), landmarks);
  const Json& runs = section(report, "scene").at("runs");
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs.at(0).at("name"), "base");
  EXPECT_EQ(runs.at(1).at("name"), "observations");
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& result = json.at("results").at(i);
    EXPECT_EQ(runs.at(i).at("summary").at("score"), result.at("score"));
    EXPECT_EQ(runs.at(i).at("summary").at("rotation_error_deg"),
              result.at("error").at("rotation_deg"));
    EXPECT_EQ(report.numbers<double>(runs.at(i).at("poses"), "f64").size(),
              7 * (result.at("history").size() + 1));
    EXPECT_EQ(replayed(report, runs.at(i).at("matches")), traced(result, landmarks));
  }
}

// A trace for the page is no reason to fill the JSON with it.
TEST_F(WrittenReportTest, ReportDoesNotChangeTheJson) {
  write_pair();
  Json with = document(align({"--report", "r.html"}));
  Json without = document(align({}));
  for (Json* const json : {&with, &without}) json->at("results").at(0).erase("duration_s");
  EXPECT_EQ(with, without);
}

TEST_F(WrittenReportTest, SavedResultMakesTheSamePage) {
  write_pair();
  answer(align({"--confidence", "base,covariance", "--truth", "truth.txt", "--report",
                "direct.html", "--trace", "--json", "result.json"}));
  EXPECT_THAT(answer({"report", "result.json", "-o", "saved.html"}), HasSubstr("saved.html"));
  const ReportPage direct = page("direct.html");
  const ReportPage saved = page("saved.html");
  EXPECT_EQ(saved.document.at("title"), direct.document.at("title"));
  EXPECT_EQ(saved.document.at("maps"), direct.document.at("maps"));
  EXPECT_EQ(section_ids(saved), section_ids(direct));
  for (std::size_t i = 0; i < 2; ++i) {
    const Json& a = section(saved, "scene").at("runs").at(i);
    const Json& b = section(direct, "scene").at("runs").at(i);
    Json a_summary = a.at("summary");
    Json b_summary = b.at("summary");
    for (const char* const error : {"rotation_error_deg", "translation_error_m"}) {
      // Of poses that went through matrices.
      EXPECT_NEAR(a_summary.at(error).get<double>(), b_summary.at(error).get<double>(), 1e-9);
      a_summary.erase(error);
      b_summary.erase(error);
    }
    EXPECT_EQ(a_summary, b_summary);
    EXPECT_EQ(replayed(saved, a.at("matches")), replayed(direct, b.at("matches")));
    const auto x = saved.numbers<double>(a.at("poses"), "f64");
    const auto y = direct.numbers<double>(b.at("poses"), "f64");
    ASSERT_EQ(x.size(), y.size());
    // A quaternion and its negative are one rotation; poses went through matrices.
    for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(std::abs(x[k]), std::abs(y[k]), 1e-7);
  }
  EXPECT_EQ(saved.document.at("provenance").at("inputs").at(0).at("role"), "result");
  EXPECT_EQ(saved.document.at("provenance").at("inputs").at(1).at("role"), "source");
}

// Results of earlier versions call every pose "aligned".
TEST_F(WrittenReportTest, ReadsTheStatusOfEarlierResults) {
  write_pair();
  Json result = document(align({}));
  result.at("results").at(0)["status"] = "aligned";
  for (const auto& [stop_reason, status] :
       {std::pair<const char*, std::string>{"mse_change", "converged"}, {"cycle", "stopped"}}) {
    result.at("results").at(0)["stop_reason"] = stop_reason;
    write("result.json", result.dump());
    answer({"report", "result.json", "-o", "r.html"});
    EXPECT_EQ(section(page("r.html"), "scene").at("runs").at(0).at("summary").at("status"), status);
  }
}

TEST_F(WrittenReportTest, MapsThatAreGoneOrChangedAreNamedAndLeftOut) {
  write_pair();
  answer(align({"--truth", "truth.txt", "--trace", "--json", "result.json"}));
  std::filesystem::remove(path("source.map"));
  write("target.map", content("target.map") + "\n");
  const CommandResult result = cairn({"report", "result.json", "-o", "r.html"});
  EXPECT_EQ(result.exit_code, kDone);
  EXPECT_THAT(result.errors, AllOf(HasSubstr("source.map is gone"),
                                   HasSubstr("target.map is not what was aligned")));
  const ReportPage report = page("r.html");
  EXPECT_THAT(report.document.at("maps"), IsEmpty());
  EXPECT_THAT(section_ids(report), ElementsAre("answer", "strategies", "convergence", "remarks"));
  EXPECT_THAT(section(report, "remarks").at("text").get<std::string>(),
              HasSubstr("source.map is gone"));
  // The errors are known from the result.
  const Json& table = section(report, "strategies");
  const Json columns = table.at("columns");
  EXPECT_TRUE(std::any_of(columns.begin(), columns.end(),
                          [](const Json& c) { return c.at("name") == "Rotation error"; }));
}

TEST_F(WrittenReportTest, MapsAreFoundBesideTheResult) {
  write_pair();
  answer(align({"--json", "result.json"}));
  std::filesystem::create_directory(path("moved"));
  for (const char* const name : {"source.map", "target.map", "result.json"}) {
    std::filesystem::rename(path(name), path("moved") / name);
  }
  answer({"report", "moved/result.json", "-o", "r.html"});
  EXPECT_EQ(page("r.html").document.at("maps").size(), 2U);
}

TEST_F(WrittenReportTest, FoldersAndMapsInJsonAreMapsLikeOthers) {
  write_pair();
  std::filesystem::create_directories(path("one/sparse"));
  std::filesystem::create_directories(path("two/sparse"));
  answer({"convert", "source.map", "one/sparse/0/"});
  answer({"convert", "target.map", "two/sparse/0/"});
  const Json shown = document({"report", "one", "-o", "r.html"});
  EXPECT_EQ(shown.at("title"), "one");
  EXPECT_THAT(shown.at("inputs").at(0).at("hash").get<std::string>(), StartsWith("xxh3:"));
  EXPECT_EQ(page("r.html").document.at("maps").size(), 1U);
  write("transforms.json",
        R"({"fl_x": 500, "w": 640, "h": 480, "frames": [{"file_path": "a.png",
            "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})");
  EXPECT_EQ(document({"report", "transforms.json", "-o", "r.html"}).at("title"), "transforms.json");

  answer({"align", "one", "two", "--scale", "--json", "result.json"});
  const CommandResult same = cairn({"report", "result.json", "-o", "r.html"});
  EXPECT_EQ(same.exit_code, kDone);
  EXPECT_THAT(same.errors, Not(HasSubstr("there is no scene of it")));
  EXPECT_EQ(page("r.html").document.at("maps").size(), 2U);
  EXPECT_EQ(page("r.html").document.at("title"), "one to two");
  answer({"convert", "target.map", "two/other/", "--min-observations", "3"});
  std::filesystem::remove_all(path("two/sparse"));
  EXPECT_THAT(cairn({"report", "result.json", "-o", "r.html"}).errors,
              HasSubstr("two is not what was aligned, its content differs"));
}

TEST_F(WrittenReportTest, SingleMapIsASceneWithoutSource) {
  write_plain();
  answer({"report", "plain.map", "-o", "r.html"});
  const ReportPage report = page("r.html");
  EXPECT_EQ(report.document.at("title"), "plain.map");
  EXPECT_EQ(report.document.at("maps").at(0).at("count"), 3);
  const Json& scene = section(report, "scene");
  EXPECT_TRUE(scene.at("source").is_null());
  EXPECT_EQ(scene.at("target"), "map");
  EXPECT_THAT(scene.at("runs"), IsEmpty());
}

#ifdef CAIRN_HAS_SEQUENCE
// A sequence with these times, in seconds.
void write_sequence(const std::filesystem::path& folder, const std::vector<double>& times) {
  SequenceWriter writer(folder);
  for (const double time : times)
    writer.add(time, ColorImage(64, 48, 90), DepthImage(64, 48, 1.0F));
  writer.finish();
}

TEST_F(WrittenReportTest, ShowsWhatKeyframesSaw) {
  const SyntheticPair pair = write_pair();
  std::vector<double> times;
  for (const auto& time : pair.source.frames().timestamps_s) times.push_back(time.value());
  ASSERT_EQ(times.size(), 20U);
  write_sequence(path("all"), times);
  write_sequence(path("some"), {times[4], times[5], times[6]});

  answer(align({"--report", "r.html", "--source-sequence", "all", "--target-sequence", "some"}));
  const ReportPage report = page("r.html");
  const Json& maps = report.document.at("maps");
  EXPECT_EQ(maps.at(0).at("frames").at("images").size(), 20U);
  const Json& images = maps.at(1).at("frames").at("images");
  ASSERT_EQ(images.size(), 3U);
  EXPECT_EQ(images.at(0).at("frame"), 4);
  EXPECT_EQ(images.at(0).at("media_type"), "image/jpeg");
  EXPECT_THAT(report.numbers<std::uint8_t>(images.at(0).at("data"), "u8").at(1), 0xd8);

  answer(align({"--json", "a.json"}));
  answer({"report", "a.json", "--source-sequence", "all", "--target-sequence", "some", "-o",
          "later.html"});
  const Json saved = page("later.html").document.at("maps");
  EXPECT_EQ(saved.at(0).at("frames").at("images").size(), 20U);
  EXPECT_EQ(saved.at(1).at("frames").at("images").size(), 3U);

  answer({"report", "source.map", "--sequence", "some", "-o", "one.html"});
  EXPECT_EQ(page("one.html").document.at("maps").at(0).at("frames").at("images").size(), 3U);
  answer({"report", "source.map", "-o", "none.html"});
  EXPECT_TRUE(page("none.html").document.at("maps").at(0).at("frames").at("images").is_null());
}

#ifdef CAIRN_HAS_MERGING
TEST_F(WrittenReportTest, MergeAndAtlasShowTwoKeyframesOfEachLink) {
  const SyntheticPair pair = write_pair(900);
  write_map(synthetic_map({.seed = 77, .landmarks = 400, .frames = 10}), path("stranger.map"));
  std::vector<double> times;
  for (const auto& time : pair.source.frames().timestamps_s) times.push_back(time.value());
  write_sequence(path("all"), times);
  times.erase(times.begin(), times.begin() + 4);
  write_sequence(path("some"), times);
  const Words merge = {"merge", "target.map", "stranger.map", "source.map",
                       "-o",    "all.map",    "--report",     "r.html"};
  const auto with = [](Words words, const Words& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  EXPECT_EQ(cairn(merge).exit_code, kNoAlignment);
  const Json plain = page("r.html").document;
  EXPECT_THAT(plain.dump(), Not(HasSubstr("\"view\"")));
  EXPECT_TRUE(plain.at("maps").at(0).at("frames").at("images").is_null());

  const Words images = with(merge, {"--images", "all", "all", "some"});
  EXPECT_EQ(cairn(images).exit_code, kNoAlignment);
  const std::string bytes = content("r.html");
  const ReportPage report = page("r.html");
  const Json& network = section(report, "network");
  EXPECT_THAT(network.at("text").get<std::string>(),
              StartsWith("1 of 3 links show the images of two keyframes; the others: 2 without a "
                         "pose. 4 of "));
  std::size_t views = 0;
  for (const Json& link : network.at("links")) {
    if (!link.contains("view")) continue;
    ++views;
    const Json& view = link.at("view");
    EXPECT_GT(view.at("matches"), 20);
    for (const char* const side : {"target", "source"}) {
      const auto map = link.at(side).get<std::size_t>();
      EXPECT_NE(map, 1U);
      const Json& shown = report.document.at("maps").at(map).at("frames").at("images");
      ASSERT_EQ(shown.size(), 1U);
      EXPECT_EQ(shown.at(0).at("frame"), view.at(std::string(side) + "_frame"));
      if (map == 2) {
        EXPECT_GE(shown.at(0).at("frame"), 4);
      }
    }
  }
  EXPECT_EQ(views, 1U);
  EXPECT_EQ(cairn(images).exit_code, kNoAlignment);
  EXPECT_EQ(content("r.html"), bytes) << "the same inputs give the same bytes";

  expect_refusal(with(merge, {"--images", "all", "some"}), kWrongUsage,
                 {"--images", "2 given", "one for each of the 3 sessions"});
  expect_refusal({"merge", "target.map", "source.map", "-o", "b.map", "--images", "all"},
                 kWrongUsage, {"--images", "--report"});
  write_sequence(path("later"), {5000.5, 5001.0});
  expect_refusal(with(merge, {"--images", "all", "all", "later"}), kBadInput,
                 {"later", "from 5000.500 to 5001.000 s", "keyframe"});
#ifdef CAIRN_HAS_ATLAS
  answer({"atlas", "init", "--atlas", "town"});
  answer({"atlas", "add", "target.map", "source.map", "--atlas", "town"});
  answer({"atlas", "link", "--atlas", "town"});
  answer({"atlas", "show", "--atlas", "town", "--report", "a.html", "--images", "all"});
  const ReportPage shown = page("a.html");
  EXPECT_TRUE(section(shown, "network").at("links").at(0).contains("view"));
  EXPECT_EQ(section(shown, "network").at("text"), "1 of 1 links show the images of two keyframes.");
#endif
}
#endif

TEST_F(WrittenReportTest, RefusesASequenceThatFitsNoMap) {
  write_pair();
  write_sequence(path("later"), {5000.5, 5001.0});
  expect_refusal(align({"--report", "r.html", "--target-sequence", "later"}), kBadInput,
                 {"later", "from 5000.500 to 5001.000 s", "keyframe"});
  expect_refusal({"report", "source.map", "--sequence", "nowhere", "-o", "r.html"}, kBadInput,
                 {"nowhere", "does not exist"});
  expect_refusal(align({"--source-sequence", "later"}), kWrongUsage,
                 {"--source-sequence", "--report"});
  expect_refusal({"report", "source.map", "target.map", "--sequence", "later", "-o", "r.html"},
                 kWrongUsage, {"--sequence", "source.map", "one map alone"});
  expect_refusal({"report", "source.map", "--target-sequence", "later", "-o", "r.html"},
                 kWrongUsage, {"--target-sequence", "source.map", "cairn align"});
  answer(align({"--json", "a.json"}));
  expect_refusal({"report", "a.json", "a.json", "--source-sequence", "later", "-o", "r.html"},
                 kWrongUsage, {"--source-sequence", "a.json", "alone"});
  expect_refusal({"report", "a.json", "--source-sequence", "later", "-o", "r.html"}, kBadInput,
                 {"later", "keyframe"});
  EXPECT_FALSE(std::filesystem::exists(path("r.html")));
}
#endif

TEST_F(WrittenReportTest, SeveralResultsStandBelowEachOther) {
  write_pair();
  write_plain();
  answer(align({"--json", "a.json"}));
  answer(align({"--confidence", "distance", "--json", "b.json"}));
  const Json json = document(
      {"report", "a.json", "b.json", "plain.map", "-o", "r.html", "--title", "All <of> it"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.report");
  EXPECT_EQ(json.at("inputs").size(), 3U);
  EXPECT_EQ(json.at("title"), "All <of> it");
  EXPECT_THAT(content("r.html"), HasSubstr("<title>All &lt;of&gt; it</title>"));
  const ReportPage report = page("r.html");
  EXPECT_EQ(report.document.at("maps").size(), 5U);
  EXPECT_THAT(section_ids(report),
              ElementsAre("r1-answer", "r1-scene", "r1-strategies", "r1-convergence", "r2-answer",
                          "r2-scene", "r2-strategies", "r2-convergence", "r3-scene"));
}

TEST_F(WrittenReportTest, DemoTellsItsStory) {
  answer({"demo", "--synthetic", "--report", "r.html", "--json", "demo.json"});
  const ReportPage report = page("r.html");
  EXPECT_THAT(section(report, "scene").at("text").get<std::string>(), StartsWith("Two synthetic"));
  EXPECT_EQ(section(report, "scene").at("runs").size(), 5U);
  EXPECT_THAT(report.document.at("subtitle").get<std::string>(), StartsWith("Aligned: "));
  EXPECT_FALSE(section(report, "scene").at("runs").at(0).at("matches").is_null());
  EXPECT_THAT(content("demo.json"), Not(HasSubstr("\"matches\": [")));
  // Its document names no maps to show.
  const CommandResult again = cairn({"report", "demo.json", "-o", "again.html"});
  EXPECT_EQ(again.exit_code, kDone);
  EXPECT_THAT(again.errors, HasSubstr("demo.json names no source map"));
}

#ifdef CAIRN_HAS_MERGING
// What a page's graph says of the link between two maps.
std::string use_between(const Json& network, std::size_t a, std::size_t b) {
  for (const Json& link : network.at("links")) {
    const auto target = link.at("target").get<std::size_t>();
    const auto source = link.at("source").get<std::size_t>();
    if (std::minmax(target, source) == std::minmax(a, b)) return link.at("use");
  }
  return "none";
}

TEST_F(WrittenReportTest, MergeShowsWhatWasPlacedAndWhatWasLeftOut) {
  write_pair(900);
  write_map(synthetic_map({.seed = 77, .landmarks = 400, .frames = 10}), path("stranger.map"));
  const CommandResult result = cairn({"merge", "target.map", "stranger.map", "source.map", "-o",
                                      "both.map", "--report", "r.html"});
  EXPECT_EQ(result.exit_code, kNoAlignment) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("wrote r.html\n"));
  const ReportPage report = page("r.html");
  EXPECT_EQ(report.document.at("title"), "3 maps merged into both.map");
  EXPECT_THAT(report.document.at("subtitle").get<std::string>(),
              AllOf(StartsWith("Placed 2 of 3 maps in the frame of target: 1,800 landmarks"),
                    HasSubstr(" Left out: stranger.")));
  const Json& inputs = report.document.at("provenance").at("inputs");
  ASSERT_EQ(inputs.size(), 3U);
  for (const Json& input : inputs) {
    const std::string file = input.at("role").get<std::string>() + ".map";
    EXPECT_EQ(input.at("hash"), hash_file(path(file)));
  }
  const Json& network = section(report, "network");
  ASSERT_EQ(network.at("nodes").size(), 3U);
  EXPECT_EQ(network.at("nodes").at(1).at("name"), "stranger");
  EXPECT_EQ(use_between(network, 0, 2), "used");
  EXPECT_THAT(use_between(network, 0, 1), AnyOf("rejected", "ambiguous"));
}
#endif

#ifdef CAIRN_HAS_ATLAS
TEST_F(WrittenReportTest, AtlasShowsItsGraphAndHowToUndoEachCommand) {
  for (const char* const name : {"1", "2", "3"}) {
    write_map(synthetic_map({.seed = static_cast<std::uint64_t>(name[0]), .landmarks = 40}),
              path(std::string(name) + ".map"));
  }
  write("pose.txt", "1 0 0 1  0 1 0 0  0 0 1 0  0 0 0 1\n");
  const auto atlas = [&](Words words) {
    words.insert(words.begin(), "atlas");
    words.insert(words.end(), {"--atlas", "a town.atlas"});
    return answer(words);
  };
  atlas({"init"});
  atlas({"add", "1.map", "2.map", "3.map"});
  atlas({"link", "--manual", "1", "2", "--pose", "pose.txt"});
  atlas({"optimize"});
  atlas({"show", "--report", "r.html"});
  const ReportPage report = page("r.html");
  EXPECT_EQ(report.document.at("title"), "a town.atlas");
  EXPECT_EQ(report.document.at("subtitle"),
            "After commit 5: 3 maps, 2 of them placed in the frame of 1; 1 of 1 pairs are "
            "aligned.");
  const Json& network = section(report, "network");
  ASSERT_EQ(network.at("nodes").size(), 3U);
  EXPECT_EQ(use_between(network, 0, 1), "used");
  EXPECT_EQ(use_between(network, 0, 2), "none");
  const Json& rows = section(report, "log").at("rows");
  ASSERT_EQ(rows.size(), 5U);
  EXPECT_EQ(rows.at(0).back(), "cairn atlas undo --commit 5 --atlas 'a town.atlas'");

  // As it was: the poses are of the commit after it.
  atlas({"show", "--at", "4", "--report", "before.html"});
  const ReportPage before = page("before.html");
  EXPECT_EQ(use_between(section(before, "network"), 0, 1), "undecided");
  EXPECT_EQ(section(before, "log").at("rows").size(), 4U);
}
#endif

TEST_F(WrittenReportTest, FailedAlignmentIsShownAsOne) {
  write("empty.map", "CAIRN 2\n");
  write_plain();
  EXPECT_EQ(cairn({"align", "empty.map", "plain.map", "--report", "r.html"}).exit_code,
            kNoAlignment);
  const ReportPage report = page("r.html");
  EXPECT_THAT(report.document.at("subtitle").get<std::string>(), HasSubstr("Rejected: "));
  EXPECT_EQ(section(report, "scene").at("runs").at(0).at("summary").at("status"), "rejected");
}

TEST_F(WrittenReportTest, NamesTheMethodAlsoWhenSaved) {
  const SyntheticPair pair = write_pair(3000);  // fewer are not sampled
  const Words words = {"align",        "source.map",       "target.map",
                       "--no-verdict", "--initial-matrix", "start.txt",
                       "--confidence", "base,observations"};
  const auto names_with = [&](const Words& more) {
    Words all = words;
    all.insert(all.end(), more.begin(), more.end());
    all.insert(all.end(), {"--json", "r.json", "--report", "r.html", "--quiet"});
    EXPECT_EQ(cairn(all).exit_code, kDone);
    answer({"report", "r.json", "-o", "saved.html"});
    std::vector<std::string> names;
    for (const char* const name : {"r.html", "saved.html"}) {
      const ReportPage report = page(name);
      for (const Json& run : section(report, "scene").at("runs")) names.push_back(run.at("name"));
      std::filesystem::remove(path(name));
    }
    return names;
  };
  // From this far off, ICP on samples leads the robust method; that does not make it ICP.
  write("start.txt", matrix_text(Rigid3::from_roll_pitch_yaw({0.4, 0.5, 0.2}, 0.17, 0.0, 0.4) *
                                 pair.target_from_source));
  EXPECT_THAT(names_with({}),
              ElementsAre("robust", "robust observations", "robust", "robust observations"));
  EXPECT_GT(Json::parse(content("r.json")).at("results").at(0).at("coarse_iterations"), 0);
  EXPECT_THAT(names_with({"--method", "icp"}),
              ElementsAre("base", "observations", "base", "observations"));
  EXPECT_THAT(names_with({"--fast"}), ElementsAre("base", "observations", "base", "observations"));
}

TEST_F(WrittenReportTest, AVerdictIsSaidFirstAlsoWhenSaved) {
  write_map(synthetic_map({.seed = 21, .landmarks = 600, .frames = 20}), path("a.map"));
  write_map(synthetic_map({.seed = 22, .landmarks = 600, .frames = 20}), path("b.map"));
  const CommandResult result = cairn({"align", "a.map", "b.map", "--anywhere", "--json", "r.json",
                                      "--report", "r.html", "--quiet"});
  EXPECT_EQ(result.exit_code, kNoAlignment);
  answer({"report", "r.json", "-o", "saved.html"});
  for (const char* const name : {"r.html", "saved.html"}) {
    const ReportPage report = page(name);
    EXPECT_THAT(report.document.at("subtitle").get<std::string>(),
                StartsWith("Rejected: probability "));
    const Json& run = section(report, "scene").at("runs").at(0);
    EXPECT_EQ(run.at("name"), "robust") << name;
    EXPECT_EQ(run.at("summary").at("status"), "rejected") << name;
  }
}

TEST_F(WrittenReportTest, WhatIsNoResultIsRefusedWithFileFieldAndValue) {
  write_pair();
  answer(align({"--trace", "--json", "result.json"}));
  const Json good = Json::parse(content("result.json"));
  const auto expect = [&](const std::string& text, std::initializer_list<std::string_view> parts) {
    write("bad.json", text);
    expect_refusal({"report", "bad.json", "-o", "r.html"}, kBadInput, parts);
    EXPECT_FALSE(std::filesystem::exists(path("r.html")));
  };
  const auto changed = [&](const char* pointer, const Json& value) {
    Json json = good;
    json[Json::json_pointer(pointer)] = value;
    return json.dump();
  };
  expect("{", {"bad.json", "is not valid JSON", "cairn align"});
  expect("{}", {"bad.json", "schema.name"});
  expect(changed("/schema/name", "cairn.info"), {"bad.json", "'cairn.info'", "'cairn align'"});
  expect(changed("/schema/version", 3), {"bad.json: schema.version is 3", "at most 2"});
  expect(changed("/results", 5), {"bad.json: results is 5", "a list"});
  expect(changed("/results", Json::array()), {"results is []", "at least one"});
  expect(changed("/results/0/status", "fine"),
         {"results[0].status is \"fine\"", "converged, stopped, failed"});
  expect(changed("/results/0/k", -1), {"results[0].k is -1", "whole number"});
  expect(changed("/results/0/history/1/target_from_source", Json::array()),
         {"results[0].history[1].target_from_source", "4 rows"});
  expect(changed("/results/0/history/1/matches/0", {0, 100000}),
         {"bad.json: results[0].history[1].matches holds [0, 100000]", "below ["});
  expect(changed("/options/initial", "x"), {"options.initial", "4 rows"});
  expect_refusal({"report", "absent.json", "-o", "r.html"}, kBadInput, {"absent.json"});
  std::filesystem::create_directory(path("results"));
  expect_refusal({"report", "results", "-o", "r.html"}, kBadInput, {"results"});
}

TEST_F(WrittenReportTest, OutputIsCheckedBeforeAnythingIsRead) {
  expect_refusal({"report", "absent.json", "-o", "no/such/r.html"}, kSystemError, {"no/such"});
  expect_refusal({"align", "a.map", "b.map", "--report", "no/such/r.html"}, kSystemError,
                 {"no/such"});
}

}  // namespace
}  // namespace cairn::testing
