// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/file.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct MapWriteOptions {
  std::string format = {};                 ///< name of a MapFormat; empty: by the path's ending
  std::optional<int> native_version = {};  ///< std::nullopt: the lowest that holds the map
  bool ascii = false;                      ///< PLY and PCD: text instead of binary
  bool double_precision =
      false;  ///< PCD: positions as doubles, which PCL's point types cannot read
};

/// A file or folder to read a map from.
struct MapInput {
  std::filesystem::path path;
  std::optional<std::string> part = {};  ///< N of "path#N": selects one map of a file with several
  std::string_view first_bytes = {};     ///< at most the first 4096 of a file; empty for a folder
  ByteSource* source = nullptr;          ///< the file, at its start; null for a folder
};

/// A map format: a row of the table from which reading, writing, help and messages derive.
struct MapFormat {
  std::string name;   ///< name in options, e.g. "colmap-text"; unique in a registry
  std::string title;  ///< name in messages, e.g. "COLMAP text"
  /// Endings of paths for this format: an extension (".ply"), a file name ("reconstruction.json"), or "/"
  /// for a folder. Empty: written only if the caller names the format.
  std::vector<std::string> endings = {};
  bool is_folder = false;      ///< written as a folder of files
  bool holds_frames = true;    ///< false: landmarks only
  bool holds_several = false;  ///< a file may hold several maps; "path#N" selects one
  bool is_read = true;         ///< false: write-only; reading reports that
  /// Whether a file or folder has this format. Uses the path, its neighbours and the first bytes; does not
  /// read from the source.
  std::function<bool(const MapInput& input)> recognises = {};
  std::function<LandmarkMap(const MapInput& input, const Execution& execution)> read = {};
  /// Writes a file as a stream of bytes. Empty, like `write`, if the format is read-only.
  std::function<void(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options,
                     const Execution& execution)>
      write_to = {};
  /// Writes a folder, or several files, atomically.
  std::function<void(const LandmarkMap& map, const std::filesystem::path& path,
                     const MapWriteOptions& options, const Execution& execution)>
      write = {};

  bool is_written() const { return write_to != nullptr || write != nullptr; }
};

/// Registry of a program's map formats; a value to pass to readers and writers of maps.
class FormatRegistry {
 public:
  FormatRegistry() = default;
  /// @param formats tried from the last to the first when a map is read
  /// @throws Error (misuse) for a duplicate name
  explicit FormatRegistry(std::vector<MapFormat> formats);

  /// This registry plus `more`; readers try `more` first.
  FormatRegistry extended_by(std::vector<MapFormat> more) const;

  std::span<const MapFormat> formats() const { return formats_; }
  /// Format by name; null if unknown.
  const MapFormat* find(std::string_view name) const;
  /// Format for a path, by its ending; null if unknown.
  const MapFormat* format_of_ending(const std::filesystem::path& path) const;
  /// All endings, for help and messages: ".map, .txt, .cairn, .ply or .pcd".
  std::string endings_text() const;
  /// Titles of the readable formats, for help: "Cairn text, Cairn binary, PLY or PCD".
  std::string titles_text() const;
  /// Names of the writable formats, for help and messages.
  std::string written_names_text() const;

  /// Maps in a folder: the folder itself, or else map folders up to three levels below, such as
  /// sparse/0.
  std::vector<std::filesystem::path> maps_of_folder(const std::filesystem::path& folder) const;

  /// Reads a map in any of the formats, recognised by content. A folder must contain exactly one
  /// map (maps_of_folder()). If no file has this path, "path#N" is map N of the file `path`,
  /// which holds several maps.
  /// @throws Error (input) naming the file, line or byte, field, value and constraint; (cancelled)
  LandmarkMap read(const std::filesystem::path& path, const Execution& execution = {}) const;

  /// The format named in `options`, or else the format of the path's ending.
  /// @throws Error (misuse) if the format or ending is unknown, or the format is read-only
  const MapFormat& format_to_write(const std::filesystem::path& path,
                                   const MapWriteOptions& options = {}) const;

  /// Writes a map atomically.
  /// @throws Error (misuse) as format_to_write, (storage) if it cannot be written
  void write(const LandmarkMap& map, const std::filesystem::path& path,
             const MapWriteOptions& options = {}, const Execution& execution = {}) const;

 private:
  const MapFormat* recognised(const MapInput& input) const;
  [[noreturn]] void refuse_folder(const std::filesystem::path& path) const;

