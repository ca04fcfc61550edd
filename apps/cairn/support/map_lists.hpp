// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn::cli {

/// Whether a path is a folder of .map and .cairn files, and no map itself as a COLMAP model is.
bool is_folder_of_maps(const std::string& path);

/// The .map and .cairn files in a folder, by name.
/// @throws Error (input) if it cannot be read
std::vector<std::string> maps_in(const std::string& folder);

/// The links of a folder's pose_graph.json, which 'cairn map --mini-map-length' writes; none if there is no
/// such file. Links of maps that are not in the folder any more are left out.
/// @param files maps, those of the folder among them; nodes of the links are indices into these
/// @throws Error (input) if the file cannot be read
std::vector<PoseLink> links_in(const std::string& folder, const std::vector<std::string>& files);

/// What maps are called: file names without extension, or for one/sparse/0 the name of the project's folder, one; with
/// further folders where several are alike.
std::vector<std::string> map_names(const std::vector<std::string>& files);

/// 61204 as "61,204".
std::string with_commas(std::size_t number);

}  // namespace cairn::cli
