// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include <unistd.h>

#include "cairn/atlas/queries.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class KeyHasher {
 public:
  // With its length, so that texts side by side are told apart.
  void add(std::string_view text) {
    add(text.size());
    hasher_.update(text);
  }
  template <class Number>
    requires std::is_arithmetic_v<Number>
  void add(Number number) {
    hasher_.update({reinterpret_cast<const char*>(&number), sizeof number});
  }
  template <class Derived>
  void add(const Eigen::MatrixBase<Derived>& matrix) {
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) add(double{matrix(i, j)});
    }
  }
  template <class Value>
  void add(const std::optional<Value>& value) {
    add(value.has_value());
    if (value) add(*value);
  }
  std::string digest() const { return to_string(hasher_.digest()); }

 private:
  detail::Hasher hasher_;
};

// Of all that Atlas::merge() reads; ids alone would not do, because another atlas may have the same.
std::string key_of(const AtlasState& state, std::uint64_t seed) {
  KeyHasher hasher;
  hasher.add(std::string_view(kVersion));
  hasher.add(seed);
  for (const auto& [id, node] : state.nodes) {
    hasher.add(id.value);
    hasher.add(node.name);
    hasher.add(node.map);
  }
  for (const auto& [id, link] : state.links) {
    if (!is_used(state, link)) continue;
    hasher.add(link.target.value);
    hasher.add(link.source.value);
    hasher.add(static_cast<int>(link.kind));
    hasher.add(link.probability);
    hasher.add(link.target_from_source->matrix());
    hasher.add(link.covariance);
    hasher.add(link.covariance_with_scale);
  }
  for (const auto& [id, pose] : state.poses) {
    hasher.add(id.value);
    hasher.add(pose.frame.value);
    hasher.add(pose.frame_from_node.matrix());
    hasher.add(pose.covariance);
  }
  return "merged world " + hasher.digest();
}

// The map in a file of this key, which is its last step of provenance.
std::optional<LandmarkMap> kept(const fs::path& path, const std::string& key) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return std::nullopt;
  try {
    MapTables tables = read_map(path).tables();
    auto& steps = tables.info.provenance;
    if (steps.empty() || steps.back() != key) return std::nullopt;
    steps.pop_back();
    return LandmarkMap(std::move(tables));
  } catch (const Error&) {
    return std::nullopt;  // it is damaged, and made anew
  }
}

// @return the map again. What cannot be kept is made anew each time.
LandmarkMap keep(LandmarkMap map, const fs::path& path, const std::string& key) {
  MapTables tables = std::move(map).tables();
  tables.info.provenance.push_back(key);
  LandmarkMap marked(std::move(tables));
  std::error_code ignored;
  try {
    // A link would lead to a file of another name, which is not ours to write.
    if (!fs::is_symlink(path, ignored)) write_map(marked, path);
  } catch (const Error&) {
  }
  tables = std::move(marked).tables();
  tables.info.provenance.pop_back();
  return LandmarkMap(std::move(tables));
}

}  // namespace

LandmarkMap merged_world(Atlas& atlas, const AtlasState& state, const Execution& execution) {
  if (state.nodes.size() == 1) return atlas.map(state.nodes.begin()->second);
  const fs::path location = atlas.store().name();
  const bool is_file = is_atlas_file(location);
  const fs::path path = merged_world_file(location);
  const std::string key = key_of(state, execution.seed);
  if (is_file) {
    if (auto map = kept(path, key)) return *std::move(map);
  }
  LandmarkMap map = *std::move(atlas.merge({}, {}, state.commit, execution).map);
  if (!is_file || ::access(location.c_str(), W_OK) != 0) return map;
  return keep(std::move(map), path, key);
}

}  // namespace cairn
