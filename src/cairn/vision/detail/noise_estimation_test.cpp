// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/noise_estimation.hpp"

#include <gtest/gtest.h>

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

using testing::GraphOptions;
using testing::make_true_graph;
using testing::test_sensor;

SensorNoise noise_of(double factor, std::size_t points = 400) {
  GraphOptions options;
  options.keyframes = 8;
  options.points = points;
  options.noise = factor;
  return estimated_noise(make_true_graph(options).graph);
}

// The graph's landmarks are where they truly are, so that their residuals are the noise itself.
TEST(EstimatedNoise, IsTheNoiseThatTheResidualsHave) {
  const SensorNoise& stated = test_sensor().noise();
  for (const double factor : {0.5, 1.0, 2.0}) {
    const SensorNoise noise = noise_of(factor);
    // What is fitted to the landmark is made up for, which is too much of landmarks that were not fitted.
    EXPECT_NEAR(noise.pixel / stated.pixel, factor, 0.12 * factor) << factor;
    EXPECT_NEAR(noise.depth_floor_m / stated.depth_floor_m, factor, 0.15 * factor) << factor;
    EXPECT_DOUBLE_EQ(noise.depth_quadratic / stated.depth_quadratic,
                     noise.depth_floor_m / stated.depth_floor_m);
    EXPECT_EQ(noise.aligned_pixel, stated.aligned_pixel) << "none was aligned";
  }
}

TEST(EstimatedNoise, StaysWithinItsLimits) {
  const SensorNoise& stated = test_sensor().noise();
  EXPECT_DOUBLE_EQ(noise_of(20.0).pixel, 4.0 * stated.pixel);
  EXPECT_DOUBLE_EQ(noise_of(0.01).pixel, 0.35 * stated.pixel);
  EXPECT_DOUBLE_EQ(noise_of(0.01).depth_floor_m, 0.25 * stated.depth_floor_m);
}

TEST(EstimatedNoise, IsTheSensorsOwnWhereFewResidualsTell) {
  const SensorNoise& stated = test_sensor().noise();
  const SensorNoise noise = noise_of(3.0, 20);
  EXPECT_EQ(noise.pixel, stated.pixel);
  EXPECT_EQ(noise.depth_floor_m, stated.depth_floor_m);
}

}  // namespace
}  // namespace cairn::detail
