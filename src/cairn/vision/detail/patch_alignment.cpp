// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/patch_alignment.hpp"

#include <cmath>

#include <Eigen/LU>

namespace cairn::detail {
namespace {

constexpr int kHalf = 4;                // 9 x 9 pixels are compared
constexpr int kPadded = 2 * kHalf + 3;  // and one more on each side, for gradients
constexpr int kCompared = 2 * kHalf + 1;

struct Template {
  std::array<float, kCompared * kCompared> values;
  std::array<float, kCompared * kCompared> by_x;
  std::array<float, kCompared * kCompared> by_y;
};

std::optional<Template> warped(const ReferencePatch& patch,
                               const Eigen::Matrix2d& reference_from_image) {
  std::array<float, kPadded * kPadded> padded;
  for (int row = 0; row < kPadded; ++row) {
    for (int column = 0; column < kPadded; ++column) {
      const auto value =
          patch.sample(reference_from_image * Eigen::Vector2d(column - kHalf - 1, row - kHalf - 1));
      if (!value) return std::nullopt;
      padded[static_cast<std::size_t>(row * kPadded + column)] = *value;
    }
  }
  Template result;
  for (int row = 0; row < kCompared; ++row) {
    for (int column = 0; column < kCompared; ++column) {
      const float* const at = &padded[static_cast<std::size_t>((row + 1) * kPadded + column + 1)];
      const auto i = static_cast<std::size_t>(row * kCompared + column);
      result.values[i] = at[0];
      result.by_x[i] = 0.5F * (at[1] - at[-1]);
      result.by_y[i] = 0.5F * (at[kPadded] - at[-kPadded]);
    }
  }
  return result;
}

// Normalised cross-correlation of two patches, -1 to 1, independent of their contrast.
double correlation(const std::array<float, kCompared * kCompared>& a,
                   const std::array<float, kCompared * kCompared>& b) {
  constexpr auto kCount = static_cast<double>(kCompared * kCompared);
  double sum_a = 0.0;
  double sum_b = 0.0;
  double sum_aa = 0.0;
  double sum_bb = 0.0;
  double sum_ab = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum_a += a[i];
    sum_b += b[i];
    sum_aa += static_cast<double>(a[i]) * a[i];
    sum_bb += static_cast<double>(b[i]) * b[i];
    sum_ab += static_cast<double>(a[i]) * b[i];
  }
  const double variance_a = sum_aa - sum_a * sum_a / kCount;
  const double variance_b = sum_bb - sum_b * sum_b / kCount;
  if (!(variance_a > 0.0 && variance_b > 0.0)) return 0.0;
  return (sum_ab - sum_a * sum_b / kCount) / std::sqrt(variance_a * variance_b);
}

}  // namespace

std::optional<ReferencePatch> ReferencePatch::cut(const cv::Mat& level_image,
                                                  const Eigen::Vector2d& center) {
  constexpr int kRadius = kSide / 2;
  const auto left = static_cast<int>(std::floor(center.x()));
  const auto top = static_cast<int>(std::floor(center.y()));
  if (left - kRadius < 0 || top - kRadius < 0 || left + kRadius + 1 >= level_image.cols ||
      top + kRadius + 1 >= level_image.rows) {
    return std::nullopt;
  }
  const auto right_share = static_cast<float>(center.x() - left);
  const auto bottom_share = static_cast<float>(center.y() - top);
  ReferencePatch patch;
  for (int row = 0; row < kSide; ++row) {
    const std::uint8_t* const above =
        level_image.ptr<std::uint8_t>(top + row - kRadius) + left - kRadius;
    const std::uint8_t* const below = above + level_image.step;
    for (int column = 0; column < kSide; ++column) {
      const auto upper = (1.0F - right_share) * static_cast<float>(above[column]) +
                         right_share * static_cast<float>(above[column + 1]);
      const auto lower = (1.0F - right_share) * static_cast<float>(below[column]) +
                         right_share * static_cast<float>(below[column + 1]);
      patch.values_[static_cast<std::size_t>(row * kSide + column)] = static_cast<std::uint8_t>(
          std::lround((1.0F - bottom_share) * upper + bottom_share * lower));
    }
  }
  return patch;
}

