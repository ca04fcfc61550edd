// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/features.hpp"

#include <cmath>
#include <cstring>

#include <Eigen/Geometry>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/core/statistics.hpp"

namespace cairn::detail {
namespace {

constexpr int kPatchRadius = 15;    // of the patch that determines a corner's direction
constexpr int kBorder = 19;         // least distance of a corner from the edge, for its descriptor
constexpr int kSelectionCell = 32;  // pixels
constexpr int kTableStep = 4;       // pixels

// Half the width of a disc of radius kPatchRadius, per row.
std::array<int, kPatchRadius + 1> disc_half_widths() {
  std::array<int, kPatchRadius + 1> widths{};
  for (int y = 0; y <= kPatchRadius; ++y) {
    widths[static_cast<std::size_t>(y)] = static_cast<int>(
        std::lround(std::sqrt(static_cast<double>(kPatchRadius * kPatchRadius - y * y))));
  }
  return widths;
}

// Direction from the corner to the centroid of its patch's brightness (Rosin).
float patch_angle(const cv::Mat& image, int x, int y) {
  static const auto half_widths = disc_half_widths();
  int moment_x = 0;
  int moment_y = 0;
  for (int dy = -kPatchRadius; dy <= kPatchRadius; ++dy) {
    const int half = half_widths[static_cast<std::size_t>(std::abs(dy))];
    const std::uint8_t* const row = image.ptr<std::uint8_t>(y + dy) + x;
    int sum = 0;
    int weighted = 0;
    for (int dx = -half; dx <= half; ++dx) {
      sum += row[dx];
      weighted += dx * row[dx];
    }
    moment_x += weighted;
    moment_y += dy * sum;
  }
  return std::atan2(static_cast<float>(moment_y), static_cast<float>(moment_x));
}

// Selects the strongest corner of each cell, then the second strongest of each, and so on: evenly spread,
// with weak corners only where there are no others.
std::vector<cv::KeyPoint> spread(const std::vector<cv::KeyPoint>& corners, cv::Size size,
                                 std::size_t wanted, int threshold) {
  const int columns = std::max(1, size.width / kSelectionCell);
  const int rows = std::max(1, size.height / kSelectionCell);
  std::vector<std::vector<const cv::KeyPoint*>> cells(static_cast<std::size_t>(columns * rows));
  for (const cv::KeyPoint& corner : corners) {
    const int column = std::min(columns - 1, static_cast<int>(corner.pt.x) * columns / size.width);
    const int row = std::min(rows - 1, static_cast<int>(corner.pt.y) * rows / size.height);
    cells[static_cast<std::size_t>(row * columns + column)].push_back(&corner);
  }
  struct Ranked {
    std::size_t rank;
    const cv::KeyPoint* corner;
  };
  std::vector<Ranked> ranked;
  ranked.reserve(corners.size());
  const auto stronger = [](const cv::KeyPoint* a, const cv::KeyPoint* b) {
    if (a->response != b->response) return a->response > b->response;
    return a < b;
  };
  for (auto& cell : cells) {
    std::sort(cell.begin(), cell.end(), stronger);
    const bool has_strong =
        !cell.empty() && cell.front()->response >= static_cast<float>(threshold);
    for (std::size_t rank = 0; rank < cell.size(); ++rank) {
      if (has_strong && cell[rank]->response < static_cast<float>(threshold)) break;
      ranked.push_back({rank, cell[rank]});
    }
  }
  const auto first = [&](const Ranked& a, const Ranked& b) {
    return a.rank != b.rank ? a.rank < b.rank : stronger(a.corner, b.corner);
  };
  if (ranked.size() > wanted) {
    std::nth_element(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(wanted),
                     ranked.end(), first);
    ranked.resize(wanted);
  }
  std::sort(ranked.begin(), ranked.end(), first);
  std::vector<cv::KeyPoint> chosen;
  chosen.reserve(ranked.size());
  for (const Ranked& entry : ranked) chosen.push_back(*entry.corner);
  return chosen;
}

// Subpixel offset of a corner: the peak of a quadratic fitted to the 3 x 3 Harris responses around it. At
// most one pixel.
cv::Point2f refined(const cv::Mat& image, int x, int y) {
  constexpr int kWindow = 2;           // the response sums gradients of 5 x 5 pixels
  constexpr int kReach = kWindow + 1;  // for responses one pixel away
  constexpr int kSide = 2 * kReach + 1;
  std::array<std::array<float, kSide>, kSide> xx;
  std::array<std::array<float, kSide>, kSide> xy;
  std::array<std::array<float, kSide>, kSide> yy;
  for (int row = 0; row < kSide; ++row) {
    const std::uint8_t* const at = image.ptr<std::uint8_t>(y + row - kReach) + x - kReach;
    const std::uint8_t* const above = at - image.step;
    const std::uint8_t* const below = at + image.step;
    for (int column = 0; column < kSide; ++column) {
      const auto gradient_x = static_cast<float>(at[column + 1] - at[column - 1]);
      const auto gradient_y = static_cast<float>(below[column] - above[column]);
      const auto i = static_cast<std::size_t>(row);
      const auto j = static_cast<std::size_t>(column);
      xx[i][j] = gradient_x * gradient_x;
      xy[i][j] = gradient_x * gradient_y;
      yy[i][j] = gradient_y * gradient_y;
    }
  }
  std::array<std::array<float, 3>, 3> response{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      float sum_xx = 0.0F;
      float sum_xy = 0.0F;
      float sum_yy = 0.0F;
      for (std::size_t row = i; row < i + 2 * kWindow + 1; ++row) {
        for (std::size_t column = j; column < j + 2 * kWindow + 1; ++column) {
          sum_xx += xx[row][column];
          sum_xy += xy[row][column];
          sum_yy += yy[row][column];
        }
      }
      const float trace = sum_xx + sum_yy;
      response[i][j] = sum_xx * sum_yy - sum_xy * sum_xy - 0.04F * trace * trace;
    }
  }
  // Least squares of a + bx + cy + dx² + exy + fy² to the nine values.
  const auto& r = response;
  const float b = (r[0][2] + r[1][2] + r[2][2] - r[0][0] - r[1][0] - r[2][0]) / 6.0F;
  const float c = (r[2][0] + r[2][1] + r[2][2] - r[0][0] - r[0][1] - r[0][2]) / 6.0F;
  const float e = (r[0][0] + r[2][2] - r[0][2] - r[2][0]) / 4.0F;
  const float rows = r[0][0] + r[0][1] + r[0][2] + r[2][0] + r[2][1] + r[2][2];
  const float columns = r[0][0] + r[1][0] + r[2][0] + r[0][2] + r[1][2] + r[2][2];
  const float d = columns / 6.0F - (r[0][1] + r[1][1] + r[2][1]) / 3.0F;
  const float f = rows / 6.0F - (r[1][0] + r[1][1] + r[1][2]) / 3.0F;
  const float determinant = 4.0F * d * f - e * e;
  if (!(d < 0.0F && determinant > 0.0F)) return {0.0F, 0.0F};  // no peak
  const float dx = (e * c - 2.0F * f * b) / determinant;
  const float dy = (e * b - 2.0F * d * c) / determinant;
  if (std::abs(dx) > 1.0F || std::abs(dy) > 1.0F) return {0.0F, 0.0F};
  return {dx, dy};
}

// Sets the corners' directions. @param corners at least kBorder from the edges
// @return a row of bytes for each
cv::Mat described(const cv::Mat& image, std::vector<cv::KeyPoint>& corners) {
  for (cv::KeyPoint& corner : corners) {
    corner.octave = 0;  // of the pyramid that ORB makes of this level: one level
    corner.size = 2 * kPatchRadius + 1;
    constexpr float kDegrees = 57.29577951F;
    const float angle =
        patch_angle(image, static_cast<int>(corner.pt.x), static_cast<int>(corner.pt.y)) * kDegrees;
    corner.angle = angle < 0.0F ? angle + 360.0F : angle;
  }
  cv::Mat rows;
  cv::ORB::create(static_cast<int>(corners.size()), 1.2F, 1, kBorder - 1)
      ->compute(image, corners, rows);
  return rows;
}

Descriptor descriptor_of(const cv::Mat& rows, std::size_t i) {
  Descriptor descriptor;
  std::memcpy(descriptor.data(), rows.ptr(static_cast<int>(i)), sizeof(descriptor));
  return descriptor;
}

}  // namespace

