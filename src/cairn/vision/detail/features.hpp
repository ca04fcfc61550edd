// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>
#include <opencv2/core/mat.hpp>

#include "cairn/core/error.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/vision/detail/row_motion.hpp"
#include "cairn/vision/detail/stereo_matching.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/odometry.hpp"

namespace cairn::detail {

/// An undistorted pinhole camera, to which keypoints are undistorted.
struct Pinhole : Intrinsics {
  /// @param x_in_camera with positive z
  Eigen::Vector2d project(const Eigen::Vector3d& x_in_camera) const {
    const double inverse = 1.0 / x_in_camera.z();
    return {fx * x_in_camera.x() * inverse + cx, fy * x_in_camera.y() * inverse + cy};
  }
  /// The point at `pixel` with `depth_m` along the optical axis.
  Eigen::Vector3d back_project(const Eigen::Vector2d& pixel, double depth_m) const {
    return {(pixel.x() - cx) / fx * depth_m, (pixel.y() - cy) / fy * depth_m, depth_m};
  }
};

/// A copy of an image of one channel.
/// @throws Error (misuse) if its number of values does not match its size
template <class T>
cv::Mat matrix_of(const Image<T>& image) {
  refuse_if(!image.consistent(), "image", fmt::format("{} values", image.values.size()),
            fmt::format("those of {} x {} pixels", image.width, image.height));
  cv::Mat_<T> matrix(static_cast<int>(image.height), static_cast<int>(image.width));
  std::copy(image.values.begin(), image.values.end(), matrix.template ptr<T>());
  return matrix;
}

/// A binary descriptor of 256 bits.
using Descriptor = std::array<std::uint64_t, 4>;

/// A corner of an image.
struct Keypoint {
  Pixel raw;              ///< in the original image
  Eigen::Vector2f pixel;  ///< undistorted, and moved to where the middle row would have seen it
  /// Along the optical axis, moved in the same way; 0 if unknown or ambiguous.
  float depth_m = 0.0F;
  float read_depth_m = 0.0F;  ///< as read from the depth image or the stereo pair, not moved
  float angle = 0.0F;         ///< of the patch, radians
  std::uint8_t octave = 0;
  PixelSource source = PixelSource::kCorner;
};

/// The corners of one image, with a grid for searches near a pixel.
class Features {
 public:
  Features() = default;
  /// @param pyramid the image, from fine to coarse
  /// @param depth_m as for FeatureExtractor::extract
  /// @param right   pyramid of the right image of a stereo pair; or empty
  Features(std::vector<Keypoint> keypoints, std::vector<Descriptor> descriptors,
           std::vector<cv::Mat> pyramid, cv::Mat depth_m, std::vector<cv::Mat> right = {});

  std::span<const Keypoint> keypoints() const { return keypoints_; }
  std::span<const Descriptor> descriptors() const { return descriptors_; }
  std::size_t size() const { return keypoints_.size(); }
  /// Number of corners; the keypoints after these were added.
  std::size_t corners() const { return corners_; }
  /// Whether there was a depth image or a right image.
  bool has_depth() const { return has_depth_; }

  /// The image, from fine to coarse; empty after it was dropped.
  std::span<const cv::Mat> pyramid() const { return pyramid_; }
  std::span<const cv::Mat> right() const { return right_; }
  const cv::Mat& depth_m() const { return depth_m_; }
  void drop_images() {
    pyramid_.clear();
    right_.clear();
    depth_m_.release();
  }
  /// Makes all depths unknown.
  void drop_depths();
  void add(std::span<const Keypoint> keypoints, std::span<const Descriptor> descriptors);
  /// Moves a keypoint to the place where patch alignment found it.
  void move_keypoint(std::uint32_t index, const Pixel& raw, const Eigen::Vector2f& pixel) {
    keypoints_[index].raw = raw;
    keypoints_[index].pixel = pixel;
    keypoints_[index].source = PixelSource::kPatch;
  }
  /// How the camera moved while the image was taken; set by FeatureExtractor::correct().
  const RowMotion& row_motion() const { return row_motion_; }
  void set_source(std::uint32_t index, PixelSource source) { keypoints_[index].source = source; }

  /// Calls `visit(index)` for each keypoint within `radius` of `pixel` (a square window).
  template <class Visit>
  void visit_near(const Eigen::Vector2d& pixel, double radius, const Visit& visit) const {
    const auto radius_f = static_cast<float>(radius);
    const Eigen::Vector2f center = pixel.cast<float>();
    const int left = column(center.x() - radius_f);
    const int right = column(center.x() + radius_f);
    const int top = row(center.y() - radius_f);
    const int bottom = row(center.y() + radius_f);
    for (int y = top; y <= bottom; ++y) {
      const std::size_t row_begin =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_);
      const std::size_t begin = cell_starts_[row_begin + left];
      const std::size_t end = cell_starts_[row_begin + right + 1];
      for (std::size_t i = begin; i < end; ++i) {
        const std::uint32_t index = in_cells_[i];
        const Eigen::Vector2f offset = keypoints_[index].pixel - center;
        if (std::abs(offset.x()) <= radius_f && std::abs(offset.y()) <= radius_f) visit(index);
      }
    }
  }

