// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
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

struct ColmapModel {
  std::string_view name;
  std::size_t parameters;
};

/// In the order of COLMAP's model ids, from 0.
inline constexpr std::array<ColmapModel, 18> kColmapModels = {{{"SIMPLE_PINHOLE", 3},
                                                               {"PINHOLE", 4},
                                                               {"SIMPLE_RADIAL", 4},
                                                               {"RADIAL", 5},
                                                               {"OPENCV", 8},
                                                               {"OPENCV_FISHEYE", 8},
                                                               {"FULL_OPENCV", 12},
                                                               {"FOV", 5},
                                                               {"SIMPLE_RADIAL_FISHEYE", 4},
                                                               {"RADIAL_FISHEYE", 5},
                                                               {"THIN_PRISM_FISHEYE", 12},
                                                               {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                               {"SIMPLE_DIVISION", 4},
                                                               {"DIVISION", 5},
                                                               {"SIMPLE_FISHEYE", 3},
                                                               {"FISHEYE", 4},
                                                               {"EUCM", 6},
                                                               {"EQUIRECTANGULAR", 2}}};

/// Name of one of a model's files, e.g. "images.bin".
inline std::string colmap_file_name(std::string_view stem, ColmapForm form) {
  return std::string(stem) + (form == ColmapForm::kBinary ? ".bin" : ".txt");
}

}  // namespace cairn::detail
