// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cairn::detail {

/// The brightness around a corner on its pyramid level: a landmark's appearance.
class ReferencePatch {
 public:
  static constexpr int kSide = 25;

  /// std::nullopt if the patch would leave the image.
  /// @param level_image 8 bit
  /// @param center of the patch, at subpixel accuracy
  static std::optional<ReferencePatch> cut(const cv::Mat& level_image,
                                           const Eigen::Vector2d& center);

  /// Interpolated brightness at `offset` from the centre, in the level's pixels. std::nullopt outside the
  /// patch.
  std::optional<float> sample(const Eigen::Vector2d& offset) const;

 private:
  std::array<std::uint8_t, kSide * kSide> values_{};
};

/// Subpixel position of a patch in an image: minimises the squared difference of brightness over 9 x 9
/// pixels, up to a common offset (inverse compositional Lucas-Kanade; Baker and Matthews, IJCV 2004).
/// @param reference_from_image linear part of the patch's warp: rotation, scale, shear
/// @param start pixel of the image near which the patch should be
/// @return std::nullopt if the patch moves by more than `most_away`, leaves the image, or does not match
///         there
std::optional<Eigen::Vector2d> align_patch(const ReferencePatch& patch, const cv::Mat& image,
                                           const Eigen::Matrix2d& reference_from_image,
                                           const Eigen::Vector2d& start, double most_away);

}  // namespace cairn::detail
