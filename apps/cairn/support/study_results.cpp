// SPDX-License-Identifier: BSD-3-Clause
#include "support/study_results.hpp"

#include <filesystem>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/report/sections.hpp"
#ifdef CAIRN_HAS_SIMULATED_SESSIONS
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#endif

#include "support/documents.hpp"
#include "support/experiment_reports.hpp"
#include "support/interrupt.hpp"
#include "support/reports.hpp"
#include "support/trial_results.hpp"

namespace cairn::cli {

namespace fs = std::filesystem;

namespace {

void check_simulation([[maybe_unused]] const PairSimulation& simulation) {
#ifdef CAIRN_HAS_SIMULATED_SESSIONS
  environment_kind(simulation.environment);
  path_kind(simulation.path);
#else
  throw Error(ErrorKind::kInput, "simulate", "this build cannot simulate",
              "a build with OpenCV, Ceres and Embree");
#endif
}

std::string summary(const Study& study, const std::vector<std::string>& findings,
                    const std::vector<ResultTable>& tables) {
  std::string text = fmt::format("# {}\n\n", study.name);
  for (const std::string& finding : findings) text += fmt::format("- {}\n", finding);
  return text + markdown_of(tables);
}

}  // namespace

PairFiles study_paths(PairFiles files, const std::string& study_path) {
  const fs::path folder = fs::path(study_path).parent_path();
  files.source = (folder / files.source).string();
  files.target = (folder / files.target).string();
  if (files.truth) files.truth = (folder / *files.truth).string();
  return files;
}

void check_pairs(const Study& study, const std::string& study_path) {
  for (const StudyPair& pair : study.pairs) {
    try {
      if (const auto* simulation = std::get_if<PairSimulation>(&pair.maps)) {
        check_simulation(*simulation);
        continue;
      }
      const PairFiles files = study_paths(std::get<PairFiles>(pair.maps), study_path);
      for (const std::string& path : {files.source, files.target, files.truth.value_or("")}) {
        if (!path.empty()) FileReader readable(path);
      }
    } catch (const Error& error) {
      // What a simulation is made of stands in the study, not on the command line.
      const bool is_simulated = std::holds_alternative<PairSimulation>(pair.maps);
      throw Error(is_simulated ? ErrorKind::kInput : error.kind(),
                  fmt::format("{}: pair {}", study_path, pair.name), error.what(), "");
    }
  }
}

std::string StudyInput::line() const {
  return fmt::format("input {} {} {}", pair, role, hash);
}

void StudyInput::require_unchanged() const {
  const std::string now = hash_file(path);
  if (now == hash) return;
  throw Error(ErrorKind::kInput, path,
              fmt::format("was changed while the study ran, its hash is {}", now), hash);
}

std::vector<StudyInput> study_inputs(const Study& study, const std::string& study_path) {
  std::vector<StudyInput> inputs;
  for (const StudyPair& pair : study.pairs) {
    const auto* given = std::get_if<PairFiles>(&pair.maps);
    if (given == nullptr) continue;
    const PairFiles files = study_paths(*given, study_path);
    inputs.push_back({pair.name, "source", files.source, hash_file(files.source)});
    inputs.push_back({pair.name, "target", files.target, hash_file(files.target)});
    if (files.truth) inputs.push_back({pair.name, "truth", *files.truth, hash_file(*files.truth)});
  }
  return inputs;
}

LandmarkMap read_study_map(const std::string& path) {
  MapReadOptions options;
  options.stop = interrupt_requests();
  LandmarkMap map = read_map(path, options);
  require_metres(map, path);
  return map;
}

StudyConclusion conclude_study(const Study& study, const std::string& folder,
                               const CommonArguments& common) {
  const std::string path = (fs::path(folder) / "runs.csv").string();
  const std::vector<TrialResult> runs = parse_runs(read_file(path), path);
  const StudySummary results = summarise_study(study, runs);
  const std::vector<ResultTable> tables = study_tables(study, results);
  StudyConclusion conclusion;
  conclusion.runs = runs.size();
  conclusion.findings = study_findings(study, results);
  conclusion.sections = report::study_sections(study, results, runs);
  write_tables(folder, tables);
  write_text(folder, "summary.md", summary(study, conclusion.findings, tables));

  CommonArguments seeded = common;
  seeded.seed = study.seed;
  Json& json = conclusion.json;
  json =
      document("experiment", seeded, {{"runs", {{"path", "runs.csv"}, {"hash", hash_file(path)}}}},
               {{"max_rotation_deg", study.success.rotation_deg},
                {"max_translation_m", study.success.translation_m},
                {"success_score_m2", to_json(study.success_score)},
                {"confidence_level", study.confidence_level},
                {"equivalence_margin", study.equivalence_margin}});
  json["experiment"] = "sweep";
  json["name"] = study.name;
  json["findings"] = conclusion.findings;
  json["tables"] = Json::array();
  for (const ResultTable& table : tables) json["tables"].push_back(to_json(table));
  write_text(folder, "experiment.json", to_text(json));
  return conclusion;
}

void tell_study(const Study& study, StudyConclusion conclusion, const std::string& folder,
                const CommonArguments& common) {
  write_document(conclusion.json, common);
  if (!common.report_path.empty()) {
    conclusion.json.erase("tables");
    report::Report report = begin_report("", common);
    set_provenance(report, conclusion.json);
    add_study(report, study.name, conclusion.findings, std::move(conclusion.sections));
    write_report(report, common);
  }
  std::string text = fmt::format("{}: {} runs\n\n", folder, conclusion.runs);
  for (const std::string& finding : conclusion.findings) text += finding + "\n";
  common.console().print(text);
}

}  // namespace cairn::cli
