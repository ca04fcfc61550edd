// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/align.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <list>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/detail/csv.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/folds.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/point_set.hpp"

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"
#include "support/hints.hpp"
#include "support/interrupt.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

struct PairOfPaths {
  std::string source;
  std::string target;
};

std::vector<PairOfPaths> read_list(const std::string& list) {
  std::string text = read_file(list == "-" ? "/dev/stdin" : list);
  if (!text.ends_with('\n')) text += '\n';
  const std::vector<detail::CsvRow> rows = detail::parse_csv(text, list);
  const auto column = [&](std::string_view name) {
    const auto& header = rows.front().cells;
    const auto found = std::find(header.begin(), header.end(), name);
    reject_if(found == header.end(), fmt::format("{}:1", list), fmt::format("no column {}", name),
              "a header with the columns source and target");
    return static_cast<std::size_t>(found - header.begin());
  };
  const std::size_t source = column("source");
  const std::size_t target = column("target");
  std::vector<PairOfPaths> pairs;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const std::vector<std::string>& cells = rows[i].cells;
    if (cells.size() == 1 && cells.front().empty()) continue;  // an empty line
    reject_if(
        cells.size() <= std::max(source, target) || cells[source].empty() || cells[target].empty(),
        fmt::format("{}:{}", list, rows[i].line), "a row without source or target",
        "the paths of two maps");
    pairs.push_back({cells[source], cells[target]});
  }
  reject_if(pairs.empty(), list, "lists no pair", "a row with the paths of two maps");
  return pairs;
}

// Maps that were used last, prepared.
class Maps {
 public:
  Maps(const AlignOptions& options, const CommonArguments& common)
      : common_(common), prepare_{.points = options.points} {}

  struct One {
    PreparedMap map;
    LengthUnit unit = LengthUnit::kMetres;
  };
  One get(const std::string& path) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(maps_.begin(), maps_.end(),
                                    [&](const auto& one) { return one.first == path; });
    if (found != maps_.end()) {
      maps_.splice(maps_.begin(), maps_, found);
      return maps_.front().second;
    }
    const LoadedMap loaded = load_map(path, common_);
    maps_.emplace_front(path, One{PreparedMap(loaded.map, prepare_, {.seed = common_.seed}),
                                  loaded.map.info().length_unit});
    if (maps_.size() > kKept) maps_.pop_back();
    return maps_.front().second;
  }

 private:
  static constexpr std::size_t kKept = 64;

  const CommonArguments& common_;
  PrepareOptions prepare_;
  std::mutex mutex_;
  std::list<std::pair<std::string, One>> maps_;  // last used first
};

// What came of a pair; of one whose maps cannot be aligned at all, why.
struct PairResult {
  std::optional<StrategyResult> result;
  std::string error;
};

PairResult aligned(const PairOfPaths& pair, AlignOptions options, bool gravity, Maps& maps,
                   const Execution& execution) {
  PairResult result;
  try {
    const Maps::One source = maps.get(pair.source);
    const Maps::One target = maps.get(pair.target);
    reject_if(!scale_range(options, source.unit, target.unit) && source.unit != target.unit,
              pair.source, "one map is in metres, one of free scale",
              "maps of one unit with --no-scale");
    if (gravity) options.gravity = gravity_prior(source.map, target.map);
    StrategyResult one;
    one.alignment = align(source.map, target.map, options, execution);
    if (one.alignment.registration.status == RegistrationStatus::kCancelled) {
      throw Error(ErrorKind::kCancelled, "align", "cancelled", "");
    }
    one.method = options.method;
    one.confidence = "base";
    one.length_unit = target.unit;
    one.matches = one.alignment.registration.matches.size();
    one.overlap_radius = options.overlap_radius.value_or(one.alignment.radius);
    result.result = std::move(one);
  } catch (const Error& error) {
    // Maps that cannot be aligned cost no other pair; a wrong command line does.
    if (error.kind() == ErrorKind::kCancelled || error.kind() == ErrorKind::kMisuse) throw;
    result.error = error.what();
  }
  return result;
}