std::optional<float> ReferencePatch::sample(const Eigen::Vector2d& offset) const {
  constexpr int kCenter = kSide / 2;
  const double x = kCenter + offset.x();
  const double y = kCenter + offset.y();
  if (!(x >= 0.0 && y >= 0.0 && x < kSide - 1 && y < kSide - 1)) return std::nullopt;
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const auto right = static_cast<float>(x - column);
  const auto down = static_cast<float>(y - row);
  const std::uint8_t* const at = &values_[static_cast<std::size_t>(row * kSide + column)];
  return (1.0F - down) * ((1.0F - right) * at[0] + right * at[1]) +
         down * ((1.0F - right) * at[kSide] + right * at[kSide + 1]);
}

std::optional<Eigen::Vector2d> align_patch(const ReferencePatch& patch, const cv::Mat& image,
                                           const Eigen::Matrix2d& reference_from_image,
                                           const Eigen::Vector2d& start, double most_away) {
  const auto seen = warped(patch, reference_from_image);
  if (!seen) return std::nullopt;
  Eigen::Matrix3f hessian = Eigen::Matrix3f::Zero();  // of the shift and the offset in brightness
  for (std::size_t i = 0; i < seen->values.size(); ++i) {
    const Eigen::Vector3f gradient(seen->by_x[i], seen->by_y[i], 1.0F);
    hessian += gradient * gradient.transpose();
  }
  const Eigen::Matrix3f inverse = hessian.inverse();
  if (!inverse.allFinite()) return std::nullopt;

  Eigen::Vector2d at = start;
  float brighter = 0.0F;
  std::array<float, kCompared * kCompared> found;
  constexpr int kMostSteps = 10;
  bool settled = false;
  for (int step = 0; step <= kMostSteps; ++step) {
    const auto left = static_cast<int>(std::floor(at.x()));
    const auto top = static_cast<int>(std::floor(at.y()));
    if (left - kHalf < 0 || top - kHalf < 0 || left + kHalf + 1 >= image.cols ||
        top + kHalf + 1 >= image.rows) {
      return std::nullopt;
    }
    const auto right_share = static_cast<float>(at.x() - left);
    const auto bottom_share = static_cast<float>(at.y() - top);
    const float w00 = (1.0F - right_share) * (1.0F - bottom_share);
    const float w10 = right_share * (1.0F - bottom_share);
    const float w01 = (1.0F - right_share) * bottom_share;
    const float w11 = right_share * bottom_share;
    float sum_x = 0.0F;
    float sum_y = 0.0F;
    float sum = 0.0F;
    for (int row = 0; row < kCompared; ++row) {
      const std::uint8_t* const above = image.ptr<std::uint8_t>(top + row - kHalf) + left - kHalf;
      const std::uint8_t* const below = above + image.step;
      for (int column = 0; column < kCompared; ++column) {
        const auto i = static_cast<std::size_t>(row * kCompared + column);
        found[i] = w00 * above[column] + w10 * above[column + 1] + w01 * below[column] +
                   w11 * below[column + 1];
        const float difference = found[i] - seen->values[i] + brighter;
        sum_x += difference * seen->by_x[i];
        sum_y += difference * seen->by_y[i];
        sum += difference;
      }
    }
    if (settled) break;  // `found` is what is there now
    const Eigen::Vector3f update = -(inverse * Eigen::Vector3f(sum_x, sum_y, sum));
    at += update.head<2>().cast<double>();
    brighter += update.z();
    if (!((at - start).squaredNorm() <= most_away * most_away)) return std::nullopt;
    constexpr float kSettled = 0.03F;  // pixels
    settled = update.head<2>().norm() < kSettled;
  }
  constexpr double kLeastCorrelation = 0.8;
  if (!settled || correlation(seen->values, found) < kLeastCorrelation) return std::nullopt;
  return at;
}

}  // namespace cairn::detail
