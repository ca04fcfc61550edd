// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/pose_estimation.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "support/landmark_graphs.hpp"

namespace cairn::detail {
namespace {

using testing::kTestPinhole;
using testing::random_step;

struct View {
  Rigid3 world_from_camera;
  std::vector<PointMatch> matches;
};

PointMatch match_of(const Rigid3& world_from_camera, const Eigen::Vector3d& x_in_camera,
                    double noise, Random& random) {
  PointMatch match;
  match.x_in_world = world_from_camera * x_in_camera;
  match.measured.sigma_pixel = 0.9;
  match.measured.sigma_depth_m = testing::test_sensor().sigma_depth_m(x_in_camera.z(), 0);
  const Eigen::Vector2d off(random.normal(), random.normal());
  match.measured.pixel = kTestPinhole.project(x_in_camera) + noise * 0.9 * off;
  match.measured.depth_m = x_in_camera.z() + noise * match.measured.sigma_depth_m * random.normal();
  return match;
}

View make_view(std::uint64_t seed, std::size_t count, double noise) {
  Random random(seed);
  View view;
  view.world_from_camera = Rigid3().perturbed(random_step(random, 2.0, 1.5));
  for (std::size_t i = 0; i < count; ++i) {
    const double depth = random.uniform(1.0, 4.0);
    const Eigen::Vector3d x =
        kTestPinhole.back_project({random.uniform(0.0, 639.0), random.uniform(0.0, 479.0)}, depth);
    view.matches.push_back(match_of(view.world_from_camera, x, noise, random));
  }
  return view;
}

double distance(const Rigid3& a, const Rigid3& b) {
  return a.difference_to(b).norm();
}

TEST(RefinePose, RecoversAPoseFromExactMatches) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const View view = make_view(seed, 100, 0.0);
    Random random(seed);
    const Rigid3 start = view.world_from_camera.perturbed(random_step(random, 0.05, 0.03));
    const PoseEstimate estimate = refine_pose(kTestPinhole, view.matches, start);
    EXPECT_LT(distance(estimate.world_from_camera, view.world_from_camera), 1e-8);
    EXPECT_EQ(estimate.inlier_count, 100U);
  }
}

TEST(RefinePose, RecoversAPoseFromNoisyMatches) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const View view = make_view(seed, 200, 1.0);
    Random random(seed);
    const Rigid3 start = view.world_from_camera.perturbed(random_step(random, 0.05, 0.03));
    const PoseEstimate estimate = refine_pose(kTestPinhole, view.matches, start);
    const Vector6d error = view.world_from_camera.difference_to(estimate.world_from_camera);
    EXPECT_LT(error.head<3>().norm(), 0.01);
    EXPECT_LT(error.tail<3>().norm(), 0.003);
    EXPECT_GT(estimate.inlier_count, 190U) << "99 % of good matches pass";
  }
}

TEST(RefinePose, LeavesOutWrongMatches) {
  View view = make_view(1, 200, 1.0);
  Random random(5);
  for (std::size_t i = 0; i < 60; ++i) {
    view.matches[i].measured.pixel += Eigen::Vector2d(random.uniform(10.0, 40.0), -20.0);
  }
  const PoseEstimate estimate =
      refine_pose(kTestPinhole, view.matches,
                  view.world_from_camera.perturbed(random_step(random, 0.02, 0.01)));
  const Vector6d error = view.world_from_camera.difference_to(estimate.world_from_camera);
  EXPECT_LT(error.head<3>().norm(), 0.01);
  EXPECT_LT(error.tail<3>().norm(), 0.004);
  EXPECT_EQ(std::count(estimate.inliers.begin(), estimate.inliers.begin() + 60, true), 0);
  EXPECT_GT(std::count(estimate.inliers.begin() + 60, estimate.inliers.end(), true), 130);
}

TEST(RefinePose, RecoversABodyFromItsCameras) {
  Random random(9);
  const View view = make_view(3, 200, 1.0);
  // Each camera of the body sees some of the points; alone, neither has enough.
  std::vector<BodyCamera> cameras;
  std::array<std::vector<PointMatch>, 2> matches;
  for (std::size_t k = 0; k < 2; ++k) {
    const Rigid3 body_from_camera = Rigid3().perturbed(random_step(random, 0.5, 1.5));
    BodyCamera camera{kTestPinhole, body_from_camera.inverse(), {}};
    const Rigid3 world_from_camera = view.world_from_camera * body_from_camera;
    for (int i = 0; i < 40; ++i) {
      const Eigen::Vector3d x = kTestPinhole.back_project(
          {random.uniform(0.0, 639.0), random.uniform(0.0, 479.0)}, random.uniform(1.0, 4.0));
      matches[k].push_back(match_of(world_from_camera, x, 1.0, random));
    }
    camera.matches = matches[k];
    cameras.push_back(camera);
  }
  matches[1][7].measured.pixel.x() += 60.0;
  const PoseEstimate estimate =
      refine_pose(cameras, view.world_from_camera.perturbed(random_step(random, 0.03, 0.02)));
  ASSERT_EQ(estimate.inliers.size(), 80U);
  EXPECT_FALSE(estimate.inliers[47]);
  EXPECT_GT(estimate.inlier_count, 74U);
  const Vector6d error = view.world_from_camera.difference_to(estimate.world_from_camera);
  EXPECT_LT(error.dot(estimate.covariance.inverse() * error), 25.0);
  EXPECT_LT(error.head<3>().norm(), 0.01);
}

