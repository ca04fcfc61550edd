// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/patch_alignment.hpp"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

// A smooth random pattern that is known between pixels.
class Pattern {
 public:
  explicit Pattern(std::uint64_t seed) {
    Random random(seed);
    for (auto& wave : waves_) {
      const double direction = random.uniform(0.0, 6.28);
      const double frequency = random.uniform(0.2, 0.7);
      wave = {frequency * std::cos(direction), frequency * std::sin(direction),
              random.uniform(0.0, 6.28)};
    }
  }
  double at(const Eigen::Vector2d& x) const {
    double sum = 0.0;
    for (const auto& wave : waves_) sum += std::sin(wave.x() * x.x() + wave.y() * x.y() + wave.z());
    return 128.0 + 22.0 * sum;
  }
  /// Image whose pixel x shows pattern(m·(x - seen_at) + shows).
  cv::Mat image(const Eigen::Matrix2d& m, const Eigen::Vector2d& seen_at,
                const Eigen::Vector2d& shows, double brighter = 0.0) const {
    cv::Mat result(80, 100, CV_8UC1);
    for (int y = 0; y < result.rows; ++y) {
      for (int x = 0; x < result.cols; ++x) {
        result.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(
            at(m * (Eigen::Vector2d(x, y) - seen_at) + shows) + brighter);
      }
    }
    return result;
  }

 private:
  std::array<Eigen::Vector3d, 6> waves_;
};

const Eigen::Matrix2d kSame = Eigen::Matrix2d::Identity();
const Eigen::Vector2d kCenter(41.3, 37.8);

ReferencePatch patch_of(const Pattern& pattern) {
  return ReferencePatch::cut(pattern.image(kSame, kCenter, kCenter), kCenter).value();
}

TEST(AlignPatch, RecoversAShiftToAFractionOfAPixel) {
  Random random(1);
  int found_count = 0;
  int close_count = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Pattern pattern(seed);
    // Braces: drawn in this order, whatever the compiler.
    const Eigen::Vector2d seen_at{random.uniform(30, 60), random.uniform(30, 50)};
    const Eigen::Vector2d off{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)};
    const auto found = align_patch(patch_of(pattern), pattern.image(kSame, seen_at, kCenter), kSame,
                                   seen_at + off, 2.5);
    if (!found) continue;
    ++found_count;
    const double error = (*found - seen_at).norm();
    close_count += error < 0.06 ? 1 : 0;
    EXPECT_LT(error, 0.1) << seed;
  }
  EXPECT_GE(found_count, 45);
  EXPECT_GE(close_count, 45);
}

TEST(AlignPatch, DoesNotMindBrightness) {
  const Pattern pattern(3);
  const Eigen::Vector2d seen_at(50.2, 40.7);
  const auto found = align_patch(patch_of(pattern), pattern.image(kSame, seen_at, kCenter, 15.0),
                                 kSame, seen_at + Eigen::Vector2d(0.6, -0.5), 2.5);
  ASSERT_TRUE(found);
  EXPECT_LT((*found - seen_at).norm(), 0.08);
}

TEST(AlignPatch, RecoversAShiftThroughAWarp) {
  Random random(2);
  int found_count = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Pattern pattern(seed);
    Eigen::Matrix2d warp = Eigen::Rotation2Dd(random.uniform(-0.6, 0.6)).toRotationMatrix();
    warp *= random.uniform(0.8, 1.3);
    warp(0, 1) += random.uniform(-0.2, 0.2);
    const Eigen::Vector2d seen_at(50.4, 40.1);
    const cv::Mat image = pattern.image(warp, seen_at, kCenter);
    const Eigen::Vector2d start = seen_at + Eigen::Vector2d(0.5, -0.6);
    const auto found = align_patch(patch_of(pattern), image, warp, start, 2.5);
    if (!found) continue;
    ++found_count;
    EXPECT_LT((*found - seen_at).norm(), 0.15) << seed;
  }
  EXPECT_GE(found_count, 45);
}

TEST(AlignPatch, RefusesAnotherTexture) {
  int refused = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const auto found =
        align_patch(patch_of(Pattern(seed)), Pattern(seed + 100).image(kSame, kCenter, kCenter),
                    kSame, kCenter, 2.5);
    refused += found ? 0 : 1;
  }
  EXPECT_GE(refused, 48);
}

TEST(AlignPatch, RefusesAFlatImage) {
  const cv::Mat flat(80, 100, CV_8UC1, cv::Scalar(90));
  const Pattern pattern(1);
  EXPECT_FALSE(align_patch(patch_of(pattern), flat, kSame, kCenter, 2.5));
  const auto flat_patch = ReferencePatch::cut(flat, kCenter);
  ASSERT_TRUE(flat_patch);
  const cv::Mat image = pattern.image(kSame, kCenter, kCenter);
  EXPECT_FALSE(align_patch(*flat_patch, image, kSame, kCenter, 2.5));
  EXPECT_FALSE(align_patch(*flat_patch, flat, kSame, kCenter, 2.5));
}

TEST(AlignPatch, NothingBeyondTheLimitOrTheImage) {
  const Pattern pattern(3);
  const cv::Mat image = pattern.image(kSame, kCenter, kCenter);
  const ReferencePatch patch = patch_of(pattern);
  EXPECT_FALSE(align_patch(patch, image, kSame, kCenter + Eigen::Vector2d(1.0, 0.5), 0.5));
  for (const auto& [x, y] : {std::pair{-5.0, 40.0},
                             {2.0, 40.0},
                             {97.0, 40.0},
                             {50.0, 1.0},
                             {50.0, 78.0},
                             {1e9, 0.0},
                             {-1e9, 1e9}}) {
    EXPECT_FALSE(align_patch(patch, image, kSame, {x, y}, 2.5)) << x << ' ' << y;
  }
  // The warped patch would need more than was cut.
  EXPECT_FALSE(align_patch(patch, image, 4.0 * kSame, kCenter, 2.5));
}

TEST(ReferencePatch, SamplesWhatWasCut) {
  const Pattern pattern(7);
  const ReferencePatch patch = patch_of(pattern);
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d offset(random.uniform(-11, 11), random.uniform(-11, 11));
    const auto value = patch.sample(offset);
    ASSERT_TRUE(value);
    EXPECT_NEAR(*value, pattern.at(kCenter + offset), 16.0);
  }
  EXPECT_FALSE(patch.sample({12.5, 0.0}));
  EXPECT_FALSE(patch.sample({0.0, -12.5}));
  EXPECT_FALSE(patch.sample({std::numeric_limits<double>::quiet_NaN(), 0.0}));
}

TEST(ReferencePatch, IsNotCutAcrossTheEdge) {
  const cv::Mat image(80, 100, CV_8UC1, cv::Scalar(0));
  EXPECT_TRUE(ReferencePatch::cut(image, {12.0, 12.0}));
  EXPECT_TRUE(ReferencePatch::cut(image, {86.9, 66.9}));
  EXPECT_FALSE(ReferencePatch::cut(image, {11.9, 40.0}));
  EXPECT_FALSE(ReferencePatch::cut(image, {40.0, 11.9}));
  EXPECT_FALSE(ReferencePatch::cut(image, {87.0, 40.0}));
  EXPECT_FALSE(ReferencePatch::cut(image, {40.0, 67.0}));
}

}  // namespace
}  // namespace cairn::detail
