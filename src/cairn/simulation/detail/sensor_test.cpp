// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/sensor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

constexpr double kFocal = 525.0;

// A wall straight ahead, in an even colour.
RenderedFrame wall(double depth_m, double level = 128.0, std::uint32_t width = 320,
                   std::uint32_t height = 240) {
  RenderedFrame frame;
  frame.width = width;
  frame.height = height;
  const std::size_t count = std::size_t{width} * height;
  frame.bgr.assign(3 * count, static_cast<std::uint16_t>(level * RenderedFrame::kLightPerLevel));
  frame.depth_m.assign(count, static_cast<float>(depth_m));
  frame.facing.assign(count, 1.0F);
  return frame;
}

struct Moments {
  double mean = 0.0;
  double deviation = 0.0;
};

template <class Values>
Moments moments(const Values& values) {
  double sum = 0.0;
  double squares = 0.0;
  for (const auto value : values) {
    sum += value;
    squares += static_cast<double>(value) * value;
  }
  const auto n = static_cast<double>(values.size());
  return {sum / n, std::sqrt(std::max(0.0, squares / n - sum / n * sum / n))};
}

TEST(Sensor, ColourNoiseHasTheDeviationAskedFor) {
  for (const double sigma : {0.0, 2.0, 10.0}) {
    const Moments found = moments(expose(wall(2.0), {.color_noise = sigma}, 5));
    EXPECT_NEAR(found.mean, 128.0, 0.1);
    // Rounding to whole levels adds 1/12.
    const double expected = sigma == 0.0 ? 0.0 : std::sqrt(sigma * sigma + 1.0 / 12.0);
    EXPECT_NEAR(found.deviation, expected, 0.01 * expected + 1e-9);
  }
}

TEST(Sensor, ExposureScalesAndClips) {
  EXPECT_THAT(expose(wall(2.0, 100.0), {.exposure = 0.5, .color_noise = 0.0}, 1), Each(50));
  EXPECT_THAT(expose(wall(2.0, 100.0), {.exposure = 10.0, .color_noise = 0.0}, 1), Each(255));
}

class DepthNoiseTest : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Depths, DepthNoiseTest, ::testing::Values(0.6, 1.0, 2.0, 3.7, 5.0));

TEST_P(DepthNoiseTest, DeviationGrowsWithTheSquareOfTheDepth) {
  const double z = GetParam();
  // A depth that happens to lie on a step is rounded there; the mean over many is what is stated.
  double variance = 0.0;
  double bias = 0.0;
  constexpr int kDepths = 16;
  const SensorOptions options{.max_depth_m = 20.0, .edge_holes = 0.0, .dropout = 0.0};
  for (int i = 0; i < kDepths; ++i) {
    const double depth = 1.0 / (1.0 / z + options.depth_step_m * i / kDepths);
    const auto image = measure_depth(wall(depth, 0.0, 160, 120), kFocal, options, 3);
    double squares = 0.0;
    for (const float value : image) {
      squares += (value - depth) * (value - depth);
      bias += (value - depth) / static_cast<double>(image.size()) / kDepths;
    }
    variance += squares / static_cast<double>(image.size()) / kDepths;
  }
  EXPECT_NEAR(std::sqrt(variance), options.depth_noise_m * z * z,
              0.04 * options.depth_noise_m * z * z);
  EXPECT_NEAR(bias, 0.0, 0.1 * options.depth_noise_m * z * z);
}

TEST(Sensor, DepthComesInStepsOfInverseDepth) {
  const SensorOptions options{.edge_holes = 0.0, .dropout = 0.0};
  for (const float value : measure_depth(wall(3.0), kFocal, options, 3)) {
    const double steps = 1.0 / (static_cast<double>(value) * options.depth_step_m);
    EXPECT_NEAR(steps, std::round(steps), 1e-3);
  }
}

TEST(Sensor, NoReadingBeyondTheRange) {
  const SensorOptions options{.dropout = 0.0};
  for (const double depth : {0.3, 6.2, 40.0}) {
    EXPECT_THAT(measure_depth(wall(depth), kFocal, options, 3), Each(0.0F));
  }
  const auto inside = measure_depth(wall(1.0), kFocal, options, 3);
  EXPECT_EQ(std::count(inside.begin(), inside.end(), 0.0F), 0);
  EXPECT_THAT(measure_depth(wall(0.0), kFocal, options, 3), Each(0.0F));
}

