// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>

#include "cairn/core/detail/csv.hpp"
#include "cairn/core/log.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/folds.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/arguments.hpp"
#include "support/json.hpp"

namespace cairn::cli {

/// A map and its description in documents.
struct LoadedMap {
  std::string path;
  LandmarkMap map;
  Json description;  ///< path, hash, counts
};

/// How `load_map` treats a file.
struct MapLoading {
  /// Which conventions apply if a file breaks those of its format: those of its "data", or those of the
  /// "format".
  std::string convention = "data";
  /// Whether it is an error, not a remark, if something is left out.
  bool strict = false;

  /// Adds --convention.
  void add_to(const Command& command);
  /// @throws Error (misuse) naming --convention
  void validate() const;
};

/// @param path path of a file, or "-" for stdin
/// @param with_hash whether to compute the hash even if no document or report was requested
LoadedMap load_map(const std::string& path, const CommonArguments& common,
                   const MapLoading& loading = {}, bool with_hash = false);

/// Adds --models, which names the models that splats were trained on.
/// @param how_many e.g. "one for each"
void add_models_to(const Command& command, std::vector<std::string>& models,
                   const std::string& how_many);

/// Reads the model that a splat was trained on, and moves it into the splat's frame by nerfstudio's
/// dataparser_transforms.json beside the splat, if there is one. Adds the model to the map's description.
/// @throws Error (input) as load_map()
LandmarkMap load_model(const std::string& path, LoadedMap& map, const CommonArguments& common);

/// A log that throws the first loss as an Error (input) if `strict`, and passes on everything else.
LogSink strict_log(LogSink log, bool strict);

/// The first bytes of a file, from which its kind is recognised; empty if there is no such file, or for
/// "-".
std::string beginning_of(const std::string& path);

/// @throws Error (input) for a map of free scale, for which displacements in metres mean nothing
void require_metres(const LandmarkMap& map, const std::string& path);

/// Fails before long work, rather than after it, if a file could not be written.
/// @throws Error (storage) if `path` is a folder, or if its folder does not exist
void require_folder_of(const std::string& path);

/// Checks --json, --csv and --report as require_folder_of() does. Also checks that at most one output
/// goes to stdout, and that this tool can write reports.
/// @throws Error (storage), (misuse)
void require_outputs(const CommonArguments& common);

/// Same as require_folder_of(). The extension must also name a map format.
/// @throws Error (misuse) naming `option`
void require_map_path(const std::string& path, const std::string& option);

/// Names of the map formats of a single file, which can go to stdout, for help and messages.
std::string stdout_formats_text();

/// Same as require_map_path(), or "-" for stdout with the name of the format. A format's name with a
/// file is refused.
void require_map_output(const std::string& path, const std::string& format,
                        const std::string& option);

/// Checks that at most one of these paths is "-".
/// @throws Error (misuse) naming both options
void require_one_stdout(std::initializer_list<std::pair<const char*, const std::string*>> outputs);

/// Writes to a file, whole or not at all, or to stdout for "-".
void write_text(const std::string& text, const std::string& path);

/// Fails before long work if a map in this format could not be written at `path`: same as
/// require_folder_of(). If the format is a folder, it must be new or empty.
/// @throws Error (storage), (misuse)
void require_place_of(const std::string& path, const MapFormat& format);

/// Writes a map, and logs what its format does not hold.
/// @param log empty: the console
void save_map(const LandmarkMap& map, const std::string& path, const CommonArguments& common,
              const MapWriteOptions& options = {}, LogSink log = {});

/// The head that every document has; `schema` is e.g. "align".
Json document(const std::string& schema, const CommonArguments& common, Json inputs, Json options,
              unsigned version = 1);

/// The fields of an options struct, by name; null for a number that is not given or not finite.
Json options_of(const OptionTable& table, const void* options);

/// A document as the text of a file; bytes that are not UTF-8 are replaced.
std::string to_text(const Json& json);

/// Writes a document to the path of --json; does nothing if it was not given.
void write_document(const Json& json, const CommonArguments& common);

/// Writes a table to the path of --csv; does nothing if it was not given.
void write_rows(const detail::Csv& rows, const CommonArguments& common);

/// Description of an input file in documents: its path, and its hash if there will be a document or
/// report.
/// @param with_hash whether to compute the hash even if there will be none
Json describe_file(const std::string& path, const CommonArguments& common, bool with_hash = false);

/// 16 numbers, row-major, four per line, that parse back exactly.
std::string matrix_text(const Similarity3& pose);
void write_pose(const std::filesystem::path& path, const Similarity3& pose);

Json to_json(const Camera& camera);
Json to_json(const Rigid3& pose);
Json to_json(const Matrix4d& matrix);
Json to_json(const Eigen::Vector3d& vector);
Json to_json(const Matrix6d& matrix);
Json to_json(const Matrix7d& matrix);
Json to_json(const PoseError& error);
/// @param map map to whose frames the fold refers
/// @param other name of the map that shows the fold
Json fold_json(const MapFold& fold, const LandmarkMap& map, const std::string& other);
/// Count, rmse, mean, median, std, min, percentile_95, max.
Json to_json(const ErrorStatistics& statistics);
template <class Value>
Json to_json(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}
/// Statistics of angles, from radians.
ErrorStatistics in_degrees(ErrorStatistics radians);
/// Null for an option that was not given.
Json text_or_null(const std::string& text);

/// "metres" or "free".
std::string to_string(LengthUnit unit);

}  // namespace cairn::cli
