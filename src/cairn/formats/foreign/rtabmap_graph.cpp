// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/rtabmap_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/zlib_stream.hpp"
#include "cairn/formats/detail/foreign/database_file.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn::detail {
namespace {

// Poses that RTAB-Map optimised and kept, by node.
std::map<std::int64_t, Rigid3> optimised_poses(sqlite::Database& database) {
  std::map<std::int64_t, Rigid3> poses;
  if (column_or_null(database, "Admin", "opt_ids") == "NULL" ||
      column_or_null(database, "Admin", "opt_poses") == "NULL") {
    return poses;
  }
  auto rows = database.prepare("SELECT opt_ids, opt_poses FROM Admin LIMIT 1");
  if (!rows.step()) return poses;
  const auto packed_ids = rows.optional_blob(0);
  const auto packed_poses = rows.optional_blob(1);
  if (!packed_ids || !packed_poses) return poses;
  // Rows, columns and type follow the zlib data, as three 32-bit numbers.
  constexpr std::size_t kTail = 12;
  const auto unpack = [&](std::span<const std::byte> bytes, const char* of) {
    const auto content =
        bytes.size() < kTail ? std::nullopt : inflate_zlib(bytes.first(bytes.size() - kTail));
    if (!content)
      refuse_database(database, "Admin", fmt::format("{} cannot be unpacked", of), "zlib data");
    return *content;
  };
  const std::string ids = unpack(*packed_ids, "opt_ids");
  const std::string matrices = unpack(*packed_poses, "opt_poses");
  constexpr std::size_t kPose = 12 * sizeof(float);
  const std::size_t count = ids.size() / sizeof(std::int32_t);
  if (ids.size() % sizeof(std::int32_t) != 0 || matrices.size() != count * kPose) {
    refuse_database(database, "Admin",
                    fmt::format("{} poses of {} nodes", matrices.size() / kPose, count),
                    "a pose for each node");
  }
  for (std::size_t i = 0; i < count; ++i) {
    std::int32_t id = 0;
    std::memcpy(&id, ids.data() + i * sizeof id, sizeof id);
    const auto pose = pose_of_floats(std::as_bytes(std::span(matrices)).subspan(i * kPose, kPose));
    if (pose) poses.emplace(id, *pose);
  }
  return poses;
}

// From doubles: time, longitude, latitude, altitude, accuracy, bearing.
std::optional<GnssFix> gnss_of(std::span<const std::byte> bytes) {
  std::array<double, 6> numbers{};
  if (bytes.size() != sizeof numbers) return std::nullopt;
  std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
  GnssFix fix{{numbers[2], numbers[1], numbers[3]}, std::nullopt};
  if (!geodetic_defect(fix.position).empty()) return std::nullopt;
  if (numbers[4] > 0.0 && numbers[4] <= kLargestCoordinate) fix.accuracy_m = numbers[4];
  return fix;
}

// From 6 x 6 doubles; std::nullopt if singular.
std::optional<Matrix6d> covariance_of(std::span<const std::byte> bytes) {
  std::array<double, 36> numbers{};
  if (bytes.size() != sizeof numbers) return std::nullopt;
  std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
  Eigen::Matrix<double, 6, 6> information;
  for (int i = 0; i < 36; ++i) information(i / 6, i % 6) = numbers[static_cast<std::size_t>(i)];
  if (!information.allFinite()) return std::nullopt;
  const auto inverse = inverse_of_positive_definite(0.5 * (information + information.transpose()));
  if (!inverse || !inverse->allFinite()) return std::nullopt;
  return Matrix6d(0.5 * (*inverse + inverse->transpose()));
}

}  // namespace

std::optional<double> finite(std::optional<double> value) {
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<Rigid3> pose_of_floats(std::span<const std::byte> bytes) {
  std::array<float, 12> numbers{};
  if (bytes.size() != sizeof numbers) return std::nullopt;
  std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      rotation(row, column) = double{numbers[static_cast<std::size_t>(4 * row + column)]};
    }
    translation[row] = double{numbers[static_cast<std::size_t>(4 * row + 3)]};
  }
  if (!translation.allFinite() || !is_rotation(rotation)) return std::nullopt;
  return Rigid3(Eigen::Quaterniond(rotation).normalized(), translation);
}

RtabmapGraph::RtabmapGraph(sqlite::Database& database, const Execution& execution)
    : database_(database), execution_(execution) {
  read_nodes();
  read_links();
}