Features::Features(std::vector<Keypoint> keypoints, std::vector<Descriptor> descriptors,
                   std::vector<cv::Mat> pyramid, cv::Mat depth_m, std::vector<cv::Mat> right)
    : keypoints_(std::move(keypoints)),
      descriptors_(std::move(descriptors)),
      corners_(keypoints_.size()),
      pyramid_(std::move(pyramid)),
      right_(std::move(right)),
      depth_m_(std::move(depth_m)),
      has_depth_(!depth_m_.empty() || !right_.empty()),
      columns_(std::max(1, (pyramid_.front().cols + kCell - 1) / kCell)),
      rows_(std::max(1, (pyramid_.front().rows + kCell - 1) / kCell)) {
  fill_grid();
}

void Features::drop_depths() {
  for (Keypoint& keypoint : keypoints_) keypoint.depth_m = keypoint.read_depth_m = 0.0F;
  depth_m_.release();
  has_depth_ = false;
}

void Features::add(std::span<const Keypoint> keypoints, std::span<const Descriptor> descriptors) {
  keypoints_.insert(keypoints_.end(), keypoints.begin(), keypoints.end());
  descriptors_.insert(descriptors_.end(), descriptors.begin(), descriptors.end());
  fill_grid();
}

void Features::fill_grid() {
  cell_starts_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  const auto cell_of = [&](const Keypoint& keypoint) {
    return static_cast<std::size_t>(row(keypoint.pixel.y()) * columns_ +
                                    column(keypoint.pixel.x()));
  };
  for (const Keypoint& keypoint : keypoints_) ++cell_starts_[cell_of(keypoint) + 1];
  for (std::size_t i = 1; i < cell_starts_.size(); ++i) cell_starts_[i] += cell_starts_[i - 1];
  in_cells_.resize(keypoints_.size());
  std::vector<std::uint32_t> next(cell_starts_.begin(), cell_starts_.end() - 1);
  for (std::size_t i = 0; i < keypoints_.size(); ++i) {
    in_cells_[next[cell_of(keypoints_[i])]++] = static_cast<std::uint32_t>(i);
  }
}

