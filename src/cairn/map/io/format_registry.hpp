// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/map/io/options.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct MapWriteOptions {
  std::string format = {};                 ///< name of a MapFormat; empty: by the path's ending
  std::optional<int> native_version = {};  ///< nothing: 1 where it holds all of the map, else 2
  bool ascii = false;                      ///< PLY and PCD: text instead of binary
  bool double_precision =
      false;  ///< PCD: positions as doubles, which PCL's point types do not take
  Progress progress = {};
  LogSink log = {};  ///< told what the format cannot hold and was left out
};

/// A file or folder that a map is read from.
struct MapInput {
  std::filesystem::path path;
  std::optional<std::string> part = {};  ///< N of "path#N": which map of a file with several
  std::string_view first_bytes = {};     ///< of a file: its first 4096, or all; of a folder none
  ByteSource* source = nullptr;          ///< of a file, at its start; null for a folder
};

/// One map format: a row of the table from which reading, writing, help and messages derive.
struct MapFormat {
  std::string name;   ///< a word for options, e.g. "colmap-text"; unique in a registry
  std::string title;  ///< for messages, e.g. "COLMAP text"
  /// Endings of paths that are written in this format: an extension (".ply"), a file name
  /// ("reconstruction.json"), or "/" for a folder. Empty: written only if asked for by name.
  std::vector<std::string> endings = {};
  bool is_folder = false;      ///< written as a folder of files
  bool holds_frames = true;    ///< false: landmarks only
  bool holds_several = false;  ///< a file may hold several maps, of which "path#N" names one
  bool is_read = true;         ///< false: only written, and reading one says so
  /// Whether a file or folder is in this format. Looks at the path, what lies beside it, and the first
  /// bytes; does not read from the source.
  std::function<bool(const MapInput& input)> recognises = {};
  std::function<LandmarkMap(const MapInput& input, const MapReadOptions& options)> read = {};
  /// Writes a file as a stream of bytes. Empty, as is `write`: the format is only read.
  std::function<void(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options)>
      write_to = {};
  /// Writes what is no single file, whole or not at all.
  std::function<void(const LandmarkMap& map, const std::filesystem::path& path,
                     const MapWriteOptions& options)>
      write = {};

  bool is_written() const { return write_to != nullptr || write != nullptr; }
};

/// The map formats that a program knows: a value, handed to whoever reads or writes maps.
class FormatRegistry {
 public:
  FormatRegistry() = default;
  /// @param formats asked from the last to the first when a map is read: the first may recognise what no
  ///        other does
  /// @throws Error (misuse) for a name that occurs twice
  explicit FormatRegistry(std::vector<MapFormat> formats);

  /// These formats and `more`, which are asked before these.
  FormatRegistry extended_by(std::vector<MapFormat> more) const;

  std::span<const MapFormat> formats() const { return formats_; }
  /// Null if there is none of that name.
  const MapFormat* find(std::string_view name) const;
  /// The format that a path is written in, by its ending; null if unknown.
  const MapFormat* format_of_ending(const std::filesystem::path& path) const;
  /// As text for help and messages: ".map, .txt, .cairn, .ply or .pcd".
  std::string endings_text() const;
  /// What can be read, as text for help: "Cairn text, Cairn binary, PLY or PCD".
  std::string titles_text() const;
  /// Names of the formats that can be written, as text for help and messages.
  std::string written_names_text() const;

  /// Reads a map in any of the formats, recognised by content. A path that does not exist as it stands may
  /// be "path#N": map N of a file that holds several.
  /// @throws Error (input) naming the file, line or byte, field, value and what was expected
  LandmarkMap read(const std::filesystem::path& path, const MapReadOptions& options = {}) const;

  /// The format of `options`, or of the path's ending.
  /// @throws Error (misuse) if the format or ending is unknown, or the format is only read
  const MapFormat& format_to_write(const std::filesystem::path& path,
                                   const MapWriteOptions& options = {}) const;

  /// Writes a map, whole or not at all.
  /// @throws Error (misuse) as format_to_write, (storage) if it cannot be written
  void write(const LandmarkMap& map, const std::filesystem::path& path,
             const MapWriteOptions& options = {}) const;

 private:
  [[noreturn]] void refuse_folder(const std::filesystem::path& path) const;

  std::vector<MapFormat> formats_;
};

/// Cairn's own formats and point clouds: "text", "binary", "ply", "pcd" (docs/formats.md).
const FormatRegistry& native_formats();

}  // namespace cairn
