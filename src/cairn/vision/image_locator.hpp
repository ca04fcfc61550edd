// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
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

/// A corner in the image and its matched landmark.
struct ImageMatch {
  Pixel pixel;  ///< in the original image
  LandmarkIndex landmark;
  std::int32_t octave = 0;             ///< pyramid level of the corner
  std::optional<double> depth_m = {};  ///< depth at the corner, if a depth image was given
};

/// Why an image was not located.
enum class LocationFailure {
  kFewMatches,    ///< no pose agrees with enough matches
  kFewInliers,    ///< chance explains the inliers of the best pose
  kImprobable,    ///< the probability of the best pose is too low
  kAmbiguous,     ///< another pose explains other matches
  kFocalLength,   ///< the matches do not determine the focal length
  kLens,          ///< the matches fit another lens far better than the camera's
  kUndetermined,  ///< without a few matches, the others do not determine the pose
  kGivenPoses,  ///< images located together have poses of their own that contradict the given ones
};

/// "few_matches", "few_inliers", "improbable", "ambiguous", "focal_length", "lens", "undetermined" or "given_poses".
std::string_view to_string(LocationFailure failure);

/// Result of locating an image.
struct ImageLocation {
  bool located = false;      ///< whether the pose is accepted; else see failure
  double probability = 0.0;  ///< probability that the estimate is correct
  std::string reason;        ///< one sentence: decision and probability, then the evidence
  std::optional<LocationFailure> failure;  ///< std::nullopt if located
  /// Camera pose, in the map's unit of length; std::nullopt unless located.
  std::optional<Rigid3> world_from_camera;
  /// The best pose found, whatever its probability.
  std::optional<Rigid3> estimate;
  /// Another pose with enough evidence to lower the probability of the estimate.
  std::optional<Rigid3> rival;
  /// Covariance of the estimate, (δt, δφ) in the map's frame, in the map's unit and radians.
  /// Includes the errors of corners and landmarks, but no error common to the whole map. Enlarged
  /// as if the most decisive landmarks, half of `expected` in number, were left out, because they
  /// may be matched by chance. std::nullopt if the others do not determine the pose.
  std::optional<Matrix6d> covariance;
  std::size_t corners = 0;  ///< detected in the image
  std::size_t proposals =
      0;  ///< corner-landmark pairs that are mutual nearest neighbours by descriptor
  std::size_t visible = 0;          ///< landmarks that the estimate projects near a corner
  double expected = 0.0;            ///< expected number of chance matches among `visible`
  std::size_t spread = 0;           ///< matches outside the largest cluster in the image
  std::vector<ImageMatch> matches;  ///< matches that agree with the estimate
  /// Descriptors of the matched corners, of the kind of the map's landmarks: one row per match.
  std::vector<std::uint8_t> descriptors;
  Camera camera;  ///< camera of the image
  /// Standard deviation of the focal length, pixels; std::nullopt unless estimated with the pose.
  std::optional<double> focal_length_sigma;
};

/// Whether the focal length of a camera is known or estimated with the pose.
enum class FocalLength { kKnown, kUnknown };

/// Estimates the camera pose of an image in a map (Sattler et al. 2011 describe the task). The
/// locator matches the image's features with all landmarks, and again with the landmarks of the
/// most likely frames. P3P in a progressive sample consensus (PROSAC) proposes poses. A guided
/// search near the projected landmarks adds matches, and the pose is refined. The verdict compares
/// the descriptor distances of the matches with the distances of other landmarks to the same
/// features.
class ImageLocator {
 public:
  /// @param map    map with ORB descriptors of 32 bytes or SIFT descriptors of 128 bytes. RootSIFT
  ///               is used for the images if the map's descriptors are RootSIFT
  /// @param camera camera of the images; without defect
  /// @throws Error (input) for a map without such descriptors; (misuse) for a defective camera or invalid
  ///        options
  ImageLocator(const LandmarkMap& map, const Camera& camera, const LocateOptions& options = {});
  ~ImageLocator();
  ImageLocator(ImageLocator&&) noexcept;
  ImageLocator& operator=(ImageLocator&&) noexcept;

  /// Locator for images of another camera; both share the prepared map.
  /// @param focal_length if unknown, focal length, distortion and principal point are found with
  ///        each pose. `camera` then gives the size, one of the initial focal lengths and an
  ///        approximate principal point, and the result's camera has the model RADIAL
  /// @throws Error (misuse) for a defective camera
  ImageLocator with_camera(const Camera& camera,
                           FocalLength focal_length = FocalLength::kKnown) const;

  /// Thread-safe. The same input gives the same result.
  /// @param image     image of the camera's size
  /// @param depth     depth image of the same size; empty if unknown. Used only for a map in metres
  /// @param execution only its seed is used
  /// @throws Error (input) for an image of another size
  ImageLocation locate(const GrayImage& image, const DepthImage& depth = {},
                       const Execution& execution = {}) const;

 private:
  struct Landmarks;
  class View;
  class Together;
  explicit ImageLocator(std::unique_ptr<const View> view);
  friend std::vector<ImageLocation> locate_together(std::span<const struct BodyView> views,
                                                    const Execution& execution);
  friend std::vector<ImageLocation> locate_with_shared_lens(
      const ImageLocator& locator, std::size_t count,
      const std::function<GrayImage(std::size_t)>& image_of, const Execution& execution);
  std::unique_ptr<const View> view_;
};

/// Locates images of one camera with an unknown lens. Each image is located with its own estimate
/// of the lens, and again with the other images' estimates as a prior. Images that show the same
/// landmarks count less, because they share the errors of these landmarks.
/// @param locator   for images of unknown focal length (with_camera())
/// @param count     number of images
/// @param image_of  returns an image, of the camera's size; called twice for each, by several threads
/// @param execution executor and seed
/// @throws Error (misuse) for a locator with a known focal length; (input) for an image of another size; (cancelled)
std::vector<ImageLocation> locate_with_shared_lens(
    const ImageLocator& locator, std::size_t count,
    const std::function<GrayImage(std::size_t)>& image_of, const Execution& execution = {});

/// An image with a known pose relative to others, e.g. from a sequence with odometry or from a rig.
struct BodyView {
  const ImageLocator* locator = nullptr;  ///< for the image's camera, its focal length known
  const GrayImage* image = nullptr;       ///< of the camera's size
  Rigid3 body_from_camera;  ///< in any frame common to all images, and the map's unit of length
};

/// Locates images as one query. Each image proposes poses of the body. The pose with the most
/// evidence in all images together is refined with the matches of all, and judged once. A landmark
/// counts once, however many images show it. The poses relative to each other count as exact: use
/// images over which the odometry's error stays within some pixels.
/// @param views     at least one; their locators share one prepared map (with_camera())
/// @param execution executor, for the images side by side, and seed
/// @return for each image its own pose, matches and covariance, with the common verdict; an image
///         with fewer than six matches of its own is not located
/// @throws Error (misuse) for no image, locators of several maps, or an unknown focal length;
///         (input) for an image of another size
std::vector<ImageLocation> locate_together(std::span<const BodyView> views,
                                           const Execution& execution = {});

}  // namespace cairn
