// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"

// The feature files of OpenMVG and AliceVision: for each image, NAME.feat with a line "x y scale orientation" per feature,
// and NAME.desc with their number (8 bytes) and their descriptors.
namespace cairn::detail {

/// A type of descriptors in such files.
struct DescriptorFileType {
  std::string_view name;  ///< name in the program's files
  std::string_view kind;  ///< kind in a DescriptorColumn
  std::size_t numbers = 0;
  bool are_floats = false;
  /// SIFT as VLFeat writes it: gradient directions run in the opposite sense to those of Lowe, COLMAP and OpenCV.
  bool is_vlfeat = false;
};

/// Where the features of a model are.
struct FeatureFiles {
  /// The first folder that has an image's file is used.
  std::vector<std::filesystem::path> folders;
  DescriptorFileType type;
  /// The NAME of an image's files.
  std::function<std::string(FrameIndex)> name;
  /// Whether a landmark has features of the type. Empty: all have.
  std::function<bool(LandmarkIndex)> has_landmark = {};
};

/// The model with the descriptors of its landmarks (ModelDescriptors). Logs files that do not fit the model, and leaves
/// them out.
/// @param model model whose observations state their keypoints
/// @param place the model's file in messages
LandmarkMap with_feature_files(LandmarkMap model, const FeatureFiles& files,
                               const std::string& place, const Execution& execution);

/// The descriptors of a .desc file, each of `size` bytes.
/// @throws Error (input) naming `place` if the file's size does not match the number of descriptors that it states
std::span<const char> feature_descriptors(std::string_view bytes, std::size_t size,
                                          const std::string& place);

/// The positions of the features in a .feat file.
/// @throws Error (input) naming line and value
std::vector<Pixel> feature_positions(std::string_view text, const std::string& place);

}  // namespace cairn::detail
