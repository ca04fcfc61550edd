// SPDX-License-Identifier: BSD-3-Clause
#include "support/trial_results.hpp"

#include <filesystem>
#include <system_error>
#include <variant>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/experiments/run.hpp"

namespace cairn::cli {

namespace fs = std::filesystem;

Json to_json(const TrialResult& run) {
  const Displacement& initial = run.trial.initial;
  Json json = {{"pair", run.trial.pair},
               {"experiment", run.trial.experiment},
               {"number", run.trial.number},
               {"method", to_string(run.trial.method)},
               {"strategy", run.trial.strategy},
               {"k", run.trial.k},
               {"x_m", initial.x_m},
               {"y_m", initial.y_m},
               {"z_m", initial.z_m},
               {"roll_deg", initial.roll_deg},
               {"pitch_deg", initial.pitch_deg},
               {"yaw_deg", initial.yaw_deg},
               {"status", to_string(run.status)},
               {"stop_reason", to_string(run.stop_reason)},
               {"iterations", run.iterations},
               {"cycle_length", run.cycle_length ? Json(*run.cycle_length) : Json(nullptr)},
               {"initial_score_m2", to_json(run.initial_score)},
               {"score_m2", to_json(run.score)}};
  json["target_from_source"] = run.target_from_source ? to_json(*run.target_from_source) : nullptr;
  json["rotation_error_deg"] = run.error ? Json(degrees(run.error->rotation_rad)) : nullptr;
  json["translation_error_m"] = run.error ? Json(run.error->translation) : nullptr;
  return json;
}

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

std::string markdown_of(const std::vector<ResultTable>& tables) {
  std::string text;
  for (const ResultTable& table : tables) {
    text += fmt::format("\n## {}\n\n{}\n\n{}", table.name, table.title, table.markdown());
  }
  return text;
}

detail::OutputFolder result_folder(const fs::path& folder) {
  std::error_code error;
  if (folder.has_parent_path()) fs::create_directories(folder.parent_path(), error);
  if (error) {
    throw Error(ErrorKind::kStorage, folder.string(), "cannot be created: " + error.message(), "");
  }
  return detail::OutputFolder(folder);
}

void write_text(const std::string& folder, const std::string& name, const std::string& text) {
  const fs::path path = fs::path(folder) / name;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
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
  }
}

}  // namespace cairn::cli