// Far too deep or too near in two of five; where they appear is right.
TEST(RefinePose, IgnoresWrongDepthsButNotTheirMatches) {
  View view = make_view(2, 200, 1.0);
  Random random(6);
  for (std::size_t i = 0; i < 80; ++i) {
    view.matches[i].measured.depth_m *= random.chance(0.5) ? 1.6 : 0.6;
  }
  const PoseEstimate estimate =
      refine_pose(kTestPinhole, view.matches,
                  view.world_from_camera.perturbed(random_step(random, 0.02, 0.01)));
  const Vector6d error = view.world_from_camera.difference_to(estimate.world_from_camera);
  EXPECT_LT(error.head<3>().norm(), 0.01);
  EXPECT_GT(std::count(estimate.inliers.begin(), estimate.inliers.begin() + 80, true), 74);
}

// Points as the rows of an image saw them while the camera moved, corrected for another motion.
struct RowsView {
  View view;
  std::vector<double> rows;
};

RowsView seen_by_rows(const RowMotion& motion, const RowMotion& corrected_for, double noise) {
  RowsView result;
  Random random(8);
  result.view.world_from_camera = Rigid3().perturbed(random_step(random, 2.0, 1.5));
  for (int i = 0; i < 300; ++i) {
    const double row = random.uniform(0.0, 479.0);
    const Eigen::Vector3d x =
        kTestPinhole.back_project({random.uniform(0.0, 639.0), row}, random.uniform(1.0, 4.0));
    const Eigen::Vector3d seen = corrected_for.at_middle(motion.at_row(x, row), row);
    PointMatch match = match_of(result.view.world_from_camera, seen, noise, random);
    match.x_in_world = result.view.world_from_camera * x;
    result.view.matches.push_back(match);
    result.rows.push_back(row);
  }
  return result;
}

RowMotion motion_of(const Eigen::Vector3d& velocity_m_s, const Eigen::Vector3d& turn_rad_s) {
  RowMotion motion;
  motion.readout_s = 0.03;
  motion.rows = 480.0;
  motion.velocity_m_s = velocity_m_s;
  motion.turn_rad_s = turn_rad_s;
  return motion;
}

TEST(RefinedRowMotion, IsTheOneThatTheRowsShow) {
  const RowMotion truth = motion_of({0.4, -0.3, 0.6}, {0.9, -1.4, 0.7});
  const RowMotion assumed = motion_of({0.1, 0.0, 0.2}, {0.2, -0.6, 0.1});
  const RowsView seen = seen_by_rows(truth, assumed, 0.0);
  Random random(9);
  const Rigid3 start = seen.view.world_from_camera.perturbed(random_step(random, 0.02, 0.01));
  const RowMotion refined =
      refined_row_motion(kTestPinhole, seen.view.matches, seen.rows, {assumed, 1e3, 1e3}, start);
  EXPECT_LT((refined.velocity_m_s - truth.velocity_m_s).norm(), 0.02);
  EXPECT_LT((refined.turn_rad_s - truth.turn_rad_s).norm(), 0.02);
  EXPECT_EQ(refined.readout_s, 0.03);
}

TEST(RefinedRowMotion, WeighsTheRowsAgainstWhatWasKnown) {
  const RowMotion truth = motion_of({0.4, -0.3, 0.6}, {0.9, -1.4, 0.7});
  const RowMotion assumed = motion_of({0.1, 0.0, 0.2}, {0.2, -0.6, 0.1});
  const RowsView seen = seen_by_rows(truth, assumed, 1.0);
  const auto error = [&](double sigma) {
    const RowMotion refined =
        refined_row_motion(kTestPinhole, seen.view.matches, seen.rows, {assumed, sigma, sigma},
                           seen.view.world_from_camera);
    return (refined.turn_rad_s - truth.turn_rad_s).norm();
  };
  const double before = (assumed.turn_rad_s - truth.turn_rad_s).norm();
  EXPECT_NEAR(error(1e-9), before, 1e-6) << "a certain prior stays";
  EXPECT_LT(error(1.0), 0.2 * before);
  EXPECT_LT(error(1e-2), before);
  EXPECT_GT(error(1e-2), error(1.0));
}

