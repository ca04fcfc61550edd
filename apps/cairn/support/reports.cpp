// SPDX-License-Identifier: BSD-3-Clause
#include "support/reports.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "cairn/experiments/run.hpp"
#include "cairn/report/machine.hpp"
#include "cairn/report/map_builder.hpp"
#include "cairn/report/run_builder.hpp"
#include "cairn/report/writer.hpp"

#include "support/command_line.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

Method method_of(const StrategyResult& result) {
  // Before it is asked for samples: ICP on samples may have led the robust method.
  if (result.method == AlignMethod::kRobust) {
    return result.alignment.verdict ? Method::kAnywhere : Method::kRobust;
  }
  return result.alignment.registration.coarse_iterations > 0 ? Method::kFast : Method::kIcp;
}

std::string name_of(const StrategyResult& result) {
  const bool weighs = result.confidence != "none";
  return approach_name(method_of(result), weighs ? result.confidence : "base");
}

std::string verdict_text(const Alignment& alignment) {
  std::string verdict(to_string(*alignment.verdict));
  verdict.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(verdict.front())));
  return fmt::format("{}: {}.", verdict, alignment.reason);
}

std::string text_of(const Json& json) {
  // Text from files may be any bytes; JSON must be UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::optional<std::string> taken(Json& object, const char* key) {
  if (!object.contains(key)) return std::nullopt;
  const Json value = object.at(key);
  object.erase(key);
  return value.is_string() ? std::optional(value.get<std::string>()) : std::nullopt;
}

std::vector<report::AlignmentRun> runs_of(const ReportedPair& pair,
                                          const report::ShownPoints& source,
                                          const report::ShownPoints& target) {
  std::vector<report::AlignmentRun> runs;
  for (const StrategyResult& one : pair.results) {
    const bool has_points = pair.source != nullptr && pair.target != nullptr;
    RegistrationResult result = one.alignment.registration;
    result.reason = one.alignment.reason;
    result.duration_s = one.alignment.duration_s;
    if (one.alignment.verdict == Verdict::kRejected) result.status = RegistrationStatus::kFailed;
    if (!has_points) {  // neither can matches be shown nor errors measured at the landmarks
      for (IterationRecord& iteration : result.history) iteration.matches.clear();
    }
    report::AlignmentRun run = report::make_run(result, source, target,
                                                {.name = name_of(one),
                                                 .initial = pair.initial,
                                                 .k = one.k,
                                                 .truth = has_points ? pair.truth : std::nullopt,
                                                 .status = std::string(status_of(one.alignment))});
    if (!has_points && one.error) {
      for (auto& [name, value] : run.summary) {
        if (name == "rotation_error_deg") value = degrees(one.error->rotation_rad);
        if (name == "translation_error_m") value = one.error->translation;
      }
    }
    runs.push_back(std::move(run));
  }
  return runs;
}

}  // namespace

report::Report begin_report(std::string title, const CommonArguments& common) {
  report::Report report;
  report.title = std::move(title);
  report.provenance.command = command_line();
  report.provenance.seed = common.seed;
  report.provenance.machine = report::this_machine(common.executor().threads());
  return report;
}