FeatureExtractor::FeatureExtractor(const Camera& camera, const FeatureOptions& options)
    : options_(options) {
  options_.validate();
  if (const std::string defect = camera_defect(camera); !defect.empty()) {
    throw Error(ErrorKind::kMisuse, "camera", defect, "a camera without defect");
  }
  refuse_if(CameraProjection(camera).focal_lengths() == 0, "camera",
            "is a panorama (" + camera.model + "), which no undistorted image can hold",
            "a perspective or fisheye camera");
  size_ = {static_cast<int>(camera.width), static_cast<int>(camera.height)};
  pinhole_ = Pinhole{intrinsics(camera)};
  for (int level = 0; level < options_.levels; ++level) {
    scales_.push_back(std::pow(options_.scale, level));
  }
  table_columns_ = (size_.width - 1) / kTableStep + 2;
  const int table_rows = (size_.height - 1) / kTableStep + 2;
  table_.reserve(static_cast<std::size_t>(table_columns_ * table_rows));
  for (int y = 0; y < table_rows; ++y) {
    for (int x = 0; x < table_columns_; ++x) {
      const Pixel raw{static_cast<double>(x * kTableStep), static_cast<double>(y * kTableStep)};
      const auto ray = unproject(
          camera, raw,
          {(raw.u - pinhole_.cx) / pinhole_.fx, (raw.v - pinhole_.cy) / pinhole_.fy, 1.0});
      // Keeps a pixel without a line of sight to the front; no map point projects there.
      const Eigen::Vector2d pixel =
          ray && ray->z() > 0.0 ? pinhole_.project(*ray) : Eigen::Vector2d(raw.u, raw.v);
      table_.push_back(pixel.cast<float>());
    }
  }
}

Eigen::Vector2f FeatureExtractor::undistorted(const Pixel& raw) const {
  const double x = raw.u / kTableStep;
  const double y = raw.v / kTableStep;
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const auto right = static_cast<float>(x - column);
  const auto down = static_cast<float>(y - row);
  const Eigen::Vector2f* const top =
      &table_[static_cast<std::size_t>(row * table_columns_ + column)];
  const Eigen::Vector2f* const bottom = top + table_columns_;
  return (1.0F - down) * ((1.0F - right) * top[0] + right * top[1]) +
         down * ((1.0F - right) * bottom[0] + right * bottom[1]);
}

