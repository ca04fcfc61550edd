// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/experiments/study.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#include "cairn/vision/map_sequence.hpp"

namespace cairn {

/// A camera's session in a simulated place.
struct SimulatedSession {
  MappedSequence mapped;  ///< with at least one map
  Trajectory truth;       ///< world_from_camera of all frames
  std::size_t movable = 0;
  std::size_t moved = 0;

  const LandmarkMap& map() const { return mapped.maps.front(); }
  /// Pose of the map in the place: exact for its first camera, with drift elsewhere.
  Rigid3 world_from_map() const;
};

/// Pose of a session's first camera in the map.
enum class SessionStart {
  kOwnFrame,  ///< the identity: the map is in the frame of the first camera
  kTruePose,  ///< the true pose: the map is in the world frame of the place, with z up
};

/// Renders a session frame by frame and maps the frames directly. Path and noise derive from the
/// place's seed and the session number. The same options give the same bytes for any number of
/// threads.
/// @param path    its seed has no effect
/// @param mapping its `odometry.start` has no effect
/// @throws Error (misuse) for options out of range, or if no frame could be tracked; (cancelled)
SimulatedSession map_simulated_session(const EnvironmentOptions& environment, PathOptions path,
                                       SessionStart start, MapSequenceOptions mapping,
                                       const Execution& execution = {});

/// The maps of two sessions of one place, both in its world frame.
/// @throws Error as map_simulated_session, and (misuse) for an unknown environment or path
MapPair simulated_pair(const StudyPair& pair, const MapSequenceOptions& mapping,
                       const Execution& execution = {});

}  // namespace cairn
