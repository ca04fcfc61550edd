// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/lens_estimation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

// A wide lens whose principal point is off the image's centre.
Camera barrel_lens() {
  return {{1}, "RADIAL", 640, 480, {480.0, 326.0, 243.0, -0.15, 0.03}};
}

struct LensView {
  Rigid3 world_from_camera;
  std::vector<PointMatch> matches;
};

// Pixels in all of the image, at depths from 1 m to `farthest`.
LensView see_points(const Camera& camera, std::uint64_t seed, double farthest, double noise) {
  Random random(seed);
  LensView view{Rigid3().perturbed(testing::random_step(random, 2.0, 1.5)), {}};
  while (view.matches.size() < 200) {
    const Pixel pixel{random.uniform(0.0, 639.0), random.uniform(0.0, 479.0)};
    const Eigen::Vector3d ray = *unproject(camera, pixel);
    PointMatch match;
    match.x_in_world =
        view.world_from_camera * Eigen::Vector3d(random.uniform(1.0, farthest) / ray.z() * ray);
    match.measured.sigma_pixel = 0.7;
    match.measured.pixel =
        Eigen::Vector2d(pixel.u, pixel.v) +
        noise * match.measured.sigma_pixel * Eigen::Vector2d(random.normal(), random.normal());
    view.matches.push_back(match);
  }
  return view;
}

Camera begin_at(const Camera& camera, double focal_length) {
  Camera begin = radial_camera(camera, focal_length);
  begin.parameters[1] = camera.parameters[1];
  begin.parameters[2] = camera.parameters[2];
  return begin;
}

std::optional<LensEstimate> found_from(const Camera& camera, std::span<const PointMatch> matches,
                                       const Rigid3& world_from_camera) {
  return estimate_lens(camera, matches, world_from_camera, LensPrior::usual(camera));
}

TEST(EstimateLens, RecoversLensAndPoseFromAFocalLengthThatIsWrong) {
  const Camera camera = barrel_lens();
  for (const double guess : {0.9, 1.1}) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      const LensView view = see_points(camera, seed, 4.0, 0.0);
      Random random(seed);
      const Rigid3 start =
          view.world_from_camera.perturbed(testing::random_step(random, 0.1, 0.03));
      const auto found =
          found_from(begin_at(camera, guess * camera.parameters[0]), view.matches, start);
      ASSERT_TRUE(found);
      // The priors of focal length and distortion are weak.
      EXPECT_NEAR(found->camera.parameters[0], camera.parameters[0], 0.05);
      EXPECT_NEAR(found->camera.parameters[3], camera.parameters[3], 1e-3);
      EXPECT_NEAR(found->camera.parameters[4], camera.parameters[4], 1e-3);
      EXPECT_LT(found->world_from_camera.difference_to(view.world_from_camera).norm(), 1e-4);
    }
  }
}

TEST(EstimateLens, LeavesOutMatchesThatDoNotFit) {
  const Camera camera = barrel_lens();
  LensView view = see_points(camera, 3, 4.0, 1.0);
  const auto clean = found_from(begin_at(camera, 500.0), view.matches, view.world_from_camera);
  for (std::size_t i = 0; i < view.matches.size(); i += 10) {
    view.matches[i].measured.pixel += Eigen::Vector2d(25.0, -15.0);
  }
  const auto found = found_from(begin_at(camera, 500.0), view.matches, view.world_from_camera);
  ASSERT_TRUE(clean && found);
  EXPECT_NEAR(found->camera.parameters[0], clean->camera.parameters[0],
              3.0 * clean->focal_length_sigma());
}

// The true pose is in the 95 % ellipsoid about as often as that says, if principal points scatter as they are expected to.
TEST(EstimateLens, StatesTheErrorOfPoseAndFocalLength) {
  constexpr int kTrials = 200;
  int inside = 0;
  int near = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    Random random(1000 + static_cast<std::uint64_t>(trial));
    Camera camera = barrel_lens();
    camera.parameters[1] = 319.5 + 0.015 * 640.0 * random.normal();
    camera.parameters[2] = 239.5 + 0.015 * 640.0 * random.normal();
    const LensView view = see_points(camera, static_cast<std::uint64_t>(trial), 4.0, 1.0);
    const Camera centred = {{1}, "SIMPLE_PINHOLE", 640, 480, {480.0, 319.5, 239.5}};
    const auto found =
        found_from(radial_camera(centred, 500.0), view.matches, view.world_from_camera);
    ASSERT_TRUE(found);
    const Vector6d off = view.world_from_camera.difference_to(found->world_from_camera);
    constexpr double k95 = 12.59;  // quantile of chi² with six degrees of freedom
    inside += off.dot(found->covariance.inverse() * off) <= k95 ? 1 : 0;
    near += std::abs(found->camera.parameters[0] - camera.parameters[0]) <=
                    1.96 * found->focal_length_sigma()
                ? 1
                : 0;
  }
  EXPECT_GE(inside, kTrials * 88 / 100);
  EXPECT_GE(near, kTrials * 88 / 100);
}