// `align --pairs`: aligns each pair of a list, reading and preparing each map once as long as it is in use.
// @param list a CSV file with columns source and target, or "-"
// @param options of all pairs; `scale` also for maps of free scale
// @param gravity whether the maps know where down is
// @param recorded what the document says of the options
// @return exit code: kDone if all pairs are aligned
int align_pairs(const std::string& list, const AlignOptions& options, bool gravity,
                const Json& recorded, const CommonArguments& common) {
  const std::vector<PairOfPaths> pairs = read_list(list);
  const Console console = common.console();
  const auto progress = console.progress("aligning");
  const Executor executor = common.executor();
  Execution each = common.execution();
  // Many pairs are the better work to share out.
  if (pairs.size() >= executor.threads()) each.executor = Executor(1);
  Maps maps(options, common);
  std::mutex mutex;  // of the results
  Json results = Json::array();
  const auto write = [&](bool interrupted) {
    Json json = document("align_pairs", common, {{"pairs", {{"path", list}}}}, recorded);
    json["interrupted"] = interrupted;
    json["results"] = results;
    write_document(json, common);
  };
  std::size_t trusted = 0;
  try {
    // At once, and not when the pairs at work have stopped, which may come too late. A pipe may block for ever.
    const std::stop_callback on_interrupt(interrupt_requests(), [&]() noexcept {
      const std::lock_guard lock(mutex);
      if (common.json_path == "-") return;
      try {
        write(true);
      } catch (const std::exception&) {  // the program ends anyway
      }
    });
    executor.in_order(
        pairs.size(), 2 * std::size_t{executor.threads()},
        [&](std::size_t i) { return aligned(pairs[i], options, gravity, maps, each); },
        [&](std::size_t i, const PairResult& found) {
          const auto& [source, target] = pairs[i];
          Json json = found.result ? to_json(*found.result, HistoryDetail::kNone)
                                   : Json{{"status", "failed"}, {"reason", found.error}};
          json["source"] = source;
          json["target"] = target;
          {
            const std::lock_guard lock(mutex);
            results.push_back(std::move(json));
          }
          std::string line = fmt::format("{} -> {}: ", source, target);
          if (found.result) {
            const Alignment& alignment = found.result->alignment;
            trusted += has_answer(alignment) ? 1 : 0;
            line += status_of(alignment);
            if (alignment.probability) line += " " + probability_text(*alignment.probability);
            if (!has_answer(alignment)) line += ": " + alignment.reason;
          } else {
            line += "failed: " + found.error;
          }
          console.print(line + "\n");
          std::fflush(stdout);  // for who follows a file
          if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(pairs.size()));
        });
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCancelled) throw;
    console.print("interrupted: {} of {} pairs were tried, {} aligned\n", results.size(),
                  pairs.size(), trusted);
    write(true);
    throw;
  }
  console.print("{} of {} pairs aligned\n", trusted, pairs.size());
  if (trusted < pairs.size()) {
    console.print("  hint: Align one of the others alone, which shows its candidates and hints.\n");
  }
  write(false);
  return trusted == pairs.size() ? kDone : kNoTrustworthyAlignment;
}

constexpr double kDefaultOverlapRadius = 0.05;  // metres

bool any_given(const std::vector<Option>& options) {
  return std::any_of(options.begin(), options.end(), [](Option option) { return option.given(); });
}

bool have_descriptors_of_one_kind(const LandmarkMap& a, const LandmarkMap& b) {
  const auto& of_a = a.landmarks().descriptors;
  const auto& of_b = b.landmarks().descriptors;
  return of_a && of_b && of_a->kind == of_b->kind;
}

std::string_view unit_text(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "in metres" : "of free scale";
}

