// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/odometry.hpp"

namespace cairn {

struct LocateOptions {
  FeatureOptions features = {};
  double min_probability = 0.99;  ///< least probability of a located pose; at least 0.5 and below 1

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// A corner of the image and its landmark.
struct ImageMatch {
  Pixel pixel;  ///< in the original image
  LandmarkIndex landmark;
};

/// Why an image was not located.
enum class LocationFailure {
  kFewMatches,   ///< no pose agrees with enough of them
  kFewInliers,   ///< chance explains those of the best pose
  kImprobable,   ///< the best pose may be right
  kAmbiguous,    ///< another pose explains other matches as well
  kFocalLength,  ///< the matches leave it open
};

/// "few_matches", "few_inliers", "improbable", "ambiguous" or "focal_length".
std::string_view to_string(LocationFailure failure);

/// Result of locating an image.
struct ImageLocation {
  bool located = false;      ///< the probability suffices
  double probability = 0.0;  ///< that the pose is right
  std::string reason;  ///< one sentence for people: the decision and its number, then the evidence
  std::optional<LocationFailure> failure;  ///< std::nullopt if located
  /// Camera pose, in the map's unit of length; std::nullopt unless located.
  std::optional<Rigid3> world_from_camera;
  /// The best pose found, whatever its probability.
  std::optional<Rigid3> estimate;
  /// Another pose with enough evidence to lower the probability of the estimate.
  std::optional<Rigid3> rival;
  /// Of the estimate: translation and rotation vector, in the world. Includes the errors of corners and
  /// landmarks, but not those of the map as a whole.
  std::optional<Matrix6d> covariance;
  std::size_t corners = 0;  ///< detected in the image
  std::size_t proposals =
      0;  ///< corner-landmark pairs that are mutual nearest neighbours by descriptor
  std::size_t visible = 0;          ///< landmarks that the estimate projects near a corner
  double expected = 0.0;            ///< matches among these expected by chance
  std::size_t spread = 0;           ///< matches outside the largest cluster in the image
  std::vector<ImageMatch> matches;  ///< at the estimate
  Camera camera;                    ///< of the image
  /// Standard deviation of the camera's focal length, pixels, if that was found with the pose.
  std::optional<double> focal_length_sigma;
};

/// Whether a camera's focal length is used as it is, or found with the pose.
enum class FocalLength { kKnown, kUnknown };

/// Finds the pose of an image in a map (Sattler et al. 2011 describe the task). Compares the descriptors of the image's
/// features with those of all landmarks, and again with those of the most likely frames; P3P in a progressive sample
/// consensus proposes poses; landmarks are searched again where a pose projects them; the pose is refined. The verdict
/// compares the similarity of the matches with that of other landmarks at the same places.
class ImageLocator {
 public:
  /// @param map with descriptors that can be extracted from an image: ORB of 32 bytes, or SIFT of 128 bytes. The
  ///             image's are RootSIFT if most of the map's are
  /// @param camera of the images; without defect
  /// @throws Error (input) for a map without such descriptors; (misuse) for a defective camera or invalid
  ///        options
  ImageLocator(const LandmarkMap& map, const Camera& camera, const LocateOptions& options = {});
  ~ImageLocator();
  ImageLocator(ImageLocator&&) noexcept;
  ImageLocator& operator=(ImageLocator&&) noexcept;

  /// The same for images of another camera. The prepared map is shared.
  /// @param focal_length if unknown, only the camera's size and its principal point are used. Locations then have a
  ///                     camera of the model RADIAL
  /// @throws Error (misuse) for a defective camera
  ImageLocator with_camera(const Camera& camera,
                           FocalLength focal_length = FocalLength::kKnown) const;

  /// Thread-safe. The same input gives the same result.
  /// @param image   of the camera's size
  /// @param depth   of the same size; empty if unknown. Ignored if the map's unit of length is free.
  /// @param execution of which only the seed counts
  /// @throws Error (input) for an image of another size
  ImageLocation locate(const GrayImage& image, const DepthImage& depth = {},
                       const Execution& execution = {}) const;

 private:
  struct Landmarks;
  class View;
  explicit ImageLocator(std::unique_ptr<const View> view);
  std::unique_ptr<const View> view_;
};

}  // namespace cairn
