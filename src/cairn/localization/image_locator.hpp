// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/odometry/features.hpp"
#include "cairn/sequence/image.hpp"

namespace cairn {

struct LocateOptions {
  FeatureOptions features = {};
  double min_probability = 0.99;  ///< from which a pose is located; at least 0.5 and below 1
  std::uint64_t seed = 0;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// A corner of the image and the landmark that it shows.
struct ImageMatch {
  Pixel pixel;  ///< in the image as it was taken
  LandmarkIndex landmark;
};

/// What is known of where an image was taken.
struct ImageLocation {
  bool located = false;      ///< the pose can be trusted
  double probability = 0.0;  ///< that the pose is right
  std::string reason;        ///< one sentence for people, with its numbers
  /// The camera's pose, in the map's unit of length. Present only where it is located.
  std::optional<Rigid3> world_from_camera;
  /// The best pose found, whatever its probability.
  std::optional<Rigid3> estimate;
  /// Of the estimate: translation and rotation vector, in the world. It holds the errors of the corners and of the landmarks,
  /// not those that the map has as a whole.
  std::optional<Matrix6d> covariance;
  std::size_t corners = 0;  ///< found in the image
  std::size_t proposals =
      0;  ///< pairs of a corner and a landmark whose descriptors are each other's nearest
  std::size_t visible = 0;  ///< landmarks that the estimate puts at a corner of the image
  double expected = 0.0;    ///< how many of these would match by chance
  std::size_t spread = 0;   ///< matches outside the cluster in the image that has most of them
  std::vector<ImageMatch> matches;  ///< at the estimate
};

/// Finds where in a map an image was taken (Sattler et al. 2011 describe the task): descriptors of the image's
/// corners are compared with those of all landmarks, P3P in a progressive sample consensus proposes a pose, landmarks
/// are searched again where that pose puts them, and the pose is refined. The verdict compares the
/// number of matches with how many would be found by chance.
class ImageLocator {
 public:
  /// @param map    with ORB descriptors of 32 bytes
  /// @param camera of the images; without defect
  /// @throws Error (input) for a map without such descriptors; (misuse) for a camera with a defect, invalid options
  ImageLocator(const LandmarkMap& map, const Camera& camera, const LocateOptions& options = {});
  ~ImageLocator();
  ImageLocator(ImageLocator&&) noexcept;
  ImageLocator& operator=(ImageLocator&&) noexcept;

  /// Thread-safe. Same input, same result.
  /// @param image   of the camera's size
  /// @param depth   of the same size; empty: no depth is known. Not looked at where the map's unit of length is free.
  /// @throws Error (input) for an image of another size
  ImageLocation locate(const GrayImage& image, const DepthImage& depth = {}) const;

 private:
  class Parts;
  std::unique_ptr<const Parts> parts_;
};

}  // namespace cairn
