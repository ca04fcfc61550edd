// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/simulation/scene.hpp"

namespace cairn {

/// The simulated place.
enum class EnvironmentKind {
  kDesk,  ///< two desks back to back in a small office; layout 1 fits the frame of TUM's fr1/desk2
  kOffice,     ///< an open-plan office of six workplaces
  kCorridor,   ///< a long corridor with doors, boards and a lobby
  kWarehouse,  ///< a hall of pallet racks
  kRoom,       ///< a living room
  kKitchen,    ///< a flat kitchen front of equal units, with a tiled wall
};

/// "desk", "office", "corridor", "warehouse", "room" or "kitchen".
/// @throws Error (misuse) for another name
EnvironmentKind environment_kind(std::string_view name);
std::string_view environment_name(EnvironmentKind kind);
/// Names of all kinds.
std::vector<std::string_view> environment_names();

struct EnvironmentOptions {
  EnvironmentKind kind = EnvironmentKind::kDesk;
  std::uint64_t seed = 1;     ///< seed of the objects and textures
  std::uint64_t session = 0;  ///< selects the moved objects and their new poses
  double changed_fraction =
      0.0;                     ///< share of the movable objects that are moved or removed; 0 to 1
  double texture_scale = 1.0;  ///< factor on the resolution of textures; 0.01 to 2
  /// Layout of rooms and furniture: positions and sizes. 1 is the designed plan; others are
  /// stretched, possibly mirrored, and have furniture of other sizes. std::nullopt: derived from
  /// the seed. Places with equal layouts and different seeds share the plan, but not objects and
  /// textures.
  std::optional<std::uint64_t> layout = std::nullopt;

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Position of a camera and the point it looks at; world frame, metres.
struct Viewpoint {
  Eigen::Vector3d position;
  Eigen::Vector3d target;
};

/// Where a camera has room to move.
struct CameraStage {
  std::vector<Viewpoint> sweep;       ///< visited in order, then in reverse
  Eigen::Vector3d orbit_target;       ///< centre of the orbit and viewing target
  double orbit_radius_m = 1.0;        ///< radius about the vertical through the target
  double orbit_height_m = 1.5;        ///< height above the floor
  std::vector<Eigen::Vector3d> walk;  ///< corners of a closed path, at eye level
};

struct Environment {
  Scene scene;
  CameraStage stage;
};

/// Builds a place. Its world frame has z up and the floor at z = 0. The frame and all unmoved
/// objects are the same for all sessions of one kind, seed and layout. The requested share of the
/// movable objects, rounded to whole objects, is moved on the same desk, shelf or floor. An object
/// without a free spot is removed. The same options give the same scene.
Environment make_environment(const EnvironmentOptions& options,
                             const Executor& executor = Executor());

}  // namespace cairn
