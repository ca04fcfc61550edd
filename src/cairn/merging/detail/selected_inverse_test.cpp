// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/selected_inverse.hpp"

#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

TEST(SelectedInverse, IsThatOfTheDenseMatrixWhereTheSparseOneHasEntries) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const auto size = static_cast<Eigen::Index>(5 + random.index(40));
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3 * size, size);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      for (int k = 0; k < 3; ++k) {
        rows(i, static_cast<Eigen::Index>(random.index(static_cast<std::size_t>(size)))) =
            random.normal();
      }
    }
    const Eigen::MatrixXd dense =
        rows.transpose() * rows + 1e-3 * Eigen::MatrixXd::Identity(size, size);
    const Eigen::SparseMatrix<double> sparse = dense.sparseView();
    const SelectedInverse inverse(sparse);
    ASSERT_TRUE(inverse.is_valid());
    const Eigen::MatrixXd expected = dense.inverse();
    for (Eigen::Index i = 0; i < size; ++i) {
      for (Eigen::Index j = 0; j < size; ++j) {
        if (dense(i, j) == 0.0) continue;
        EXPECT_NEAR(inverse(i, j), expected(i, j), 1e-9 * expected.norm()) << seed;
      }
    }
  }
}

TEST(SelectedInverse, ThereIsNoneOfAMatrixThatIsNotPositiveDefinite) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Identity(3, 3);
  dense(1, 1) = -1.0;
  EXPECT_FALSE(SelectedInverse(Eigen::SparseMatrix<double>(dense.sparseView())).is_valid());
  dense(1, 1) = 1.0;
  dense(0, 2) = dense(2, 0) = 1.0;  // singular
  EXPECT_FALSE(SelectedInverse(Eigen::SparseMatrix<double>(dense.sparseView())).is_valid());
}

}  // namespace
}  // namespace cairn
