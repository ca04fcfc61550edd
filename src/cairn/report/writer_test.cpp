// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/report/detail/gzip_base64.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/report/detail/run_builder.hpp"
#include "cairn/report/report.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/report_page.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::report {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kStubPage;
using ::testing::Not;
using testing::ReportPage;
using ::testing::StartsWith;
using Json = nlohmann::json;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string written(const Report& report, std::string_view page = kStubPage) {
  std::string html;
  write_report(report, page, [&](std::string_view bytes) { html += bytes; });
  return html;
}

std::string refusal(const Report& report) {
  return testing::refusal(ErrorKind::kMisuse, [&] { written(report, kStubPage); });
}

std::string refusal_of_page(std::string_view page) {
  return testing::refusal(ErrorKind::kInput, [&] { written({}, page); });
}

Answer ambiguous_answer() {
  AlignmentAnswer one{
      .name = "base",
      .status = "ambiguous",
      .judged = true,
      .probability = 0.75,
      .reason = "one of two",
      .target_from_source =
          Similarity3(1.5, Rigid3(Eigen::Quaterniond(0.6, 0.0, 0.8, 0.0), {1.0, 2.0, 3.0})),
      .deviations =
          PoseDeviations{{0.25, 0.5, 1.0}, radians(1.0) * Eigen::Vector3d(1.0, 2.0, 4.0), 0.125},
      .open = {{{0.0, 1.0, 0.0}, {0.0, 0.0, 0.5}, 0.0}},
      .radius = 0.5};
  one.candidates = {{.probability = 0.75,
                     .matches = 12,
                     .share = 0.5,
                     .contradicted = 0.25,
                     .evidence = {{"distances", 2.5}}}};
  return {LengthUnit::kFree, "scene", {one, {.name = "none", .status = "failed"}}};
}

// One section of each kind, with all that may be unknown known once and unknown once.
Report full_report() {
  Report report;
  report.title = "later.map to earlier.map";
  report.subtitle = "observations is nearest to the truth";
  report.provenance = {.command = {"cairn", "align", "a b.map"},
                       .seed = 18446744073709551615U,
                       .machine = Machine{"Linux", "abacus", 2},
                       .inputs = {{"source", "a b.map", "xxh3:12", R"({"landmarks": 3})"},
                                  {"target", std::nullopt, std::nullopt, ""}},
                       .options_json = R"({"k": 5, "nested": {"b": 1, "a": [null]}})"};
  report.maps = {
      detail::make_map(testing::plain_map(), {.id = "source", .name = "a b.map"}),
      detail::make_map(testing::full_map(), {.id = "target",
                                             .name = "full",
                                             .images = {{2, ImageType::kJpeg, {255, 216, 255}},
                                                        {0, ImageType::kPng, {137, 80}}}})};
  AlignmentRun run;
  run.name = "base";
  run.summary = {{"status", "aligned"}, {"score", 0.25}, {"iterations", 2.0}, {"reason", {}}};
  run.target_from_source = {
      Rigid3(), Similarity3(1.5, Rigid3(Eigen::Quaterniond(0.6, 0.0, 0.8, 0.0), {1.0, 2.0, 3.0})),
      Rigid3()};
  run.mean_squared_distance = {kNan, 0.5, 0.25};
  run.scores = {0.75, 0.5, 0.25};
  run.matches = Matches{{0, -1, 3}, {2}, {0, 1}, {-1, 2}};
  AlignmentRun bare;
  bare.name = "distance";
  bare.target_from_source = {Rigid3()};
  report.sections = {
      {.id = "scene",
       .title = "Maps",
       .text = "Turn it.",
       .content = Scene{"source", "target", Rigid3(), Eigen::Vector3d(0, 0, 1), {run, bare}}},
      {.id = "violin",
       .title = "Scores",
       .text = {},
       .content =
           DistributionChart{"Strategy",
                             "Score",
                             AxisScale::kLog,
                             Threshold{0.0037, "success"},
                             {{"base", {0.5, kNan, 2.0}, {"a", "b", "c"}}, {"none", {}, {}}}}},
      {.id = "empty",
       .title = "None",
       .text = {},
       .content = DistributionChart{"", "", AxisScale::kLinear, {}, {}}},
      {.id = "lines",
       .title = "Lines",
       .text = {},
       .content =
           LinesChart{"i", "y", AxisScale::kLog, {{"base", {0, 1}, {2, 3}}, {"bare", {0}, {1}}}}},
      {.id = "heat",
       .title = "Basin",
       .text = {},
       .content = HeatmapChart{"yaw",
                               "offset",
                               "success",
                               {0, 10, 20},
                               {0, 1},
                               {{"base", {{1.0, kNan}}, {{3, 0}}}, {"bare", {{0.5, 0.25}}, {}}},
                               std::array{0.0, 1.0}}},
      {.id = "rates",
       .title = "Rates",
       .text = {},
       .content = IntervalsChart{"rate", {{"base", {{"desk", 0.5, 0.25, 0.75}}}}}},
      {.id = "scatter",
       .title = "Score and error",
       .text = {},
       .content = ScatterChart{"score",
                               "error",
                               AxisScale::kLog,
                               AxisScale::kLog,
                               Threshold{1, "a"},
                               {},
                               {{"base", {1, 2}, {3, 4}, {"x", "y"}}}}},
      {.id = "table",
       .title = "Table",
       .text = {},
       .content =
           Table{{{"Strategy", {}, CellType::kText, {}}, {"Score", "m²", CellType::kNumber, 3}},
                 {{"base", 0.5}, {{}, kNan}},
                 {Best::kNone, Best::kLow}}},
      {.id = "text", .title = "Notes", .text = "One.\n\nTwo.", .content = Text()},
      {.id = "answer", .title = "Answer", .text = {}, .content = ambiguous_answer()}};
  return report;
}

