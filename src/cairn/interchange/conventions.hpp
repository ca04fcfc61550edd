// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"

// Formats differ in how they write poses, axes and pixels, and files in whether they obey their format. Which
// convention the numbers obey shows in the reprojection error: only one explains the observations.
namespace cairn {

/// In what order the parts of quaternions are stored.
enum class QuaternionOrder {
  kAsRead,
  kScalarLast,   ///< stored x y z w, read as w x y z
  kScalarFirst,  ///< stored w x y z, read as x y z w
};

/// What stands where the position of a frame does.
enum class PositionReading {
  kAsRead,               ///< the camera's centre, in the world
  kTranslation,          ///< the centre as read is the translation camera_from_world
  kTranslationIsCentre,  ///< the translation camera_from_world as read is the centre
  kTranslationKept,      ///< the translation camera_from_world as read stays, whatever the rotation
};

enum class FocalReading {
  kAsRead,
  kNormalised,  ///< divided by the longer side of the image: to be multiplied by it
  kMultiplied,  ///< multiplied by it already
};

enum class PixelCentreReading {
  kAsRead,
  kHalfMore,  ///< half a pixel is to be added to both coordinates
  kHalfLess,
};

/// A way to read the numbers of a map. The default is as its format says.
struct ConventionReading {
  QuaternionOrder quaternion = QuaternionOrder::kAsRead;
  bool order_is_of_world = false;  ///< the quaternions whose order is wrong are world_from_camera
  bool rotation_is_transposed = false;  ///< in the other direction, or matrices column by column
  PositionReading position = PositionReading::kAsRead;
  bool looks_backwards = false;  ///< camera axes x right, y up, z backward, as in OpenGL
  bool rows_go_up = false;  ///< v of the observations is counted upwards from the principal point
  bool is_undistorted = false;  ///< the observations are free of the camera's distortion
  FocalReading focal = FocalReading::kAsRead;
  PixelCentreReading pixel_centre = PixelCentreReading::kAsRead;

  friend bool operator==(const ConventionReading&, const ConventionReading&) = default;
};

/// In words, e.g. "quaternions are qx qy qz qw, not qw qx qy qz"; empty for the default.
std::string describe(const ConventionReading& reading);

struct ScoredReading {
  ConventionReading reading;
  double median_px = 0.0;  ///< reprojection error; a landmark behind its camera counts as infinite
};

enum class ConventionVerdict {
  kAsFormat,  ///< the data obey the format
  kOther,     ///< the data obey `best`, which is another reading
  kUndecidable,  ///< `best` and `runner_up` explain the data about equally well, and neither is the format's
  kNone,        ///< no reading explains the data
  kNotChecked,  ///< the map lacks observations, cameras or poses
};

/// "as_format" and so on: the names in files.
const char* to_string(ConventionVerdict verdict);

struct ConventionCheck {
  ConventionVerdict verdict = ConventionVerdict::kNotChecked;
  double as_format_px = 0.0;  ///< median reprojection error of the map as read
  ScoredReading best;
  /// The best of the readings that put landmarks elsewhere; std::nullopt if there is none.
  std::optional<ScoredReading> runner_up;
  std::size_t observations = 0;  ///< that were looked at
  std::string sentence;          ///< the verdict for people, and what to do
};

/// Projects landmarks into the frames that saw them, under all readings and at most two thousand observations
/// spread over the map.
ConventionCheck check_conventions(const LandmarkMap& map);

/// The map read so: poses, pixels and cameras changed, all else kept.
LandmarkMap reread(LandmarkMap map, const ConventionReading& reading);

}  // namespace cairn
