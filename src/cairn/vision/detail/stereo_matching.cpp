// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/stereo_matching.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cairn/vision/detail/patch_alignment.hpp"

namespace cairn::detail {
namespace {

constexpr int kWindowHalf = 5;
constexpr int kWindowSide = 2 * kWindowHalf + 1;
constexpr int kWindowArea = kWindowSide * kWindowSide;

// Moments of a window's brightness.
struct Moments {
  int sum = 0;
  int squares = 0;

  // Times the number of pixels squared.
  double variance() const {
    return static_cast<double>(kWindowArea) * squares - static_cast<double>(sum) * sum;
  }
};

Moments column_moments(const cv::Mat& image, int x, int y) {
  Moments column;
  for (int dy = -kWindowHalf; dy <= kWindowHalf; ++dy) {
    const int value = image.at<std::uint8_t>(y + dy, x);
    column.sum += value;
    column.squares += value * value;
  }
  return column;
}

Moments window_moments(const cv::Mat& image, int x, int y) {
  Moments window;
  for (int dx = -kWindowHalf; dx <= kWindowHalf; ++dx) {
    const Moments column = column_moments(image, x + dx, y);
    window.sum += column.sum;
    window.squares += column.squares;
  }
  return window;
}

// The column from `first` to `last` whose window correlates best with that of another image at (x, y). std::nullopt
// if the correlation is low, or nearly as high elsewhere.
std::optional<int> best_column(const cv::Mat& image, int x, int y, const cv::Mat& searched,
                               int first, int last) {
  first = std::max(first, kWindowHalf);
  last = std::min(last, searched.cols - 1 - kWindowHalf);
  const Moments here = window_moments(image, x, y);
  const double variance = here.variance();
  if (first > last || !(variance > 0.0)) return std::nullopt;
  std::array<std::uint8_t, kWindowArea> window;
  for (int dy = 0; dy < kWindowSide; ++dy) {
    std::copy_n(image.ptr<std::uint8_t>(y + dy - kWindowHalf) + x - kWindowHalf, kWindowSide,
                window.begin() + dy * kWindowSide);
  }
  std::vector<double> scores;
  Moments there = window_moments(searched, first, y);
  for (int column = first; column <= last; ++column) {
    int products = 0;
    for (int dy = 0; dy < kWindowSide; ++dy) {
      const std::uint8_t* const row =
          searched.ptr<std::uint8_t>(y + dy - kWindowHalf) + column - kWindowHalf;
      for (int dx = 0; dx < kWindowSide; ++dx) products += row[dx] * window[dy * kWindowSide + dx];
    }
    const double covariance =
        static_cast<double>(kWindowArea) * products - static_cast<double>(here.sum) * there.sum;
    const double both = variance * there.variance();
    scores.push_back(both > 0.0 ? covariance / std::sqrt(both) : 0.0);
    if (column == last) break;
    const Moments leaves = column_moments(searched, column - kWindowHalf, y);
    const Moments enters = column_moments(searched, column + kWindowHalf + 1, y);
    there.sum += enters.sum - leaves.sum;
    there.squares += enters.squares - leaves.squares;
  }
  const auto best = std::max_element(scores.begin(), scores.end());
  constexpr double kLeastCorrelation = 0.7;
  constexpr double kNoise = 0.01;  // of a correlation
  if (*best < kLeastCorrelation) return std::nullopt;
  constexpr std::ptrdiff_t kPeak = 2;  // pixels to each side that belong to one maximum
  constexpr double kDistinct = 0.8;    // of what the next best lacks to a perfect correlation
  for (auto other = scores.begin(); other != scores.end(); ++other) {
    if (std::abs(other - best) > kPeak && 1.0 - *best + kNoise > kDistinct * (1.0 - *other)) {
      return std::nullopt;
    }
  }
  return first + static_cast<int>(best - scores.begin());
}

// Refines a disparity by patch alignment.
std::optional<double> aligned(const cv::Mat& left, const cv::Mat& right, const Eigen::Vector2d& at,
                              double start, double most_away) {
  const auto patch = ReferencePatch::cut(left, at);
  if (!patch) return std::nullopt;
  const auto found = align_patch(*patch, right, Eigen::Matrix2d::Identity(),
                                 at - Eigen::Vector2d(start, 0.0), most_away);
  constexpr double kMostOffRow = 1.0;
  if (!found || std::abs(found->y() - at.y()) > kMostOffRow) return std::nullopt;
  return at.x() - found->x();
}

// The slope along an axis from the places on both sides; std::nullopt if they do not lie on one surface with the middle.
std::optional<double> slope_along(const cv::Mat& left, const cv::Mat& right,
                                  const Eigen::Vector2d& at, double middle,
                                  const Eigen::Vector2d& axis) {
  constexpr double kBeside = 8.0;    // pixels: the windows, of 4 to each side, do not overlap
  constexpr double kSteepest = 0.4;  // of a floor: baseline over the camera's height
  constexpr double kMostBend = 0.5;  // pixels: twice what noise of 0.1 a place makes of it
  const auto before = aligned(left, right, at - kBeside * axis, middle, kSteepest * kBeside);
  const auto after = aligned(left, right, at + kBeside * axis, middle, kSteepest * kBeside);
  if (before && after) {
    if (std::abs(*before + *after - 2.0 * middle) > kMostBend) return std::nullopt;
    return (*after - *before) / (2.0 * kBeside);
  }
  if (!before && !after) return std::nullopt;
  const double step = before ? middle - *before : *after - middle;
  return std::abs(step) <= kMostBend ? std::optional(step / kBeside) : std::nullopt;
}

}  // namespace

std::optional<Disparity> disparity(const cv::Mat& left, const cv::Mat& right,
                                   const Eigen::Vector2d& at, const DisparityRange& range) {
  const int x = static_cast<int>(std::lround(at.x()));
  const int y = static_cast<int>(std::lround(at.y()));
  if (x < kWindowHalf || y < kWindowHalf || x + kWindowHalf >= left.cols ||
      y + kWindowHalf >= left.rows) {
    return std::nullopt;
  }
  // Beyond its ends, so that a maximum there is one.
  const int least = static_cast<int>(std::floor(range.least)) - 2;
  const int most = static_cast<int>(std::ceil(range.most)) + 2;
  const auto found = best_column(left, x, y, right, x - most, x - least);
  if (!found) return std::nullopt;
  const auto back = best_column(right, *found, y, left, *found + least, *found + most);
  if (!back || std::abs(*back - x) > 1) return std::nullopt;

  constexpr double kMostAway = 1.5;  // pixels from the found column
  const auto refined = aligned(left, right, at, x - *found, kMostAway);
  if (!refined || *refined < range.least || *refined > range.most) return std::nullopt;
  const auto by_x = slope_along(left, right, at, *refined, Eigen::Vector2d::UnitX());
  const auto by_y = slope_along(left, right, at, *refined, Eigen::Vector2d::UnitY());
  if (!by_x || !by_y) return std::nullopt;
  return Disparity{*refined, {*by_x, *by_y}};
}

}  // namespace cairn::detail
