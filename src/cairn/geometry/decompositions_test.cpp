// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/decompositions.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {
namespace {

template <int kRows, int kColumns>
Eigen::Matrix<double, kRows, kColumns> random_matrix(std::uint64_t seed) {
  Random random(seed);
  return Eigen::Matrix<double, kRows, kColumns>::NullaryExpr([&] { return random.normal(); });
}

template <int kSize>
Eigen::Matrix<double, kSize, kSize> positive_definite(std::uint64_t seed) {
  const auto root = random_matrix<kSize, kSize>(seed);
  return root * root.transpose() + Eigen::Matrix<double, kSize, kSize>::Identity();
}

template <int kSize>
void expect_eigen_of_symmetric() {
  const auto matrix = positive_definite<kSize>(1);
  const auto [values, vectors] = symmetric_eigen<kSize>(matrix);
  const Eigen::Matrix<double, kSize, kSize> remade =
      vectors * values.asDiagonal() * vectors.transpose();
  EXPECT_TRUE(remade.isApprox(matrix, 1e-12)) << remade;
  EXPECT_TRUE(vectors.isUnitary(1e-12));
  for (int i = 1; i < kSize; ++i) EXPECT_LE(values[i - 1], values[i]);
  EXPECT_TRUE((symmetric_eigenvalues<kSize>(matrix).isApprox(values, 1e-12)));
}

TEST(Decompositions, EigenvectorsAndValuesMakeTheMatrix) {
  expect_eigen_of_symmetric<3>();
  expect_eigen_of_symmetric<6>();
  expect_eigen_of_symmetric<7>();
}

TEST(Decompositions, EigenvaluesOfADiagonalMatrixAreItsEntriesAscending) {
  Eigen::Matrix<double, 7, 1> entries;
  for (int i = 0; i < 7; ++i) entries[i] = (i * 5) % 7 - 3;
  const auto values = symmetric_eigenvalues<7>(Eigen::Matrix<double, 7, 7>(entries.asDiagonal()));
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(values[i], i - 3, 1e-12);
}

template <int kSize>
void expect_solved() {
  const auto matrix = positive_definite<kSize>(2);
  const auto truth = random_matrix<kSize, 1>(3);
  EXPECT_TRUE((solve_symmetric<kSize>(matrix, matrix * truth).isApprox(truth, 1e-10)));
}

TEST(Decompositions, SystemsAreSolved) {
  expect_solved<6>();
  expect_solved<7>();
  expect_solved<14>();
}

TEST(Decompositions, SystemsArePositiveDefiniteOrNotSolved) {
  const auto matrix = positive_definite<12>(4);
  const auto truth = random_matrix<12, 1>(5);
  const auto solution = solve_positive_definite<12>(matrix, matrix * truth);
  ASSERT_TRUE(solution);
  EXPECT_TRUE(solution->isApprox(truth, 1e-10));

  Eigen::Matrix<double, 6, 6> indefinite = Eigen::Matrix<double, 6, 6>::Identity();
  const Eigen::Matrix<double, 6, 1> ones = Eigen::Matrix<double, 6, 1>::Ones();
  for (const double least : {0.0, -1.0, std::nan("")}) {
    indefinite(4, 4) = least;
    EXPECT_FALSE(solve_positive_definite<6>(indefinite, ones)) << least;
    EXPECT_FALSE(inverse_of_positive_definite(indefinite)) << least;
  }
}

TEST(Decompositions, InverseOfAPositiveDefiniteMatrix) {
  const auto matrix = positive_definite<6>(6);
  const auto inverse = inverse_of_positive_definite(matrix);
  ASSERT_TRUE(inverse);
  EXPECT_TRUE((matrix * *inverse).isIdentity(1e-12));
}

TEST(Decompositions, SingularValuesMakeTheMatrix) {
  const Eigen::Matrix3d matrix = random_matrix<3, 3>(7);
  const auto [u, values, v] = singular_values(matrix);
  EXPECT_TRUE((u * values.asDiagonal() * v.transpose()).isApprox(matrix, 1e-12));
  EXPECT_TRUE(u.isUnitary(1e-12));
  EXPECT_TRUE(v.isUnitary(1e-12));
  EXPECT_GE(values[0], values[1]);
  EXPECT_GE(values[1], values[2]);
  EXPECT_GE(values[2], 0.0);
}

TEST(Decompositions, NoRotationNearbyIsNearerThanTheNearest) {
  Random random(8);
  for (const double sign : {1.0, -1.0}) {  // of the determinant
    const Eigen::Matrix3d matrix =
        sign * (Eigen::Matrix3d::Identity() + 0.3 * random_matrix<3, 3>(9));
    const Eigen::Matrix3d nearest = nearest_rotation(singular_values(matrix));
    EXPECT_TRUE(nearest.isUnitary(1e-12));
    EXPECT_NEAR(nearest.determinant(), 1.0, 1e-12);
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d axis(random.normal(), random.normal(), random.normal());
      const Eigen::Matrix3d other =
          Eigen::AngleAxisd(random.uniform(0.01, 3.0), axis.normalized()) * nearest;
      EXPECT_GT((other - matrix).norm(), (nearest - matrix).norm());
    }
  }
}

TEST(Decompositions, TheSimilarityOfExactPointsIsTheTruth) {
  const Rigid3 truth = Rigid3::from_roll_pitch_yaw({1, -2, 3}, 0.3, -1.2, 2.5);
  for (const double scale : {1.0, 0.4}) {
    std::vector<Eigen::Vector3d> from;
    std::vector<Eigen::Vector3d> to;
    for (std::uint64_t i = 0; i < 8; ++i) {
      from.emplace_back(random_matrix<3, 1>(10 + i));
      to.emplace_back(scale * (truth.rotation() * from.back()) + truth.translation());
    }
    const Eigen::Matrix4d similarity = least_squares_similarity(from, to, true);
    EXPECT_TRUE((similarity.topLeftCorner<3, 3>().isApprox(scale * truth.rotation(), 1e-10)));
    EXPECT_TRUE((similarity.topRightCorner<3, 1>().isApprox(truth.translation(), 1e-10)));
    const Eigen::Matrix4d rigid = least_squares_similarity(from, to, false);
    EXPECT_TRUE((rigid.topLeftCorner<3, 3>().isApprox(truth.rotation(), 1e-10)));
  }
}

TEST(Decompositions, ADirectionIsTurnedIntoAnotherOrItsOpposite) {
  const Eigen::Vector3d from(1, 2, -3);
  for (const Eigen::Vector3d& to : {Eigen::Vector3d(0, 5, 1), Eigen::Vector3d(2, 4, -6),
                                    Eigen::Vector3d(-1, -2, 3), Eigen::Vector3d(-1, -2, 2.9999)}) {
    const Eigen::Quaterniond turn = rotation_between(from, to);
    EXPECT_TRUE((turn * from.normalized()).isApprox(to.normalized(), 1e-9));
    const double angle = std::acos(from.normalized().dot(to.normalized()));
    EXPECT_NEAR(Eigen::AngleAxisd(turn).angle(), angle, 1e-6) << "no smaller one";
  }
}

}  // namespace
}  // namespace cairn
