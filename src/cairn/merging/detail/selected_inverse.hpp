// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/SparseCore>

namespace cairn {

/// The entries of the inverse of a sparse symmetric positive definite matrix at the nonzeros of its
/// Cholesky factor, which include those of the matrix (Takahashi, Fagan and Chen 1973). Takes little longer
/// than the factorisation.
class SelectedInverse {
 public:
  /// @param matrix only its lower triangle is used
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& matrix);

  /// False if the matrix is not positive definite; then there are no entries.
  bool is_valid() const { return valid_; }
  /// An entry; 0 if it was not computed.
  double operator()(Eigen::Index row, Eigen::Index column) const;

 private:
  bool valid_ = false;
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation_;
  Eigen::SparseMatrix<double> inverse_;  ///< lower triangle, permuted
};

}  // namespace cairn