// In front of a plane, a longer lens shows the same from farther away.
TEST(EstimateLens, IsUncertainInFrontOfAPlane) {
  const Camera camera = barrel_lens();
  const auto focal_sigma = [&](double farthest) {
    const LensView view = see_points(camera, 5, farthest, 1.0);
    const auto found = found_from(begin_at(camera, 500.0), view.matches, view.world_from_camera);
    EXPECT_TRUE(found);
    return found ? found->focal_length_sigma() : 0.0;
  };
  EXPECT_GT(focal_sigma(1.0 + 1e-9), 20.0 * focal_sigma(4.0));
}

// A photograph's principal point is not known, but most images show it.
TEST(EstimateLens, FindsThePrincipalPoint) {
  const Camera camera = barrel_lens();
  const LensView view = see_points(camera, 8, 4.0, 1.0);
  Camera centred = begin_at(camera, 500.0);
  centred.parameters[1] = 319.5;
  centred.parameters[2] = 239.5;
  const auto found = found_from(centred, view.matches, view.world_from_camera);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->camera.parameters[1], camera.parameters[1], 2.0);
  EXPECT_NEAR(found->camera.parameters[2], camera.parameters[2], 2.0);
  const auto kept = estimate_lens(centred, view.matches, view.world_from_camera,
                                  LensPrior::usual_about_centre(centred));
  ASSERT_TRUE(kept);
  EXPECT_NEAR(kept->camera.parameters[1], 319.5, 0.01);
  EXPECT_NEAR(kept->camera.parameters[2], 239.5, 0.01);
}

TEST(EstimateLens, KeepsToAPriorThatIsCertain) {
  const Camera camera = barrel_lens();
  const LensView view = see_points(camera, 9, 4.0, 1.0);
  LensPrior prior;
  prior.mean = lens_of(with_lens(camera, lens_of(camera) + 0.02 * LensVector::Ones()));
  prior.information = 1e12 * LensMatrix::Identity();
  const auto found = estimate_lens(camera, view.matches, view.world_from_camera, prior);
  ASSERT_TRUE(found);
  EXPECT_LT((lens_of(found->camera) - prior.mean).norm(), 1e-5);
}

// Errors that neighbours share: each eighth of the image is shifted as a whole.
TEST(AddJackknife, StatesErrorsThatNeighboursShare) {
  constexpr int kTrials = 200;
  int inside_without = 0;
  int inside = 0;
  const Camera camera = barrel_lens();
  for (int trial = 0; trial < kTrials; ++trial) {
    LensView view = see_points(camera, static_cast<std::uint64_t>(trial), 4.0, 1.0);
    Random random(2000 + static_cast<std::uint64_t>(trial));
    std::array<Eigen::Vector2d, 8> shifts;
    for (Eigen::Vector2d& shift : shifts) shift = {random.normal(), random.normal()};
    for (PointMatch& match : view.matches) {
      const Eigen::Vector2d& at = match.measured.pixel;
      const auto column = static_cast<std::size_t>(std::clamp(at.x() / 160.0, 0.0, 3.0));
      match.measured.pixel += 0.7 * shifts[column + (at.y() < 240.0 ? 0 : 4)];
    }
    const LensPrior prior = LensPrior::usual(camera);
    auto found =
        estimate_lens(begin_at(camera, 500.0), view.matches, view.world_from_camera, prior);
    ASSERT_TRUE(found);
    const auto is_near = [&] {
      return std::abs(found->camera.parameters[0] - camera.parameters[0]) <=
             1.96 * found->focal_length_sigma();
    };
    inside_without += is_near() ? 1 : 0;
    ASSERT_TRUE(add_jackknife(*found, view.matches, prior));
    inside += is_near() ? 1 : 0;
  }
  EXPECT_LT(inside_without, kTrials * 85 / 100);
  EXPECT_GE(inside, kTrials * 90 / 100);
}

TEST(AddJackknife, SaysWhetherOnePartOfTheImageDecides) {
  const Camera camera = barrel_lens();
  LensView view = see_points(camera, 7, 4.0, 0.1);
  view.matches.resize(3);
  const LensPrior prior = LensPrior::usual(camera);
  LensEstimate estimate{camera, view.world_from_camera};
  EXPECT_FALSE(add_jackknife(estimate, view.matches, prior));
}

TEST(EstimateLens, NeedsMatchesThatDetermineAPose) {
  const Camera camera = barrel_lens();
  LensView view = see_points(camera, 6, 4.0, 0.0);
  view.matches.resize(2);
  EXPECT_FALSE(found_from(begin_at(camera, 480.0), view.matches, view.world_from_camera));
}

}  // namespace
}  // namespace cairn::detail
