// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/experiments/paper.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/report/sections.hpp"

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"
#include "support/experiment_reports.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

// What is to be said of the truth if its inverse fits.
std::optional<std::string> swapped_truth(const PaperResults& results) {
  if (!results.fits_inverse) return std::nullopt;
  return swapped_truth_text("the maps better");
}

struct PaperArguments {
  CommonArguments common;
  std::string source;
  std::string target;
  std::string output;
  std::string truth;
  std::vector<std::string> images;
  PaperOptions options;

  void add_to(const Command& command) {
    command.add_text("source", source, "Map to move: " + all_formats().titles_text()).required();
    command.add_text("target", target, "Map to align it to").required();
    command.add_text("-o,--output", output, "New folder for the results", "FOLDER").required();
    command.add_text(
        "--truth", truth,
        "True target_from_source, 16 numbers or the JSON of an alignment; the runs start from it, "
        "displaced, and have pose errors",
        "FILE");
    add_options(command, PaperOptions::table, &options);
    command
        .add_words("--images", images,
                   "RGB-D sequences of source and target; adds the paper's Figure 1",
                   "FOLDER FOLDER")
        .words(2);
    common.add_report_to(command, "one configuration in 3D at each iteration, figures and tables");
    common.add_to(command);
    common.add_threads_to(command);
    command.footer(
        "Each run starts from the true pose, or from the maps as they lie without --truth, "
        "displaced\n"
        "as in the paper: turned about the target's origin, then moved.\n"
        "Writes runs.csv, timings.csv, experiment.json, summary.md and tables/ (CSV and LaTeX).\n"
        "\n"
        "Example: run the experiments on two maps with a known true pose\n"
        "  cairn experiment paper second.map first.map --truth truth.txt -o results");
  }

  int run() {
    with_option_names({PaperOptions::table, IcpOptions::table}, [&] { options.validate(); });
    require_outputs(common);
    MapPair pair;
    if (!truth.empty()) pair.truth = read_pose_file(truth);
    LoadedMap source_map = load_map(source, common, {}, true);
    LoadedMap target_map = load_map(target, common, {}, true);
    for (LoadedMap* const loaded : {&source_map, &target_map}) {
      require_metres(loaded->map, loaded->path);
      loaded->description["kept_landmarks"] =
          landmarks_observed(loaded->map, options.points.min_observations).size();
    }
    detail::OutputFolder folder = result_folder(output);
    const std::string unfinished = folder.unfinished().string();
    pair.name = std::filesystem::path(source).stem().string() + "_to_" +
                std::filesystem::path(target).stem().string();
    pair.source = std::move(source_map.map);
    pair.target = std::move(target_map.map);
    const Stopwatch watch;
    const PaperResults results =
        run_paper_experiments(pair, options, common.execution("180 alignments"));
    const double seconds = watch.seconds();

    const std::vector<ResultTable> tables = paper_tables(results, options.tolerance);
    const std::vector<std::string> findings = paper_findings(results, options.tolerance);
    write_all(unfinished, results, findings, tables);
    if (!images.empty()) {
      common.console().remark(write_common_view(unfinished, pair, results, images[0], images[1]));
    }
    Json inputs = {{"source", source_map.description}, {"target", target_map.description}};
    if (pair.truth)
      inputs["truth"] = {{"path", truth}, {"target_from_source", to_json(*pair.truth)}};
    const Json json = describe(std::move(inputs), results, findings, tables);
    write_text(unfinished, "experiment.json", to_text(json));
    folder.commit();
    write_document(json, common);
    if (!common.report_path.empty()) {
      report::Report report = begin_report("", common);
      set_provenance(report, json);
      add_paper(report,
                {.results = &results,
                 .tolerance = options.tolerance,
                 .source_name = file_name(source),
                 .target_name = file_name(target),
                 .pair = &pair,
                 .align = options.align,
                 .points = options.points},
                common);
      write_report(report, common);
    }
    print(results, findings, seconds);
    return kDone;
  }

 private:
  Json options_json() const {
    Json json = {{"start", truth.empty() ? "as_read" : "truth"}};
    json.update(options_of(PaperOptions::table, &options));
    return json;
  }

