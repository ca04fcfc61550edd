// SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/sections.hpp"
#ifdef CAIRN_HAS_SIMULATED_SESSIONS
#include "cairn/experiments/simulated_session/simulated_session.hpp"
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#endif

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/experiment_reports.hpp"
#include "support/interrupt.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

// A file that the runs of a study depend on.
struct StudyInput {
  std::string pair;  // name
  std::string role;  // source, target or truth
  std::string path;
  std::string hash;

  // As StudyFolder takes it.
  std::string line() const { return fmt::format("input {} {} {}", pair, role, hash); }
  // For after the file was read.
  // @throws Error (input) naming the file if its content is another now
  void require_unchanged() const {
    const std::string now = hash_file(path);
    reject_if(now != hash, path,
              fmt::format("was changed while the study ran, its hash is {}", now), hash);
  }
};

// What follows from the runs of a study.
struct StudyConclusion {
  std::size_t runs = 0;
  std::vector<std::string> findings;
  std::vector<report::Section> sections;
  Json json;  // experiment.json
};

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
  return fmt::format("# {}\n\n", study.name) + markdown_of(findings) + markdown_of(tables);
}

// A pair's paths, which are relative to the study's file, as seen from here.
PairFiles study_paths(PairFiles files, const std::string& study_path) {
  const fs::path folder = fs::path(study_path).parent_path();
  files.source = (folder / files.source).string();
  files.target = (folder / files.target).string();
  if (files.truth) files.truth = (folder / *files.truth).string();
  return files;
}

// Fails before hours of work rather than after them: files that are not there, places and paths that
// no simulation knows.
// @throws Error (input) naming the study's file and the pair
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

// The files of a study, with the hashes of their content.
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

// A map in metres.
// @throws Error (input)
LandmarkMap read_study_map(const std::string& path) {
  LandmarkMap map = read_map(path, {.stop = interrupt_requests()});
  require_metres(map, path);
  return map;
}

// Reads a complete study's runs.csv, and writes beside it what follows from them: tables/, summary.md and
// experiment.json.
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

// Writes the document and the report that the user asked for; prints the findings.
// @param folder of the results
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

void remark_on_processors(const std::vector<std::string>& kinds, const Console& console) {
  if (kinds.size() < 2) return;
  console.remark(fmt::format(
      "the runs are from several kinds of processor ({}), whose results may differ in last digits",
      fmt::join(kinds, ", ")));
}

struct SweepArguments {
  CommonArguments common;
  std::string study_path;
  std::string output;
  std::string shard_text;
  bool check_only = false;

  void add_to(const Command& command) {
    command.add_text("study", study_path, "Study to run, a YAML file").required();
    command
        .add_text("-o,--output", output,
                  "Folder for the results; continues a run of the same study that was stopped",
                  "FOLDER")
        .required();
    command.add_text("--shard", shard_text,
                     "Run only part i of n; 'cairn experiment merge' joins the parts", "i/n");
    command.add_flag("--check", check_only,
                     "Run and write nothing; the exit code is 0 if all runs are in the folder and "
                     "sound, else 4");
    common.add_report_to(command, "findings, figures and tables");
    common.add_to(command);
    common.add_threads_to(command);
    command.footer(
        "Paths in the study are relative to its file. The subfolder maps keeps simulated maps.\n"
        "Each run starts from the true pose, or from the maps as they lie without a truth, "
        "displaced:\n"
        "turned about the source's centroid, then moved.\n"
        "\n"
        "A study (docs/experiments.md lists all settings):\n"
        "  name: desks\n"
        "  seed: 1\n"
        "  pairs:\n"
        "    - {name: desk, simulate: {environment: desk, seeds: [1, 2, 3]}}\n"
        "    - {name: real, source: later.map, target: earlier.map, truth: truth.txt}\n"
        "  initial_poses: {count: 200, x_m: [-1, 1], y_m: [-1, 1], yaw_deg: [-60, 60]}\n"
        "\n"
        "Example: run the study\n"
        "  cairn experiment sweep study.yaml -o results");
  }

  int run() {
    const Shard part = shard();
    require_outputs(common);
    refuse_if(check_only && !(common.json_path.empty() && common.report_path.empty()), "--check",
              "given with --json or --report", "--check alone");
    const std::string yaml = read_file(study_path);
    const Study study = parse_study(yaml, study_path);
    check_pairs(study, study_path);
    const StudyPlan plan(study);
    const std::vector<StudyInput> inputs = study_inputs(study, study_path);
    std::vector<std::string> input_lines;
    for (const StudyInput& input : inputs) input_lines.push_back(input.line());
    if (check_only) return check(plan, part, input_lines);
    StudyFolder folder(output, plan, part, input_lines);
    write_text(output, "study.yaml", yaml);

    const std::size_t all = part.end(plan.size()) - part.begin(plan.size());
    const Console console = common.console();
    if (folder.done() > 0) {
      console.remark(fmt::format("{}: {} of {} runs were done before", output, folder.done(), all));
    }
    remark_on_processors(folder.processors(), console);
    Execution execution = common.execution();
    if (const auto show = console.detailed_progress("aligning")) {
      execution.progress = [&, show](double share) {
        show(share, fmt::format("{} of {} runs", folder.done(), all));
      };
    }
    std::map<std::string, std::size_t> swapped;  // runs of each pair
    const auto count = [&](const TrialResult& run) {
      if (run.fits_inverse) ++swapped[run.trial.pair];
    };
    run_study(
        plan, part, folder, [&](const StudyPair& pair) { return load_pair(pair, inputs); }, count,
        execution);
    for (const auto& [pair, runs] : swapped) {
      console.remark(
          fmt::format("{}: {}", pair, swapped_truth_text(fmt::format("{} poses", runs))));
    }
    if (part.count > 1) {
      console.print(
          fmt::format("{}: {} runs, shard {} of {}; 'cairn experiment merge' joins them\n", output,
                      all, part.index, part.count));
      return kDone;
    }
    tell_study(study, conclude_study(study, output, common), output, common);
    return kDone;
  }

