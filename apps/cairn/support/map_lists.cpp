// SPDX-License-Identifier: BSD-3-Clause
#include "support/map_lists.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/interchange/formats.hpp"
#include "cairn/pose_graph/graph_json.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

}  // namespace

bool is_folder_of_maps(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return false;
  const MapInput input{.path = path};
  const auto formats = all_formats().formats();
  return std::none_of(formats.begin(), formats.end(), [&](const MapFormat& format) {
    return format.recognises && format.recognises(input);
  });
}

std::vector<std::string> maps_in(const std::string& folder) {
  std::vector<std::string> files;
  try {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      // Text files and clouds may lie there for other reasons.
      const std::string extension = entry.path().extension().string();
      if (entry.is_regular_file() && (extension == ".map" || extension == ".cairn")) {
        files.push_back(entry.path().string());
      }
    }
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::kInput, folder, error.code().message(), "a folder that can be read");
  }
  if (files.empty()) {
    throw Error(ErrorKind::kInput, folder, "holds no map", "a folder of .map or .cairn files");
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<PoseLink> links_in(const std::string& folder, const std::vector<std::string>& files) {
  const fs::path path = fs::path(folder) / "pose_graph.json";
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return {};
  FileReader reader(path);
  PoseGraph graph = read_pose_graph(reader);
  // By name without extension: maps may have been converted since.
  const auto index_of = [&](NodeId id) {
    const auto node = std::find_if(graph.nodes.begin(), graph.nodes.end(),
                                   [&](const PoseNode& one) { return one.id == id; });
    return std::find_if(files.begin(), files.end(), [&](const std::string& file) {
      const fs::path map(file);
      return map.stem() == fs::path(node->name).stem() &&
             fs::equivalent(map.parent_path(), folder, ignored);
    });
  };
  std::vector<PoseLink> links;
  for (PoseLink& link : graph.links) {
    const auto target = index_of(link.target);
    const auto source = index_of(link.source);
    if (target == files.end() || source == files.end()) continue;
    link.target = NodeId{static_cast<std::uint64_t>(target - files.begin())};
    link.source = NodeId{static_cast<std::uint64_t>(source - files.begin())};
    links.push_back(std::move(link));
  }
  return links;
}

std::vector<std::string> map_names(const std::vector<std::string>& files) {
  const auto stem = [](const std::string& file) { return fs::path(file).stem().string(); };
  std::vector<std::string> names;
  for (const std::string& file : files) {
    const auto alike = std::count_if(files.begin(), files.end(), [&](const std::string& other) {
      return stem(other) == stem(file);
    });
    names.push_back(alike > 1 ? fs::path(file).replace_extension().string() : stem(file));
  }
  return names;
}

std::string with_commas(std::size_t number) {
  const std::string digits = fmt::format("{}", number);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
    text += digits[i];
  }
  return text;
}

}  // namespace cairn::cli
