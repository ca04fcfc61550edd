// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Options of every map reader.
struct MapReadOptions {
  Progress progress = {};
  std::stop_token stop = {};  ///< if requested, reading throws Error (cancelled)
  LogSink log = {};           ///< reports what was left out and why
};

struct MapWriteOptions {
  std::string format = {};                 ///< name of a MapFormat; empty: by the path's ending
  std::optional<int> native_version = {};  ///< std::nullopt: the lowest that holds the map
  bool ascii = false;                      ///< PLY and PCD: text instead of binary
  bool double_precision =
      false;  ///< PCD: positions as doubles, which PCL's point types cannot read
  Progress progress = {};
  LogSink log = {};  ///< reports what the format cannot hold
};

/// A file or folder to read a map from.
struct MapInput {
  std::filesystem::path path;
  std::optional<std::string> part = {};  ///< N of "path#N": selects one map of a file with several
  std::string_view first_bytes = {};     ///< of a file: at most its first 4096; of a folder none
  ByteSource* source = nullptr;          ///< of a file, at its start; null for a folder
};

/// A map format: a row of the table from which reading, writing, help and messages derive.
struct MapFormat {
  std::string name;   ///< name in options, e.g. "colmap-text"; unique in a registry
  std::string title;  ///< name in messages, e.g. "COLMAP text"
  /// Endings of paths for this format: an extension (".ply"), a file name ("reconstruction.json"), or "/"
  /// for a folder. Empty: written only if requested by name.
  std::vector<std::string> endings = {};
  bool is_folder = false;      ///< written as a folder of files
  bool holds_frames = true;    ///< false: landmarks only
  bool holds_several = false;  ///< a file may hold several maps; "path#N" selects one
  bool is_read = true;         ///< false: write-only; reading reports that
  /// Whether a file or folder has this format. Uses the path, its neighbours and the first bytes; does not
  /// read from the source.
  std::function<bool(const MapInput& input)> recognises = {};
  std::function<LandmarkMap(const MapInput& input, const MapReadOptions& options)> read = {};
  /// Writes a file as a stream of bytes. Empty, like `write`, if the format is read-only.
  std::function<void(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options)>
      write_to = {};
  /// Writes a folder, or several files, atomically.
  std::function<void(const LandmarkMap& map, const std::filesystem::path& path,
                     const MapWriteOptions& options)>
      write = {};

  bool is_written() const { return write_to != nullptr || write != nullptr; }
};

/// The map formats that a program knows; a value that is passed to readers and writers of maps.
class FormatRegistry {
 public:
  FormatRegistry() = default;
  /// @param formats tried from the last to the first when a map is read
  /// @throws Error (misuse) for a duplicate name
  explicit FormatRegistry(std::vector<MapFormat> formats);

  /// These formats and `more`, which are tried first.
  FormatRegistry extended_by(std::vector<MapFormat> more) const;

  std::span<const MapFormat> formats() const { return formats_; }
  /// Null if there is none of that name.
  const MapFormat* find(std::string_view name) const;
  /// Format for a path, by its ending; null if unknown.
  const MapFormat* format_of_ending(const std::filesystem::path& path) const;
  /// As text for help and messages: ".map, .txt, .cairn, .ply or .pcd".
  std::string endings_text() const;
  /// Formats that can be read, as text for help: "Cairn text, Cairn binary, PLY or PCD".
  std::string titles_text() const;
  /// Names of the formats that can be written, as text for help and messages.
  std::string written_names_text() const;

  /// The maps that are folders: the folder itself, or else those up to three folders below, such as its sparse/0.
  std::vector<std::filesystem::path> maps_of_folder(const std::filesystem::path& folder) const;

  /// Reads a map in any of the formats, recognised by content; of a folder the only one of maps_of_folder(). If the
  /// path does not exist, it may be "path#N": map N of a file that holds several.
  /// @throws Error (input) naming the file, line or byte, field, value and constraint
  LandmarkMap read(const std::filesystem::path& path, const MapReadOptions& options = {}) const;

  /// The format in `options`, or else that of the path's ending.
  /// @throws Error (misuse) if the format or ending is unknown, or the format is read-only
  const MapFormat& format_to_write(const std::filesystem::path& path,
                                   const MapWriteOptions& options = {}) const;

  /// Writes a map atomically.
  /// @throws Error (misuse) as format_to_write, (storage) if it cannot be written
  void write(const LandmarkMap& map, const std::filesystem::path& path,
             const MapWriteOptions& options = {}) const;

 private:
  const MapFormat* recognised(const MapInput& input) const;
  [[noreturn]] void refuse_folder(const std::filesystem::path& path) const;

  std::vector<MapFormat> formats_;
};

/// Cairn's own formats and point clouds: "text", "binary", "ply", "pcd" (docs/formats.md).
const FormatRegistry& native_formats();

/// All map formats of Cairn, in the library cairn::foreign_formats: native_formats() and those of other systems (docs/formats.md).
const FormatRegistry& all_formats();

/// Reads a map in one of the native_formats(), recognised by the first bytes.
/// @throws Error (input) naming the file, line or byte, field, value and constraint
LandmarkMap read_map(const std::filesystem::path& path, const MapReadOptions& options = {});

/// Writes a map in one of the native_formats(), atomically.
/// @throws Error (misuse) for an unknown extension, (storage) if the file cannot be written
void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options = {});

/// Names content that no map format reads, for messages.
struct ForeignContent {
  std::string_view what;    ///< e.g. "is a ROS bag"
  std::string_view advice;  ///< what to give instead; empty: a map in a known format
};

/// What a file is, by its first bytes and its name, or a folder, by the names in it; std::nullopt if unknown.
std::optional<ForeignContent> foreign_content(const MapInput& input);
std::optional<ForeignContent> foreign_content(const std::filesystem::path& path);

}  // namespace cairn
