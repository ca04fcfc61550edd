// SPDX-License-Identifier: BSD-3-Clause
#include "support/experiment_reports.hpp"

#include <algorithm>
#include <span>
#include <system_error>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/report/sections.hpp"
#ifdef CAIRN_HAS_ODOMETRY
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"
#endif

#include "support/alignments.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

#ifdef CAIRN_HAS_ODOMETRY
// The image of a keyframe, by its time.
std::optional<std::filesystem::path> image_of(const LandmarkMap& map, FrameIndex frame,
                                              const ImageSequence& sequence) {
  const auto& times = map.frames().timestamps_s;
  if (times.empty() || !times[frame.value]) return std::nullopt;
  constexpr double kSameFrame = 1e-3;  // seconds; a map's times are the images' own
  for (const SequenceFrame& candidate : sequence.frames()) {
    if (std::abs(candidate.timestamp_s - *times[frame.value]) < kSameFrame) return candidate.color;
  }
  return std::nullopt;
}

ColorImage side_by_side(const ColorImage& left, const ColorImage& right) {
  constexpr std::uint32_t kGap = 8;
  constexpr std::uint8_t kWhite = 255;
  ColorImage both(left.width + kGap + right.width, std::max(left.height, right.height), kWhite);
  const auto place = [&](const ColorImage& image, std::size_t column) {
    for (std::size_t row = 0; row < image.height; ++row) {
      std::copy_n(&image.at(0, row), image.width * ColorImage::kPixelValues, &both.at(column, row));
    }
  };
  place(left, 0);
  place(right, left.width + kGap);
  return both;
}
#endif

void add_sections(report::Report& report, std::vector<report::Section> sections,
                  const std::string& prefix) {
  for (report::Section& section : sections) {
    section.id = prefix + section.id;
    report.sections.push_back(std::move(section));
  }
}

std::string paragraphs_of(std::span<const std::string> sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : "\n\n") + sentence;
  return text;
}

// The first stands below the title, unless the report has others beside this.
void add_findings(report::Report& report, const std::vector<std::string>& findings,
                  const std::string& prefix) {
  const bool alone = prefix.empty() && !report.subtitle && findings.size() > 1;
  if (!report.subtitle) report.subtitle = findings.front();
  report.sections.push_back({.id = prefix + "findings",
                             .title = "Findings",
                             .text = paragraphs_of(std::span(findings).subspan(alone ? 1 : 0)),
                             .content = report::Text()});
}

void add_one_configuration(report::Report& report, const ShownPaper& shown,
                           const CommonArguments& common, const std::string& prefix) {
  const auto published = published_experiments();
  const auto one =
      std::find_if(published.begin(), published.end(), [](const PublishedExperiment& candidate) {
        return candidate.experiment == Experiment::kNeighbors && candidate.k == IcpOptions().k;
      });
  std::vector<Strategy> strategies;
  for (const std::string_view name : kPaperStrategies) strategies.push_back(strategy_named(name));
  IcpOptions align = shown.align;
  align.initial = initial_pose(one->initial, shown.pair->truth);
  align.trace = true;
  ReportedPair pair;
  pair.source_name = shown.source_name;
  pair.target_name = shown.target_name;
  pair.source = &shown.pair->source;
  pair.target = &shown.pair->target;
  pair.points = shown.points;
  pair.initial = align.initial;
  pair.truth = shown.pair->truth;
  pair.results = align_by_all(shown.pair->source, shown.pair->target, strategies,
                              by_icp_alone(align, shown.points), shown.pair->truth, common);
  pair.answer = false;  // that of the experiment is above
  // None of several failures is best.
  pair.marks_best =
      std::any_of(pair.results.begin(), pair.results.end(), [&](const StrategyResult& result) {
        return !pair.truth || (result.error && shown.tolerance.holds(*result.error));
      });
  pair.story = fmt::format("One of the 45 configurations: initial {}, k = {}.",
                           describe(one->initial), align.k);
  add_pair(report, pair, prefix);
}

}  // namespace

Json to_json(const ResultTable& table) {
  Json columns = Json::array();
  for (const ResultTable::Column& column : table.columns) {
    columns.push_back({{"name", column.name}, {"unit", text_or_null(column.unit)}});
  }
  Json rows = Json::array();
  for (const auto& cells : table.rows) {
    Json row = Json::array();
    for (const ResultTable::Cell& cell : cells) {
      if (const double* number = std::get_if<double>(&cell)) {
        row.push_back(*number);
      } else if (const std::string* text = std::get_if<std::string>(&cell)) {
        row.push_back(*text);
      } else {
        row.push_back(nullptr);
      }
    }
    rows.push_back(std::move(row));
  }
  return {{"name", table.name},
          {"title", table.title},
          {"columns", std::move(columns)},
          {"rows", std::move(rows)}};
}