// The unit of both maps, which must be the same: a rigid pose between different scales has no meaning.
LengthUnit common_unit(const LoadedMap& source, const LoadedMap& target) {
  const LengthUnit unit = source.map.info().length_unit;
  reject_if(unit != target.map.info().length_unit, source.path,
            fmt::format("is {}, but {} {}", unit_text(unit), target.path,
                        unit_text(target.map.info().length_unit)),
            "maps of one unit");
  return unit;
}

struct AlignArguments {
  CommonArguments common;
  std::string source;
  std::string target;
  std::string pairs;
  std::vector<std::string> models;
  std::string confidence = "base";
  PoseArguments initial;
  std::string truth;
  std::string output;
  std::string format;  // of an output to stdout
  std::string pose;
  std::string pose_format = "matrix";
  std::string camera;
  std::string source_sequence;
  std::string target_sequence;
  std::string method;
  bool gravity = false;
  bool estimate_scale = false;
  bool with_scale = false;  // whether it is estimated for these maps
  bool anywhere = false;
  bool by_parts = false;
  bool no_parts = false;
  AlignOptions options;
  Rigid3 initial_pose;
  std::vector<Option> of_icp_alone;
  std::vector<Option> of_guesses;  // a search has none of these
  std::vector<Option> initials;

  void add_to(const Command& command) {
    command.add_text("source", source,
                     "Map to move: " + all_formats().titles_text() + "; - for stdin");
    command.add_text("target", target, "Map to align it to");
    const Option list = command.add_text("--pairs", pairs,
                                         "Align each pair in a CSV file (columns source and "
                                         "target) instead of two maps; - for stdin",
                                         "FILE|-");
    add_models_to(command, models, "of the source and of the target");
    command.add_text("--confidence", confidence,
                     "Confidence metric of the landmarks: " + confidence_help() +
                         ". Several, separated by commas, are compared",
                     "METRIC,...");
    initial.add_to(command, "initial", "Initial pose, target_from_source");
    command.add_text(
        "--truth", truth,
        "True target_from_source, 16 numbers or the JSON of an alignment; prints the pose errors",
        "FILE");
    command.add_text(
        "-o,--output", output,
        "Write the aligned source map, in the target's frame; - for stdout, with --format",
        "FILE|-");
    command.add_text("--format", format, "Format of a map on stdout: " + stdout_formats_text(),
                     "NAME");
    command.add_text(
        "--pose", pose,
        "Write target_from_source as 16 numbers, row-major, if the pose is aligned; - for stdout",
        "FILE|-");
    command.add_text("--pose-format", pose_format,
                     "Format of --pose: matrix, or tum (one line: 0 tx ty tz qx qy qz qw)", "NAME");
    command.add_text(
        "--method", method,
        "robust (graduated kernel, landmark covariances; confidences are weights) or icp (the "
        "paper's) (default: robust; icp if an option is given that only icp has)",
        "METHOD");
    add_options(command, AlignOptions::table, &options);
    of_icp_alone = add_options(command, IcpOptions::table, &options.icp);
    std::erase_if(of_icp_alone, [](const Option& one) { return one.name() == "--max-iterations"; });
    command.add_text("--camera", camera,
                     fmt::format("Camera of all frames, for reprojection errors: {}", kCameraHelp),
                     "CAMERA");
    common.add_report_to(command, "the verdict, the maps in 3D at each iteration, and charts");
    add_sequence_to(command, "--source-sequence", source_sequence, "the source map");
    add_sequence_to(command, "--target-sequence", target_sequence, "the target map");
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    add_search_to(command);
    command.list_under("Search",
                       {"--anywhere", "--effort", "--time-limit", "--no-scale", "--no-deformation",
                        "--by-parts", "--no-parts", "--one-to-one", "--max-iterations"});
    command.list_under("Verdict",
                       {"--min-probability", "--prior-odds", "--no-verdict", "--overlap-radius"});
    command.list_under("Maps and files",
                       {"--min-observations", "--camera", "--format", "--pose-format", "--trace",
                        "--source-sequence", "--target-sequence"});
    for (const Option& option : of_icp_alone) option.under("ICP of the paper");
    list.excludes(command.option("source")).excludes(command.option("target"));
    for (const char* const of_one :
         {"--confidence", "--models", "--initial", "--initial-matrix", "--truth", "--output",
          "--format", "--pose", "--pose-format", "--camera", "--method", "--trace", "--report",
          "--no-verdict"}) {
      list.excludes(command.option(of_one));
    }
    for (const Option& option : of_icp_alone) list.excludes(option);
    command.footer(
        "Example: align two maps of one place without an initial pose\n"
        "  cairn align later.map earlier.map\n"
        "Example: read a map from a pipe, and write the pose for other programs\n"
        "  cairn convert later.map - --format binary | cairn align - earlier.map --pose pose.txt\n"
        "Example: align many pairs; each map is read once\n"
        "  cairn align --pairs pairs.csv --json results.json\n"
        "Example: refine an initial pose with the paper's ICP, with two metrics, and save the "
        "result\n"
        "  cairn align later.map earlier.map --method icp --confidence base,observations \\\n"
        "      --initial \"0.5 -0.5 0 0 0 30\" --json result.json");
  }

