// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/core/file.hpp"
#include "cairn/formats/detail/bytes/scalars.hpp"
#include "cairn/formats/detail/own/headed_source.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"

// Shared by the formats of points: a landmark map as a table of points with scalar fields.
namespace cairn::detail {

enum class PointFormat {
  kPly,
  kPcd,
  kSplats,    ///< PLY as trainers of Gaussian splats write it; write-only
  kFoxglove,  ///< as PLY, with an alpha value; write-only
};

/// The unit that a comment of a header states: "cairn length_unit metres", or "free"; std::nullopt for another comment.
std::optional<LengthUnit> unit_in_comment(std::string_view comment);
/// The comment that states the unit.
std::string unit_comment(LengthUnit unit);

/// A field of a point or other record, as a file declares it, in the file's order.
struct PointField {
  std::string name;
  ScalarType type = ScalarType::kFloat64;
  std::uint64_t count = 1;               ///< values per point; below 2^32
  std::optional<ScalarType> list_count;  ///< type of a list's length, which precedes its values
};

/// Names of the fields that the formats share.
inline constexpr std::array<const char*, 3> kAxisNames = {"x", "y", "z"};
inline constexpr std::array<const char*, 3> kChannelNames = {"red", "green", "blue"};

/// The lower triangle of a covariance, in the order of the names. The validity test of a covariance uses the lower
/// triangle, so a matrix that passed it passes it again after reading, even if it was not quite symmetric.
struct CovarianceEntry {
  const char* name;
  int row;
  int column;
};
inline constexpr std::array<CovarianceEntry, 6> kCovarianceEntries = {{{"cov_xx", 0, 0},
                                                                       {"cov_xy", 1, 0},
                                                                       {"cov_xz", 2, 0},
                                                                       {"cov_yy", 1, 1},
                                                                       {"cov_yz", 2, 1},
                                                                       {"cov_zz", 2, 2}}};

/// Upper bound of the points in a map.
constexpr std::uint64_t kPointLimit = std::uint64_t{1} << 32;
/// Upper bound of the fields in a file: above any real file, and few enough to compare all names.
constexpr std::size_t kFieldLimit = 4096;

/// Collects point fields for a map.
class PointTable {
 public:
  /// Assigns each field its role.
  /// @param where text for the message if x, y or z is missing
  PointTable(PointFormat format, std::string source, std::string_view where,
             std::vector<PointField> fields, const Execution& execution);

  const std::vector<PointField>& fields() const { return fields_; }
  std::size_t size() const { return positions_.size(); }
  /// Keeps the columns of 32-bit fields in single precision. Only for an empty table, and not for text, whose numbers
  /// may have more digits than the field's type.
  void expect_binary();
  void reserve(std::size_t rows);

  /// Adds one point from text.
  void append_text(std::string_view row, std::uint64_t line_number);
  /// Adds `rows` contiguous points without lists.
  void append_binary(const char* bytes, std::size_t rows, bool big_endian);
  /// Adds little-endian points from columns, given each field's first value.
  void append_columns(const std::vector<const char*>& columns, std::size_t rows);

  /// Makes the map: drops points without a usable position, and decides whether the ids are usable.
  /// @param unit std::nullopt if the file states none. The unit is then free, or metres if the fields are those of
  ///        Cairn, which in the past did not state metres
  LandmarkMap finish(std::optional<LengthUnit> unit) &&;

 private:
  enum class Role { kSkipped, kPosition, kCovariance, kChannel, kPackedColor, kId, kColumn };
  struct Slot {
    Role role = Role::kSkipped;
    std::size_t index = 0;
  };

  void choose_slots(PointFormat format, std::string_view where);
  void grow(std::size_t rows);
  template <class T>
  void put(Slot slot, std::size_t row, T value);
  void put_integer(Slot slot, std::size_t row, std::uint64_t bits);
  void put_text(std::size_t field, std::string_view text, std::uint64_t line, std::uint64_t token);
  void put_run(std::size_t field, std::size_t first_row, std::size_t rows, const char* bytes,
               std::size_t step, bool big_endian);
  [[noreturn]] void refuse(std::uint64_t line, std::uint64_t token, std::string_view field,
                           std::string_view what, std::string_view expected) const;
  bool has_fields_of_cairn() const;
  void drop_points_without_position();
  void forget_infinite_values();
  void take_ids(LandmarkTable& landmarks);
  void lost(const std::string& text) const;

  std::string source_;
  const Execution& execution_;
  std::vector<PointField> fields_;
  std::vector<Slot> slots_;  // one per field
  std::vector<Eigen::Vector3d> positions_;
  bool has_covariances_ = false;
  std::vector<Eigen::Matrix3d> covariances_;
  bool has_colors_ = false;
  OptionalColumn<Color> colors_;
  bool has_ids_ = false;
  bool ids_are_signed_ = false;
  std::vector<std::uint64_t> ids_;  // two's complement if negative
  std::vector<NamedColumn> columns_;
  std::vector<std::string_view> words_;  // of the row that is read
};

/// Reads `count` points of a text body.
void read_text_points(TextRows& rows, HeadedSource& source, std::uint64_t count,
                      std::string_view points, PointTable& table);

/// Reads `count` points of a binary body, point after point.
void read_binary_points(HeadedSource& source, std::uint64_t count, std::string_view points,
                        bool big_endian, PointTable& table);

/// Skips records of a binary body.
void skip_binary_records(HeadedSource& source, const std::vector<PointField>& fields,
                         std::uint64_t count, std::string_view records, bool big_endian);

/// Whether single precision rounds points by more than 1e-5 of their extent, because they lie far from the origin.
/// @param box of the points
bool is_rounded_by_floats(const Eigen::AlignedBox3d& box);
bool is_rounded_by_floats(std::span<const Eigen::Vector3d> points);

/// The landmarks of a map as points with fields.
class PointRows {
 public:
  /// @param position_type type of x, y and z: kFloat32 or kFloat64
  /// @throws Error (misuse) for a named column whose name has another meaning in the file, or a position
  ///        out of the range of `position_type`
  PointRows(const LandmarkMap& map, PointFormat format, ScalarType position_type);

  const std::vector<PointField>& fields() const { return fields_; }
  /// Writes header and points, as text or little-endian binary.
  void write(std::string header, bool ascii, const ByteSink& sink) const;

 private:
  enum class Content { kPosition, kCovariance, kChannel, kPackedColor, kCount, kId, kColumn };
  struct Cell {
    Content content;
    std::size_t index;
  };

  void add(std::string name, ScalarType type, Content content, std::size_t index = 0);
  template <class Put>
  void visit(std::size_t field, std::size_t row, Put&& put) const;

  const LandmarkMap& map_;
  std::vector<PointField> fields_;
  std::vector<Cell> cells_;  // one per field
};

}  // namespace cairn::detail