 private:
  Shard shard() const {
    if (shard_text.empty()) return {};
    const auto [index, count] = parse_part(shard_text, "--shard", "i/n with i from 1 to n");
    return {index, count};
  }

  int check(const StudyPlan& plan, const Shard& part,
            const std::vector<std::string>& inputs) const {
    const bool complete = is_complete(output, plan, part, inputs);
    common.console().print(fmt::format(
        "{}: {}\n", output, complete ? "complete" : "not complete; without --check it goes on"));
    return complete ? kDone : kNoTrustworthyAlignment;
  }

  // A simulated pair is made once, and then read like any other: its maps can be looked at.
  MapPair load_pair(const StudyPair& pair, const std::vector<StudyInput>& inputs) const {
    PairFiles files;
    if (const auto* given = std::get_if<PairFiles>(&pair.maps)) {
      files = study_paths(*given, study_path);
    } else {
      const fs::path folder = fs::path(output) / "maps";
      files = {(folder / (pair.name + "_source.map")).string(),
               (folder / (pair.name + "_target.map")).string(),
               (folder / (pair.name + "_truth.txt")).string()};
      if (!fs::exists(*files.truth)) {  // written last
        const MapPair made = simulated(pair);
        fs::create_directories(folder);
        write_map(made.source, files.source);
        write_map(made.target, files.target);
        write_pose(*files.truth, *made.truth);
      }
    }
    MapPair loaded{pair.name, read_study_map(files.source), read_study_map(files.target), {}};
    if (files.truth) loaded.truth = read_pose_file(*files.truth);
    // The rows are to be those of the files that study.txt names, read perhaps hours later.
    for (const StudyInput& input : inputs) {
      if (input.pair == pair.name) input.require_unchanged();
    }
    return loaded;
  }

  MapPair simulated(const StudyPair& pair) const {
#ifdef CAIRN_HAS_SIMULATED_SESSIONS
    MapSequenceOptions options;
    const auto show = common.console().detailed_progress("simulating and mapping " + pair.name);
    if (show) {
      options.on_frame = [show](const MappingProgress& now) {
        show(static_cast<double>(now.frame) / static_cast<double>(now.frames),
             fmt::format("frame {} of {}", now.frame, now.frames));
      };
    }
    return simulated_pair(pair, options, common.execution());
#else
    throw Error(ErrorKind::kMisuse, pair.name, "this build cannot simulate",
                "a build with OpenCV, Ceres and Embree");
#endif
  }
};

struct SavedStudy {
  std::string path;
  std::string yaml;
  Study study;
};

// How the runs are judged is not in study.txt, and may differ between the shards' files.
std::string judgement_of(const Study& study) {
  return fmt::format(
      "success within {} degrees and {} m{}, confidence level {}, margin {}",
      study.success.rotation_deg, study.success.translation_m,
      study.success_score ? fmt::format(" or by a score below {} m^2", *study.success_score) : "",
      study.confidence_level, study.equivalence_margin);
}

struct MergeArguments {
  CommonArguments common;
  std::vector<std::string> shards;
  std::string output;

  void add_to(const Command& command) {
    command.add_words("folders", shards, "Folders of all shards, in any order").required();
    command.add_text("-o,--output", output, "New folder for the joined results", "FOLDER")
        .required();
    common.add_report_to(command, "findings, figures and tables");
    common.add_to(command);
    common.add_threads_to(command);
    command.footer(
        "Example: run a study in two parts, for example on two machines\n"
        "  cairn experiment sweep study.yaml --shard 1/2 -o part1\n"
        "  cairn experiment sweep study.yaml --shard 2/2 -o part2\n"
        "  cairn experiment merge part1 part2 -o results");
  }

  int run() const {
    require_outputs(common);
    const SavedStudy saved = read_study();
    detail::OutputFolder folder = result_folder(output);
    const std::string unfinished = folder.unfinished().string();
    remark_on_processors(merge_study({shards.begin(), shards.end()}, unfinished), common.console());
    write_text(unfinished, "study.yaml", saved.yaml);
    StudyConclusion conclusion = conclude_study(saved.study, unfinished, common);
    folder.commit();
    tell_study(saved.study, std::move(conclusion), output, common);
    return kDone;
  }

 private:
  // The study of all shards.
  SavedStudy read_study() const {
    std::optional<SavedStudy> first;
    for (const std::string& folder : shards) {
      const std::string path = (fs::path(folder) / "study.yaml").string();
      SavedStudy saved{path, read_file(path), {}};
      saved.study = parse_study(saved.yaml, path);
      require_runs_of(folder, saved.study, path);
      if (!first) {
        first = std::move(saved);
      } else if (judgement_of(saved.study) != judgement_of(first->study)) {
        throw Error(ErrorKind::kInput, path, judgement_of(saved.study),
                    fmt::format("{}, as in {}", judgement_of(first->study), first->path));
      }
    }
    return *first;
  }
};

}  // namespace

void add_experiment_sweep(const Command& experiment) {
  add_verb<SweepArguments>(experiment, "sweep",
                           "Run a study: many pairs of maps, random initial poses and strategies");
}

void add_experiment_merge(const Command& experiment) {
  add_verb<MergeArguments>(experiment, "merge", "Join the shards of a study");
}

}  // namespace cairn::cli