  int run() {
    if (!pairs.empty()) return run_pairs();
    for (const auto& [name, path] : {std::pair{"source", &source}, {"target", &target}}) {
      refuse_if(path->empty(), name, "not given", "two maps, or --pairs");
    }
    // What the command line says is checked before any file is read.
    refuse_if(!models.empty() && models.size() != 2, "--models",
              fmt::format("{} given", models.size()), "two: of the source and of the target");
    const std::vector<Strategy> strategies = parse_strategies(confidence);
    check_outputs(strategies.size());
    check_options();
    const auto given_camera =
        camera.empty() ? std::nullopt : std::optional(load_camera(camera).camera);
    const Similarity3 guess = initial.guess(estimate_scale);
    initial_pose = guess.rigid();
    std::optional<Similarity3> true_pose;
    if (!truth.empty()) {
      true_pose = !options.scale_where_free || !is_robust() ? read_pose_file(truth)
                                                            : read_similarity_file(truth);
    }

    LoadedMap source_map = load_map(source, common);
    LoadedMap target_map = load_map(target, common);
    std::optional<LandmarkMap> given_source;  // if its model is aligned in its place
    if (!models.empty()) {
      given_source = put_model_into(source_map, models[0]);
      put_model_into(target_map, models[1]);
    }
    complete_options();
    with_scale =
        scale_range(options, source_map.map.info().length_unit, target_map.map.info().length_unit)
            .has_value();
    refuse_scale_in_tum();
    const LengthUnit unit =
        with_scale ? target_map.map.info().length_unit : common_unit(source_map, target_map);
    if (!options.overlap_radius && unit == LengthUnit::kMetres) {
      options.overlap_radius = kDefaultOverlapRadius;
    }
    for (LoadedMap* const loaded : {&source_map, &target_map}) {
      if (given_camera) loaded->map = with_camera(loaded->map, *given_camera);
      loaded->description["kept_landmarks"] =
          landmarks_to_align(loaded->map, options.points).size();
    }
    if (has_initial()) options.prior = PosePrior{.target_from_source = guess};
    if (gravity) options.gravity = gravity_prior(source_map.map, target_map.map);
    AlignOptions traced = options;
    traced.trace = options.trace || !common.report_path.empty();
    ReportedPair shown = reported_pair(source_map, target_map, unit, true_pose);
    shown.results =
        align_by_all(source_map.map, target_map.map, strategies, traced, true_pose, common);
    const std::vector<StrategyResult>& results = shown.results;

    const Folds folds = folds_of(results.front().alignment, source_map, target_map);
    write_answer(results.front().alignment, given_source ? *given_source : source_map.map,
                 target_map, unit, folds.of_source);
    Json inputs = {{"source", source_map.description}, {"target", target_map.description}};
    if (true_pose) {
      inputs["truth"] = {{"path", truth},
                         {"target_from_source", to_json(true_pose->rigid())},
                         {"scale", true_pose->scale()}};
    }
    Json json =
        document("align", common, std::move(inputs), options_json(strategies), kAlignmentVersion);
    json["results"] = Json::array();
    for (const StrategyResult& one : results) {
      json["results"].push_back(
          to_json(one, options.trace ? HistoryDetail::kMatches : HistoryDetail::kNone));
    }
    json["folds"] = folds.json;
    write_document(json, common);
    print(source_map, target_map, results, unit);
    common.console().print(folds.text);
    if (!common.report_path.empty()) write_report(make_report(shown, json), common);
    const bool all_answered = std::all_of(
        results.begin(), results.end(), [](const auto& one) { return has_answer(one.alignment); });
    return all_answered ? kDone : kNoTrustworthyAlignment;
  }