TEST(RefinePose, NeedsNoDepth) {
  View view = make_view(3, 200, 1.0);
  for (PointMatch& match : view.matches) match.measured.depth_m = 0.0;
  Random random(7);
  const PoseEstimate estimate =
      refine_pose(kTestPinhole, view.matches,
                  view.world_from_camera.perturbed(random_step(random, 0.03, 0.02)));
  const Vector6d error = view.world_from_camera.difference_to(estimate.world_from_camera);
  EXPECT_LT(error.head<3>().norm(), 0.015);
}

// The squared error in units of the covariance has mean 6 over many trials, and each component its
// own share.
TEST(RefinePose, CovarianceIsThatOfTheErrors) {
  constexpr int kTrials = 600;
  const View exact = make_view(4, 80, 0.0);
  Random random(8);
  double sum = 0.0;
  Matrix6d scatter = Matrix6d::Zero();
  Matrix6d covariance = Matrix6d::Zero();
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<PointMatch> matches;
    const Rigid3 camera_from_world = exact.world_from_camera.inverse();
    for (const PointMatch& match : exact.matches) {
      matches.push_back(
          match_of(exact.world_from_camera, camera_from_world * match.x_in_world, 1.0, random));
    }
    const PoseEstimate estimate = refine_pose(kTestPinhole, matches, exact.world_from_camera);
    const Vector6d error = exact.world_from_camera.difference_to(estimate.world_from_camera);
    sum += error.dot(estimate.covariance.inverse() * error);
    scatter += error * error.transpose() / kTrials;
    covariance += estimate.covariance / kTrials;
  }
  EXPECT_NEAR(sum / kTrials, 6.0, 0.6);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(scatter(i, i) / covariance(i, i), 1.0, 0.25) << i;
}

// The covariance of a pose from the matches of some landmarks.
Matrix6d covariance_from(const View& view, const std::vector<std::size_t>& kept) {
  std::vector<PointMatch> matches;
  for (const std::size_t i : kept) matches.push_back(view.matches[i]);
  return refine_pose(kTestPinhole, matches, view.world_from_camera).covariance;
}

std::optional<Matrix6d> growth_of(const View& view, std::size_t count, std::size_t copies = 1) {
  std::vector<std::uint32_t> landmarks(view.matches.size());
  std::iota(landmarks.begin(), landmarks.end(), 0U);
  const BodyCamera camera{kTestPinhole, Rigid3(), view.matches};
  const std::vector<BodyCamera> cameras(copies, camera);
  const std::size_t each = landmarks.size();
  for (std::size_t k = 1; k < copies; ++k) {
    landmarks.insert(landmarks.end(), landmarks.begin(),
                     landmarks.begin() + static_cast<std::ptrdiff_t>(each));
  }
  return growth_without_landmarks(cameras, landmarks, view.world_from_camera, count);
}

TEST(GrowthWithoutLandmarks, IsTheLargestThatTheAbsenceOfOneGives) {
  const View view = make_view(3, 12, 0.0);
  std::vector<std::size_t> all(view.matches.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const Matrix6d whole = covariance_from(view, all);
  const auto variance = [](const Matrix6d& covariance) {
    return covariance.topLeftCorner<3, 3>().trace();
  };
  Matrix6d largest = whole;
  for (const std::size_t left_out : all) {
    std::vector<std::size_t> others = all;
    std::erase(others, left_out);
    const Matrix6d covariance = covariance_from(view, others);
    if (variance(covariance) > variance(largest)) largest = covariance;
  }
  ASSERT_TRUE(growth_of(view, 0) && growth_of(view, 1));
  EXPECT_TRUE(growth_of(view, 0)->isZero());
  EXPECT_TRUE((whole + *growth_of(view, 1)).isApprox(largest, 1e-6));
  EXPECT_GT(variance(*growth_of(view, 2)), variance(*growth_of(view, 1)));
  EXPECT_FALSE(growth_of(view, 10)) << "two do not determine a pose";
  EXPECT_TRUE((2.0 * *growth_of(view, 1, 2)).isApprox(*growth_of(view, 1), 1e-9))
      << "a landmark that two images show is left out of both";
}

TEST(GrowthWithoutLandmarks, IsLargeIfOneNearLandmarkDecides) {
  Random random(4);
  View view;
  for (int i = 0; i < 60; ++i) {  // a far patch
    const Eigen::Vector2d pixel(random.uniform(300.0, 380.0), random.uniform(200.0, 260.0));
    view.matches.push_back(match_of(view.world_from_camera,
                                    kTestPinhole.back_project(pixel, random.uniform(5.4, 5.6)), 0.0,
                                    random));
    view.matches.back().measured.depth_m = 0.0;
  }
  const auto deviation = [&] {
    const Matrix6d covariance =
        refine_pose(kTestPinhole, view.matches, view.world_from_camera).covariance;
    return std::sqrt((covariance + *growth_of(view, 1)).topLeftCorner<3, 3>().trace() /
                     covariance.topLeftCorner<3, 3>().trace());
  };
  EXPECT_LT(deviation(), 1.3) << "many landmarks share the decision";
  view.matches.push_back(match_of(view.world_from_camera,
                                  kTestPinhole.back_project({200.0, 100.0}, 1.5), 0.0, random));
  view.matches.back().measured.depth_m = 0.0;
  EXPECT_GT(deviation(), 3.0);
}

TEST(RefinePose, TooLittleToFixAPoseIsNoEstimate) {
  for (const std::size_t count : {0U, 1U}) {
    View view = make_view(5, count, 0.0);
    for (PointMatch& match : view.matches) match.measured.depth_m = 0.0;
    const PoseEstimate estimate = refine_pose(kTestPinhole, view.matches, view.world_from_camera);
    EXPECT_EQ(estimate.inlier_count, 0U);
    EXPECT_TRUE(estimate.covariance.isZero());
  }
  // All behind the camera.
  const View view = make_view(5, 50, 0.0);
  const Rigid3 turned = view.world_from_camera * Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, 3.14, 0);
  EXPECT_EQ(refine_pose(kTestPinhole, view.matches, turned).inlier_count, 0U);
}

