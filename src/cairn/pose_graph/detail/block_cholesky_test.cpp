// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/detail/block_cholesky.hpp"

#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

// A positive definite matrix of blocks, sparse and dense.
struct BlockMatrix {
  BlockMatrix(std::size_t blocks, Eigen::Index block_size, std::size_t pairs, std::uint64_t seed)
      : count(blocks), size(block_size) {
    Random random(seed);
    const auto rows = static_cast<Eigen::Index>(blocks) * size;
    dense = Eigen::MatrixXd::Zero(rows, rows);
    others.resize(size, static_cast<Eigen::Index>(pairs) * size);
    for (std::size_t i = 0; i < pairs; ++i) {
      const std::size_t row = random.index(blocks);
      const std::size_t column = (row + 1 + random.index(blocks - 1)) % blocks;
      places.emplace_back(row, column);
      for (Eigen::Index k = 0; k < size * size; ++k) {
        others(k % size, static_cast<Eigen::Index>(i) * size + k / size) = random.normal();
      }
      const Eigen::MatrixXd block = others.middleCols(static_cast<Eigen::Index>(i) * size, size);
      dense.block(at(row), at(column), size, size) += block;
      dense.block(at(column), at(row), size, size) += block.transpose();
    }
    // Rows that their diagonal outweighs make a positive definite matrix.
    diagonal.setZero(size, rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
      dense(i, i) = 0.1 + dense.row(i).cwiseAbs().sum();
      diagonal(i % size, i) = dense(i, i);
    }
  }
  Eigen::Index at(std::size_t block) const { return static_cast<Eigen::Index>(block) * size; }

  std::size_t count;
  Eigen::Index size;
  std::vector<BlockCholesky::Place> places;
  Eigen::MatrixXd diagonal;
  Eigen::MatrixXd others;
  Eigen::MatrixXd dense;
};

TEST(BlockCholesky, SolvesAndInvertsAsTheDenseMatrixDoes) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(100 + seed);
    const std::size_t blocks = 2 + random.index(60);
    const BlockMatrix matrix(blocks, 1 + static_cast<Eigen::Index>(random.index(7)),
                             random.index(3 * blocks), seed);
    BlockCholesky cholesky(matrix.count, matrix.size, matrix.places);
    ASSERT_TRUE(cholesky.factor(matrix.diagonal, matrix.others)) << seed;
    Eigen::VectorXd right(matrix.dense.rows());
    for (Eigen::Index i = 0; i < right.size(); ++i) right[i] = random.normal();
    const Eigen::VectorXd left = matrix.dense * cholesky.solve(right);
    EXPECT_LT((left - right).norm(), 1e-10 * right.norm()) << seed;
    const Eigen::MatrixXd expected = matrix.dense.inverse();
    const Eigen::MatrixXd inverse = cholesky.inverse_diagonal();
    for (std::size_t i = 0; i < blocks; ++i) {
      const Eigen::Index at = matrix.at(i);
      EXPECT_LT(
          (inverse.middleCols(at, matrix.size) - expected.block(at, at, matrix.size, matrix.size))
              .norm(),
          1e-10 * expected.norm())
          << seed << ": " << i;
    }
  }
}

TEST(BlockCholesky, IsForManyMatricesOfOneStructure) {
  BlockMatrix matrix(20, 3, 40, 1);
  BlockCholesky cholesky(matrix.count, matrix.size, matrix.places);
  ASSERT_TRUE(cholesky.factor(matrix.diagonal, matrix.others));
  const Eigen::VectorXd right = Eigen::VectorXd::Ones(60);
  const Eigen::VectorXd before = cholesky.solve(right);
  ASSERT_TRUE(cholesky.factor(4.0 * matrix.diagonal, 4.0 * matrix.others));
  EXPECT_LT((4.0 * cholesky.solve(right) - before).norm(), 1e-12 * before.norm());
}

TEST(BlockCholesky, ThereIsNoneOfAMatrixThatIsNotPositiveDefinite) {
  BlockMatrix matrix(20, 3, 40, 1);
  BlockCholesky cholesky(matrix.count, matrix.size, matrix.places);
  matrix.diagonal(1, 31) = -1.0;
  EXPECT_FALSE(cholesky.factor(matrix.diagonal, matrix.others));
}

}  // namespace
}  // namespace cairn::detail