 private:
  void add_search_to(const Command& command) {
    const Option everywhere = command.add_flag(
        "--anywhere", anywhere,
        "Search without an initial pose; the default unless --initial or --method icp is given");
    for (const char* const other :
         {"--initial", "--initial-matrix", "--method", "--max-iterations", "--one-to-one"}) {
      everywhere.excludes(command.option(other));
    }
    for (const Option& option : of_icp_alone) everywhere.excludes(option);
    command.add_flag(
        "--gravity", gravity,
        "Allow only rotations about the vertical and tilts of up to 10 degrees; z is up "
        "in a map without a stored vertical");
    const Option scale = command.add_flag(
        "--scale", estimate_scale,
        "Also estimate the scale of the source, from 1/20 to 20 times the target's; "
        "the default if the unit of a map is free");
    command.option("--no-scale").excludes(scale);
    const Option parts =
        command.add_flag("--by-parts", by_parts,
                         "Always align the parts of the maps separately too; prints "
                         "each part's pose and how far a map bends");
    command
        .add_flag("--no-parts", no_parts,
                  "Never align parts (default: if large maps with descriptors are not aligned as a "
                  "whole, their parts are tried)")
        .excludes(parts);
    for (const char* const name : {"--initial", "--initial-matrix"}) {
      initials.push_back(command.option(name));
    }
    of_guesses = {command.option("--max-iterations"), command.option("--one-to-one")};
  }

  int run_pairs() {
    require_outputs(common);
    check_options();
    complete_options();
    with_scale = estimate_scale;
    return align_pairs(pairs, options, gravity, options_json(parse_strategies("base")), common);
  }

  // @return the map itself
  LandmarkMap put_model_into(LoadedMap& loaded, const std::string& path) const {
    LandmarkMap model = load_model(path, loaded, common);
    require_one_frame(loaded.map, model, loaded.path);
    return std::exchange(loaded.map, std::move(model));
  }

  // What each map shows to be folded in the other, at a trusted pose.
  struct Folds {
    std::vector<FrameIndex> of_source;  // to be left out of the output
    Json json = Json::array();
    std::string text;
  };

  Folds folds_of(const Alignment& alignment, const LoadedMap& source_map,
                 const LoadedMap& target_map) const {
    Folds result;
    if (!has_answer(alignment)) return result;
    const std::array<MapInWorld, 2> maps = {MapInWorld{&source_map.map, *alignment.estimate},
                                            MapInWorld{&target_map.map, Similarity3()}};
    const std::array<std::string, 2> paths = {source_map.path, target_map.path};
    const auto folds = find_folds(maps);
    for (const std::size_t i : {0U, 1U}) {
      if (!folds[i]) continue;
      Json json = fold_json(*folds[i], *maps[i].map, paths[1 - i]);
      json["map"] = to_string(i == 0 ? MapRole::kSource : MapRole::kTarget);
      result.json.push_back(std::move(json));
      result.text += "\n" + fold_text(*folds[i], *maps[i].map, paths[i], paths[1 - i]);
      if (i == 0 && !output.empty() && models.empty())
        result.text += "; they are left out of " + output;
      result.text += "\n";
    }
    // A model is not what is written.
    if (folds[0] && models.empty()) result.of_source = folds[0]->frames;
    return result;
  }

