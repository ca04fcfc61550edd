// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/map/landmark_map.hpp"

// Shared by formats with images and cameras, mostly by their writers.
namespace cairn::detail {

/// @param image the system's term for a frame, e.g. "a shot of OpenSfM"
/// @throws Error (input) naming a frame without a camera
void require_cameras(const LandmarkMap& map, std::string_view image);

/// The camera of a frame that has one.
const Camera& camera_of(const LandmarkMap& map, FrameIndex frame);
/// @throws Error (input) naming the camera, whose model the system lacks
[[noreturn]] void refuse_model(const Camera& camera, std::string_view system);
/// Colour of a landmark; black if unknown.
Color color_of(const LandmarkMap& map, std::uint32_t landmark);

/// Ids for another system: the map's ids if all are at most `most`, otherwise numbers from `first` on.
template <class Id>
std::vector<std::uint64_t> fitting_ids(const std::vector<Id>& ids, std::uint64_t most,
                                       std::uint64_t first) {
  std::vector<std::uint64_t> result;
  result.reserve(ids.size());
  const bool fit = std::all_of(ids.begin(), ids.end(), [&](Id id) { return id.value <= most; });
  for (std::size_t i = 0; i < ids.size(); ++i) result.push_back(fit ? ids[i].value : first + i);
  return result;
}

/// Ids of a map's cameras, frames and landmarks for another system.
struct WrittenIds {
  /// @param most the largest id of cameras and frames
  /// @param first first of the ids that replace too large ones
  WrittenIds(const LandmarkMap& map, std::uint64_t most, std::uint64_t most_of_landmarks,
             std::uint64_t first);

  /// Logs as a loss which ids were replaced.
  void log_replaced(const LogSink& log, const LandmarkMap& map, std::string_view system,
                    std::string_view path = {}) const;

  std::vector<std::uint64_t> cameras;
  std::vector<std::uint64_t> frames;
  std::vector<std::uint64_t> landmarks;
  std::uint64_t first = 0;
};

/// The observations of each frame, for systems that list the keypoints of an image.
struct FrameObservations {
  explicit FrameObservations(const LandmarkMap& map);

  /// Observations per frame, by the index of their keypoint; observations without one follow in the order of
  /// their landmarks.
  std::vector<std::vector<std::uint64_t>> of_frame;
  std::vector<std::uint32_t> landmark_of;  ///< landmark of each observation
};

/// Whether two poses differ by at most `tolerance`: in position relative to the distance of `b` from the origin, at least
/// 1, and in radians.
bool are_near(const Rigid3& a, const Rigid3& b, double tolerance);

/// The frames that a rig took at one instant, for systems that read the rig's pose instead of the frames'.
struct RigInstants {
  explicit RigInstants(const LandmarkMap& map);

  /// Logs as a loss which frames are not where their rig has them.
  void log_elsewhere(const LogSink& log, std::string_view path) const;

  /// Frames that are where the rig of their first has them, ascending.
  std::map<InstantId, std::vector<std::uint32_t>> together;
  std::vector<std::uint32_t> alone;  ///< all other frames, ascending
  std::size_t elsewhere = 0;         ///< frames that are not where their rig has them
  double farthest = 0.0;             ///< largest distance from there, in the map's unit
};

/// The names of the frames' images; "frame_ID" for a frame whose image has no name.
/// @throws Error (input) naming a frame whose image has the name of another frame's image, because programs
///         would confuse them
std::vector<std::string> image_names(const LandmarkMap& map);

/// image_names() for JSON.
/// @throws Error (input) as image_names(), or naming a frame whose image name is not UTF-8
std::vector<std::string> json_image_names(const LandmarkMap& map);

/// A focal length and radial distortion about the optical axis, as in camera model RADIAL.
struct RadialCamera {
  double focal = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
};
/// The camera as a RadialCamera; std::nullopt if it needs further parameters.
std::optional<RadialCamera> radial_camera(const Camera& camera);

/// Distortion in the form of OpenCV.
struct Distortion {
  bool is_fisheye = false;  ///< whether it is the fisheye model, of k1 to k4
  double k1 = 0.0, k2 = 0.0, p1 = 0.0, p2 = 0.0, k3 = 0.0, k4 = 0.0;
};
/// The camera's distortion; std::nullopt if the camera needs further parameters.
std::optional<Distortion> opencv_distortion(const Camera& camera);
/// Whether the image of the camera is the whole sphere.
bool is_panorama(const Camera& camera);
/// A camera of the simplest model that represents the distortion.
Camera opencv_camera(CameraId id, std::uint32_t width, std::uint32_t height, const Intrinsics& k,
                     const Distortion& distortion);

/// Position of a pixel in an undistorted image of focal length fx, in pixels from the optical axis;
/// std::nullopt if the pixel has no line of sight.
std::optional<Pixel> undistorted_offset(const Camera& camera, const Pixel& pixel);

/// Keypoint index of one observation; `unknown` without one.
std::uint64_t keypoint_index(const LandmarkMap& map, std::uint64_t observation,
                             std::uint64_t unknown);

/// Keypoint index of each observation within its frame: the map's, if every observation has one and they are
/// unique within each frame; otherwise counted from 0 in the order of the landmarks.
std::vector<std::uint32_t> keypoint_indices(const LandmarkMap& map);

}  // namespace cairn::detail
