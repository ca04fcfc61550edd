// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <charconv>
#include <cmath>
#include <concepts>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/map/column_motion.hpp"

// Points of a map as a format writes them.
namespace cairn::detail {
namespace {

constexpr std::size_t kRowBlock = std::size_t{1} << 20;
constexpr std::size_t kAlpha = kChannelNames.size();  // index of the channel that follows them

template <std::floating_point Number>
void append_text_value(std::string& out, Number value) {
  std::array<char, 32> buffer;
  // Some readers do not accept the sign of a NaN.
  if (std::isnan(value)) value = std::abs(value);
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  out.append(buffer.data(), result.ptr);
}
void append_text_value(std::string& out, std::uint64_t value) {
  append_number(out, value);
}

// By column: whether a splat has it in single precision, as trainers write all properties. Those of splats and normals
// are rounded, others only if that loses nothing.
std::vector<bool> single_precision_columns(const SplatColumns& splats,
                                           std::span<const NamedColumn> columns) {
  const Similarity3 any_turn(Rigid3::from_roll_pitch_yaw({0, 0, 0}, 1.0, 1.0, 1.0));
  const ColumnMotion turning(column_names(columns), any_turn, "splats");
  std::vector<bool> single;
  for (const NamedColumn& column : columns) {
    single.push_back(std::all_of(column.values.begin(), column.values.end(), [](double value) {
      return std::isnan(value) || static_cast<double>(static_cast<float>(value)) == value;
    }));
  }
  for (const std::size_t column : turning.changed()) single[column] = true;
  for (const std::size_t column : splats.all()) single[column] = true;
  return single;
}

}  // namespace

PointRows::PointRows(const LandmarkMap& map, PointFormat format, ScalarType position_type)
    : map_(map) {
  const LandmarkTable& landmarks = map.landmarks();
  const bool are_splats = format == PointFormat::kSplats;
  for (std::size_t i = 0; i < 3; ++i) add(kAxisNames[i], position_type, Content::kPosition, i);
  for (std::size_t i = 0; !are_splats && map.has_covariances() && i < kCovarianceEntries.size();
       ++i) {
    add(kCovarianceEntries[i].name, ScalarType::kFloat64, Content::kCovariance, i);
  }
  // Point formats cannot mark a colour as unknown, so colours are written only if all are known.
  const bool all_colored =
      !landmarks.colors.empty() && !(are_splats && map.column("f_dc_0") != nullptr) &&
      std::all_of(landmarks.colors.begin(), landmarks.colors.end(),
                  [](const std::optional<Color>& color) { return color.has_value(); });
  if (all_colored && format == PointFormat::kPcd) {
    add("rgb", ScalarType::kUint32, Content::kPackedColor);
  } else if (all_colored) {
    for (std::size_t i = 0; i < 3; ++i)
      add(kChannelNames[i], ScalarType::kUint8, Content::kChannel, i);
    if (format == PointFormat::kFoxglove) {
      add("alpha", ScalarType::kUint8, Content::kChannel, kAlpha);
    }
  }
  const bool has_counts = !are_splats && !map.observations().offsets.empty();
  if (has_counts) add("observations", ScalarType::kUint32, Content::kCount);
  const bool ids_fit_32_bits = std::all_of(
      landmarks.ids.begin(), landmarks.ids.end(),
      [](LandmarkId id) { return id.value <= std::numeric_limits<std::uint32_t>::max(); });
  if (!are_splats && map.column("id") == nullptr &&
      (ids_fit_32_bits || format == PointFormat::kPcd)) {
    add("id", ids_fit_32_bits ? ScalarType::kUint32 : ScalarType::kUint64, Content::kId);
  }
  const std::vector<bool> single =
      are_splats ? single_precision_columns(*splat_columns(landmarks.columns), landmarks.columns)
                 : std::vector<bool>();
  for (std::size_t i = 0; i < landmarks.columns.size(); ++i) {
    const std::string& name = landmarks.columns[i].name;
    if (has_counts && name == "observations") continue;
    const bool taken = std::any_of(fields_.begin(), fields_.end(),
                                   [&](const PointField& field) { return field.name == name; });
    refuse_if(taken || (format == PointFormat::kPcd && name == "_"), "column " + printable(name),
              "the format has another meaning for this name", "another name");
    add(name, are_splats && single[i] ? ScalarType::kFloat32 : ScalarType::kFloat64,
        Content::kColumn, i);
  }
}

void PointRows::add(std::string name, ScalarType type, Content content, std::size_t index) {
  fields_.push_back({.name = std::move(name), .type = type, .count = 1, .list_count = {}});
  cells_.push_back({content, index});
}

template <class Put>
void PointRows::visit(std::size_t field, std::size_t row, Put&& put) const {
  const LandmarkTable& landmarks = map_.landmarks();
  const std::size_t index = cells_[field].index;
  switch (cells_[field].content) {
    case Content::kPosition: {
      const double coordinate = landmarks.positions[row][static_cast<Eigen::Index>(index)];
      if (fields_[field].type == ScalarType::kFloat32) {
        put(static_cast<float>(coordinate));
      } else {
        put(coordinate);
      }
      break;
    }
    case Content::kCovariance: {
      const Eigen::Matrix3d& covariance = landmarks.covariances[row];
      const CovarianceEntry& entry = kCovarianceEntries[index];
      constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
      put(std::isnan(covariance(0, 0)) ? kUnknown : covariance(entry.row, entry.column));
      break;
    }
    case Content::kChannel: {
      const Color color = *landmarks.colors[row];
      constexpr std::uint8_t kOpaque = 255;
      put(index == kAlpha ? kOpaque
          : index == 0    ? color.red
          : index == 1    ? color.green
                          : color.blue);
      break;
    }
    case Content::kPackedColor: {
      const Color color = *landmarks.colors[row];
      put(std::uint32_t{color.red} << 16 | std::uint32_t{color.green} << 8 |
          std::uint32_t{color.blue});
      break;
    }
    case Content::kCount: {
      const auto& offsets = map_.observations().offsets;
      put(static_cast<std::uint32_t>(std::min<std::uint64_t>(
          offsets[row + 1] - offsets[row], std::numeric_limits<std::uint32_t>::max())));
      break;
    }
    case Content::kId: {
      const std::uint64_t id = landmarks.ids[row].value;
      if (fields_[field].type == ScalarType::kUint32) {
        put(static_cast<std::uint32_t>(id));
      } else {
        put(id);
      }
      break;
    }
    case Content::kColumn:
      if (fields_[field].type == ScalarType::kFloat32) {
        put(static_cast<float>(landmarks.columns[index].values[row]));
      } else {
        put(landmarks.columns[index].values[row]);
      }
      break;
  }
}

void PointRows::write(std::string header, bool ascii, const ByteSink& sink) const {
  std::string buffer = std::move(header);
  for (std::size_t row = 0; row < map_.landmark_count(); ++row) {
    for (std::size_t field = 0; field < fields_.size(); ++field) {
      if (ascii) {
        if (field > 0) buffer += ' ';
        visit(field, row, [&]<class T>(T value) {
          using Text = std::conditional_t<std::is_integral_v<T>, std::uint64_t, T>;
          append_text_value(buffer, Text{value});
        });
      } else {
        visit(field, row, [&](auto value) { append_scalar(buffer, value); });
      }
    }
    if (ascii) buffer += '\n';
    if (buffer.size() >= kRowBlock) {
      sink(buffer);
      buffer.clear();
    }
  }
  sink(buffer);
}

}  // namespace cairn::detail
