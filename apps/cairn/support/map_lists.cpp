// SPDX-License-Identifier: BSD-3-Clause
#include "support/map_lists.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

// Whether a folder of that name holds a model of the project whose folder is above.
bool is_part_of_project(const std::string& name) {
  static const std::set<std::string> kParts = {"sparse", "dense",          "colmap",
                                               "model",  "colmap_sparse",  "colmap_text",
                                               "text",   "reconstruction", "distorted"};
  return kParts.contains(name) || parse_unsigned(name).has_value();
}

// What a map may be called, the shortest first: the file's name without its extension, or the name of the project of
// which a folder is a part; then with folders above, then the whole path.
std::vector<std::string> possible_names(const std::string& file) {
  if (file == "-") return {"stdin"};
  std::error_code ignored;
  fs::path path(file);
  std::string part;  // N of "path#N"
  if (const std::size_t hash = file.rfind('#');
      hash != std::string::npos && hash > 0 && !fs::exists(path, ignored)) {
    part = file.substr(hash);
    path = file.substr(0, hash);
  }
  const bool is_folder = fs::is_directory(path, ignored);
  // From within the project's folder, its own name is that of a folder above.
  if (is_folder && is_part_of_project(path.begin()->string()))
    path = fs::absolute(path).lexically_normal();
  std::vector<std::string> words;
  for (const fs::path& word : is_folder ? path : path.replace_extension()) {
    const std::string text = word.string();
    if (!text.empty() && text != "/" && text != "." && text != "..") words.push_back(text);
  }
  if (words.empty()) words.push_back(fs::weakly_canonical(fs::path(file), ignored).filename());
  std::size_t last = words.size() - 1;
  while (is_folder && last > 0 && is_part_of_project(words[last])) --last;
  if (is_part_of_project(words[last])) last = words.size() - 1;
  std::vector<std::string> names;
  for (const std::size_t end : {last + 1, words.size()}) {
    for (std::size_t begin = last + 1; begin-- > 0;) {
      const auto at = words.begin();
      names.push_back(fmt::format("{}{}",
                                  fmt::join(at + static_cast<std::ptrdiff_t>(begin),
                                            at + static_cast<std::ptrdiff_t>(end), "/"),
                                  part));
    }
  }
  return names;
}

// Text files and clouds may lie in a folder of maps for other reasons.
std::vector<std::string> maps_in(const std::string& folder) {
  return files_in(folder, {".map", ".cairn"});
}

std::vector<Link> links_in(const std::string& folder, const std::vector<ListedMap>& maps) {
  const fs::path path = fs::path(folder) / "pose_graph.json";
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return {};
  FileReader reader(path);
  PoseGraph graph = read_pose_graph(reader);
  // By name without extension: maps may have been converted since.
  const auto index_of = [&](NodeId id) {
    const auto node = std::find_if(graph.nodes.begin(), graph.nodes.end(),
                                   [&](const PoseNode& other) { return other.id == id; });
    return std::find_if(maps.begin(), maps.end(), [&](const ListedMap& one) {
      const fs::path map(one.file);
      return map.stem() == fs::path(node->name).stem() &&
             fs::equivalent(map.parent_path(), folder, ignored);
    });
  };
  std::vector<Link> links;
  for (Link& link : graph.links) {
    const auto target = index_of(link.target);
    const auto source = index_of(link.source);
    if (target == maps.end() || source == maps.end()) continue;
    link.target = NodeId{static_cast<std::uint64_t>(target - maps.begin())};
    link.source = NodeId{static_cast<std::uint64_t>(source - maps.begin())};
    links.push_back(std::move(link));
  }
  return links;
}

}  // namespace

std::vector<std::string> files_in(const std::string& folder, const std::set<std::string>& endings) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored) &&
        endings.contains(lower_case(entry->path().extension().string()))) {
      files.push_back(entry->path().string());
    }
  }
  reject_if(static_cast<bool>(error), folder, error.message(), "a folder that can be read");
  std::sort(files.begin(), files.end());
  return files;
}

bool is_folder_of_maps(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored) || maps_in(path).empty()) return false;
  const std::vector<fs::path> maps = all_formats().maps_of_folder(path);
  return maps.empty() || maps.front() != path;
}

std::vector<std::string> told_apart(const std::vector<PossibleNames>& possible,
                                    const std::vector<std::string>& taken) {
  std::map<std::string, std::size_t> chosen;  // index of a name, by group
  std::vector<std::string> names(possible.size());
  for (bool changed = true; changed;) {
    std::map<std::string, int> uses;
    for (const std::string& name : taken) ++uses[name];
    for (std::size_t i = 0; i < names.size(); ++i) {
      names[i] = possible[i].names[chosen[possible[i].group]];
      ++uses[names[i]];
    }
    std::set<std::string> alike;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto& [group, longer] = possible[i];
      if (uses[names[i]] > 1 && chosen[group] + 1 < longer.size()) alike.insert(group);
    }
    for (const std::string& group : alike) ++chosen[group];
    changed = !alike.empty();
  }
  return names;
}

std::vector<std::string> map_names(const std::vector<std::string>& files) {
  std::vector<PossibleNames> possible;
  for (const std::string& file : files) possible.push_back({file, possible_names(file)});
  return told_apart(possible);
}

std::vector<ListedMap> listed_maps(const std::vector<std::string>& paths) {
  std::vector<ListedMap> maps;
  for (const std::string& path : paths) {
    if (!is_folder_of_maps(path)) {
      maps.push_back({path, {}, {}});
      continue;
    }
    const std::string folder = fs::canonical(path).filename().string();
    for (std::string& file : maps_in(path)) maps.push_back({std::move(file), {}, folder});
  }
  std::vector<std::string> files;
  std::set<std::string> names;
  for (ListedMap& map : maps) {
    files.push_back(map.file);
    // Mini-maps of every run are numbered alike.
    if (!map.session.empty()) map.name = map.session + "/" + fs::path(map.file).stem().string();
  }
  const std::vector<std::string> by_file = map_names(files);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (maps[i].name.empty()) maps[i].name = by_file[i];
    names.insert(maps[i].name);
  }
  if (names.size() == maps.size()) return maps;
  for (std::size_t i = 0; i < maps.size(); ++i) maps[i].name = by_file[i];
  return maps;
}

std::vector<Link> links_of_folders(const std::vector<std::string>& paths,
                                   const std::vector<ListedMap>& maps) {
  std::vector<Link> links;
  for (const std::string& path : paths) {
    if (!is_folder_of_maps(path)) continue;
    for (Link& link : links_in(path, maps)) links.push_back(std::move(link));
  }
  return links;
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
