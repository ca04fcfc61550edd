// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "cairn/map/landmark_map.hpp"

// Formats differ in their conventions for poses, axes and pixels, and some files violate their
// format's conventions. The reprojection error reveals the actual convention: only one explains the
// observations.
namespace cairn {

/// Order of the stored quaternion components.
enum class QuaternionOrder {
  kAsRead,
  kScalarLast,   ///< stored x y z w, read as w x y z
  kScalarFirst,  ///< stored w x y z, read as x y z w
};

/// Meaning of a frame's stored position.
enum class PositionReading {
  kAsRead,               ///< the camera's centre, in the world
  kTranslation,          ///< the stored centre is the translation camera_from_world
  kTranslationIsCentre,  ///< the stored translation camera_from_world is the centre
  kTranslationKept,  ///< the stored translation camera_from_world holds for the corrected rotation
};

enum class FocalReading {
  kAsRead,
  kNormalised,  ///< divided by the longer side of the image; must be multiplied by it
  kMultiplied,  ///< already multiplied by the longer side
};

enum class PixelCentreReading {
  kAsRead,
  kHalfMore,  ///< add half a pixel to both coordinates
  kHalfLess,
};

/// An interpretation of a map's numbers. The default is the format's convention.
struct ConventionReading {
  QuaternionOrder quaternion = QuaternionOrder::kAsRead;
  bool order_is_of_world = false;  ///< the quaternions in the wrong order are world_from_camera
  bool rotation_is_transposed = false;  ///< inverse rotations, or column-major matrices
  PositionReading position = PositionReading::kAsRead;
  bool looks_backwards = false;  ///< camera axes x right, y up, z backward, as in OpenGL
  bool rows_go_up = false;  ///< v of the observations increases upwards from the principal point
  bool is_undistorted = false;  ///< the observations are undistorted
  FocalReading focal = FocalReading::kAsRead;
  PixelCentreReading pixel_centre = PixelCentreReading::kAsRead;

  friend bool operator==(const ConventionReading&, const ConventionReading&) = default;
};

/// Description, e.g. "quaternions are qx qy qz qw, not qw qx qy qz"; empty for the default.
std::string describe(const ConventionReading& reading);

struct ScoredReading {
  ConventionReading reading;
  double median_px = 0.0;  ///< reprojection error; infinite for a landmark behind its camera
};

enum class ConventionVerdict {
  kAsFormat,  ///< the data follow the format
  kOther,     ///< the data follow `best`, another interpretation
  kUndecidable,  ///< `best` and `runner_up` explain the data about equally well; neither is the format's
  kNone,         ///< no interpretation explains the data
  kNotChecked,  ///< the map lacks observations, cameras or poses
};

/// "as_format" etc.: the names in files.
const char* to_string(ConventionVerdict verdict);

struct ConventionCheck {
  ConventionVerdict verdict = ConventionVerdict::kNotChecked;
  double as_format_px = 0.0;  ///< median reprojection error of the map as read
  ScoredReading best;
  /// The best interpretation that projects the landmarks differently; std::nullopt if none.
  std::optional<ScoredReading> runner_up;
  std::size_t observations = 0;  ///< number used
  std::string sentence;          ///< verdict and advice in words
};

/// Projects landmarks into the frames that observed them under every interpretation, for at most two
/// thousand observations spread over the map.
ConventionCheck check_conventions(const LandmarkMap& map);

/// The map under this interpretation: changes poses, pixels and cameras, drops rigs and instants.
LandmarkMap reread(LandmarkMap map, const ConventionReading& reading);

}  // namespace cairn