Keypoint FeatureExtractor::corrected(const Features& features, Keypoint keypoint) const {
  keypoint.pixel = undistorted(keypoint.raw);
  keypoint.depth_m = keypoint.read_depth_m;
  const RowMotion& motion = features.row_motion();
  if (motion.none()) return keypoint;
  const bool known = keypoint.read_depth_m > 0.0F;
  const double depth = known ? keypoint.read_depth_m : features.usual_depth_m_;
  const Eigen::Vector3d x =
      motion.at_middle(pinhole_.back_project(keypoint.pixel.cast<double>(), depth), keypoint.raw.v);
  keypoint.pixel = pinhole_.project(x).cast<float>();
  if (known) keypoint.depth_m = static_cast<float>(x.z());
  return keypoint;
}

void FeatureExtractor::correct(Features& features, std::uint32_t index) const {
  features.keypoints_[index] = corrected(features, features.keypoints_[index]);
}

void FeatureExtractor::correct(Features& features, const RowMotion& motion) const {
  features.row_motion_ = motion;
  std::vector<float> depths;
  for (const Keypoint& keypoint : features.keypoints_) {
    if (keypoint.read_depth_m > 0.0F) depths.push_back(keypoint.read_depth_m);
  }
  if (!depths.empty()) features.usual_depth_m_ = upper_median(depths);
  for (Keypoint& keypoint : features.keypoints_) keypoint = corrected(features, keypoint);
  features.fill_grid();
}

float FeatureExtractor::depth_at(const cv::Mat& depth_m, const Pixel& raw) const {
  if (depth_m.empty()) return 0.0F;
  const int x = static_cast<int>(std::lround(raw.u));
  const int y = static_cast<int>(std::lround(raw.v));
  if (x < 1 || y < 1 || x + 1 >= depth_m.cols || y + 1 >= depth_m.rows) return 0.0F;
  const float center = depth_m.at<float>(y, x);
  if (!(center > 0.0F && center <= static_cast<float>(options_.max_depth_m))) return 0.0F;
  float nearest = center;
  float farthest = center;
  float slope_x = 0.0F;
  float slope_y = 0.0F;
  int readings = 0;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      const float reading = depth_m.at<float>(y + v, x + u);
      if (!(reading > 0.0F)) continue;
      ++readings;
      nearest = std::min(nearest, reading);
      farthest = std::max(farthest, reading);
      slope_x += static_cast<float>(u) * reading;
      slope_y += static_cast<float>(v) * reading;
    }
  }
  // Bound for slanted surfaces and the sensor's noise.
  const float spread = 0.01F * center + 0.01F * center * center;
  constexpr int kFewest = 5;
  if (readings < kFewest || farthest - nearest > spread) return 0.0F;
  if (readings < 9) return center;
  // Uses the single reading, because its neighbours' errors are correlated with it, and their slope to reach
  // the corner.
  return center + slope_x / 6.0F * static_cast<float>(raw.u - x) +
         slope_y / 6.0F * static_cast<float>(raw.v - y);
}

Eigen::Vector2d FeatureExtractor::depth_slope(const cv::Mat& depth_m, const Pixel& raw,
                                              double reach) {
  if (depth_m.empty()) return Eigen::Vector2d::Zero();
  const int x = static_cast<int>(std::lround(raw.u));
  const int y = static_cast<int>(std::lround(raw.v));
  const int step = std::max(1, static_cast<int>(std::lround(reach / 3.0)));
  if (x < 3 * step || y < 3 * step || x + 3 * step >= depth_m.cols ||
      y + 3 * step >= depth_m.rows) {
    return Eigen::Vector2d::Zero();
  }
  // Least squares over a 7 x 7 grid, from differences across the middle; a missing reading excludes the
  // opposite one.
  const double center = depth_m.at<float>(y, x);
  double sum_x = 0.0;
  double sum_y = 0.0;
  double weight_x = 0.0;
  double weight_y = 0.0;
  int pairs = 0;
  for (int v = -3; v <= 3; ++v) {
    for (int u = -3; u <= 3; ++u) {
      const bool second_half = v > 0 || (v == 0 && u > 0);
      if (!second_half) continue;
      const double there = depth_m.at<float>(y + v * step, x + u * step);
      const double opposite = depth_m.at<float>(y - v * step, x - u * step);
      if (!(there > 0.0 && opposite > 0.0)) continue;
      // On one surface, the differences on both sides are opposite.
      const double bend = std::abs(there + opposite - 2.0 * center);
      if (bend > 0.02 * center + 0.01 * center * center) return Eigen::Vector2d::Zero();
      ++pairs;
      sum_x += u * (there - opposite);
      sum_y += v * (there - opposite);
      weight_x += 2.0 * u * u;
      weight_y += 2.0 * v * v;
    }
  }
  constexpr int kFewest = 14;
  if (pairs < kFewest || !(center > 0.0)) return Eigen::Vector2d::Zero();
  return Eigen::Vector2d(sum_x / weight_x, sum_y / weight_y) / (step * center);
}

