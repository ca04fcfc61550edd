// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn::cli {

/// Whether a path is a folder of .map and .cairn files, and no map itself as a COLMAP model is.
bool is_folder_of_maps(const std::string& path);

/// A map of a list, as a file or one of a folder's.
struct ListedMap {
  std::string file;
  std::string name;     ///< map_names(), or "folder/file" of a folder's; unique
  std::string session;  ///< the folder's name; empty for a file
};

/// The maps that the arguments of a command name: files, and the .map and .cairn files in folders, by name.
/// @throws Error (input) if a folder cannot be read
std::vector<ListedMap> listed_maps(const std::vector<std::string>& paths);

/// The links in the pose_graph.json of each folder among the paths, which 'cairn map --mini-map-length' writes; none
/// where there is no such file. Links of maps that are not in the folder any more are left out.
/// @return links of which the nodes are indices of `maps`
/// @throws Error (input) if a file cannot be read
std::vector<Link> links_of_folders(const std::vector<std::string>& paths,
                                   const std::vector<ListedMap>& maps);

/// What a thing may be called. Those of one group are called by names of one index.
struct PossibleNames {
  std::string group;
  std::vector<std::string> names;  ///< the shortest first; as many for all of the group
};

/// The shortest names that tell things apart, as far as there are any.
/// @param taken names of others
std::vector<std::string> told_apart(const std::vector<PossibleNames>& possible,
                                    const std::vector<std::string>& taken = {});

/// What maps are called: file names without extension, or for one/sparse/0 the name of the project's folder, one; with
/// further folders where several are alike.
std::vector<std::string> map_names(const std::vector<std::string>& files);

/// 61204 as "61,204".
std::string with_commas(std::size_t number);

}  // namespace cairn::cli
