// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/map_drift.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/covariance.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint32_t kKeyframes = 16;
constexpr std::uint32_t kEach = 12;  // landmarks that a keyframe observes

const Vector6d kStep = (Vector6d() << 3e-3, 2e-3, 1e-3, 1e-3, 2e-3, 3e-3).finished();

Eigen::Vector3d keyframe_place(std::uint32_t k) {
  return {1.0 * k, 0.1 * k * k, 0.3};
}

// A walk along a bend, whose covariances grow as a random walk's.
LandmarkMap walk() {
  MapTables tables;
  Random random(3);
  tables.observations.offsets.push_back(0);
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    tables.frames.ids.push_back(FrameId{k});
    tables.frames.translations.push_back(keyframe_place(k));
    tables.frames.quaternions.push_back({1.0, 0.0, 0.0, 0.0});
    Matrix6d covariance = Matrix6d::Zero();
    for (std::uint32_t step = 0; step <= k; ++step) {
      const Matrix6d own = kStep.cwiseAbs2().asDiagonal();
      covariance += covariance_at_point(own, keyframe_place(k) - keyframe_place(step));
    }
    tables.frames.pose_covariances.push_back(covariance);
    for (std::uint32_t i = 0; i < kEach; ++i) {
      tables.landmarks.ids.push_back(LandmarkId{kEach * k + i});
      tables.landmarks.positions.push_back(
          keyframe_place(k) + Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
      tables.observations.frames.push_back(FrameIndex{k});
      tables.observations.pixels.push_back({});
      tables.observations.offsets.push_back(tables.observations.frames.size());
    }
  }
  return LandmarkMap(std::move(tables));
}

std::vector<LandmarkIndex> all_of(const LandmarkMap& map) {
  std::vector<LandmarkIndex> all;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) all.push_back(LandmarkIndex{i});
  return all;
}

// Terms of the landmarks of some keyframes, moved to the target.
std::vector<MapDrift::Term> terms_of(const LandmarkMap& map, std::uint32_t begin, std::uint32_t end,
                                     const Similarity3& from_map = {}) {
  std::vector<MapDrift::Term> terms;
  for (std::uint32_t i = begin * kEach; i < end * kEach; ++i) {
    terms.push_back({i, from_map * map.landmarks().positions[i], 1.0});
  }
  return terms;
}

// Each keyframe's displacement of the map's origin and its rotation, by errors of the steps before it.
std::vector<Vector6d> drawn(Random& random) {
  std::vector<Vector6d> motions(kKeyframes, Vector6d::Zero());
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    Vector6d step;
    for (int axis = 0; axis < 6; ++axis) step[axis] = kStep[axis] * random.normal();
    step.head<3>() -= step.tail<3>().cross(keyframe_place(k));
    motions[k] = (k > 0 ? motions[k - 1] : motions[k]) + step;
  }
  return motions;
}

Eigen::Vector3d moved(const Eigen::Vector3d& x, const Vector6d& by) {
  return by.head<3>() + by.tail<3>().cross(x);
}

// The rotation that keyframes have on average, which moves the middle of the cameras as they move.
Vector6d motion_of_frame(std::span<const Vector6d> motions) {
  Vector6d mean = Vector6d::Zero();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    mean.head<3>() += moved(keyframe_place(k), motions[k]) / kKeyframes;
    mean.tail<3>() += motions[k].tail<3>() / kKeyframes;
    middle += keyframe_place(k) / kKeyframes;
  }
  mean.head<3>() -= mean.tail<3>().cross(middle);
  return mean;
}

// Drawn drift, and the least-squares poses by some keyframes' landmarks only: the mean squared error, over the degrees of
// freedom, under the stated covariance.
double mean_squared_error(std::uint32_t begin, std::uint32_t end, bool free_scale) {
  const LandmarkMap map = walk();
  const auto all = all_of(map);
  const MapDrift drift(map, all);
  const std::vector<MapDrift::Term> terms = terms_of(map, begin, end);
  const Matrix7d stated = drift.covariance(terms, {}, Eigen::Vector3d::Zero(), free_scale);
  const int freedoms = free_scale ? 7 : 6;
  Eigen::MatrixXd derivatives(3 * terms.size(), freedoms);
  for (std::size_t i = 0; i < terms.size(); ++i) {
    derivatives.middleRows<3>(3 * static_cast<Eigen::Index>(i)) =
        point_by_pose(terms[i].place).leftCols(freedoms);
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(derivatives);
  constexpr int kRuns = 2000;
  Random random(5);
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const std::vector<Vector6d> motions = drawn(random);
    Eigen::VectorXd errors(derivatives.rows());
    for (std::size_t i = 0; i < terms.size(); ++i) {
      errors.segment<3>(3 * static_cast<Eigen::Index>(i)) =
          moved(terms[i].place, motions[terms[i].landmark / kEach]);
    }
    Eigen::VectorXd error = solver.solve(errors);
    error.head<6>() -= motion_of_frame(motions);
    const Eigen::MatrixXd covariance = stated.topLeftCorner(freedoms, freedoms);
    sum += error.dot(covariance.ldlt().solve(error)) / freedoms;
  }
  return sum / kRuns;
}