  // Writes the map and the pose that are asked for, if the pose is aligned.
  void write_answer(const Alignment& first, const LandmarkMap& source_map,
                    const LoadedMap& target_map, LengthUnit unit,
                    const std::vector<FrameIndex>& folded) const {
    if (has_answer(first)) {
      if (!output.empty()) {
        LandmarkMap aligned = transformed(
            folded.empty() ? source_map : without_frames(source_map, folded), *first.estimate);
        if (aligned.info().length_unit != unit) aligned = with_length_unit(aligned, unit);
        // The frame is the target's now, and so is what is known of its place on the Earth.
        if (const auto& georeference = target_map.map.info().georeference) {
          aligned = with_georeference(aligned, georeference);
        }
        save_map(aligned, output, common, {.format = format});
      }
      if (!pose.empty()) write_pose_file(*first.estimate);
    } else {
      for (const std::string& path : {output, pose}) {
        if (!path.empty())
          common.console().remark(path + " is not written: the pose is not aligned");
      }
    }
  }

  // Sets what no flag sets by itself.
  void complete_options() {
    options.method = is_robust() ? AlignMethod::kRobust : AlignMethod::kIcp;
    if (estimate_scale) options.scale = ScaleRange();
    if (by_parts) options.parts = PartsUse::kAlways;
    if (no_parts) options.parts = PartsUse::kNever;
  }

  bool is_robust() const {
    if (anywhere || !method.empty()) return method != "icp";
    return !any_given(of_icp_alone);
  }

  bool has_initial() const { return any_given(initials); }

  void check_options() const {
    with_option_names({AlignOptions::table, IcpOptions::table}, [&] { options.validate(); });
    refuse_if(!method.empty() && method != "icp" && method != "robust", "--method",
              printable(method) + " is no method", "icp or robust");
    for (const Option& option : of_icp_alone) {
      refuse_if(method == "robust" && option.given(), option.name(), "given with --method robust",
                "--method icp");
    }
    refuse_if(!is_robust() && options.one_to_one, "--one-to-one",
              "given with an option that only icp has", "--method robust");
    for (const Option& option : of_guesses) {
      refuse_if(is_robust() && !has_initial() && option.given(), option.name(),
                "given, but the search has no such option", "--initial, or --method icp");
    }
    refuse_if(!is_robust() && estimate_scale, "--scale", "given with icp", "--method robust");
    refuse_if(!is_robust() && by_parts, "--by-parts",
              "given with icp, which aligns whole maps only", "--method robust");
  }

  void refuse_scale_in_tum() const {
    if (pose_format != "tum" || !(estimate_scale || with_scale)) return;
    throw Error(ErrorKind::kMisuse, "--pose-format", "tum holds no scale, but one is estimated",
                "matrix, or --no-scale");
  }

  void check_outputs(std::size_t strategies) {
    refuse_if(pose_format != "matrix" && pose_format != "tum", "--pose-format",
              printable(pose_format), "matrix or tum");
    if (!output.empty()) require_map_output(output, format, "--output");
    if (!pose.empty() && pose != "-") require_folder_of(pose);
    refuse_if(output.empty() && !format.empty(), "--format", "given without --output -", "");
    for (const auto& [option, path] : {std::pair{"--output", &output}, {"--pose", &pose}}) {
      refuse_if(!path->empty() && strategies > 1, option, "several strategies give several results",
                "one --confidence");
    }
    refuse_scale_in_tum();
    require_one_stdout({{"--json", &common.json_path}, {"--output", &output}, {"--pose", &pose}});
    refuse_if(source == "-" && target == "-", "target", "stdin is the source already", "a file");
    common.stdout_is_taken = output == "-" || pose == "-";
    require_outputs(common);
  }

