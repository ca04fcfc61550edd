// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/column_motion.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/splats.hpp"

namespace cairn {
namespace {

using testing::color_towards;
using ::testing::HasSubstr;
using testing::random_splats;

Similarity3 motion_of(double scale, const Eigen::Vector3d& to, double roll, double pitch,
                      double yaw) {
  return {scale, Rigid3::from_roll_pitch_yaw(to, roll, pitch, yaw)};
}

const Similarity3 kThere = motion_of(2.5, {1.0, -2.0, 3.0}, 0.4, -1.2, 2.6);

// Largest difference of a column of two maps.
double difference(const LandmarkMap& a, const LandmarkMap& b, const std::string& name) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.landmark_count(); ++i) {
    most = std::max(most, std::abs(a.column(name)->values[i] - b.column(name)->values[i]));
  }
  return most;
}

TEST(MovedSplats, ComeBack) {
  for (int degree = 0; degree <= kMostSplatDegree; ++degree) {
    const LandmarkMap splats = random_splats(50, degree, 1);
    const LandmarkMap back = transformed(transformed(splats, kThere), kThere.inverse());
    for (const NamedColumn& column : splats.landmarks().columns) {
      EXPECT_LT(difference(splats, back, column.name), 1e-13) << column.name;
    }
  }
}

TEST(MovedSplats, ComposeAsTheMotionsDo) {
  const Similarity3 then = motion_of(0.3, {0, 0, 0}, -2.0, 0.1, 1.0);
  const LandmarkMap splats = random_splats(50, 4, 2);
  const LandmarkMap twice = transformed(transformed(splats, kThere), then);
  const LandmarkMap once = transformed(splats, then * kThere);
  const double sign =
      std::copysign(1.0, twice.column("rot_0")->values[0] * once.column("rot_0")->values[0]);
  for (const NamedColumn& column : splats.landmarks().columns) {
    const double factor = column.name.starts_with("rot") ? sign : 1.0;
    for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
      EXPECT_NEAR(factor * twice.column(column.name)->values[i],
                  once.column(column.name)->values[i], 1e-12)
          << column.name;
    }
  }
}

TEST(MovedSplats, HaveTheSameColourFromATurnedDirection) {
  Random random(3);
  for (int degree = 0; degree <= kMostSplatDegree; ++degree) {
    const LandmarkMap splats = random_splats(20, degree, 4);
    const LandmarkMap moved = transformed(splats, kThere);
    for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
      const Eigen::Vector3d direction = testing::random_direction(random);
      const Eigen::Vector3d turned = kThere.rigid().rotation() * direction;
      EXPECT_LT(
          (color_towards(moved, degree, i, turned) - color_towards(splats, degree, i, direction))
              .norm(),
          1e-13)
          << degree;
    }
  }
}

TEST(MovedSplats, HaveTheCovarianceOfTheirAxes) {
  const LandmarkMap moved = transformed(random_splats(50, 1, 5), kThere);
  LandmarkTable landmarks = moved.landmarks();
  set_splat_looks(*splat_columns(landmarks.columns), landmarks);
  for (std::uint32_t i = 0; i < moved.landmark_count(); ++i) {
    const Eigen::Matrix3d covariance = *moved.covariance(LandmarkIndex{i});
    EXPECT_LT((covariance - landmarks.covariances[i]).norm(), 1e-12 * covariance.norm());
  }
  EXPECT_EQ(moved.landmarks().colors, landmarks.colors);
}

// Grey levels of an image of splats, 0 to 255: each is projected to the image plane as a Gaussian, and blended from the
// nearest on. The camera looks along its z axis.
std::vector<double> rendered(const LandmarkMap& splats, int degree,
                             const Similarity3& camera_from_world) {
  constexpr int kSide = 24;
  constexpr double kFocal = 30.0;  // pixels
  const Similarity3 world_from_camera = camera_from_world.inverse();
  std::vector<std::size_t> order(splats.landmark_count());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const std::vector<Eigen::Vector3d> centres =
      moved_points(splats.landmarks().positions, camera_from_world);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return centres[a].z() < centres[b].z(); });
  LandmarkTable landmarks = splats.landmarks();
  set_splat_looks(*splat_columns(landmarks.columns), landmarks);
  const Eigen::Matrix3d linear = camera_from_world.linear();
  std::vector<double> left(kSide * kSide, 1.0);  // transmittance
  std::vector<double> image(kSide * kSide * 3, 0.0);
  for (const std::size_t i : order) {
    const Eigen::Vector3d& c = centres[i];
    if (c.z() < 0.1) continue;
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << kFocal / c.z(), 0.0, -kFocal * c.x() / (c.z() * c.z()), 0.0, kFocal / c.z(),
        -kFocal * c.y() / (c.z() * c.z());
    const Eigen::Matrix3d in_camera = linear * landmarks.covariances[i] * linear.transpose();
    Eigen::Matrix2d covariance = jacobian * in_camera * jacobian.transpose();
    covariance.diagonal().array() += 0.3;
    const Eigen::Matrix2d information = covariance.inverse();
    const Eigen::Vector3d seen_along =
        (landmarks.positions[i] - world_from_camera.translation()).normalized();
    const Eigen::Vector3d color =
        color_towards(splats, degree, i, seen_along).cwiseMax(0.0).cwiseMin(1.0);
    const double opacity = 1.0 / (1.0 + std::exp(-splats.column("opacity")->values[i]));
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kSide; ++u) {
        const Eigen::Vector2d apart(u - kSide / 2 - kFocal * c.x() / c.z(),
                                    v - kSide / 2 - kFocal * c.y() / c.z());
        const double alpha = opacity * std::exp(-0.5 * apart.dot(information * apart));
        const auto pixel = static_cast<std::size_t>(v * kSide + u);
        for (std::size_t channel = 0; channel < 3; ++channel) {
          image[3 * pixel + channel] +=
              255.0 * left[pixel] * alpha * color[static_cast<Eigen::Index>(channel)];
        }
        left[pixel] *= 1.0 - alpha;
      }
    }
  }
  return image;
}

TEST(MovedSplats, LookTheSameToACameraThatMovesAlong) {
  constexpr int kDegreeSeen = 3;
  const LandmarkMap splats = random_splats(60, kDegreeSeen, 6);
  const Similarity3 camera_from_world = motion_of(1.0, {0.1, 0.0, 3.0}, 0.2, 0.5, -0.4);
  const std::vector<double> before = rendered(splats, kDegreeSeen, camera_from_world);
  const std::vector<double> after =
      rendered(transformed(splats, kThere), kDegreeSeen, camera_from_world * kThere.inverse());
  double brightest = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    brightest = std::max(brightest, before[i]);
    EXPECT_NEAR(after[i], before[i], 1e-6) << i;
  }
  EXPECT_GT(brightest, 100.0) << "there is something to see";
}

TEST(ColumnMotion, ShiftsWhatItCannotTurn) {
  for (const char* name : {"rot_0", "f_rest_0"}) {
    const LandmarkMap splats = with_column(testing::plain_map(), name, {1, 2, 3});
    for (const Similarity3& motion :
         {Similarity3(2.0, Rigid3()), motion_of(1.0, {0, 0, 0}, 0.0, 0.0, 0.1)}) {
      EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { transformed(splats, motion); }),
                  HasSubstr("map: has Gaussian splats in no known layout"));
    }
    const LandmarkMap moved = transformed(splats, motion_of(1.0, {1, 2, 3}, 0, 0, 0));
    EXPECT_EQ(moved.column(name)->values[2], 3.0);
  }
}

}  // namespace
}  // namespace cairn
