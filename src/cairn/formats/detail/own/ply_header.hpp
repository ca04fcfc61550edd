// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/formats/detail/own/headed_source.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Text of an error: what to provide in place of compressed splats.
inline constexpr std::string_view kExpectedSplats =
    "splats as PLY, to which 'npx @playcanvas/splat-transform IN OUT.ply' converts it";

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::string place;  ///< "file:line" where it is declared
  std::vector<PointField> properties;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::optional<LengthUnit> length_unit;
  std::vector<PlyElement> elements;

  /// The element "vertex"; every header that was read has it.
  const PlyElement* vertex() const;
};

/// Reads the header of a PLY 1.0 file, up to the start of the body.
/// @throws Error (input) naming source, line, value and constraint
PlyHeader read_ply_header(HeadedSource& source);

}  // namespace cairn::detail
