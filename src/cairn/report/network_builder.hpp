// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/report/report.hpp"

/// Several maps and the links between them as sections of a report.
namespace cairn::report {

/// A map, and what placed it says of it.
struct NetworkMap {
  std::string name = {};
  const LandmarkMap* map = nullptr;  ///< null: its landmarks are not shown
  std::string session = {};          ///< empty: unknown
  std::string reason = {};           ///< why it has no pose
  /// Index of the map in whose frame the pose is; nothing: no pose. That map's own pose is the identity.
  std::optional<std::size_t> frame = {};
  Similarity3 frame_from_map = {};
  std::size_t landmarks = 0;
  std::size_t keyframes = 0;
  std::optional<std::size_t> fused = {};     ///< landmarks that were one with those of other maps
  Eigen::Vector3d centre = {0.0, 0.0, 0.0};  ///< of the landmarks
  LengthUnit length_unit = LengthUnit::kMetres;
};

/// What was found out about two of the maps.
struct NetworkEdge {
  std::size_t target = 0;
  std::size_t source = 0;
  LinkUse use = LinkUse::kRejected;
  std::string kind = {};
  std::optional<double> probability = {};
  std::string reason = {};
  std::optional<Similarity3> target_from_source = {};
};

/// The poses' three stages: every map in its own frame, placed by the surest chain of used links from its
/// group's frame, and as optimised.
/// @throws Error (misuse) for an index that is not one of the maps
Network make_network(std::span<const NetworkMap> maps, std::span<const NetworkEdge> edges);

/// How many landmarks of all maps together a page shows; of more, every so manieth.
inline constexpr std::size_t kShownLandmarks = 400000;

/// Adds the maps' landmarks, and the sections `network`, `residuals`, `sessions`, `maps` and `links`; those
/// that would be empty are left out.
void add_network(Report& report, std::span<const NetworkMap> maps,
                 std::span<const NetworkEdge> edges, std::vector<NetworkThing> things = {},
                 std::size_t shown_landmarks = kShownLandmarks);

/// How far each link that was used is from the poses.
IntervalsChart residual_chart(const Network& network);

/// When each map's keyframes were taken; maps without times have no bar. If the longest session would take
/// less than 2 % of the common axis, each session starts at zero.
SpansChart session_chart(std::span<const NetworkMap> maps);

}  // namespace cairn::report
