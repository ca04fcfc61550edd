// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/storage/sqlite/database.hpp"

// The nodes and links of RTAB-Map's databases, for the readers of maps and of pose graphs.
namespace cairn::detail {

// Kinds of links, as RTAB-Map numbers them.
inline constexpr std::int64_t kRtabmapNeighbor = 0;
inline constexpr std::int64_t kRtabmapUserClosure = 4;
inline constexpr std::int64_t kRtabmapVirtualClosure = 5;
inline constexpr std::int64_t kRtabmapNeighborMerged = 6;

struct RtabmapNode {
  std::uint64_t id = 0;
  Rigid3 world_from_base;
  std::optional<double> stamp_s;
  std::string label;
  std::uint64_t session = 0;
  std::optional<GnssFix> gnss = {};
};

struct RtabmapLink {
  std::uint32_t from = 0;  ///< indices in the nodes
  std::uint32_t to = 0;
  std::int64_t type = kRtabmapNeighbor;
  std::optional<Rigid3> from_from_to;
  std::optional<Matrix6d> covariance;

  /// Whether the link joins successive nodes.
  bool is_neighbor() const { return type == kRtabmapNeighbor || type == kRtabmapNeighborMerged; }
};

/// Nodes with a pose and the links between them.
class RtabmapGraph {
 public:
  RtabmapGraph(sqlite::Database& database, const Execution& execution);

  std::vector<RtabmapNode> nodes;  ///< by id, ascending
  std::vector<RtabmapLink> links;
  bool is_optimised = false;

  /// Index in `nodes` of the node with this id.
  std::optional<std::uint32_t> find(std::int64_t id) const;

 private:
  void read_nodes();
  void read_links();
  void lost(std::size_t count, std::string_view text) const;

  sqlite::Database& database_;
  const Execution& execution_;
};

/// A rigid motion from RTAB-Map's 12 float32 (3×4, row-major); std::nullopt if they are all zero, which means
/// unknown, or not a rotation and a finite translation.
std::optional<Rigid3> pose_of_floats(std::span<const std::byte> bytes);

/// The number if it is finite.
std::optional<double> finite(std::optional<double> value);

}  // namespace cairn::detail