  void write_pose_file(const Similarity3& target_from_source) const {
    std::string text = matrix_text(target_from_source);
    if (pose_format == "tum") {
      const Eigen::Quaterniond q = shown_quaternion(target_from_source.rigid());
      const Eigen::Vector3d& t = target_from_source.translation();
      text =
          fmt::format("0 {} {} {} {} {} {} {}\n", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    }
    write_text(text, pose);
  }

  Json options_json(const std::vector<Strategy>& strategies) const {
    Json names = Json::array();
    for (const Strategy& strategy : strategies) names.push_back(strategy.name);
    Json json = {{"confidence", std::move(names)},
                 {"method", is_robust() ? "robust" : "icp"},
                 {"anywhere", is_robust() && !has_initial()},
                 {"parts", by_parts   ? "always"
                           : no_parts ? "never"
                                      : "where_refused"},
                 {"gravity", gravity},
                 {"estimate_scale", with_scale},
                 {"initial", to_json(initial_pose)},
                 {"camera", text_or_null(camera)}};
    json.update(options_of(IcpOptions::table, &options.icp));
    json["fast"] = options.icp.coarse_to_fine;
    json.erase("coarse_to_fine");
    json.update(options_of(AlignOptions::table, &options));
    if (!options.judge) json["min_probability"] = nullptr;
    return json;
  }

  // What is known before the maps are aligned.
  ReportedPair reported_pair(const LoadedMap& source_map, const LoadedMap& target_map,
                             LengthUnit unit, const std::optional<Similarity3>& true_pose) const {
    ReportedPair pair;
    pair.source_name = file_name(source_map.path);
    pair.target_name = file_name(target_map.path);
    pair.source = &source_map.map;
    pair.target = &target_map.map;
    pair.source_images = images_of(source_map.map, source_sequence, common);
    pair.target_images = images_of(target_map.map, target_sequence, common);
    pair.unit = unit;
    pair.points = options.points;
    pair.initial = initial_pose;
    pair.truth = true_pose;
    return pair;
  }

  report::Report make_report(const ReportedPair& pair, const Json& json) const {
    report::Report report = begin_report(pair.source_name + " to " + pair.target_name, common);
    report.subtitle = subtitle_of(pair.results, pair.unit);
    set_provenance(report, json);
    add_pair(report, pair);
    return report;
  }

  void print(const LoadedMap& source_map, const LoadedMap& target_map,
             const std::vector<StrategyResult>& results, LengthUnit unit) const {
    const Console console = common.console();
    for (const auto& [role, loaded] : {std::pair{"source", &source_map}, {"target", &target_map}}) {
      const bool is_model = loaded->description.contains("model");
      console.print(
          "{}  {}: {} of {} landmarks\n", role,
          is_model ? fmt::format("{} (model of {})",
                                 *loaded->description.at("model").at("path").text(), loaded->path)
                   : loaded->path,
          loaded->description.at("kept_landmarks").dump(-1), loaded->map.landmark_count());
    }
    console.print("\n" + alignment_table(results, unit));
    for (const StrategyResult& each : results) {
      console.print(results.size() > 1 ? fmt::format("\nconfidence {}:", each.confidence) : "");
      console.print(alignment_text(each, unit, with_scale, by_parts));
      if (has_answer(each.alignment) && with_scale &&
          !have_descriptors_of_one_kind(source_map.map, target_map.map)) {
        console.print(
            "  not in these standard deviations: a deformation of the maps, which only descriptors "
            "show\n");
      }
      if (!has_answer(each.alignment)) {
        console.print(hints(each.alignment, source_map.map, target_map.map, options, with_scale));
      }
    }
    if (!has_answer(results.front().alignment)) return;
    for (const std::string& path : {output, pose}) {
      if (!path.empty() && path != "-") console.print("\nwrote {}\n", path);
    }
  }
};

}  // namespace

void add_align(const Command& program) {
  add_verb<AlignArguments>(program, "align",
                           "Find the pose of a source map in a target map, and judge it");
}

}  // namespace cairn::cli
