// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/vision/detail/described_image.hpp"
#include "cairn/vision/detail/described_landmarks.hpp"
#include "cairn/vision/detail/pose_estimation.hpp"

namespace cairn::detail {

/// A feature of an image and a landmark that it may show.
struct FeatureMatch {
  std::uint32_t feature = 0;
  std::uint32_t landmark = 0;  ///< index in DescribedLandmarks
  std::uint32_t distance = 0;  ///< of their descriptors
};

/// What speaks for a pose of an image, or of several images together.
struct PoseEvidence {
  std::size_t agreeing = 0;  ///< matches that agree with the pose
  std::size_t visible = 0;   ///< landmarks that the pose projects near a feature
  double expected = 0.0;     ///< matches among these landmarks expected by chance
  std::size_t spread = 0;    ///< matches outside the largest cluster in the image
  double evidence = 0.0;     ///< log-likelihood ratio of the matches against chance
  /// Number of cells of the image whose landmarks were seen alike before (Sight), and of which none matches.
  std::size_t unmatched_cells = 0;
  std::size_t tried = 1;  ///< different poses of the body that images proposed; at least one
};

/// A pose of an image with its evidence.
struct ImagePose : PoseEvidence {
  PoseEstimate pose;
  std::vector<FeatureMatch> matches;           ///< matches that agree with the pose
  std::vector<std::array<int, 3>> directions;  ///< of the matches, in cells of about five degrees
  std::vector<std::uint32_t> cluster;          ///< landmarks of the largest cluster in the image
  /// Of each feature near landmarks: the most similar one, and the likelihood ratio of a right pose to a wrong one.
  std::vector<std::pair<std::uint32_t, double>> likelihood_ratios;
};

class ImagePoseSearch;

/// One of several images whose cameras are fixed to one body.
struct BodyImage {
  const ImagePoseSearch* search = nullptr;
  SensorModel sensor;
  Rigid3 camera_from_body;
};

/// A pose of a body, with that of each of its images. `evidence` counts each landmark once, however many images show it;
/// `unmatched_cells` is the largest of any image.
struct BodyPose : PoseEvidence {
  PoseEstimate pose;  ///< world_from_body
  std::vector<ImagePose> images;
  double independent = 1.0;  ///< share of the matches that the images do not repeat
};

/// Fewest matches of a pose: three determine it, the others must confirm it.
inline constexpr std::size_t kFewestMatches = 6;
/// Number of cells into which an image is divided.
inline constexpr std::size_t kImageCells = 48;

/// A pose found with one of several focal lengths.
struct FocalLengthPose {
  ImagePose pose;
  double focal_length = 0.0;  ///< pixels; accurate to a few percent
};

/// Searches for the pose of one image among landmarks. Keeps references to all arguments.
class ImagePoseSearch {
 public:
  ImagePoseSearch(const DescribedLandmarks& landmarks, const ImageDescriber& describer,
                  const DescribedImage& image, std::uint64_t seed);

  /// Number of pairs of a feature and a landmark that are mutual nearest neighbours by descriptor.
  std::size_t proposals() const { return mutual_.size(); }
  /// The pose with most evidence.
  std::optional<ImagePose> best(const SensorModel& sensor) const;
  /// The same with each of several focal lengths, from two fifths to four times the image's larger side, in steps of
  /// 15 %, of which one is the sensor's. Most evidence first.
  std::vector<FocalLengthPose> of_focal_lengths(const SensorModel& sensor) const;
  /// The pose and its matches, from an approximate pose; std::nullopt if too few features match there.
  std::optional<ImagePose> settled(const SensorModel& sensor,
                                   const Rigid3& world_from_camera) const;
  /// The same for the images of a body.
  static std::optional<BodyPose> settled_together(std::span<const BodyImage> images,
                                                  const Rigid3& world_from_body);
  /// By how much the covariance of a body's pose grows without as many landmarks as match and fit by chance: half of
  /// ImagePose::expected, rounded up.
  /// @return std::nullopt if the others do not determine the pose
  static std::optional<Matrix6d> growth_without_chance(std::span<const BodyImage> images,
                                                       const BodyPose& body);
  /// Median distance of the landmarks that the pose's matches show.
  double distance_of(const ImagePose& pose) const;
  /// The pose's matches with pixels of the original image, as estimate_lens() takes them.
  std::vector<PointMatch> matches_in_original(const SensorModel& sensor,
                                              const ImagePose& pose) const;
  /// The same with pixels of the undistorted image.
  std::vector<PointMatch> point_matches(const SensorModel& sensor, const ImagePose& pose) const;
  /// The same search with the features of the image as another camera would have undistorted them.
  ImagePoseSearch seen_through(const ImageDescriber& describer, const DescribedImage& image) const;
  /// The best pose from the pairs that `pose` does not explain.
  std::optional<ImagePose> rival(const SensorModel& sensor, const ImagePose& pose) const;
  /// Whether the poses differ by no more than their errors.
  bool same(const ImagePose& a, const ImagePose& b) const;

 private:
  struct View;
  struct Found;

  void set_extent();
  void match_all();
  std::vector<std::uint32_t> likely_frames() const;
  std::vector<FeatureMatch> pairs_near(std::uint32_t frame) const;
  std::optional<Rigid3> proposed(const SensorModel& sensor, std::span<const FeatureMatch> pairs,
                                 int iterations) const;
  View view_from(const SensorModel& sensor, const Rigid3& world_from_camera, double pixels) const;
  Found matches_in(const View& view) const;
  static std::vector<std::vector<PointMatch>> point_matches_of(std::span<const BodyImage> images,
                                                               const BodyPose& body);
  static std::optional<BodyPose> settled_images(std::span<const BodyImage> images,
                                                const Rigid3& world_from_body);
  static void refine_together(std::span<const BodyImage> images, BodyPose& body);
  SensorModel with_focal_length(const SensorModel& sensor, double focal_length) const;
  void weigh(const View& view, const Found& found, ImagePose& pose) const;
  std::vector<std::uint32_t> largest_cluster(std::span<const FeatureMatch> matches) const;

  const DescribedLandmarks* landmarks_;
  const ImageDescriber* describer_;
  const DescribedImage* image_;
  std::uint64_t seed_;
  cv::Size size_;
  // Of the features. Those of a wide lens lie far outside the image once they are undistorted.
  Eigen::AlignedBox2d extent_;
  // Each landmark with its most similar feature, most similar first.
  std::vector<FeatureMatch> pairs_;
  std::vector<FeatureMatch> mutual_;  // the pairs that are mutual nearest neighbours
  // The nearest feature of each descriptor of the landmarks.
  std::vector<descriptor_kernel::Nearest> nearest_features_;
};

}  // namespace cairn::detail
