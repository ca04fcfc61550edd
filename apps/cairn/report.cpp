// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/json_text.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/report/sections.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/experiment_reports.hpp"
#include "support/map_lists.hpp"
#include "support/reports.hpp"
#include "support/saved_results.hpp"

namespace cairn::cli {
namespace {

constexpr std::string_view kExpectedResult =
    "the JSON of 'cairn align' or 'cairn demo', the folder of an experiment, or a map";

// Every match must be one of landmarks that are there.
void check_matches(const SavedResult& result, const ReportedPair& pair) {
  const std::size_t source = landmarks_to_align(*pair.source, pair.points).size();
  const std::size_t target = landmarks_to_align(*pair.target, pair.points).size();
  for (std::size_t i = 0; i < pair.results.size(); ++i) {
    const auto& history = pair.results[i].alignment.registration.history;
    for (std::size_t k = 0; k < history.size(); ++k) {
      for (const Match& match : history[k].matches) {
        if (match.source < source && match.target < target) continue;
        throw Error(ErrorKind::kInput, result.file,
                    fmt::format("results[{}].history[{}].matches holds [{}, {}]", i, k,
                                match.source, match.target),
                    fmt::format("below [{}, {}], the numbers of landmarks", source, target));
      }
    }
  }
}

// Folders of the sequences that maps were built from; empty if not given.
struct Sequences {
  std::string map;  ///< of the map, if a map is all that is shown
  std::string source;
  std::string target;
};

// Whether a file is JSON by its first character; a pipe cannot be looked into twice.
bool looks_like_json(const std::string& path) {
  FileReader file(path);
  std::string start(64, '\0');
  start.resize(file.read(start.data(), start.size()));
  const std::size_t first = start.find_first_not_of(" \t\r\n");
  return first != std::string::npos && start[first] == '{';
}

// Whether JSON is a map of another system. Cairn's own documents begin with their schema.
bool is_map_in_json(const std::string& path, const std::string& text) {
  MemoryReader source(text, path);
  const MapInput input{
      .path = path, .first_bytes = std::string_view(text).substr(0, 4096), .source = &source};
  const auto formats = all_formats().formats();
  return input.first_bytes.find("\"schema\"") == std::string_view::npos &&
         std::any_of(formats.begin(), formats.end(), [&](const MapFormat& format) {
           return format.name != "text" && format.recognises && format.recognises(input);
         });
}

// One report being put together from several files.
class Assembly {
 public:
  Assembly(report::Report report, const CommonArguments& common, Sequences sequences, bool several)
      : report_(std::move(report)),
        common_(common),
        sequences_(std::move(sequences)),
        several_(several) {}

  void add_file(const std::string& path) {
    ++count_;
    if (several_) {
      refuse_sequence(path);
      refuse_pair_sequences(path);
    }
    std::error_code ignored;  // the reader explains it
    if (std::filesystem::is_directory(path, ignored)) {
      refuse_pair_sequences(path);
      if (!all_formats().maps_of_folder(path).empty()) {
        const Json map = add_single_map(path);
        inputs_.push_back({{"path", map.at("path")}, {"hash", map.at("hash")}});
        return;
      }
      refuse_sequence(path);
      add_experiment(path);
      return;
    }
    if (!std::filesystem::is_regular_file(path, ignored)) {
      const FileReader says_why_it_cannot_be_read(path);
      throw Error(ErrorKind::kInput, path, "no file", kExpectedResult);
    }
    inputs_.push_back(describe_file(path, common_));
    if (!looks_like_json(path)) {
      refuse_pair_sequences(path);
      add_single_map(path);
      return;
    }
    const std::string text = read_file(path);
    if (is_map_in_json(path, text)) {
      refuse_pair_sequences(path);
      add_single_map(path);
      return;
    }
    refuse_sequence(path);
    const std::optional<Json> parsed = Json::parse(text, path);
    reject_if(!parsed, path, "is not valid JSON", kExpectedResult);
    const std::string* const named = parsed->at("schema").at("name").text();
    const std::string schema = named != nullptr ? *named : "";
    const Reader reader = reader_of(schema);
    reject_if(reader == nullptr, path,
              named != nullptr ? "schema.name is " + printable(schema) : "has no schema.name",
              kExpectedResult);
    add_input(role("result"), inputs_.back());
    (this->*reader)(text, path);
  }

