// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/splats.hpp"

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/rigid3.hpp"

#include "support/splats.hpp"

namespace cairn {
namespace {

using testing::random_splats;
using testing::splat_names;

std::optional<SplatColumns> columns_named(const std::vector<std::string>& names) {
  return splat_columns(std::vector<std::string_view>(names.begin(), names.end()));
}

TEST(SplatColumns, AreFoundForEachDegree) {
  for (int degree = 0; degree <= kMostSplatDegree; ++degree) {
    const std::vector<std::string> names = splat_names(degree);
    const auto columns = columns_named(names);
    ASSERT_TRUE(columns) << degree;
    EXPECT_EQ(columns->degree, degree);
    EXPECT_EQ(names[columns->rotation[0]], "rot_0");
    EXPECT_EQ(names[columns->opacity], "opacity");
    EXPECT_EQ(columns->harmonics.size(), 3 * testing::harmonics_each(degree));
  }
}

TEST(SplatColumns, AreNoneIfSomeAreMissing) {
  for (const std::string_view missing : {"rot_3", "scale_1", "opacity", "f_dc_2", "f_rest_44"}) {
    std::vector<std::string> names = splat_names(3);
    std::erase(names, missing);
    EXPECT_FALSE(columns_named(names)) << missing;
  }
  std::vector<std::string> names = splat_names(3);
  std::erase(names, "scale_2");
  EXPECT_TRUE(columns_named(names)) << "flat splats";
}

TEST(Harmonics, AreThePolynomials) {
  Random random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d direction = testing::random_direction(random);
    const Harmonics values = harmonics_towards(direction);
    const auto expected = testing::harmonic_polynomials(direction);
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_NEAR(values[static_cast<Eigen::Index>(k)], expected.at(k), 1e-13) << k;
    }
  }
}

TEST(Harmonics, TurnByOrthogonalMatricesThatCompose) {
  const Eigen::Matrix3d a = Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0.3, -1.1, 2.0).rotation();
  const Eigen::Matrix3d b = Rigid3::from_roll_pitch_yaw({0, 0, 0}, -2.0, 0.4, 1.0).rotation();
  const auto of_a = harmonics_rotation(kMostSplatDegree, a);
  const auto of_b = harmonics_rotation(kMostSplatDegree, b);
  const auto of_both = harmonics_rotation(kMostSplatDegree, b * a);
  ASSERT_EQ(of_a.size(), 4U);
  for (std::size_t l = 0; l < of_a.size(); ++l) {
    const auto size = static_cast<Eigen::Index>(2 * l + 3);
    EXPECT_LT((of_a[l].transpose() * of_a[l] - Eigen::MatrixXd::Identity(size, size)).norm(),
              1e-13);
    EXPECT_LT((of_b[l] * of_a[l] - of_both[l]).norm(), 1e-13);
  }
}

TEST(SplatLooks, CovarianceHasTheAxesAndColourTheMeanOfAllDirections) {
  LandmarkTable landmarks = random_splats(1, 0, 1).landmarks();
  const auto set = [&](std::string_view name, double value) {
    for (NamedColumn& column : landmarks.columns) {
      if (column.name == name) column.values = {value};
    }
  };
  // Turned by 90 degrees about z, by a quaternion of length 2: its x is the world's y.
  for (const auto& [name, value] : {std::pair{"rot_0", std::sqrt(2.0)},
                                    {"rot_1", 0.0},
                                    {"rot_2", 0.0},
                                    {"rot_3", std::sqrt(2.0)},
                                    {"scale_0", std::log(3.0)},
                                    {"scale_1", std::log(2.0)},
                                    {"scale_2", 0.0},
                                    {"f_dc_0", 0.0},
                                    {"f_dc_1", 10.0},
                                    {"f_dc_2", -10.0}}) {
    set(name, value);
  }
  const SplatColumns columns = *splat_columns(landmarks.columns);
  set_splat_looks(columns, landmarks);
  const Eigen::Matrix3d expected = Eigen::Vector3d(4.0, 9.0, 1.0).asDiagonal();
  EXPECT_LT((landmarks.covariances[0] - expected).norm(), 1e-12);
  EXPECT_EQ(landmarks.colors[0], (Color{128, 255, 0}));
  set("scale_0", std::numeric_limits<double>::quiet_NaN());
  set_splat_looks(columns, landmarks);
  EXPECT_TRUE(std::isnan(landmarks.covariances[0](0, 0))) << "unknown";
}

}  // namespace
}  // namespace cairn