void add_pair(report::Report& report, const ReportedPair& pair, const std::string& prefix) {
  report::ShownPoints source;
  report::ShownPoints target;
  const bool has_maps = pair.source != nullptr && pair.target != nullptr;
  if (has_maps) {
    source = report::ShownPoints::only_aligned(*pair.source, pair.point_options);
    target = report::ShownPoints::only_aligned(*pair.target, pair.point_options);
  }
  const std::vector<report::AlignmentRun> runs = runs_of(pair, source, target);
  if (has_maps) {
    report.maps.push_back(report::make_map(
        *pair.source, {.id = prefix + "source",
                       .name = pair.source_name,
                       .landmarks = landmarks_to_align(*pair.source, pair.point_options)}));
    report.maps.push_back(report::make_map(
        *pair.target, {.id = prefix + "target",
                       .name = pair.target_name,
                       .landmarks = landmarks_to_align(*pair.target, pair.point_options)}));
    report.sections.push_back(
        {.id = prefix + "scene",
         .title = prefix.empty() ? "Alignment" : pair.source_name + " to " + pair.target_name,
         .text = pair.story,
         .content = report::Scene{.source = prefix + "source",
                                  .target = prefix + "target",
                                  .truth = pair.truth,
                                  .up = report::up_of(*pair.target),
                                  .runs = runs}});
  }
  report.sections.push_back(
      {.id = prefix + "strategies",
       .title = "Strategies",
       .text = "The score is the mean squared distance of the source landmarks to the nearest "
               "target landmark. A lower one is a closer fit, not always a better pose.",
       .content = report::run_table(runs, pair.unit)});
  const auto add_chart = [&](const char* id, const char* title, report::LinesChart chart) {
    if (chart.series.empty()) return;
    report.sections.push_back({.id = prefix + id,
                               .title = title,
                               .text = std::nullopt,
                               .content = report::Chart(std::move(chart))});
  };
  add_chart("convergence", "Convergence", report::convergence_chart(runs, pair.unit));
  add_chart("translation-error", "Translation error", report::error_chart(runs, pair.unit, true));
  add_chart("rotation-error", "Rotation error", report::error_chart(runs, pair.unit, false));
}

void add_map(report::Report& report, const LandmarkMap& map, const std::string& name,
             const std::string& prefix) {
  report.maps.push_back(
      report::make_map(map, {.id = prefix + "map", .name = name, .landmarks = std::nullopt}));
  report.sections.push_back({.id = prefix + "scene",
                             .title = prefix.empty() ? "Map" : name,
                             .text = std::nullopt,
                             .content = report::Scene{.source = std::nullopt,
                                                      .target = prefix + "map",
                                                      .truth = std::nullopt,
                                                      .up = report::up_of(map),
                                                      .runs = {}}});
}

std::string subtitle_of(const std::vector<StrategyResult>& results, LengthUnit unit) {
  const auto judged = std::count_if(results.begin(), results.end(), [](const auto& result) {
    return result.alignment.verdict.has_value();
  });
  if (judged > 0) {
    std::string text;
    for (const StrategyResult& result : results) {
      if (!result.alignment.verdict) continue;
      if (!text.empty()) text += " ";
      if (judged > 1) text += name_of(result) + ": ";
      text += verdict_text(result.alignment);
    }
    return text;
  }
  const std::string symbol = unit_symbol(unit);
  const StrategyResult* nearest = nullptr;
  const StrategyResult* closest = nullptr;
  const auto score_of = [](const StrategyResult& result) {
    return result.alignment.registration.score;
  };
  for (const StrategyResult& result : results) {
    if (!has_answer(result.alignment)) continue;
    const auto& error = result.error;
    if (error && (nearest == nullptr || error->translation < nearest->error->translation)) {
      nearest = &result;
    }
    const auto score = score_of(result);
    if (score && (closest == nullptr || *score < *score_of(*closest))) closest = &result;
  }
  if (closest == nullptr) return "No strategy found a pose.";
  std::string text = fmt::format("The lowest score is that of {}: {:.4g} {}² after {} iterations",
                                 name_of(*closest), *score_of(*closest), symbol,
                                 closest->alignment.registration.iterations);
  if (nearest != nullptr) {
    text += fmt::format("; {} is nearest to the true pose, {} {} and {} degrees off",
                        nearest == closest ? "it" : name_of(*nearest),
                        fixed(nearest->error->translation, 4), symbol,
                        fixed(degrees(nearest->error->rotation_rad), 3));
  }
  return text + ".";
}

report::Input reported_input(const std::string& role, Json description) {
  report::Input input;
  input.role = role;
  input.path = taken(description, "path");
  input.hash = taken(description, "hash");
  if (!description.empty()) input.details_json = text_of(description);
  return input;
}

void set_provenance(report::Report& report, const Json& document) {
  for (const auto& [role, description] : document.at("inputs").items()) {
    report.provenance.inputs.push_back(reported_input(role, description));
  }
  report.provenance.options_json = text_of(document.at("options"));
}

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

void write_report(const report::Report& report, const CommonArguments& common) {
  if (common.report_path.empty()) return;
  report::save_report(report, common.report_path);
  common.console().print(fmt::format("\nreport  {}\n", common.report_path));
}

}  // namespace cairn::cli