  const report::Report& report() const { return report_; }
  const std::vector<std::string>& remarks() const { return remarks_; }
  const Json& inputs() const { return inputs_; }

  /// Adds what is to be said at the end.
  void finish() {
    if (report_.title.empty()) report_.title = fmt::format("{} results", count_);
    if (!options_.empty()) report_.provenance.options_json = options_.dump(-1);
    if (remarks_.empty()) return;
    std::string text;
    for (const std::string& remark : remarks_) text += (text.empty() ? "" : "\n\n") + remark + ".";
    report_.sections.push_back(
        {.id = "remarks", .title = "Remarks", .text = std::move(text), .content = report::Text()});
  }

 private:
  // Adds what the text of one kind of JSON document holds.
  using Reader = void (Assembly::*)(const std::string& text, const std::string& path);

  // Documents by schema.
  static Reader reader_of(std::string_view schema) {
    if (schema == "cairn.align" || schema == "cairn.demo") return &Assembly::add_alignment;
    return nullptr;
  }

  void add_alignment(const std::string& text, const std::string& path) {
    const SavedResult saved = saved_result(text, path);
    const auto source = reload(saved.source, "source", saved);
    const auto target = reload(saved.target, "target", saved);
    ReportedPair pair;
    pair.source_name = file_name(saved.source.path.value_or("source"));
    pair.target_name = file_name(saved.target.path.value_or("target"));
    pair.source = source ? &source->map : nullptr;
    pair.target = target ? &target->map : nullptr;
    pair.unit = saved.unit;
    pair.points.min_observations = saved.min_observations;
    pair.initial = saved.initial;
    pair.truth = saved.truth;
    pair.results = saved.results;
    if (source && target) {
      check_matches(saved, pair);
      pair.source_images = images_of(source->map, sequences_.source, common_);
      pair.target_images = images_of(target->map, sequences_.target, common_);
    }
    add_pair(report_, pair, prefix());
    for (const auto& [name, description] : saved.inputs) add_input(role(name), description);
    options_[path] = saved.options;
    if (!several_) {
      if (report_.title.empty()) report_.title = pair.source_name + " to " + pair.target_name;
      report_.subtitle = subtitle_of(pair.results, pair.unit);
    }
  }

  // What lies in the folder of an experiment, by the document in it.
  void add_experiment(const std::string& folder) {
    const auto path_of = [&](const char* name) {
      return (std::filesystem::path(folder) / name).string();
    };
    const auto text_of = [&](const char* name) { return read_file(path_of(name)); };
    const std::string path = path_of("experiment.json");
    std::error_code failure;  // the reader explains it
    reject_if(!std::filesystem::exists(path, failure) && !failure, folder,
              "holds no experiment.json: no experiment was completed here", kExpectedResult);
    const std::string text = text_of("experiment.json");
    const Json document = Json::parse(text, path).value_or(Json());
    const std::string* const named = document.at("experiment").text();
    const std::string kind = named != nullptr ? *named : "";
    const std::string title = report_.title;
    inputs_.push_back(describe_file(path, common_));
    add_input(role("experiment"), inputs_.back());
    std::vector<TrialResult> runs = parse_runs(text_of("runs.csv"), path_of("runs.csv"));
    if (kind == "paper") {
      add_paper_experiment(text, folder, std::move(runs));
    } else if (kind == "sweep") {
      const Study study = parse_study(text_of("study.yaml"), path_of("study.yaml"));
      const StudySummary summary = summarise_study(study, runs);
      add_study(report_, study.name, study_findings(study, summary),
                report::study_sections(study, summary, runs), prefix());
    } else {
      throw Error(ErrorKind::kInput, path, "its experiment is neither 'paper' nor 'sweep'",
                  kExpectedResult);
    }
    if (document.contains("options")) options_[folder] = document.at("options");
    if (several_) {  // no one of them speaks for all
      report_.title = title;
      report_.subtitle.reset();
    }
  }

