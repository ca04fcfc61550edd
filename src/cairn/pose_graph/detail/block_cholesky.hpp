// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace cairn::detail {

/// Cholesky factor of a sparse symmetric positive definite matrix of equal square blocks, and the diagonal blocks
/// of its inverse.
///
/// Multifrontal (Duff and Reid 1983): columns of similar structure are eliminated together in dense matrices.
/// The inverse follows Takahashi, Fagan and Chen (1973) on the same matrices. The structure is analysed once
/// for any number of matrices.
class BlockCholesky {
 public:
  /// Row and column of a block off the diagonal; the block at (column, row) is its transpose.
  using Place = std::pair<std::size_t, std::size_t>;

  /// @param blocks     number of block rows
  /// @param block_size rows of a block
  /// @param places     places of the blocks off the diagonal; blocks at the same place are added
  BlockCholesky(std::size_t blocks, Eigen::Index block_size, std::span<const Place> places);

  /// @param diagonal blocks of the diagonal, side by side
  /// @param others   blocks at the places, side by side
  /// @return false, without a factor, if the matrix is not positive definite
  bool factor(const Eigen::MatrixXd& diagonal, const Eigen::MatrixXd& others);

  /// Solves for one right-hand side; needs a factor.
  Eigen::VectorXd solve(const Eigen::VectorXd& right) const;

  /// Diagonal blocks of the inverse, side by side; needs a factor.
  Eigen::MatrixXd inverse_diagonal() const;

 private:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  // Columns that are eliminated together. Positions number block rows in the order of elimination.
  struct Front {
    std::size_t first = 0;              // position of the first column
    std::size_t width = 0;              // columns
    std::vector<std::size_t> rows;      // positions below the columns that have entries, ascending
    std::size_t parent = kNone;         // front of the first of `rows`
    std::vector<std::size_t> children;  // ascending
    std::vector<Eigen::Index> in_parent;  // per row: its place among the parent's columns and rows
    std::vector<std::size_t> entries;     // places whose block lies in the columns
    std::size_t update = 0;               // where the update of its `rows` begins in updates_
  };

  void order();
  void analyse();
  void merge_columns(const std::vector<std::vector<std::size_t>>& below,
                     const std::vector<std::size_t>& parent);
  void place_updates();

  std::size_t blocks_ = 0;
  Eigen::Index size_ = 0;  // of a block
  std::vector<Place> places_;
  std::vector<std::size_t> position_;  // per block row
  std::vector<std::size_t> row_at_;    // per position: its block row
  std::vector<std::size_t> front_of_;  // per position
  std::vector<Front> fronts_;          // children before parents
  // Per front: its columns of the factor, (columns + rows) x columns.
  std::vector<Eigen::MatrixXd> factors_;
  std::vector<double> updates_;  // scratch memory of factor()
};

}  // namespace cairn::detail
