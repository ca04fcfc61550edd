// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cairn::detail {

/// Bounds of a disparity, pixels: how far to the left of its pixel in the left image of a rectified pair the right
/// image shows a point.
struct DisparityRange {
  double least = 0.0;
  double most = 0.0;
};

struct Disparity {
  double pixels = 0.0;
  Eigen::Vector2d slope =
      Eigen::Vector2d::Zero();  ///< its increase per pixel to the right and downwards
};

/// Subpixel disparity of a place in the left image: the column of the same row of the right image whose window
/// correlates best, if the search back from there returns and no other column is nearly as good; refined by patch
/// alignment, which may not leave the row.
/// @param left, right 8 bit, of one size
/// @return std::nullopt if there is none within the range, or the places beside it do not lie on one surface with it,
///         so that it may belong to either of two
std::optional<Disparity> disparity(const cv::Mat& left, const cv::Mat& right,
                                   const Eigen::Vector2d& at, const DisparityRange& range);

}  // namespace cairn::detail