TEST(WriteReport, PageIsTheTemplateWithTitleAndDataInTheirPlaces) {
  const std::string html = written(full_report());
  EXPECT_THAT(html,
              StartsWith("<!DOCTYPE html>\n<html><head><title>later.map to earlier.map</title>"
                         "</head>\n<body><script type=\"application/x-cairn-report\" "
                         "id=\"cairn-report\" data-encoding=\"gzip-base64\">H4sI"));
  EXPECT_THAT(html, HasSubstr("</script>\n<script type=\"application/x-cairn-buffers\" "
                              "id=\"cairn-buffers\" data-encoding=\"gzip-base64\">H4sI"));
  EXPECT_TRUE(html.ends_with("</script>\n</body></html>\n"));
}

TEST(WriteReport, DocumentSaysWhatTheReportSays) {
  const ReportPage page(written(full_report()));
  const Json& json = page.document;
  EXPECT_EQ(json.at("schema"), Json({{"name", "cairn.report"}, {"version", 1}}));
  EXPECT_EQ(json.at("cairn_version"), kVersion);
  EXPECT_EQ(json.at("title"), "later.map to earlier.map");
  EXPECT_EQ(json.at("subtitle"), "observations is nearest to the truth");
  EXPECT_EQ(json.at("provenance"), Json::parse(R"({
    "command": ["cairn", "align", "a b.map"], "seed": 18446744073709551615,
    "machine": {"system": "Linux", "processor": "abacus", "threads": 2},
    "inputs": [{"role": "source", "path": "a b.map", "hash": "xxh3:12", "details": {"landmarks": 3}},
               {"role": "target", "path": null, "hash": null, "details": null}],
    "options": {"k": 5, "nested": {"b": 1, "a": [null]}}})"));
  const auto expect_section = [&](std::size_t i, const char* expected) {
    EXPECT_EQ(json.at("sections").at(i), Json::parse(expected));
  };
  expect_section(1, R"({"kind": "chart", "id": "violin", "title": "Scores", "text": null,
    "chart": "violin", "x_label": "Strategy", "y_label": "Score", "y_scale": "log",
    "threshold": {"value": 0.0037, "label": "success"},
    "groups": [{"name": "base", "values": [0.5, null, 2], "labels": ["a", "b", "c"]},
               {"name": "none", "values": [], "labels": null}]})");
  expect_section(
      2,
      R"({"kind": "chart", "id": "empty", "title": "None", "text": null, "chart": "violin",
    "x_label": "", "y_label": "", "y_scale": "linear", "threshold": null, "groups": []})");
  expect_section(3, R"({"kind": "chart", "id": "lines", "title": "Lines", "text": null,
    "chart": "lines", "x_label": "i", "y_label": "y", "y_scale": "log", "series": [
      {"name": "base", "x": [0, 1], "y": [2, 3]}, {"name": "bare", "x": [0], "y": [1]}]})");
  expect_section(4, R"({"kind": "chart", "id": "heat", "title": "Basin", "text": null,
    "chart": "heatmap", "x_label": "yaw", "y_label": "offset", "value_label": "success",
    "x": [0, 10, 20], "y": [0, 1], "range": [0, 1], "panels": [
      {"name": "base", "values": [[1, null]], "counts": [[3, 0]]},
      {"name": "bare", "values": [[0.5, 0.25]], "counts": null}]})");
  expect_section(5, R"({"kind": "chart", "id": "rates", "title": "Rates", "text": null,
    "chart": "intervals", "x_label": "rate", "x_scale": "linear", "series": [{"name": "base", "items":
      [{"name": "desk", "value": 0.5, "low": 0.25, "high": 0.75}]}]})");
  expect_section(6, R"({"kind": "chart", "id": "scatter", "title": "Score and error", "text": null,
    "chart": "scatter", "x_label": "score", "y_label": "error", "x_scale": "log", "y_scale": "log",
    "x_threshold": {"value": 1, "label": "a"}, "y_threshold": null,
    "series": [{"name": "base", "x": [1, 2], "y": [3, 4], "labels": ["x", "y"]}]})");
  expect_section(7, R"({"kind": "table", "id": "table", "title": "Table", "text": null,
    "columns": [{"name": "Strategy", "unit": null, "type": "text", "digits": null},
                {"name": "Score", "unit": "m²", "type": "number", "digits": 3}],
    "rows": [["base", 0.5], [null, null]], "best": [null, "low"]})");
  expect_section(8, R"({"kind": "text", "id": "text", "title": "Notes", "text": "One.\n\nTwo."})");
  expect_section(9, R"({"kind": "answer", "id": "answer", "title": "Answer", "text": null,
    "length_unit": "mapunits", "scene": "scene", "alignments": [
      {"name": "base", "status": "ambiguous", "judged": true, "probability": 0.75,
       "reason": "one of two", "radius": 0.5,
       "estimate": {"pose": [1, 2, 3, 0.6, 0, 0.8, 0], "scale": 1.5},
       "deviations": {"translation": [0.25, 0.5, 1], "rotation_deg": [1, 2, 4], "log_scale": 0.125},
       "open": [{"translation": [0, 1, 0], "rotation": [0, 0, 0.5], "log_scale": 0}],
       "candidates": [{"pose": [0, 0, 0, 1, 0, 0, 0], "scale": 1, "probability": 0.75,
                       "matches": 12, "share": 0.5, "contradicted": 0.25,
                       "evidence": [{"name": "distances", "value": 2.5}]}]},
      {"name": "none", "status": "failed", "judged": false, "probability": null, "reason": "",
       "radius": null, "estimate": null, "deviations": null, "open": [], "candidates": []}]})");
}