std::string markdown_of(const std::vector<std::string>& findings) {
  std::string text;
  for (const std::string& finding : findings) text += fmt::format("- {}\n", finding);
  return text;
}

std::string markdown_of(const std::vector<ResultTable>& tables) {
  std::string text;
  for (const ResultTable& table : tables) {
    text += fmt::format("\n## {}\n\n{}\n\n{}", table.name, table.title, table.markdown());
  }
  return text;
}

detail::OutputFolder result_folder(const std::filesystem::path& folder) {
  std::error_code error;
  if (folder.has_parent_path()) std::filesystem::create_directories(folder.parent_path(), error);
  if (error) {
    throw Error(ErrorKind::kStorage, folder.string(), "cannot be created: " + error.message(), "");
  }
  return detail::OutputFolder(folder);
}

void write_text(const std::string& folder, const std::string& name, const std::string& text) {
  const std::filesystem::path path = std::filesystem::path(folder) / name;
  std::error_code error;
  std::filesystem::create_directories(path.parent_path(), error);
  if (error) throw Error(ErrorKind::kStorage, path.string(), error.message(), "");
  write_file(path, [&](const ByteSink& sink) { sink(text); });
}

void write_runs(const std::string& folder, const std::vector<TrialResult>& runs,
                const std::string& prefix) {
  std::string rows = runs_header();
  std::string timings = timings_header();
  for (const TrialResult& run : runs) {
    rows += runs_row(run);
    timings += timings_row(run);
  }
  write_text(folder, prefix + "runs.csv", rows);
  write_text(folder, prefix + "timings.csv", timings);
}

void write_tables(const std::string& folder, const std::vector<ResultTable>& tables) {
  for (const ResultTable& table : tables) {
    write_text(folder, "tables/" + table.name + ".csv", table.csv());
    write_text(folder, "tables/" + table.name + ".tex", table.latex());
  }
}

void add_paper(report::Report& report, const ShownPaper& shown, const CommonArguments& common,
               const std::string& prefix) {
  if (report.title.empty()) {
    report.title =
        fmt::format("The paper's experiments on {} and {}", shown.source_name, shown.target_name);
  }
  add_findings(report, paper_findings(*shown.results, shown.tolerance), prefix);
  if (shown.pair != nullptr) add_one_configuration(report, shown, common, prefix);
  add_sections(report, report::paper_sections(*shown.results, shown.tolerance), prefix);
}

void add_study(report::Report& report, const std::string& name,
               const std::vector<std::string>& findings, std::vector<report::Section> sections,
               const std::string& prefix) {
  if (report.title.empty()) report.title = "Study " + name;
  add_findings(report, findings, prefix);
  add_sections(report, std::move(sections), prefix);
}

std::string write_common_view([[maybe_unused]] const std::string& folder,
                              [[maybe_unused]] const MapPair& pair,
                              [[maybe_unused]] const PaperResults& results,
                              [[maybe_unused]] const std::string& source_sequence,
                              [[maybe_unused]] const std::string& target_sequence) {
#ifdef CAIRN_HAS_ODOMETRY
  const TrialResult* best = nullptr;
  for (const TrialResult& run : results.runs) {
    if (!run.score || !run.target_from_source) continue;
    if (best == nullptr || *run.score < *best->score) best = &run;
  }
  if (best == nullptr) return "Figure 1: no run found a pose";
  constexpr double kRadius = 0.05;  // metres
  const auto view = find_common_view(pair.source, pair.target, *best->target_from_source, kRadius);
  if (!view) return "Figure 1: no two keyframes see one place";
  const auto source_image = image_of(pair.source, view->source, ImageSequence(source_sequence));
  const auto target_image = image_of(pair.target, view->target, ImageSequence(target_sequence));
  if (!source_image || !target_image) {
    return fmt::format("Figure 1: the {} has no image of the time of the map's keyframe",
                       source_image ? target_sequence : source_sequence);
  }
  const ColorImage both =
      side_by_side(read_color_image(*source_image), read_color_image(*target_image));
  std::filesystem::create_directories(std::filesystem::path(folder) / "figures");
  write_png(std::filesystem::path(folder) / "figures/figure1.png", both);
  return fmt::format("Figure 1: {} and {} see {} landmarks in common",
                     source_image->filename().string(), target_image->filename().string(),
                     view->landmarks);
#else
  throw Error(ErrorKind::kMisuse, "--images", "this build cannot read images",
              "a build with OpenCV and Ceres");
#endif
}

}  // namespace cairn::cli
