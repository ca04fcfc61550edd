// SPDX-License-Identifier: BSD-3-Clause
#include "support/documents.hpp"

#include <cmath>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/detail/files_read.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/formats/foreign/conventions.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/report/report.hpp"

#include "support/interrupt.hpp"

namespace cairn::cli {
namespace {

constexpr const char* kStdin = "/dev/stdin";

bool wants_hash(const CommonArguments& common, bool with_hash) {
  return with_hash || !common.json_path.empty() || !common.report_path.empty();
}

Json rows_of(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(matrix(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

void MapLoading::add_to(const Command& command) {
  command
      .add_text(
          "--convention", convention,
          "How to read a file that breaks the conventions of its format. data: by the conventions "
          "under which landmarks project to their observations; format: by those of the format",
          "data|format")
      .shows("data");
}

void MapLoading::validate() const {
  if (convention == "data" || convention == "format") return;
  throw Error(ErrorKind::kMisuse, "--convention", printable(convention), "data or format");
}

void add_models_to(const Command& command, std::vector<std::string>& models,
                   const std::string& how_many) {
  command.add_words(
      "--models", models,
      "For Gaussian splats: align the models that the splats were trained on instead, " + how_many +
          ". Each must be in the frame of its splat. "
          "nerfstudio's dataparser_transforms.json beside a map is applied to its "
          "model",
      "MODEL...");
}

LandmarkMap load_model(const std::string& path, LoadedMap& map, const CommonArguments& common) {
  LoadedMap model = load_map(path, common);
  map.description["model"] = std::move(model.description);
  const auto training =
      std::filesystem::path(map.path).parent_path() / "dataparser_transforms.json";
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(training, ignored)) return std::move(model.map);
  return with_length_unit(transformed(model.map, read_similarity_file(training.string())),
                          LengthUnit::kFree);
}

LogSink strict_log(LogSink log, bool strict) {
  if (!strict) return log;
  return [log = std::move(log)](const Remark& remark) {
    reject_if(remark.kind == RemarkKind::kLoss, "--strict", std::string(remark.text),
              "a file that can be read completely");
    if (log) log(remark);
  };
}

std::string beginning_of(const std::string& path) {
  std::error_code ignored;
  if (path == "-" || !std::filesystem::is_regular_file(path, ignored)) return {};
  FileReader file(path);
  std::string first(4096, '\0');
  first.resize(file.read(first.data(), first.size()));
  return first;
}

LoadedMap load_map(const std::string& path, const CommonArguments& common,
                   const MapLoading& loading, bool with_hash) {
  const Console console = common.console();
  const Execution execution{.stop = interrupt_requests(),
                            .progress = console.progress("reading " + path),
                            .log = strict_log(console.log(), loading.strict)};
  LoadedMap loaded{path, {}, {}};
  std::vector<std::filesystem::path> files;
  {
    const detail::FilesRead read;
    loaded.map = all_formats().read(path == "-" ? kStdin : path, execution);
    files = read.paths();
  }
  std::string reread_as;
  if (loading.convention == "data") {
    const ConventionCheck check = check_conventions(loaded.map);
    // Few observations fit a wrong reading by chance. Half a pixel is not worth other numbers.
    constexpr std::size_t kFewest = 50;
    ConventionReading but_for_pixels = check.best.reading;
    but_for_pixels.pixel_centre = PixelCentreReading::kAsRead;
    if (check.verdict == ConventionVerdict::kOther && check.observations >= kFewest &&
        !(but_for_pixels == ConventionReading{})) {
      reread_as = describe(check.best.reading);
      console.remark(
          "{}: {}; read with these conventions (--convention format of cairn convert "
          "and cairn info keeps the format's)",
          path, check.sentence);
      loaded.map = reread(std::move(loaded.map), check.best.reading);
    }
  }
  loaded.description = describe_file(path, common, with_hash);
  std::error_code ignored;
  if (wants_hash(common, with_hash) && std::filesystem::is_directory(path, ignored)) {
    loaded.description["hash"] = detail::hash_files(files);
  }
  loaded.description["frames"] = loaded.map.frame_count();
  loaded.description["landmarks"] = loaded.map.landmark_count();
  loaded.description["observations"] =
      loaded.map.has_observations() ? Json(loaded.map.observation_count()) : Json(nullptr);
  if (!reread_as.empty()) loaded.description["reread_as"] = reread_as;
  return loaded;
}

void require_metres(const LandmarkMap& map, const std::string& path) {
  if (map.info().length_unit == LengthUnit::kMetres) return;
  throw Error(ErrorKind::kInput, path, "is of free scale",
              "a map in metres, the unit of the displacements");
}

void require_folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw Error(ErrorKind::kStorage, path, "cannot be written: it is a folder", "a file");
  }
  if (!folder.empty() && !std::filesystem::is_directory(folder, ignored)) {
    throw Error(ErrorKind::kStorage, path,
                "cannot be written: there is no folder " + folder.string(), "");
  }
}

void require_outputs(const CommonArguments& common) {
  refuse_if(common.json_path == "-" && common.csv_path == "-", "--csv", "stdout is taken by --json",
            "a file for one of them");
  require_folder_of(common.json_path);
  require_folder_of(common.csv_path);
  if (common.report_path.empty()) return;
  refuse_if(common.report_path == "-", "--report", "a page cannot be written to stdout", "a file");
  refuse_if(!report::has_viewer(), common.report_path,
            "cannot be written: this build of cairn has no viewer",
            "a build with -DCAIRN_WITH_VIEWER=ON, which takes Node.js and npm");
  require_folder_of(common.report_path);
}

void require_map_path(const std::string& path, const std::string& option) {
  const MapFormat* const format = all_formats().format_of_ending(path);
  refuse_if(format == nullptr, option, path + " names no map format",
            "a name that ends in " + all_formats().endings_text());
  require_place_of(path, *format);
}

void require_place_of(const std::string& path, const MapFormat& format) {
  if (!format.is_folder) return require_folder_of(path);
  std::error_code ignored;
  const std::filesystem::path folder = std::filesystem::path(path + "/").parent_path();
  if (!std::filesystem::is_directory(folder, ignored)) return require_folder_of(folder.string());
  refuse_if(!std::filesystem::is_empty(folder, ignored), path,
            "cannot be written: the folder is not empty", "a new or an empty folder");
}

void require_map_output(const std::string& path, const std::string& format,
                        const std::string& option) {
  if (path != "-") {
    refuse_if(!format.empty(), "--format", "given, but " + path + " names its format",
              option + " -");
    return require_map_path(path, option);
  }
  const MapFormat* const named = all_formats().find(format);
  refuse_if(named == nullptr || named->write_to == nullptr, "--format",
            format.empty() ? "not given, but stdout has no ending that names a format"
                           : printable(format) + " names no format of a single file",
            stdout_formats_text());
}

std::string stdout_formats_text() {
  std::vector<std::string_view> names;
  for (const MapFormat& format : all_formats().formats()) {
    if (format.write_to != nullptr) names.push_back(format.name);
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

void require_one_stdout(std::initializer_list<std::pair<const char*, const std::string*>> outputs) {
  std::string taken;
  for (const auto& [option, path] : outputs) {
    if (*path != "-") continue;
    refuse_if(!taken.empty(), option, fmt::format("stdout is taken by {}", taken),
              "a file for one of them");
    taken = option;
  }
}

void write_text(const std::string& text, const std::string& path) {
  if (path == "-") {
    print_raw(text);
  } else {
    write_file(path, [&](const ByteSink& sink) { sink(text); });
  }
}

void save_map(const LandmarkMap& map, const std::string& path, const CommonArguments& common,
              const MapWriteOptions& options, LogSink log) {
  const Console console = common.console();
  Execution execution;
  execution.progress = [show = console.progress("writing " + path), path,
                        stop = interrupt_requests()](double share) {
    if (stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, path, "writing was cancelled", "");
    }
    if (show) show(share);
  };
  execution.log = log ? std::move(log) : console.log();
  const MapFormat& format = all_formats().format_to_write(path, options);
  // Before anything is written: the log may refuse it.
  if (!format.holds_frames && map.frame_count() > 0) {
    execution.log(
        {fmt::format("{} holds landmarks only: {} frames and {} observations are left out", path,
                     map.frame_count(), map.observation_count()),
         RemarkKind::kLoss});
  }
  if (path == "-") {
    format.write_to(map, print_raw, options, execution);
  } else {
    all_formats().write(map, path, options, execution);
  }
}

Json describe_file(const std::string& path, const CommonArguments& common, bool with_hash) {
  // A pipe cannot be read a second time.
  std::error_code ignored;  // the reader explains it
  const bool can_hash =
      wants_hash(common, with_hash) && std::filesystem::is_regular_file(path, ignored);
  return {{"path", path}, {"hash", can_hash ? Json(hash_file(path)) : Json(nullptr)}};
}

Json document(const std::string& schema, const CommonArguments& common, Json inputs, Json options,
              unsigned version) {
  return {{"schema", {{"name", "cairn." + schema}, {"version", version}}},
          {"cairn_version", kVersion},
          {"inputs", std::move(inputs)},
          {"options", std::move(options)},
          {"seed", common.seed}};
}

Json options_of(const OptionTable& table, const void* options) {
  Json json = Json::object();
  for (const OptionField& field : table.fields) {
    const auto read = [](const auto* value) {
      using Value = std::decay_t<decltype(*value)>;
      if constexpr (requires { value->has_value(); }) {
        return to_json(*value);
      } else if constexpr (std::is_same_v<Value, double>) {
        return std::isfinite(*value) ? Json(*value) : Json(nullptr);
      } else {
        return Json(*value);
      }
    };
    json[field.name] = std::visit(read, field.value(const_cast<void*>(options)));
  }
  return json;
}

std::string to_text(const Json& json) {
  return json.dump(2) + "\n";
}

void write_document(const Json& json, const CommonArguments& common) {
  if (!common.json_path.empty()) write_text(to_text(json), common.json_path);
}

void write_rows(const detail::Csv& rows, const CommonArguments& common) {
  if (!common.csv_path.empty()) write_text(rows.text(), common.csv_path);
}

std::string matrix_text(const Similarity3& pose) {
  const Matrix4d matrix = pose.matrix();
  std::string text;
  for (int i = 0; i < 4; ++i) {
    text += fmt::format("{} {} {} {}\n", matrix(i, 0), matrix(i, 1), matrix(i, 2), matrix(i, 3));
  }
  return text;
}

void write_pose(const std::filesystem::path& path, const Similarity3& pose) {
  write_file(path, [&](const ByteSink& sink) { sink(matrix_text(pose)); });
}

Json to_json(const Camera& camera) {
  return {{"model", camera.model},
          {"width", camera.width},
          {"height", camera.height},
          {"parameters", camera.parameters}};
}

Json to_json(const Rigid3& pose) {
  return to_json(pose.matrix());
}

Json to_json(const Matrix4d& matrix) {
  return rows_of(matrix);
}

Json to_json(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

Json to_json(const Matrix6d& matrix) {
  return rows_of(matrix);
}

Json to_json(const Matrix7d& matrix) {
  return rows_of(matrix);
}

Json to_json(const PoseError& error) {
  return {{"rotation_deg", degrees(error.rotation_rad)},
          {"translation", error.translation},
          {"log_scale", error.log_scale}};
}

Json to_json(const ErrorStatistics& statistics) {
  return {{"count", statistics.count},
          {"rmse", statistics.rmse},
          {"mean", statistics.mean},
          {"median", statistics.median},
          {"std", statistics.standard_deviation},
          {"min", statistics.lowest},
          {"percentile_95", statistics.percentile_95},
          {"max", statistics.highest}};
}

ErrorStatistics in_degrees(ErrorStatistics radians) {
  for (double ErrorStatistics::*const field :
       {&ErrorStatistics::rmse, &ErrorStatistics::mean, &ErrorStatistics::median,
        &ErrorStatistics::standard_deviation, &ErrorStatistics::lowest,
        &ErrorStatistics::percentile_95, &ErrorStatistics::highest}) {
    radians.*field = degrees(radians.*field);
  }
  return radians;
}

Json fold_json(const MapFold& fold, const LandmarkMap& map, const std::string& other) {
  Json images = Json::array();
  for (const FrameIndex frame : fold.frames) {
    images.push_back(printable(map.frames().image_names[frame.value]));
  }
  return {{"images", std::move(images)},
          {"shown_by", other},
          {"apart", fold.apart},
          {"turned_deg", fold.turned_deg}};
}

Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

std::string to_string(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "metres" : "free";
}

}  // namespace cairn::cli
