// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/described_image.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <utility>

#include <fmt/format.h>
#include <opencv2/features2d.hpp>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

constexpr float kSiftLength = 512.0F;  // of a descriptor, as all systems store them
// SIFT finds more features than corners are needed, and the ones that a map kept need not be the strongest.
constexpr int kSiftFeatures = 4;       // times the number of corners
constexpr double kSiftDiameter = 4.0;  // of the smallest features, pixels
constexpr double kRootMean = 29.0;     // 33 is the mean of a root's bytes on photographs, else 25

void append_sift(const cv::Mat& rows, int row, bool root, std::vector<std::uint8_t>& bytes) {
  const float* const values = rows.ptr<float>(row);
  float norm = 0.0F;
  for (std::size_t k = 0; k < kSiftBytes; ++k) norm += root ? values[k] : values[k] * values[k];
  if (!root) norm = std::sqrt(norm);
  const float per_norm = norm > 0.0F ? 1.0F / norm : 0.0F;
  for (std::size_t k = 0; k < kSiftBytes; ++k) {
    const float share = values[k] * per_norm;
    const float byte = std::round(kSiftLength * (root ? std::sqrt(share) : share));
    bytes.push_back(static_cast<std::uint8_t>(std::clamp(byte, 0.0F, 255.0F)));
  }
}

}  // namespace

std::optional<ImageDescriptor> image_descriptor_of(const DescriptorColumn& column) {
  if (column.kind == "ORB" && column.bytes_each == sizeof(Descriptor)) return ImageDescriptor::kOrb;
  if (column.kind != "SIFT" || column.bytes_each != kSiftBytes) return std::nullopt;
  std::uint64_t sum = 0;
  std::uint64_t known = 0;
  for (std::size_t i = 0; i < column.known.size(); ++i) {
    if (column.known[i] == 0) continue;
    ++known;
    const auto row = column.descriptor(i, 0);
    sum += std::accumulate(row.begin(), row.end(), std::uint64_t{0});
  }
  const double mean =
      static_cast<double>(sum) / (kSiftBytes * std::max<double>(1.0, static_cast<double>(known)));
  return mean > kRootMean ? ImageDescriptor::kRootSift : ImageDescriptor::kSift;
}

ImageDescriptor image_descriptor_of(const LandmarkMap& map) {
  const auto& column = map.landmarks().descriptors;
  const auto kind = column ? image_descriptor_of(*column) : std::nullopt;
  reject_if(!kind, "descriptors",
            column ? fmt::format("{} of {} bytes", column->kind, column->bytes_each) : "none",
            "ORB of 32 bytes or SIFT of 128: an image is compared with these");
  return *kind;
}

descriptor_kernel::Norm norm_of(ImageDescriptor kind) {
  return kind == ImageDescriptor::kOrb ? descriptor_kernel::Norm::kHamming
                                       : descriptor_kernel::Norm::kSquaredBytes;
}

SiftFeatures sift_features(const cv::Mat& gray, int most, bool root) {
  SiftFeatures features;
  cv::Mat rows;
  cv::SIFT::create(most)->detectAndCompute(gray, cv::noArray(), features.keypoints, rows);
  features.descriptors.reserve(features.keypoints.size() * kSiftBytes);
  for (int i = 0; i < rows.rows; ++i) append_sift(rows, i, root, features.descriptors);
  // OpenCV searches an image of twice the size, and takes the middle of each two pixels for the first of them.
  constexpr float kShift = 0.25F;
  for (cv::KeyPoint& keypoint : features.keypoints) keypoint.pt -= cv::Point2f(kShift, kShift);
  return features;
}

ImageDescriber::ImageDescriber(const Camera& camera, const FeatureOptions& options,
                               ImageDescriptor kind)
    : options_(options), kind_(kind), extractor_(camera, options) {}

DescribedImage ImageDescriber::describe(const cv::Mat& gray, const cv::Mat& depth_m) const {
  if (kind_ != ImageDescriptor::kOrb) return describe_by_sift(gray, depth_m);
  DescribedImage image{extractor_.extract(gray, depth_m), {}};
  const auto descriptors = image.features.descriptors();
  image.descriptors.resize(descriptors.size_bytes());
  if (!descriptors.empty()) {
    std::memcpy(image.descriptors.data(), descriptors.data(), descriptors.size_bytes());
  }
  return image;
}

DescribedImage ImageDescriber::describe_by_sift(const cv::Mat& gray, const cv::Mat& depth_m) const {
  SiftFeatures features =
      sift_features(gray, kSiftFeatures * options_.count, kind_ == ImageDescriptor::kRootSift);
  std::vector<Keypoint> keypoints;
  const std::vector<double>& scales = extractor_.scales();
  for (const cv::KeyPoint& found : features.keypoints) {
    Keypoint keypoint;
    keypoint.raw = {found.pt.x, found.pt.y};
    keypoint.pixel = extractor_.undistorted(keypoint.raw);
    keypoint.angle = found.angle * static_cast<float>(CV_PI / 180.0);
    const auto level =
        std::lower_bound(scales.begin(), scales.end() - 1, found.size / kSiftDiameter);
    keypoint.octave = static_cast<std::uint8_t>(level - scales.begin());
    keypoint.read_depth_m = extractor_.depth_at(depth_m, keypoint.raw);
    keypoint.depth_m = keypoint.read_depth_m;
    keypoints.push_back(keypoint);
  }
  return {Features(std::move(keypoints), {}, {gray}, depth_m), std::move(features.descriptors)};
}

}  // namespace cairn::detail
