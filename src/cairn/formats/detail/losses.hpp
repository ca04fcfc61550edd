// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Which parts of a map another system's format can hold, besides landmark positions.
struct Holdings {
  bool frames = true;
  bool observations = true;
  bool cameras = true;
  bool image_sizes = true;  ///< of the cameras
  bool image_names = true;
  bool timestamps = false;
  bool keypoints = false;
  bool depths = false;
  bool octaves = false;
  bool measured = false;  ///< source and standard deviation of observations
  bool colors = true;
  bool covariances = false;
  bool length_unit = false;
  bool georeference = false;
  bool gnss = false;  ///< GNSS positions of frames
  bool rigs = false;
  bool control_points = false;
  std::string_view descriptors = {};               ///< the kind that the format can hold; "*": any
  bool further_descriptors = false;                ///< several descriptors of a landmark
  std::span<const std::string_view> columns = {};  ///< names of columns that the format can hold
};

/// Sends "name: text" to the log, if there is one.
/// @param name name of the file
void log_remark(const LogSink& log, std::string_view name, std::string_view text,
                RemarkKind kind = RemarkKind::kInformation);

/// Text of the loss of landmarks that drop_far_landmarks() drops.
std::string far_landmarks_text(std::size_t count, std::size_t of);

/// A map of the tables that a reader filled. Drops landmarks whose positions are not finite or too far away, e.g. badly
/// triangulated ones, and logs their number.
/// @param name name of the file
/// @param place names an entry in messages, as in LandmarkMap; by default `name`. Landmark rows are those after the
///        drop
LandmarkMap imported_map(MapTables tables, const std::string& name, const LogSink& log,
                         const EntryPlace& place = {});

/// Names the parts of `map` that the format cannot hold.
std::vector<std::string> losses(const LandmarkMap& map, const Holdings& holdings);

/// Sends a loss to the log, if there is one: "x: COLMAP has no place for: covariances, colours; left out". Also logs if
/// sizes of images are written that no file stated.
/// @param path empty if the writer does not know it
void log_losses(const LogSink& log, const LandmarkMap& map, const Holdings& holdings,
                std::string_view format, std::string_view path = {});

}  // namespace cairn::detail