std::optional<std::uint32_t> RtabmapGraph::find(std::int64_t id) const {
  const auto wanted = static_cast<std::uint64_t>(id);
  const auto found =
      std::lower_bound(nodes.begin(), nodes.end(), wanted,
                       [](const RtabmapNode& node, std::uint64_t x) { return node.id < x; });
  if (id < 0 || found == nodes.end() || found->id != wanted) return std::nullopt;
  return static_cast<std::uint32_t>(found - nodes.begin());
}

void RtabmapGraph::lost(std::size_t count, std::string_view text) const {
  if (count == 0) return;
  log_remark(execution_.log, database_.name(), fmt::format("{} {}", count, text),
             RemarkKind::kLoss);
}

void RtabmapGraph::read_nodes() {
  const auto optimised = optimised_poses(database_);
  is_optimised = !optimised.empty();
  std::size_t without_pose = 0;
  auto rows = database_.prepare(
      fmt::format("SELECT id, map_id, stamp, pose, label, {} FROM Node ORDER BY id",
                  column_or_null(database_, "Node", "gps")));
  std::size_t no_place = 0;
  while (rows.step()) {
    const std::int64_t id = rows.integer(0);
    if (id < 0)
      refuse_database(database_, fmt::format("Node {}", id), "a negative id", "0 or more");
    std::optional<Rigid3> pose;
    if (const auto found = optimised.find(id); found != optimised.end()) {
      pose = found->second;
    } else if (const auto bytes = rows.optional_blob(3); bytes && optimised.empty()) {
      pose = pose_of_floats(*bytes);
    }
    if (!pose) {
      ++without_pose;
      continue;
    }
    RtabmapNode node{static_cast<std::uint64_t>(id), *pose, finite(rows.optional_real(2)), {}};
    if (const auto label = rows.optional_text(4)) node.label = *label;
    const std::int64_t session = rows.optional_integer(1).value_or(0);
    node.session = session < 0 ? 0 : static_cast<std::uint64_t>(session);
    if (const auto bytes = rows.optional_blob(5); bytes && !bytes->empty()) {
      node.gnss = gnss_of(*bytes);
      no_place += node.gnss ? 0 : 1;
    }
    nodes.push_back(std::move(node));
  }
  lost(without_pose, is_optimised ? "nodes without an optimised pose are left out"
                                  : "nodes without a pose are left out");
  lost(no_place, "GNSS positions are none on the Earth; left out");
}

void RtabmapGraph::read_links() {
  std::size_t others = 0;
  auto rows = database_.prepare(fmt::format(
      "SELECT from_id, to_id, type, transform, {} FROM Link ORDER BY from_id, to_id, type",
      column_or_null(database_, "Link", "information_matrix")));
  std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
  while (rows.step()) {
    RtabmapLink link;
    link.type = rows.integer(2);
    const auto from = find(rows.integer(0));
    const auto to = find(rows.integer(1));
    // Priors, landmarks and gravity link a node with itself or with another object.
    const bool is_between = link.type >= kRtabmapNeighbor && link.type <= kRtabmapNeighborMerged &&
                            link.type != kRtabmapVirtualClosure && from && to && *from != *to;
    if (!is_between) {
      ++others;
      continue;
    }
    link.from = *from;
    link.to = *to;
    // Both directions of a link are stored.
    if (!seen.emplace(std::min(*from, *to), std::max(*from, *to)).second) continue;
    if (const auto bytes = rows.optional_blob(3)) link.from_from_to = pose_of_floats(*bytes);
    if (const auto bytes = rows.optional_blob(4)) link.covariance = covariance_of(*bytes);
    links.push_back(link);
  }
  lost(others, "priors and other links are left out");
}

}  // namespace cairn::detail

namespace cairn {

PoseGraph read_rtabmap_graph(const std::filesystem::path& path, const Execution& execution) {
  sqlite::Database database = detail::open_foreign_database(path, execution);
  const detail::RtabmapGraph graph(database, execution);
  PoseGraph result;
  for (const detail::RtabmapNode& node : graph.nodes) {
    result.nodes.push_back({NodeId{node.id}, node.label, fmt::format("map {}", node.session),
                            Similarity3(node.world_from_base)});
  }
  for (const detail::RtabmapLink& link : graph.links) {
    if (!link.from_from_to) continue;
    Link out;
    out.target = NodeId{graph.nodes[link.from].id};
    out.source = NodeId{graph.nodes[link.to].id};
    out.target_from_source = Similarity3(*link.from_from_to);
    out.covariance = link.covariance;
    out.kind = link.is_neighbor()                         ? LinkKind::kOdometry
               : link.type == detail::kRtabmapUserClosure ? LinkKind::kManual
                                                          : LinkKind::kPlacement;
    result.links.push_back(std::move(out));
  }
  result.validate(path.string());
  return result;
}

}  // namespace cairn
