// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn::cli {

/// The files of a folder, not of folders in it, whose names end so, in lower or upper case; by name.
/// @throws Error (input) if the folder cannot be read
std::vector<std::string> files_in(const std::string& folder, const std::set<std::string>& endings);

/// Whether a path is a folder of .map and .cairn files, and is not itself a map, as a COLMAP model is.
bool is_folder_of_maps(const std::string& path);

/// A map in a list: a file, or a file in a folder of the list.
struct ListedMap {
  std::string file;
  std::string name;     ///< by map_names(), or "folder/file" in a folder; unique
  std::string session;  ///< the folder's name; empty without a folder
};

/// The maps that the arguments of a command name: files, and the .map and .cairn files in folders, by name.
/// @throws Error (input) if a folder cannot be read
std::vector<ListedMap> listed_maps(const std::vector<std::string>& paths);

/// The links in the pose_graph.json of each folder among the paths, which 'cairn map --mini-map-length' writes; none
/// for a folder without this file. Links of maps that are no longer in the folder are left out.
/// @return links whose nodes are indices of `maps`
/// @throws Error (input) if a file cannot be read
std::vector<Link> links_of_folders(const std::vector<std::string>& paths,
                                   const std::vector<ListedMap>& maps);

/// Possible names of a thing. All things of one group take their names at the same index.
struct PossibleNames {
  std::string group;
  std::vector<std::string> names;  ///< shortest first; equally many for all things of the group
};

/// For each thing, the shortest name that differs from all other names, if there is one.
/// @param taken names that are already in use
std::vector<std::string> told_apart(const std::vector<PossibleNames>& possible,
                                    const std::vector<std::string>& taken = {});

/// Names of maps: file names without extension, or for one/sparse/0 the name of the project's folder, one. Names that
/// would be equal get further folders.
std::vector<std::string> map_names(const std::vector<std::string>& files);

/// 61204 as "61,204".
std::string with_commas(std::size_t number);

}  // namespace cairn::cli
