// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// What a format of another system holds of a map, beside positions of landmarks.
struct Holdings {
  bool frames = true;
  bool observations = true;
  bool cameras = true;
  bool image_names = true;
  bool timestamps = false;
  bool keypoints = false;
  bool depths = false;
  bool octaves = false;
  bool measured = false;  ///< how observations were, and how exactly
  bool colors = true;
  bool covariances = false;
  bool length_unit = false;
  bool georeference = false;
  bool gnss = false;                               ///< GNSS positions of frames
  std::string_view descriptors = {};               ///< the kind that has a place, or "*": any
  std::span<const std::string_view> columns = {};  ///< names of columns that have a place
};

/// Tells the sink, if there is one, "name: text".
/// @param name of the file
void log_remark(const LogSink& log, std::string_view name, std::string_view text,
                RemarkKind kind = RemarkKind::kInformation);

/// What `map` has and the format does not hold, in words.
std::vector<std::string> losses(const LandmarkMap& map, const Holdings& holdings);

/// "x: COLMAP has no place for the covariances, depths; they are left out"; empty if nothing is lost.
/// @param path empty where a writer does not know it
std::string loss_remark(const LandmarkMap& map, const Holdings& holdings, std::string_view path,
                        std::string_view format);

}  // namespace cairn::detail