  // Whether no run that starts at the true pose ends there, with matches at any distance.
  bool fails_in_place(const PaperResults& results) const {
    return results.has_truth && std::isinf(options.align.max_distance) &&
           std::none_of(results.runs.begin(), results.runs.end(), [&](const TrialResult& run) {
             return run.trial.initial == Displacement{} && run.error &&
                    options.tolerance.holds(*run.error);
           });
  }

  static bool agree_rarely(const PaperResults& results) {
    return !results.has_truth && results.agreement &&
           2 * std::ranges::count(results.agreement->agrees, true) <
               std::ssize(results.agreement->agrees);
  }

  std::string success_text(const PaperResults& results) const {
    std::string text = fmt::format(
        "\nA run succeeds by its score below {:.6g} m^2 (the paper's, on its own pair: {:g}), by "
        "its pose within {:g} degrees and {:g} m.\nThe runs start from {}.\n",
        results.success_score, kPublishedSuccessScore, options.tolerance.rotation_deg,
        options.tolerance.translation_m, start_text(results));
    if (const auto swapped = swapped_truth(results)) text += fmt::format("\n{}.\n", *swapped);
    return text;
  }

  std::string summary(const PaperResults& results, const std::vector<std::string>& findings,
                      const std::vector<ResultTable>& tables) const {
    return fmt::format("# The paper's experiments on {} and {}\n\n", source, target) +
           markdown_of(findings) + success_text(results) + markdown_of(tables);
  }

  void write_all(const std::string& folder, const PaperResults& results,
                 const std::vector<std::string>& findings,
                 const std::vector<ResultTable>& tables) const {
    write_runs(folder, results.runs);
    write_tables(folder, tables);
    write_tables(folder, {paper_durations(results)});
    if (!results.searches.empty()) {
      std::vector<TrialResult> runs;
      for (const QuadrantSearch& search : results.searches) {
        runs.insert(runs.end(), search.runs.begin(), search.runs.end());
      }
      write_runs(folder, runs, "xy_search_");
    }
    write_text(folder, "summary.md", summary(results, findings, tables));
  }

  Json describe(Json inputs, const PaperResults& results, const std::vector<std::string>& findings,
                const std::vector<ResultTable>& tables) const {
    Json json = document("experiment", common, std::move(inputs), options_json());
    json["experiment"] = "paper";
    json["success_score_m2"] = results.success_score;
    json["agreement"] =
        results.agreement
            ? Json{{"target_from_source",
                    to_json(*results.runs[results.agreement->pose].target_from_source)},
                   {"pose", results.agreement->pose},
                   {"agrees", results.agreement->agrees}}
            : Json(nullptr);
    json["findings"] = findings;
    json["tables"] = Json::array();
    for (const ResultTable& table : tables) json["tables"].push_back(to_json(table));
    return json;
  }

  void print(const PaperResults& results, const std::vector<std::string>& findings,
             double seconds) const {
    const Console console = common.console();
    console.print("{}: {} runs in {:.1f} s\n\n", output, results.runs.size(), seconds);
    for (const std::string& finding : findings) console.print("{}\n", finding);
    console.print(success_text(results));
    if (const auto swapped = swapped_truth(results)) {
      console.remark(*swapped);
    } else if (fails_in_place(results)) {
      console.print(
          "  hint: No run ends at the true pose, even without displacement. Where the maps overlap "
          "in part, --max-distance keeps landmarks of one map alone from pulling.\n");
    } else if (agree_rarely(results)) {
      console.print(
          "  hint: Fewer than half of the runs agree on a pose, so the maps may not lie in one "
          "frame: 'cairn align {} {} --json truth.json' finds a pose for --truth truth.json.\n",
          source, target);
    }
  }
};

}  // namespace

void add_experiment_paper(const Command& experiment) {
  add_verb<PaperArguments>(experiment, "paper",
                           "Run the paper's 45 configurations with base ICP and three confidences");
}

void add_experiment(const Command& program) {
  const Command experiment = program.add_group(
      "experiment", "Align maps from many initial poses: the paper's experiments, or a study");
  add_experiment_paper(experiment);
  add_experiment_sweep(experiment);
  add_experiment_merge(experiment);
  experiment.footer(
      "Example: run the paper's 45 configurations on two maps of one place\n"
      "  cairn experiment paper later.map earlier.map -o results");
}

}  // namespace cairn::cli
