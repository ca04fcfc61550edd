// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/report/report.hpp"

/// Several maps and their links as sections of a report.
namespace cairn::report {

/// A map and its pose.
struct NetworkMap {
  std::string name = {};
  const LandmarkMap* map = nullptr;  ///< null: its landmarks are not shown
  std::string session = {};          ///< empty: unknown
  std::string reason = {};           ///< why it has no pose
  /// Index of the map whose frame the pose is in, whose own pose is the identity; std::nullopt: no pose.
  std::optional<std::size_t> frame = {};
  Similarity3 frame_from_map = {};
  std::size_t landmarks = 0;
  std::size_t keyframes = 0;
  std::optional<std::size_t> fused = {};     ///< landmarks fused with those of other maps
  Eigen::Vector3d centre = {0.0, 0.0, 0.0};  ///< of the landmarks
  LengthUnit length_unit = LengthUnit::kMetres;
};

/// A link between two of the maps.
struct NetworkEdge {
  std::size_t target = 0;
  std::size_t source = 0;
  LinkUse use = LinkUse::kRejected;
  std::string kind = {};
  std::optional<double> probability = {};
  std::string reason = {};
  std::optional<Similarity3> target_from_source = {};
};

/// The three stages of the poses: every map in its own frame; placed by the most certain chain of used
/// links from its group's frame; optimised.
/// @throws Error (misuse) for an index out of range
Network make_network(std::span<const NetworkMap> maps, std::span<const NetworkEdge> edges);

/// Largest number of landmarks on a page; of more, a regular sample is shown.
inline constexpr std::size_t kShownLandmarks = 400000;

/// Adds the maps' landmarks and the sections `network`, `residuals`, `sessions`, `maps` and `links`, except
/// empty ones.
void add_network(Report& report, std::span<const NetworkMap> maps,
                 std::span<const NetworkEdge> edges, std::vector<NetworkThing> things = {},
                 std::size_t shown_landmarks = kShownLandmarks);

/// Distance of each used or contradicted link from the poses.
IntervalsChart residual_chart(const Network& network);

/// When each map's keyframes were taken; maps without times have no bar. If the longest session would take
/// less than 2 % of the common axis, each session starts at zero.
SpansChart session_chart(std::span<const NetworkMap> maps);

}  // namespace cairn::report
