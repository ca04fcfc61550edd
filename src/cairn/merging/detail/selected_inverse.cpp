// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/selected_inverse.hpp"

#include <algorithm>
#include <vector>

#include <Eigen/SparseCholesky>

namespace cairn {

SelectedInverse::SelectedInverse(const Eigen::SparseMatrix<double>& matrix) {
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(matrix);
  const auto diagonal = factor.vectorD();
  if (factor.info() != Eigen::Success || !(diagonal.minCoeff() > 0.0)) return;
  valid_ = true;
  permutation_ = factor.permutationP();
  // L without its ones, column by column; Z takes its place from the last column to the first:
  //   Z(i, j) = -sum over k of Z(i, k) L(k, j),  Z(j, j) = 1 / D(j) - sum over k of Z(k, j) L(k, j),  k > j.
  inverse_ = factor.matrixL();
  inverse_.makeCompressed();
  const int size = static_cast<int>(inverse_.cols());
  const int* const begins = inverse_.outerIndexPtr();
  const int* const rows = inverse_.innerIndexPtr();
  double* const values = inverse_.valuePtr();
  std::vector<double> l(static_cast<std::size_t>(size), 0.0);  // the column of L that is worked on
  std::vector<double> z(static_cast<std::size_t>(size), 0.0);
  for (int j = size - 1; j >= 0; --j) {
    const int first = begins[j] + 1;  // behind the diagonal
    const int last = begins[j + 1];
    for (int p = first; p < last; ++p) {
      l[static_cast<std::size_t>(rows[p])] = values[p];
      z[static_cast<std::size_t>(rows[p])] = 0.0;
    }
    for (int p = first; p < last; ++p) {
      const int k = rows[p];
      const double l_k = values[p];
      double sum = values[begins[k]] * l_k;
      // Rows of column k that column j has are a subset of those that it needs, and l is 0 in others.
      for (int q = begins[k] + 1; q < begins[k + 1]; ++q) {
        const auto i = static_cast<std::size_t>(rows[q]);
        sum += values[q] * l[i];
        z[i] -= values[q] * l_k;
      }
      z[static_cast<std::size_t>(k)] -= sum;
    }
    double diagonal_entry = 1.0 / diagonal[j];
    for (int p = first; p < last; ++p) {
      const auto i = static_cast<std::size_t>(rows[p]);
      diagonal_entry -= z[i] * l[i];
    }
    for (int p = first; p < last; ++p) {
      const auto i = static_cast<std::size_t>(rows[p]);
      values[p] = z[i];
      l[i] = 0.0;
    }
    values[begins[j]] = diagonal_entry;
  }
}

double SelectedInverse::operator()(Eigen::Index row, Eigen::Index column) const {
  const auto i = permutation_.indices()[row];
  const auto j = permutation_.indices()[column];
  return inverse_.coeff(std::max(i, j), std::min(i, j));
}

}  // namespace cairn
