// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// A trajectory and the name of its file.
struct NamedTrajectory {
  std::string file;
  Trajectory trajectory;
};

/// Two maps of one desk, each in a frame of its own, and how they came about.
struct DemoPair {
  LandmarkMap source;
  LandmarkMap target;
  Rigid3 target_from_source;  ///< the truth
  std::vector<NamedTrajectory> trajectories;
  std::string story;  ///< for people; ends a line
  Json description;   ///< fields for the document
};

/// Renders two sessions with an RGB-D camera that goes round a desk once, some things moved in
/// between, and maps them. Only where the tool was built with CAIRN_HAS_SIMULATED_SESSIONS.
/// @param frames a session
/// @throws Error (misuse) if a session cannot be mapped with so few; (cancelled)
DemoPair simulated_demo(std::size_t frames, const CommonArguments& common);

}  // namespace cairn::cli
