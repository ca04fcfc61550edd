// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"

// Shared by the reader and the writer of COLMAP models.
namespace cairn::detail {

/// A keypoint's point id if it has no point.
inline constexpr std::uint64_t kNoPoint = std::numeric_limits<std::uint64_t>::max();
/// Name of the column with the errors of 3D points, in pixels.
inline constexpr std::string_view kErrorColumn = "reprojection_error";

/// Name of one of a model's files, e.g. "images.bin".
inline std::string colmap_file_name(std::string_view stem, ColmapForm form) {
  return std::string(stem) + (form == ColmapForm::kBinary ? ".bin" : ".txt");
}

}  // namespace cairn::detail