TEST(WriteReport, SceneNamesItsMapsAndRuns) {
  const ReportPage page(written(full_report()));
  const Json& scene = page.document.at("sections").at(0);
  EXPECT_EQ(scene.at("kind"), "scene");
  EXPECT_EQ(scene.at("source"), "source");
  EXPECT_EQ(scene.at("target"), "target");
  EXPECT_EQ(scene.at("truth"), Json({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(scene.at("up"), Json({0, 0, 1}));
  const Json& run = scene.at("runs").at(0);
  EXPECT_EQ(run.at("summary"),
            Json({{"status", "aligned"}, {"score", 0.25}, {"iterations", 2}, {"reason", nullptr}}));
  EXPECT_THAT(page.numbers<double>(run.at("scales"), "f64"), ElementsAre(1.0, 1.5, 1.0));
  EXPECT_TRUE(scene.at("runs").at(1).at("scales").is_null());
  const auto poses = page.numbers<double>(run.at("poses"), "f64");
  ASSERT_EQ(poses.size(), 21U);
  EXPECT_THAT(std::vector<double>(poses.begin() + 7, poses.begin() + 14),
              ElementsAre(1.0, 2.0, 3.0, 0.6, 0.0, 0.8, 0.0));
  const auto distances = page.numbers<double>(run.at("mean_squared_distance"), "f64");
  EXPECT_TRUE(std::isnan(distances.at(0)));
  EXPECT_EQ(distances.at(1), 0.5);
  EXPECT_THAT(page.numbers<double>(run.at("scores"), "f64"), ElementsAre(0.75, 0.5, 0.25));
  EXPECT_TRUE(run.at("rotation_error_deg").is_null());
  EXPECT_TRUE(run.at("translation_error_m").is_null());
  EXPECT_THAT(replayed(page, run.at("matches")),
              ElementsAre(ElementsAre(0, -1, 3), ElementsAre(-1, 2, 3)));
  EXPECT_TRUE(scene.at("runs").at(1).at("matches").is_null());
}

TEST(WriteReport, MapsComeThroughTheirBuffers) {
  const ReportPage page(written(full_report()));
  const Json& map = page.document.at("maps").at(1);
  EXPECT_EQ(map.at("id"), "target");
  EXPECT_EQ(map.at("length_unit"), "mapunits");
  EXPECT_EQ(map.at("count"), 4);
  EXPECT_EQ(page.numbers<std::uint32_t>(map.at("positions"), "u32").size(), 12U);
  EXPECT_THAT(page.numbers<std::uint32_t>(map.at("ids"), "u32"),
              ElementsAre(30, 0, 10, 0, 0, 0x80000000U, 20, 0));
  EXPECT_EQ(page.numbers<std::uint8_t>(map.at("colors"), "u8").size(), 12U);
  const Json& column = map.at("columns").at(0);
  EXPECT_EQ(column.at("name"), "observations");
  EXPECT_EQ(column.at("scale"), 1);
  EXPECT_TRUE(column.at("unit").is_null());
  EXPECT_THAT(page.numbers<std::uint8_t>(column.at("values"), "u8"), ElementsAre(2, 1, 0, 2));
  const Json& frames = map.at("frames");
  EXPECT_EQ(frames.at("count"), 3);
  const auto poses = page.numbers<float>(frames.at("poses"), "f32");
  ASSERT_EQ(poses.size(), 21U);
  EXPECT_FLOAT_EQ(poses[9], -0.3F);
  EXPECT_FLOAT_EQ(poses[11], -0.5F);
  EXPECT_EQ(page.numbers<double>(frames.at("timestamps"), "f64").at(1), 1305031453.374112);
  EXPECT_TRUE(page.document.at("maps").at(0).at("frames").at("frustum").is_null());
  const Json& images = frames.at("images");
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images.at(0).at("frame"), 2);
  EXPECT_EQ(images.at(0).at("media_type"), "image/jpeg");
  EXPECT_EQ(images.at(1).at("media_type"), "image/png");
  EXPECT_THAT(page.numbers<std::uint8_t>(images.at(0).at("data"), "u8"),
              ElementsAre(255, 216, 255));
  EXPECT_TRUE(page.document.at("maps").at(0).at("frames").at("images").is_null());
  EXPECT_TRUE(page.document.at("maps").at(0).at("colors").is_null());
}

TEST(WriteReport, EqualListsAreStoredOnce) {
  const ReportPage page(written(full_report()));
  const Json& columns = page.document.at("maps").at(1).at("columns");
  EXPECT_EQ(columns.at(0).at("name"), "observations");
  EXPECT_EQ(columns.at(4).at("name"), "observations_confidence");
  EXPECT_EQ(columns.at(0).at("values"), columns.at(4).at("values"));
}

// What a file says is text, whatever it says.
TEST(WriteReport, HostileNamesLeaveNoMarkupAndComeThrough) {
  const std::string hostile =
      "</script></title><script>alert(1)</script><!--\"'&\x01\xff\xc3(\n-->";
  const std::string expected =
      "</script></title><script>alert(1)</script><!--\"'&\x01\xef\xbf\xbd\xef\xbf\xbd(\n-->";
  Report report = full_report();
  report.title = hostile;
  report.provenance.command = {hostile};
  report.provenance.inputs[0].path = hostile;
  report.maps[0].name = hostile;
  report.sections[0].title = hostile;
  std::get<Scene>(report.sections[0].content).runs[0].name = hostile;
  std::get<Table>(report.sections[7].content).rows[0][0] = hostile;
  const std::string html = written(report);

  // Less the template's own markup and the two elements, nothing may be left of it.
  std::string rest = html;
  for (const std::string_view own : {"<!DOCTYPE html>", "<html>", "<head>", "<title>", "</title>",
                                     "</head>", "<body>", "</body>", "</html>", "</script>",
                                     "</script>", "<script type=\"application/x-cairn-report\"",
                                     "<script type=\"application/x-cairn-buffers\""}) {
    const std::size_t at = rest.find(own);
    ASSERT_NE(at, std::string::npos) << own;
    rest.erase(at, own.size());
  }
  EXPECT_THAT(rest, Not(HasSubstr("<")));

  const ReportPage page(html);
  // The title also goes to places that show no markup: window lists, tabs, logs.
  EXPECT_EQ(page.document.at("title"),
            "</script></title><script>alert(1)</script><!--\"'&\\x01\\xff\\xc3(\\x0a-->");
  EXPECT_EQ(page.document.at("provenance").at("inputs").at(0).at("path"), expected);
  EXPECT_EQ(page.document.at("maps").at(0).at("name"), expected);
  EXPECT_EQ(page.document.at("sections").at(0).at("runs").at(0).at("name"), expected);
  EXPECT_EQ(page.document.at("sections").at(7).at("rows").at(0).at(0), expected);
}

TEST(WriteReport, SameReportSameBytes) {
  EXPECT_EQ(written(full_report()), written(full_report()));
}

TEST(WriteReport, EmptyReportAndEmptyMapAreFine) {
  Report report;
  report.maps = {detail::make_map(LandmarkMap())};
  report.sections = {{.id = "scene", .title = "", .text = {}, .content = Scene{.target = "map"}}};
  const ReportPage page(written(report));
  EXPECT_EQ(page.document.at("maps").at(0).at("count"), 0);
  EXPECT_EQ(page.document.at("maps").at(0).at("positions").at("count"), 0);
  EXPECT_TRUE(page.document.at("sections").at(0).at("source").is_null());
  EXPECT_TRUE(page.document.at("provenance").at("seed").is_null());
  EXPECT_TRUE(page.document.at("provenance").at("machine").is_null());
}

TEST(WriteReport, PageWithoutItsMarksIsRefused) {
  EXPECT_THAT(refusal_of_page("<title><!--CAIRN:TITLE--></title>"),
              HasSubstr("viewer page: <!--CAIRN:DATA--> stands there nowhere"));
  EXPECT_THAT(refusal_of_page("<!--CAIRN:DATA-->"), HasSubstr("<!--CAIRN:TITLE-->"));
  EXPECT_THAT(refusal_of_page("<!--CAIRN:TITLE--><!--CAIRN:DATA--><!--CAIRN:DATA-->"),
              HasSubstr("more than once"));
  EXPECT_THAT(refusal_of_page("<!--CAIRN:DATA--><!--CAIRN:TITLE-->"), HasSubstr("title"));
}

TEST(WriteReport, WhatDoesNotFitTogetherIsRefusedByName) {
  const auto broken = [](auto&& change) {
    Report report = full_report();
    change(report);
    return refusal(report);
  };
  const auto scene = [](Report& r) -> Scene& { return std::get<Scene>(r.sections[0].content); };
  EXPECT_THAT(broken([](Report& r) { r.maps[1].frames->images[0].frame = 3; }),
              HasSubstr("map target: an image of frame 3"));
  EXPECT_THAT(broken([](Report& r) { r.maps[1].frames->images[0].frame = 0; }),
              HasSubstr("at most one for each of 3 frames"));
  EXPECT_THAT(broken([](Report& r) { r.maps[1].frames->images[0].bytes.clear(); }),
              HasSubstr("no bytes of the image of frame 2"));
  EXPECT_THAT(broken([](Report& r) { r.maps[1].id = "source"; }), HasSubstr("Map.id: 'source'"));
  EXPECT_THAT(broken([](Report& r) { r.sections[1].id = "A b"; }), HasSubstr("Section.id: 'A b'"));
  EXPECT_THAT(broken([&](Report& r) { scene(r).target = "x"; }), HasSubstr("no map 'x'"));
  EXPECT_THAT(broken([&](Report& r) { scene(r).source.reset(); }), HasSubstr("without a source"));
  EXPECT_THAT(broken([](Report& r) { r.maps[0].count = 2; }), HasSubstr("6"));
  EXPECT_THAT(broken([](Report& r) { r.maps[0].columns[0].values = std::vector<float>(2); }),
              HasSubstr("observations"));
  EXPECT_THAT(broken([&](Report& r) { scene(r).runs[0].scores.pop_back(); }), HasSubstr("scores"));
  EXPECT_THAT(broken([&](Report& r) { scene(r).runs[0].matches->targets[0] = 4; }),
              HasSubstr("a match with landmark 4; expected -1 or one of 4"));
  EXPECT_THAT(broken([&](Report& r) { scene(r).runs[0].matches->changed[0] = 3; }),
              HasSubstr("one of 3"));
  EXPECT_THAT(broken([&](Report& r) { scene(r).runs[0].matches->change_counts[0] = 3; }),
              HasSubstr("Matches.changed"));
  EXPECT_THAT(broken([](Report& r) { std::get<Table>(r.sections[7].content).rows[0].pop_back(); }),
              HasSubstr("section table"));
  EXPECT_THAT(broken([](Report& r) { r.provenance.options_json = "{"; }),
              HasSubstr("Provenance.options_json"));
  EXPECT_THAT(broken([](Report& r) { r.sections[8].text.reset(); }), HasSubstr("section text"));
  // A table is no scene.
  EXPECT_THAT(broken([](Report& r) { std::get<Answer>(r.sections[9].content).scene = "table"; }),
              HasSubstr("no scene 'table'"));
}

TEST(GzipBase64, HeaderHoldsNoTimeAndPiecesMakeTheWhole) {
  std::string bytes;
  for (std::uint64_t i = 0; i < 300000; ++i) bytes += static_cast<char>(i * i >> 3);
  std::string text;
  const ByteSink sink = [&](std::string_view part) { text += part; };
  detail::GzipBase64 encoder(sink);
  for (std::size_t at = 0; at < bytes.size(); at += 70001) {
    encoder.write(std::string_view(bytes).substr(at, 70001));
  }
  encoder.finish();
  const std::string packed = testing::from_base64(text);
  EXPECT_EQ(packed.substr(4, 4), std::string(4, '\0'));
  EXPECT_EQ(testing::gunzipped(packed), bytes);
}

TEST(SaveReport, WritesAFileOrSaysThatThereIsNoViewer) {
  const testing::TemporaryFolder folder;
  if (has_viewer()) {
    save_report(full_report(), folder / "r.html");
    const std::string html = testing::read_text(folder / "r.html");
    EXPECT_EQ(ReportPage(html).document.at("title"), full_report().title);
    EXPECT_EQ(html, written(full_report(), viewer_page()));
    return;
  }
  try {
    save_report(full_report(), folder / "r.html");
    FAIL() << "wrote a report without a viewer";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no viewer"));
    EXPECT_THAT(error.what(), HasSubstr("CAIRN_WITH_VIEWER"));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "r.html"));
}

TEST(ThisMachine, NamesTheSystem) {
  const Machine machine = this_machine(3);
  EXPECT_THAT(machine.system, Not(::testing::IsEmpty()));
  EXPECT_EQ(machine.threads, 3U);
}

}  // namespace
}  // namespace cairn::report