// The image of the level before on this one.
cv::Mat FeatureExtractor::on_level(const cv::Mat& finer, std::size_t level) const {
  const cv::Size size(static_cast<int>(std::lround(size_.width / scales_[level])),
                      static_cast<int>(std::lround(size_.height / scales_[level])));
  cv::Mat coarser;
  cv::resize(finer, coarser, size, 0.0, 0.0, cv::INTER_LINEAR);
  return coarser;
}

void FeatureExtractor::check(const cv::Mat& gray, const cv::Mat& depth_m,
                             const cv::Mat& right) const {
  const auto refuse_unless = [&](const cv::Mat& image, int type, std::string_view name,
                                 std::string_view expected) {
    refuse_if(image.type() != type || image.size() != size_, name,
              fmt::format("{} x {} pixels", image.cols, image.rows),
              fmt::format("{} x {} of {}", size_.width, size_.height, expected));
  };
  refuse_unless(gray, CV_8UC1, "image", "8 bit, as the camera has");
  if (!depth_m.empty()) refuse_unless(depth_m, CV_32FC1, "depth image", "32-bit float");
  if (right.empty()) return;
  refuse_unless(right, CV_8UC1, "right image", "8 bit");
  refuse_if(!depth_m.empty(), "right image", "there is a depth image, too", "one of them");
  refuse_if(!(options_.baseline_m > 0.0), "right image", "the baseline is not given",
            "FeatureOptions.baseline_m");
}

Features FeatureExtractor::extract(const cv::Mat& gray, const cv::Mat& depth_m,
                                   const cv::Mat& right) const {
  check(gray, depth_m, right);
  double share = 0.0;  // corners go to the levels in proportion to their side lengths
  for (const double scale : scales_) share += 1.0 / scale;

  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;
  std::vector<cv::Mat> pyramid;
  for (std::size_t level = 0; level < scales_.size(); ++level) {
    const double scale = scales_[level];
    const cv::Mat level_image = level > 0 ? on_level(pyramid.back(), level) : gray;
    pyramid.push_back(level_image);
    const cv::Rect inner(kBorder, kBorder, level_image.cols - 2 * kBorder,
                         level_image.rows - 2 * kBorder);
    if (inner.width < 1 || inner.height < 1) break;
    std::vector<cv::KeyPoint> corners;
    // FAST skips three pixels at the edge of its input.
    cv::FAST(level_image(inner), corners, options_.least_threshold, true);
    const auto wanted = static_cast<std::size_t>(std::lround(options_.count / scale / share));
    corners = spread(corners, inner.size(), wanted, options_.threshold);
    for (cv::KeyPoint& corner : corners) {
      corner.pt.x += static_cast<float>(kBorder);
      corner.pt.y += static_cast<float>(kBorder);
    }
    if (corners.empty()) continue;
    const cv::Mat rows = described(level_image, corners);
    const double scale_x = static_cast<double>(size_.width) / level_image.cols;
    const double scale_y = static_cast<double>(size_.height) / level_image.rows;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      Keypoint keypoint;
      const cv::Point2f offset = refined(level_image, static_cast<int>(corners[i].pt.x),
                                         static_cast<int>(corners[i].pt.y));
      // Centres of pixels are at whole numbers on every level.
      keypoint.raw = {(corners[i].pt.x + offset.x + 0.5) * scale_x - 0.5,
                      (corners[i].pt.y + offset.y + 0.5) * scale_y - 0.5};
      keypoint.pixel = undistorted(keypoint.raw);
      constexpr float kRadians = 0.01745329252F;
      keypoint.angle = corners[i].angle * kRadians;
      keypoint.octave = static_cast<std::uint8_t>(level);
      keypoints.push_back(keypoint);
      descriptors.push_back(descriptor_of(rows, i));
    }
  }
  std::vector<cv::Mat> of_right;
  while (!right.empty() && of_right.size() < pyramid.size()) {
    of_right.push_back(of_right.empty() ? right : on_level(of_right.back(), of_right.size()));
  }
  Features features(std::move(keypoints), std::move(descriptors), std::move(pyramid), depth_m,
                    std::move(of_right));
  for (Keypoint& keypoint : features.keypoints_) {
    keypoint.read_depth_m = depth_at(features, keypoint.raw, keypoint.octave);
    keypoint.depth_m = keypoint.read_depth_m;
  }
  if (!right.empty()) refuse_swapped(features);
  return features;
}