TEST(Sensor, NoReadingOnSlants) {
  RenderedFrame frame = wall(2.0);
  std::fill(frame.facing.begin(), frame.facing.end(), 0.16F);  // 80.8 degrees
  EXPECT_THAT(measure_depth(frame, kFocal, {}, 3), Each(0.0F));
  std::fill(frame.facing.begin(), frame.facing.end(), 0.19F);  // 79.0 degrees
  const auto image = measure_depth(frame, kFocal, {.dropout = 0.0}, 3);
  EXPECT_EQ(std::count(image.begin(), image.end(), 0.0F), 0);
}

// Something near in the middle columns, before a wall.
RenderedFrame post_before_wall() {
  RenderedFrame frame = wall(3.0);
  for (std::size_t row = 0; row < frame.height; ++row) {
    for (std::size_t column = 150; column < 200; ++column) {
      frame.depth_m[row * frame.width + column] = 1.0F;
    }
  }
  return frame;
}

TEST(Sensor, ProjectorsShadowLiesLeftOfWhatIsNear) {
  const SensorOptions options{.edge_holes = 0.0, .dropout = 0.0};
  const auto image = measure_depth(post_before_wall(), kFocal, options, 3);
  // Of width f·b·(1/near - 1/far) = 525 · 0.075 · (1 - 1/3) = 26.25 pixels.
  std::vector<std::size_t> holes;
  for (std::size_t column = 0; column < 320; ++column) {
    if (image[100 * 320 + column] == 0.0F) holes.push_back(column);
  }
  ASSERT_FALSE(holes.empty());
  EXPECT_EQ(holes.back(), 149U);
  EXPECT_NEAR(static_cast<double>(holes.size()), 26.25, 1.5);
  EXPECT_EQ(holes.back() - holes.front() + 1, holes.size());
}

TEST(Sensor, HalfOfTheEdgePixelsAreHoles) {
  const SensorOptions options{.baseline_m = 0.0, .dropout = 0.0};
  const RenderedFrame frame = post_before_wall();
  const auto image = measure_depth(frame, kFocal, options, 3);
  std::size_t holes = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (image[i] != 0.0F) continue;
    ++holes;
    const std::size_t column = i % 320;
    EXPECT_TRUE(column == 149 || column == 150 || column == 199 || column == 200) << column;
  }
  EXPECT_NEAR(static_cast<double>(holes), 0.5 * 4 * 240, 60.0);
}

TEST(Sensor, DropoutTakesItsShare) {
  const auto image = measure_depth(wall(1.0), kFocal, {.dropout = 0.05}, 3);
  const double share = static_cast<double>(std::count(image.begin(), image.end(), 0.0F)) /
                       static_cast<double>(image.size());
  EXPECT_NEAR(share, 0.05, 0.004);
}

TEST(Sensor, IdealDepthIsExact) {
  const RenderedFrame frame = post_before_wall();
  EXPECT_EQ(measure_depth(frame, kFocal, {.ideal_depth = true}, 3), frame.depth_m);
}

TEST(Sensor, SameStreamSameBytesForAnyNumberOfThreads) {
  const RenderedFrame frame = post_before_wall();
  EXPECT_EQ(expose(frame, {}, 9, Executor(1)), expose(frame, {}, 9, Executor(2)));
  EXPECT_NE(expose(frame, {}, 9), expose(frame, {}, 10));
  EXPECT_EQ(measure_depth(frame, kFocal, {}, 9, Executor(1)),
            measure_depth(frame, kFocal, {}, 9, Executor(2)));
  EXPECT_NE(measure_depth(frame, kFocal, {}, 9), measure_depth(frame, kFocal, {}, 10));
}

TEST(Sensor, RefusesNonsenseByName) {
  const auto refused = [](const SensorOptions& options, const char* field) {
    try {
      options.validate();
      ADD_FAILURE() << field;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(std::string("SensorOptions.") + field));
    }
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  refused({.exposure = 0.0}, "exposure");
  refused({.color_noise = -1.0}, "color_noise");
  refused({.depth_noise_m = kNan}, "depth_noise_m");
  refused({.depth_step_m = 1.0}, "depth_step_m");
  refused({.min_depth_m = -1.0}, "min_depth_m");
  refused({.max_depth_m = 0.2}, "max_depth_m");
  refused({.baseline_m = -0.1}, "baseline_m");
  refused({.max_incidence_rad = 2.0}, "max_incidence_rad");
  refused({.edge_holes = 1.5}, "edge_holes");
  refused({.dropout = kNan}, "dropout");
}

}  // namespace
}  // namespace cairn::detail
