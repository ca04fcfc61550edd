// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cairn::detail {

/// Bounds of a disparity, in pixels. The disparity is how far a point's pixel in the right image of a rectified pair
/// is to the left of its pixel in the left image.
struct DisparityRange {
  double least = 0.0;
  double most = 0.0;
};

struct Disparity {
  double pixels = 0.0;
  Eigen::Vector2d slope =
      Eigen::Vector2d::Zero();  ///< its increase per pixel to the right and downwards
};

/// Subpixel disparity of a place in the left image. Chooses the column, in the same row of the right image, whose
/// window correlates best. The search back from this column must return to the place, and no other column may
/// correlate nearly as well. Patch alignment refines the column within the row.
/// @param left, right 8 bit, of one size
/// @return std::nullopt if there is no such column within the range, or if the place and the places beside it do not
///         lie on one surface, because the place may then belong to either of two surfaces
std::optional<Disparity> disparity(const cv::Mat& left, const cv::Mat& right,
                                   const Eigen::Vector2d& at, const DisparityRange& range);

}  // namespace cairn::detail