  void add_paper_experiment(const std::string& text, const std::string& folder,
                            std::vector<TrialResult> runs) {
    const std::string path = (std::filesystem::path(folder) / "experiment.json").string();
    const SavedPaper saved = saved_paper(text, path);
    PaperResults results;
    results.runs = std::move(runs);
    const std::size_t expected = published_experiments().size() * kPaperStrategies.size();
    reject_if(results.runs.size() != expected || saved.agreement.agrees.size() != expected, folder,
              fmt::format("{} runs", results.runs.size()), fmt::format("{}", expected));
    results.has_truth = saved.truth.has_value();
    results.success_score = saved.success_score;
    results.agreement = saved.agreement;
    SavedResult place;
    place.file = path;
    auto source = reload(saved.source, "source", place);
    auto target = reload(saved.target, "target", place);
    const bool has_maps = source && target;
    MapPair pair;
    pair.truth = saved.truth;
    if (has_maps) {
      pair.source = std::move(source->map);
      pair.target = std::move(target->map);
    }
    add_paper(report_,
              {.results = &results,
               .tolerance = saved.tolerance,
               .source_name = file_name(saved.source.path.value_or("source")),
               .target_name = file_name(saved.target.path.value_or("target")),
               .pair = has_maps ? &pair : nullptr,
               .align = saved.align,
               .points = saved.points},
              common_, prefix());
    for (const auto& [name, description] : saved.inputs) add_input(role(name), description);
  }

  // @return what a document says of the map
  Json add_single_map(const std::string& path) {
    const LoadedMap loaded = load_map(path, common_);
    add_input(role("map"), loaded.description);
    report::add_map(report_, loaded.map, file_name(path), prefix(),
                    images_of(loaded.map, sequences_.map, common_));
    if (!several_) {
      if (report_.title.empty()) report_.title = file_name(path);
      const LandmarkMap& map = loaded.map;
      report_.subtitle =
          fmt::format("{} {}", with_commas(map.landmark_count()),
                      splat_columns(map.landmarks().columns) ? "Gaussian splats" : "landmarks");
      if (map.frame_count() > 0) {
        *report_.subtitle += fmt::format(" seen from {} keyframes", with_commas(map.frame_count()));
      }
    }
    return loaded.description;
  }

  // The map that a result names, looked for from the current folder and then from the result's.
  // std::nullopt if it is in neither or has changed.
  std::optional<LoadedMap> reload(const SavedMap& saved, std::string_view role,
                                  const SavedResult& result) {
    if (!saved.path) {
      remark(fmt::format("{} names no {} map: there is no scene of it", result.file, role));
      return std::nullopt;
    }
    const std::filesystem::path here = *saved.path;
    const std::filesystem::path beside = std::filesystem::path(result.file).parent_path() / here;
    bool changed = false;
    for (const auto& path : {here, beside}) {
      std::error_code ignored;
      const bool is_folder = std::filesystem::is_directory(path, ignored);
      if (!is_folder && !std::filesystem::is_regular_file(path, ignored)) continue;
      const auto differs = [&](const std::string& hash) {
        return saved.hash && hash != *saved.hash;
      };
      if (!is_folder && differs(hash_file(path))) {
        changed = true;
        continue;
      }
      LoadedMap loaded = load_map(path.string(), common_, {}, true);
      if (is_folder && differs(*loaded.description.at("hash").text())) {
        changed = true;
        continue;
      }
      if (!result.camera.empty())
        loaded.map = with_camera(loaded.map, load_camera(result.camera).camera);
      return loaded;
    }
    remark(fmt::format("{} {}: there is no scene of it", here.string(),
                       changed ? "is not what was aligned, its content differs" : "is gone"));
    return std::nullopt;
  }

