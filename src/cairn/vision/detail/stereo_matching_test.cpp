// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/stereo_matching.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "cairn/vision/detail/features.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

#include "support/refusal.hpp"
#include "support/textured_wall.hpp"

namespace cairn::detail {
namespace {

using ::testing::HasSubstr;
using testing::TexturedWall;

constexpr DisparityRange kRange{1.0, 80.0};

// The image with its content moved to the left.
cv::Mat moved_left(const cv::Mat& image, double pixels) {
  const cv::Mat motion = (cv::Mat_<double>(2, 3) << 1.0, 0.0, -pixels, 0.0, 1.0, 0.0);
  cv::Mat moved;
  cv::warpAffine(image, moved, motion, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  return moved;
}

// Depths of the corners that have one.
std::vector<float> depths_of(const Features& features) {
  std::vector<float> depths;
  for (const Keypoint& keypoint : features.keypoints()) {
    if (keypoint.depth_m > 0.0F) depths.push_back(keypoint.depth_m);
  }
  return depths;
}

// Waves of several directions, moved to the left without any interpolation.
cv::Mat waves(double moved_left) {
  cv::Mat image(200, 640, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      double sum = 128.0;
      for (int k = 0; k < 12; ++k) {
        const double angle = 0.55 * k;
        const double rate = 0.15 + 0.055 * k;  // radians per pixel
        sum += 16.0 * std::sin(rate * (std::cos(angle) * (x + moved_left) + std::sin(angle) * y) +
                               1.7 * k * k);
      }
      image.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(sum);
    }
  }
  return image;
}

TEST(Disparity, IsHowFarTheContentMovedToATenthOfAPixelWithoutBias) {
  const cv::Mat left = waves(0.0);
  double sum = 0.0;
  int found = 0;
  for (const double moved : {3.0, 12.3, 22.5, 40.75}) {
    const cv::Mat right = waves(moved);
    for (double x = 120.0; x < 600.0; x += 37.37) {
      const auto at = disparity(left, right, {x, 100.6}, kRange);
      if (!at) continue;
      ++found;
      sum += at->pixels - moved;
      EXPECT_NEAR(at->pixels, moved, 0.1) << x;
      EXPECT_LT(at->slope.norm(), 0.03) << x;
    }
  }
  ASSERT_GE(found, 30);
  EXPECT_NEAR(sum / found, 0.0, 0.03);
}

TEST(Disparity, IsUnknownBeyondTheRangeAndAtOtherRows) {
  const cv::Mat left = TexturedWall().gray(60);
  EXPECT_TRUE(disparity(left, moved_left(left, 30.0), {300, 200}, kRange));
  EXPECT_FALSE(disparity(left, moved_left(left, 30.0), {300, 200}, {1.0, 25.0}));
  EXPECT_FALSE(disparity(left, moved_left(left, -5.0), {300, 200}, kRange));
  EXPECT_FALSE(disparity(left, TexturedWall().gray(90, 6), {300, 200}, kRange)) << "6 rows lower";
}

TEST(Disparity, IsUnknownWhereThePatternRepeats) {
  cv::Mat stripes(200, 400, CV_8UC1);
  for (int x = 0; x < stripes.cols; ++x)
    stripes.col(x) = 128 + 100 * std::sin(2.0 * CV_PI * x / 12.0);
  for (int y = 0; y < stripes.rows; ++y) stripes.row(y) *= 0.6 + 0.4 * std::cos(0.4 * y);
  EXPECT_FALSE(disparity(stripes, moved_left(stripes, 5.0), {200, 100}, kRange));
  EXPECT_FALSE(disparity(cv::Mat(200, 400, CV_8UC1, cv::Scalar(90)),
                         cv::Mat(200, 400, CV_8UC1, cv::Scalar(90)), {200, 100}, kRange));
}

// The wall stands at 2 m, where 20 pixels of disparity are a baseline of 8 cm.
TEST(FeatureExtractor, DepthOfACornerFollowsFromItsDisparity) {
  constexpr int kDisparity = 20;
  const double baseline_m = kDisparity * TexturedWall::kMetresPerPixel;
  const FeatureExtractor extractor(TexturedWall::camera(), {.baseline_m = baseline_m});
  const Features features =
      extractor.extract(TexturedWall().gray(60), {}, TexturedWall().gray(60 + kDisparity));
  EXPECT_TRUE(features.has_depth());
  const std::vector<float> depths = depths_of(features);
  EXPECT_GT(depths.size(), features.size() / 2);
  const auto near = std::count_if(depths.begin(), depths.end(), [](float depth) {
    return std::abs(depth - TexturedWall::kDepthM) < 0.04;
  });
  EXPECT_GT(near, 0.98 * static_cast<double>(depths.size()));
}

TEST(FeatureExtractor, SwappedImagesOfAPairAreRefused) {
  const FeatureExtractor extractor(TexturedWall::camera(), {.baseline_m = 0.08});
  EXPECT_THAT(testing::refusal(
                  ErrorKind::kInput,
                  [&] { extractor.extract(TexturedWall().gray(80), {}, TexturedWall().gray(60)); }),
              HasSubstr("left and right are swapped"));
  EXPECT_TRUE(depths_of(extractor.extract(TexturedWall().gray(60), {},
                                          cv::Mat(480, 640, CV_8UC1, cv::Scalar(0))))
                  .empty())
      << "a covered camera is no swapped one";
}

TEST(FeatureExtractor, ARightImageNeedsABaselineAndTheSize) {
  const auto refused = [](double baseline_m, const cv::Mat& depth_m, const cv::Mat& right) {
    const FeatureExtractor extractor(TexturedWall::camera(), {.baseline_m = baseline_m});
    return testing::refusal(ErrorKind::kMisuse,
                            [&] { extractor.extract(TexturedWall().gray(60), depth_m, right); });
  };
  const cv::Mat right = TexturedWall().gray(80);
  EXPECT_THAT(refused(0.0, {}, right), HasSubstr("baseline"));
  EXPECT_THAT(refused(0.08, TexturedWall::depth_m(), right), HasSubstr("depth image, too"));
  EXPECT_THAT(refused(0.08, {}, right.rowRange(0, 400)), HasSubstr("right image: 640 x 400"));
}

// In standard deviations, the residual of a depth from a pair is that of its disparity, however far the point is.
TEST(SensorModel, ADepthFromAPairErrsAsItsDisparity) {
  constexpr double kBaseline = 0.2;
  const Pinhole pinhole{{400.0, 410.0, 320.0, 240.0}};
  const SensorNoise noise{.disparity = 0.3};
  const SensorModel sensor(noise, pinhole, {1.0, 1.2}, kBaseline);
  const double fb = pinhole.fx * kBaseline;
  for (const int octave : {0, 1}) {
    for (const double depth : {0.5, 5.0, 60.0}) {
      Keypoint keypoint{};
      keypoint.pixel = {330.0F, 220.0F};
      keypoint.depth_m = static_cast<float>(depth);
      keypoint.octave = static_cast<std::uint8_t>(octave);
      const double sigma = noise.disparity * sensor.scale(octave);
      EXPECT_NEAR(sensor.sigma_depth_m(depth, octave), depth * depth / fb * sigma, 1e-9 * depth);
      for (const double factor : {0.7, 1.0, 3.0}) {
        const double z = factor * depth;
        const Eigen::Vector3d x(0.1, -0.2, z);
        const PointMeasurement measured = sensor.measurement(keypoint);
        const PointResidual residual = point_residual(pinhole, measured, x);
        EXPECT_NEAR(residual.value.z(), (fb / depth - fb / z) / sigma, 1e-4 * fb / depth / sigma);
        constexpr double kStep = 1e-5;
        const Eigen::Vector3d beyond(x.x(), x.y(), z * (1.0 + kStep));
        EXPECT_NEAR(residual.by_x_in_camera(2, 2),
                    (point_residual(pinhole, measured, beyond).value.z() - residual.value.z()) /
                        (kStep * z),
                    1e-3 * residual.by_x_in_camera(2, 2));
      }
    }
  }
}

}  // namespace
}  // namespace cairn::detail
