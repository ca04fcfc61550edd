// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cairn {

/// The brightness around a corner, on its pyramid level: what a landmark looks like.
class ReferencePatch {
 public:
  static constexpr int kSide = 25;

  /// Nothing if the patch would leave the image.
  /// @param level_image 8 bit
  /// @param center      of the patch, which need not be a whole pixel
  static std::optional<ReferencePatch> cut(const cv::Mat& level_image,
                                           const Eigen::Vector2d& center);

  /// Between pixels; `offset` from the centre, in the level's pixels. Nothing outside the patch.
  std::optional<float> sample(const Eigen::Vector2d& offset) const;

 private:
  std::array<std::uint8_t, kSide * kSide> values_{};
};

/// Where in an image a patch appears, to a fraction of a pixel: the shift that minimises the squared
/// difference of brightness over 9 x 9 pixels, up to a common offset (inverse compositional
/// Lucas-Kanade; Baker and Matthews, IJCV 2004).
/// @param reference_from_image linear part of how the patch is seen: turned, scaled, sheared
/// @param start                pixel of the image near which the patch should be
/// @return nothing if it moves away by over `most_away`, leaves the image, or looks different there
std::optional<Eigen::Vector2d> align_patch(const ReferencePatch& patch, const cv::Mat& image,
                                           const Eigen::Matrix2d& reference_from_image,
                                           const Eigen::Vector2d& start, double most_away);

}  // namespace cairn