  void remark(std::string text) {
    common_.console().remark(text);
    remarks_.push_back(std::move(text));
  }

  void refuse_sequence(const std::string& path) const {
    if (sequences_.map.empty()) return;
    throw Error(ErrorKind::kMisuse, "--sequence", "given with " + printable(path), "one map alone");
  }

  void refuse_pair_sequences(const std::string& path) const {
    if (sequences_.source.empty() && sequences_.target.empty()) return;
    throw Error(ErrorKind::kMisuse,
                sequences_.source.empty() ? "--target-sequence" : "--source-sequence",
                "given with " + printable(path), "the JSON of one 'cairn align' alone");
  }

  void add_input(const std::string& role, Json description) {
    report_.provenance.inputs.push_back(reported_input(role, std::move(description)));
  }
  std::string prefix() const { return several_ ? fmt::format("r{}-", count_) : std::string(); }
  std::string role(const std::string& name) const {
    return several_ ? fmt::format("{} {}", name, count_) : name;
  }

  report::Report report_;
  const CommonArguments& common_;
  Sequences sequences_;
  bool several_;
  std::size_t count_ = 0;
  Json inputs_ = Json::array();
  Json options_ = Json::object();
  std::vector<std::string> remarks_;
};

struct ReportArguments {
  CommonArguments common;
  std::vector<std::string> results;
  std::string title;
  std::string sequence;
  std::string source_sequence;
  std::string target_sequence;

  void add_to(const Command& command) {
    command
        .add_words("result", results,
                   "JSON of 'cairn align --json', folders of experiments, or maps")
        .required();
    command.add_text("-o,--output", common.report_path, "HTML file to write. Required", "FILE");
    command.add_text("--title", title, "Title of the report", "TEXT");
    add_sequence_to(command, "--sequence", sequence, "a map that is shown alone");
    add_sequence_to(command, "--source-sequence", source_sequence, "the source map of one result");
    add_sequence_to(command, "--target-sequence", target_sequence, "the target map of one result");
    common.add_to(command);
    common.add_threads_to(command);
    command.footer(
        "Reads the maps that a result names; leaves out maps that are missing or were changed.\n"
        "Shows iterations and matches if the result was written with --trace.\n"
        "\n"
        "Example: write a page for an experiment\n"
        "  cairn report results -o report.html\n"
        "Example: save a result, and write a page for it later\n"
        "  cairn align source.map target.map --confidence base,observations --trace \\\n"
        "      --json result.json\n"
        "  cairn report result.json -o report.html\n"
        "Example: show a map, and what its keyframes saw\n"
        "  cairn report desk.map --sequence rgbd_desk -o desk.html");
  }

  int run() {
    refuse_if(common.report_path.empty(), "--output", "not given", "the HTML file to write");
    require_outputs(common);
    Assembly assembly(begin_report(title, common), common,
                      {sequence, source_sequence, target_sequence}, results.size() > 1);
    for (const std::string& path : results) assembly.add_file(path);
    assembly.finish();
    write_report(assembly.report(), common);
    Json json = document("report", common, assembly.inputs(),
                         {{"title", text_or_null(title)}, {"output", common.report_path}});
    json["title"] = assembly.report().title;
    json["remarks"] = assembly.remarks();
    write_document(json, common);
    return kDone;
  }
};

}  // namespace

void add_report(const Command& program) {
  add_verb<ReportArguments>(
      program, "report",
      "Write results as one HTML page that works offline: 3D view, charts, tables");
}

}  // namespace cairn::cli