TEST(FindPose, NeedsNoStartThough70PercentAreWrong) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    View view = make_view(seed, 200, 1.0);
    Random random(seed + 50);
    for (std::size_t i = 0; i < 140; ++i) {  // matched with another point
      view.matches[i].x_in_world =
          view.world_from_camera *
          kTestPinhole.back_project({random.uniform(0.0, 639.0), random.uniform(0.0, 479.0)},
                                    random.uniform(1.0, 4.0));
    }
    const auto estimate = find_pose(kTestPinhole, view.matches, 20, seed);
    ASSERT_TRUE(estimate) << seed;
    const Vector6d error = view.world_from_camera.difference_to(estimate->world_from_camera);
    EXPECT_LT(error.head<3>().norm(), 0.03);
    EXPECT_LT(error.tail<3>().norm(), 0.01);
    EXPECT_LE(std::count(estimate->inliers.begin(), estimate->inliers.begin() + 140, true), 2);
    EXPECT_GE(estimate->inlier_count, 50U);
    EXPECT_EQ(std::count(estimate->inliers.begin(), estimate->inliers.end(), true),
              static_cast<std::ptrdiff_t>(estimate->inlier_count));
  }
}

TEST(FindPose, SameSeedSamePose) {
  const View view = make_view(6, 100, 1.0);
  const auto a = find_pose(kTestPinhole, view.matches, 20, 1);
  const auto b = find_pose(kTestPinhole, view.matches, 20, 1);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->world_from_camera.matrix(), b->world_from_camera.matrix());
}

// The covariance is of the pose by its own noise, not by the wider one of the search.
TEST(FindPose, CovarianceIsThatOfRefiningTheInliers) {
  const View view = make_view(7, 100, 1.0);
  const auto found = find_pose(kTestPinhole, view.matches, 20, 1);
  ASSERT_TRUE(found);
  const PoseEstimate refined = refine_pose(kTestPinhole, view.matches, found->world_from_camera);
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(found->covariance(i, i) / refined.covariance(i, i), 1.0, 0.3) << i;
  }
}

TEST(FindPose, NothingFromTooFewOrUselessMatches) {
  EXPECT_FALSE(find_pose(kTestPinhole, {}, 6, 1));
  EXPECT_FALSE(find_pose(kTestPinhole, make_view(1, 19, 0.0).matches, 20, 1));
  View view = make_view(1, 100, 0.0);
  for (PointMatch& match : view.matches) match.measured.depth_m = 0.0;
  EXPECT_FALSE(find_pose(kTestPinhole, view.matches, 20, 1));
  // All the same point: no triangle.
  const std::vector<PointMatch> same(100, make_view(1, 1, 0.0).matches[0]);
  EXPECT_FALSE(find_pose(kTestPinhole, same, 20, 1));
  // Nothing but wrong ones.
  View wrong = make_view(2, 100, 0.0);
  Random random(3);
  for (PointMatch& match : wrong.matches) {
    match.x_in_world = testing::random_vector(random, 3.0);
  }
  EXPECT_FALSE(find_pose(kTestPinhole, wrong.matches, 20, 1));
}

}  // namespace
}  // namespace cairn::detail