  std::vector<MapFormat> formats_;
};

/// Cairn's own formats and point clouds: "text", "binary", "ply", "pcd" (docs/formats.md).
const FormatRegistry& native_formats();

/// All map formats of Cairn: native_formats() and the formats of other systems (docs/formats.md).
/// In the library cairn::foreign_formats.
const FormatRegistry& all_formats();

/// Reads a map in one of the native_formats(), recognised by the first bytes.
/// @throws Error (input) naming the file, line or byte, field, value and constraint
LandmarkMap read_map(const std::filesystem::path& path, const Execution& execution = {});

/// Writes a map in one of the native_formats(), atomically.
/// @throws Error (misuse) for an unknown extension, (storage) if the file cannot be written
void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options = {}, const Execution& execution = {});

/// Describes content that no map format reads, for messages.
struct ForeignContent {
  std::string_view what;    ///< e.g. "is a ROS bag"
  std::string_view advice;  ///< what to give instead; empty: a map in a known format
};

/// Identifies a file by its first bytes and name, or a folder by its entries; std::nullopt if
/// unknown.
std::optional<ForeignContent> foreign_content(const MapInput& input);
std::optional<ForeignContent> foreign_content(const std::filesystem::path& path);

// ---- the formats of Cairn, PLY and PCD

/// Reads Cairn's text format, version 1, 2 or 3 (docs/formats.md).
/// @throws Error (input) naming source, line, field, value and constraint
LandmarkMap read_native(ByteSource& source, const Execution& execution = {});

/// Describes the data of `map` that version 1 of the text format cannot hold; std::nullopt if none.
std::optional<std::string> version_1_loss(const LandmarkMap& map);

/// Writes Cairn's text format.
/// @param version 1, 2 or 3; std::nullopt: the lowest that can hold the whole map
/// @throws Error (misuse) if the requested version cannot hold the map
void write_native(const LandmarkMap& map, const ByteSink& sink,
                  std::optional<int> version = std::nullopt, const Execution& execution = {});

/// First bytes of Cairn's binary format. No text begins with these bytes, and a transfer that
/// converts line ends corrupts them.
inline constexpr std::string_view kBinaryMagic =
    "\x89"
    "CAIRN\r\n";

/// Reads Cairn's binary format (docs/formats.md), in place if the source is in memory.
/// @throws Error (input) naming source, byte, field, value and constraint
LandmarkMap read_binary(ByteSource& source, const Execution& execution = {});

/// Writes Cairn's binary format.
/// @throws Error (misuse) if a text of the map has 2^32 bytes or more
void write_binary(const LandmarkMap& map, const ByteSink& sink, const Execution& execution = {});

/// Reads the vertices of a PLY 1.0 file as landmarks (docs/formats.md lists the properties).
/// @throws Error (input) naming source, line or byte, value and constraint
LandmarkMap read_ply(ByteSource& source, const Execution& execution = {});

/// Writes the landmarks as PLY 1.0 vertices: position, covariance, colour, observation count, named
/// columns. Writes Gaussian splats in the layout of their trainers.
void write_ply(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

/// Reads the points of a PCD 0.7 file as landmarks (docs/formats.md lists the fields).
/// @throws Error (input) naming source, line or byte, value and constraint
LandmarkMap read_pcd(ByteSource& source, const Execution& execution = {});

/// Writes the landmarks as PCD 0.7 points: position, covariance, colour, observation count, named
/// columns.
void write_pcd(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options = {});

/// Transforms a map's point cloud, mesh or splats in PLY: vertex positions, covariances (cov_xx ...
/// cov_zz) and ColumnMotion properties. Copies all other content byte for byte.
/// @param source ascii, binary little- or big-endian; the result has the same form
/// @throws Error (input) naming source, line or byte: not PLY, truncated, no x, y and z, float
///        positions moved so far that they round, or rotated or scaled splats in no known layout
void move_ply(ByteSource& source, const Similarity3& new_from_old, const ByteSink& sink);

/// A UUID (RFC 9562, version 8) from a hash of the bytes.
std::string uuid_of(std::string_view bytes);

/// UUID of a map's content, from its bytes in the binary format without its own UUID. Equal for
/// maps made with the same inputs, options and seed.
std::string content_uuid(const LandmarkMap& map);

/// The map with its content_uuid().
LandmarkMap with_content_uuid(LandmarkMap map);

}  // namespace cairn