TEST(MapDrift, StatesTheErrorsOfPosesThatPartOfAMapShows) {
  EXPECT_NEAR(mean_squared_error(0, 5, false), 1.0, 0.06);
  EXPECT_NEAR(mean_squared_error(6, 10, false), 1.0, 0.06);
  EXPECT_NEAR(mean_squared_error(11, 16, false), 1.0, 0.06);
  EXPECT_NEAR(mean_squared_error(9, 16, true), 1.0, 0.06);
}

TEST(MapDrift, IsSmallWhereAllOfTheMapTakesPart) {
  const LandmarkMap map = walk();
  const MapDrift drift(map, all_of(map));
  const auto at_centre = [&](std::uint32_t begin, std::uint32_t end) {
    return drift.covariance(terms_of(map, begin, end), {}, keyframe_place(kKeyframes / 2), false)
        .topLeftCorner<3, 3>()
        .trace();
  };
  EXPECT_LT(10.0 * at_centre(0, kKeyframes), at_centre(0, 3));
}

TEST(MapDrift, CountsTheErrorOfAnyViewInFull) {
  MapTables tables = walk().tables();
  Matrix6d stated = Matrix6d::Zero();
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    tables.frames.pose_covariances.set(
        k, covariance_at_point(stated, keyframe_place(k) - keyframe_place(1)));
    stated = kStep.cwiseAbs2().asDiagonal();
  }
  const LandmarkMap map(std::move(tables));
  const MapDrift drift(map, all_of(map));
  const Matrix6d found =
      drift.covariance(terms_of(map, 10, 12), {}, keyframe_place(1), false).topLeftCorner<6, 6>();
  EXPECT_TRUE(found.isApprox(stated, 1e-6));
}

// Closed loops make a keyframe more certain along one axis than one that is more certain on the whole.
TEST(MapDrift, GivesEachKeyframeTheCovarianceThatItStates) {
  MapTables tables = walk().tables();
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    Vector6d variances = Vector6d::Zero();
    if (k == 3) variances.head<2>() << 9.0, 1.0;
    if (k == 4) variances.head<2>() << 1.0, 10.0;
    tables.frames.pose_covariances.set(k, Matrix6d(variances.asDiagonal()));
  }
  const LandmarkMap map(std::move(tables));
  const MapDrift drift(map, all_of(map));
  const Matrix7d found = drift.covariance(terms_of(map, 4, 5), {}, keyframe_place(4), false);
  // Along x, the other's error of 3 is 1 here. The frame moves by a sixteenth of both.
  constexpr double kShare = 1.0 / kKeyframes;
  EXPECT_NEAR(std::sqrt(found(0, 0)), (1.0 - kShare) * 1.0 - kShare * 3.0, 1e-3);
  EXPECT_NEAR(found(1, 1), std::pow(1.0 - 2.0 * kShare, 2) + std::pow(1.0 - kShare, 2) * 9.0, 1e-3);
}

TEST(MapDrift, MovesALandmarkWithTheMiddleOfItsKeyframes) {
  MapTables tables = walk().tables();
  ObservationTable& observations = tables.observations;
  observations = {};
  observations.offsets.push_back(0);
  for (std::uint32_t i = 0; i < tables.landmarks.ids.size(); ++i) {
    const std::uint32_t own = i / kEach;
    for (const std::uint32_t frame : {kKeyframes - 1, own, 0U}) {
      observations.frames.push_back(FrameIndex{frame});
      observations.pixels.push_back({});
    }
    observations.offsets.push_back(observations.frames.size());
  }
  const LandmarkMap often(std::move(tables));
  const LandmarkMap once = walk();
  const auto covariance = [](const LandmarkMap& map) {
    return MapDrift(map, all_of(map)).covariance(terms_of(map, 3, 8), {}, keyframe_place(5), false);
  };
  EXPECT_TRUE(covariance(often).isApprox(covariance(once), 1e-12));
}

TEST(MapDrift, MovesWithTheFrames) {
  const LandmarkMap map = walk();
  const MapDrift drift(map, all_of(map));
  const Eigen::Vector3d origin(1.0, -2.0, 3.0);
  const Similarity3 target_from_map(
      1.7, Rigid3(Eigen::Quaterniond(0.8, 0.4, -0.4, 0.2).normalized(), {3.0, 1.0, -2.0}));
  const Matrix7d there = drift.covariance(terms_of(map, 10, 16, target_from_map), target_from_map,
                                          target_from_map * origin, true);
  Matrix7d turn = Matrix7d::Identity();
  turn.topLeftCorner<3, 3>() = target_from_map.linear();
  turn.block<3, 3>(3, 3) = target_from_map.rigid().rotation();
  const Matrix7d here =
      propagated_covariance(turn, drift.covariance(terms_of(map, 10, 16), {}, origin, true));
  EXPECT_TRUE(there.isApprox(here, 1e-6));
}

TEST(MapDrift, IsUnknownWithoutCovariancesOrObservations) {
  const LandmarkMap map = walk();
  MapTables without = LandmarkMap(map).tables();
  without.frames.pose_covariances.clear();
  const LandmarkMap silent(std::move(without));
  EXPECT_TRUE(MapDrift(silent, all_of(silent)).empty());
  MapTables unobserved = LandmarkMap(map).tables();
  unobserved.observations = {};
  const LandmarkMap cloud(std::move(unobserved));
  EXPECT_TRUE(MapDrift(cloud, all_of(cloud)).empty());
  EXPECT_FALSE(MapDrift(map, all_of(map)).empty());
}

}  // namespace
}  // namespace cairn::detail