 private:
  friend class FeatureExtractor;    // corrects keypoints
  static constexpr int kCell = 16;  // pixels

  int column(float x) const {
    return std::clamp(static_cast<int>(std::floor(x / kCell)), 0, columns_ - 1);
  }
  void fill_grid();
  int row(float y) const {
    return std::clamp(static_cast<int>(std::floor(y / kCell)), 0, rows_ - 1);
  }

  std::vector<Keypoint> keypoints_;
  std::vector<Descriptor> descriptors_;
  std::size_t corners_ = 0;
  std::vector<cv::Mat> pyramid_;
  std::vector<cv::Mat> right_;
  cv::Mat depth_m_;
  bool has_depth_ = false;
  RowMotion row_motion_;
  float usual_depth_m_ = 1.0F;  // assumed for keypoints without depth
  int columns_ = 1;
  int rows_ = 1;
  std::vector<std::uint32_t> cell_starts_ = {0, 0};
  std::vector<std::uint32_t> in_cells_;
};

/// Detects corners as FeatureOptions describe.
class FeatureExtractor {
 public:
  /// @param camera without defect
  FeatureExtractor(const Camera& camera, const FeatureOptions& options);

  /// Thread-safe. A depth that changes abruptly around a corner counts as unknown, because the corner may
  /// belong to either surface.
  /// @param gray 8 bit, of the camera's size
  /// @param depth_m 32-bit float of the same size, 0 if unknown; or empty
  /// @param right   right image of a rectified stereo pair, 8 bit, of the same size; or empty. Excludes depth_m
  /// @throws Error (misuse) for other images; (input) if most disparities are negative, so that left and right are
  ///         swapped
  Features extract(const cv::Mat& gray, const cv::Mat& depth_m, const cv::Mat& right = {}) const;

  /// Descriptors of what the image shows at the keypoints that were added to its corners; std::nullopt near the
  /// image's edges. The features must still have their images.
  std::vector<std::optional<Descriptor>> describe_added(const Features& features) const;

  const Pinhole& pinhole() const { return pinhole_; }
  /// Pixel size of each pyramid level, in pixels of the image.
  const std::vector<double>& scales() const { return scales_; }
  /// Baseline of the stereo pair; 0 with depth images.
  double baseline_m() const { return options_.baseline_m; }
  /// The depth at a place of the image, for a corner on this octave; 0 if unknown or ambiguous.
  float depth_at(const Features& features, const Pixel& raw, int octave) const;
  /// Increase of the depth per pixel to the right and downwards around a place of the image, as a share of the depth
  /// there; zero if the surface is not known well enough.
  Eigen::Vector2d depth_slope(const Features& features, const Pixel& raw, int octave) const;
  /// The same from a depth image.
  float depth_at(const cv::Mat& depth_m, const Pixel& raw) const;
  /// @param reach in pixels: half the side of the window
  static Eigen::Vector2d depth_slope(const cv::Mat& depth_m, const Pixel& raw, double reach);
  /// Moves all keypoints and their depths to where the image's middle row would have seen them. Keypoints without
  /// depth are moved as if they had the median depth of the others. Assumes that colour and depth are read out in the
  /// same way.
  void correct(Features& features, const RowMotion& motion) const;
  /// Corrects one keypoint by the motion that its features have.
  void correct(Features& features, std::uint32_t index) const;
  Keypoint corrected(const Features& features, Keypoint keypoint) const;
  /// @param raw within the image
  Eigen::Vector2f undistorted(const Pixel& raw) const;

 private:
  void check(const cv::Mat& gray, const cv::Mat& depth_m, const cv::Mat& right) const;
  cv::Mat on_level(const cv::Mat& finer, std::size_t level) const;
  DisparityRange disparity_range(int octave) const;
  std::optional<Disparity> disparity_at(const Features& features, const Pixel& raw, int octave,
                                        const DisparityRange& range) const;
  void refuse_swapped(const Features& features) const;

  FeatureOptions options_;
  cv::Size size_;
  Pinhole pinhole_;
  std::vector<double> scales_;
  // Undistorted pixels at every kTableStep-th pixel.
  int table_columns_ = 0;
  std::vector<Eigen::Vector2f> table_;
};

}  // namespace cairn::detail