// In pixels of the image.
std::optional<Disparity> FeatureExtractor::disparity_at(const Features& features, const Pixel& raw,
                                                        int octave,
                                                        const DisparityRange& range) const {
  const auto level = static_cast<std::size_t>(octave);
  const cv::Mat& left = features.pyramid()[level];
  const double scale = static_cast<double>(left.cols) / size_.width;
  const Eigen::Vector2d at((raw.u + 0.5) * scale - 0.5,
                           (raw.v + 0.5) * left.rows / size_.height - 0.5);
  auto found = disparity(left, features.right()[level], at, range);
  if (found) found->pixels /= scale;
  return found;
}

DisparityRange FeatureExtractor::disparity_range(int octave) const {
  // A nearer surface looks different to the two cameras.
  constexpr double kNearest = 0.3;
  const double nearest_m = std::max(kNearest, 2.0 * options_.baseline_m);
  const double most = pinhole_.fx * options_.baseline_m / nearest_m;
  return {1.0, most / scales_[static_cast<std::size_t>(octave)]};
}

float FeatureExtractor::depth_at(const Features& features, const Pixel& raw, int octave) const {
  if (features.right().empty()) return depth_at(features.depth_m(), raw);
  const auto found = disparity_at(features, raw, octave, disparity_range(octave));
  return found ? static_cast<float>(pinhole_.fx * options_.baseline_m / found->pixels) : 0.0F;
}

Eigen::Vector2d FeatureExtractor::depth_slope(const Features& features, const Pixel& raw,
                                              int octave) const {
  if (features.right().empty()) {
    return depth_slope(features.depth_m(), raw, 4.0 * scales_[static_cast<std::size_t>(octave)]);
  }
  const auto found = disparity_at(features, raw, octave, disparity_range(octave));
  return found ? Eigen::Vector2d(-found->slope / found->pixels) : Eigen::Vector2d::Zero();
}

// The corners of a pair in the right order have positive disparities.
void FeatureExtractor::refuse_swapped(const Features& features) const {
  constexpr std::ptrdiff_t kEnough = 50;
  const auto keypoints = features.keypoints();
  const auto positive =
      std::count_if(keypoints.begin(), keypoints.end(),
                    [](const Keypoint& keypoint) { return keypoint.read_depth_m > 0.0F; });
  if (positive >= kEnough) return;
  const auto negative =
      std::count_if(keypoints.begin(), keypoints.end(), [&](const Keypoint& keypoint) {
        const DisparityRange range = disparity_range(keypoint.octave);
        return disparity_at(features, keypoint.raw, keypoint.octave, {-range.most, -range.least})
            .has_value();
      });
  reject_if(negative >= kEnough && negative > 4 * positive, "stereo pair",
            fmt::format("{} of {} corners have a negative disparity, {} a positive one", negative,
                        keypoints.size(), positive),
            "the left image first: left and right are swapped");
}

std::vector<std::optional<Descriptor>> FeatureExtractor::describe_added(
    const Features& features) const {
  const std::span added = features.keypoints().subspan(features.corners());
  std::vector<std::optional<Descriptor>> descriptors(added.size());
  for (std::size_t level = 0; level < features.pyramid().size(); ++level) {
    const cv::Mat& image = features.pyramid()[level];
    std::vector<cv::KeyPoint> points;
    std::vector<std::size_t> place;
    for (std::size_t i = 0; i < added.size(); ++i) {
      if (added[i].octave != level) continue;
      // To whole pixels, where corners are before they are refined.
      const double x = std::round((added[i].raw.u + 0.5) * image.cols / size_.width - 0.5);
      const double y = std::round((added[i].raw.v + 0.5) * image.rows / size_.height - 0.5);
      if (x < kBorder || y < kBorder || x >= image.cols - kBorder || y >= image.rows - kBorder) {
        continue;
      }
      points.emplace_back(static_cast<float>(x), static_cast<float>(y), 1.0F);
      place.push_back(i);
    }
    if (points.empty()) continue;
    const cv::Mat rows = described(image, points);
    for (std::size_t i = 0; i < place.size(); ++i) descriptors[place[i]] = descriptor_of(rows, i);
  }
  return descriptors;
}

}  // namespace cairn::detail
