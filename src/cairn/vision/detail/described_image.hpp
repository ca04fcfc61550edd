// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include "cairn/core/detail/descriptor_kernel.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/detail/features.hpp"

namespace cairn::detail {

inline constexpr std::size_t kSiftBytes = 128;  ///< of a descriptor

/// Descriptors that can be made of an image's features.
enum class ImageDescriptor {
  kOrb,       ///< 32 bytes, by Cairn's own corners
  kSift,      ///< 128 bytes: the histograms of Lowe 2004, of length 512
  kRootSift,  ///< square roots of these histograms, of length 512 (Arandjelovic and Zisserman 2012)
};

/// The kind of a map's descriptors; std::nullopt if no image can be compared with them. Both kinds of SIFT have the
/// same name and length; they are told apart by the mean, which is larger for roots.
std::optional<ImageDescriptor> image_descriptor_of(const DescriptorColumn& column);

/// The same of a map.
/// @throws Error (input) if no image can be compared with the map
ImageDescriptor image_descriptor_of(const LandmarkMap& map);

descriptor_kernel::Norm norm_of(ImageDescriptor kind);

/// The features of an image with descriptors of one kind.
struct DescribedImage {
  Features features;                      ///< without their own descriptors
  std::vector<std::uint8_t> descriptors;  ///< a row for each keypoint
};

/// SIFT features of an image, and a row of kSiftBytes for each.
struct SiftFeatures {
  std::vector<cv::KeyPoint> keypoints;
  std::vector<std::uint8_t> descriptors;
};

/// @param gray 8 bit
/// @param most largest number of features to keep, the strongest ones
/// @param root whether the descriptors are square roots
SiftFeatures sift_features(const cv::Mat& gray, int most, bool root);

/// Detects and describes features of images.
class ImageDescriber {
 public:
  /// @param camera without defect
  ImageDescriber(const Camera& camera, const FeatureOptions& options, ImageDescriptor kind);

  /// Thread-safe.
  /// @param gray, depth_m as for FeatureExtractor::extract
  DescribedImage describe(const cv::Mat& gray, const cv::Mat& depth_m) const;

  const FeatureExtractor& extractor() const { return extractor_; }
  std::size_t bytes_each() const {
    return kind_ == ImageDescriptor::kOrb ? sizeof(Descriptor) : kSiftBytes;
  }
  descriptor_kernel::Norm norm() const { return norm_of(kind_); }
  /// Largest distance of descriptors that suggests a match.
  std::uint32_t most_distance() const { return kind_ == ImageDescriptor::kOrb ? 64 : 130000; }

 private:
  DescribedImage describe_by_sift(const cv::Mat& gray, const cv::Mat& depth_m) const;

  FeatureOptions options_;
  ImageDescriptor kind_;
  FeatureExtractor extractor_;
};

}  // namespace cairn::detail
