// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/decompositions.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace cairn {

namespace {

template <int kSize>
using Square = Eigen::Matrix<double, kSize, kSize>;
template <int kSize>
using Column = Eigen::Matrix<double, kSize, 1>;

// A solver takes the compiler seconds for each function that it becomes part of, so it stays in these.

template <int kSize>
[[gnu::noinline]] Eigen::SelfAdjointEigenSolver<Square<kSize>> decomposed(
    const Square<kSize>& matrix, int options) {
  return Eigen::SelfAdjointEigenSolver<Square<kSize>>(matrix, options);
}

template <int kSize>
[[gnu::noinline]] Eigen::LDLT<Square<kSize>> factored(const Square<kSize>& matrix) {
  return matrix.ldlt();
}

template <int kSize>
[[gnu::noinline]] Column<kSize> solved(const Eigen::LDLT<Square<kSize>>& factors,
                                       const Column<kSize>& vector) {
  return factors.solve(vector);
}

template <class Factors>
bool is_positive_definite(const Factors& factors) {
  return factors.info() == Eigen::Success && (factors.vectorD().array() > 0.0).all();  // NaN is not
}

}  // namespace

template <int kSize>
SymmetricEigen<kSize> symmetric_eigen(const Eigen::Matrix<double, kSize, kSize>& matrix) {
  const auto solver = decomposed<kSize>(matrix, Eigen::ComputeEigenvectors);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

template SymmetricEigen<3> symmetric_eigen(const Square<3>&);
template SymmetricEigen<6> symmetric_eigen(const Square<6>&);
template SymmetricEigen<7> symmetric_eigen(const Square<7>&);

template <int kSize>
Eigen::Matrix<double, kSize, 1> symmetric_eigenvalues(
    const Eigen::Matrix<double, kSize, kSize>& matrix) {
  return decomposed<kSize>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

template Column<3> symmetric_eigenvalues(const Square<3>&);
template Column<6> symmetric_eigenvalues(const Square<6>&);
template Column<7> symmetric_eigenvalues(const Square<7>&);

template <int kSize>
Eigen::Matrix<double, kSize, 1> solve_symmetric(const Eigen::Matrix<double, kSize, kSize>& matrix,
                                                const Eigen::Matrix<double, kSize, 1>& vector) {
  return solved<kSize>(factored<kSize>(matrix), vector);
}

template Column<6> solve_symmetric(const Square<6>&, const Column<6>&);
template Column<7> solve_symmetric(const Square<7>&, const Column<7>&);
template Column<14> solve_symmetric(const Square<14>&, const Column<14>&);

template <int kSize>
std::optional<Eigen::Matrix<double, kSize, 1>> solve_positive_definite(
    const Eigen::Matrix<double, kSize, kSize>& matrix,
    const Eigen::Matrix<double, kSize, 1>& vector) {
  const auto factors = factored<kSize>(matrix);
  if (!is_positive_definite(factors)) return std::nullopt;
  return solved<kSize>(factors, vector);
}

template std::optional<Column<6>> solve_positive_definite(const Square<6>&, const Column<6>&);
template std::optional<Column<12>> solve_positive_definite(const Square<12>&, const Column<12>&);
template std::optional<Column<14>> solve_positive_definite(const Square<14>&, const Column<14>&);

std::optional<Eigen::Matrix<double, 6, 6>> inverse_of_positive_definite(
    const Eigen::Matrix<double, 6, 6>& matrix) {
  const auto factors = factored<6>(matrix);
  if (!is_positive_definite(factors)) return std::nullopt;
  return factors.solve(Square<6>::Identity());
}

SingularValues3 singular_values(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

Eigen::Matrix3d nearest_rotation(const SingularValues3& matrix) {
  const double sign = (matrix.u * matrix.v.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return matrix.u * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * matrix.v.transpose();
}

Eigen::Matrix4d least_squares_similarity(std::span<const Eigen::Vector3d> from,
                                         std::span<const Eigen::Vector3d> to, bool with_scale) {
  const auto columns = [](std::span<const Eigen::Vector3d> points) {
    return Eigen::Matrix3Xd(Eigen::Map<const Eigen::Matrix3Xd>(
        points.front().data(), 3, static_cast<Eigen::Index>(points.size())));
  };
  return Eigen::umeyama(columns(from), columns(to), with_scale);
}

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  const Eigen::Vector3d axis = a.cross(b);
  const double twice = 2.0 + 2.0 * a.dot(b);  // the square of |a + b|
  constexpr double kOpposite = 1e-12;
  if (twice < kOpposite)
    return Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, a.unitOrthogonal()));
  const double length = std::sqrt(twice);
  return Eigen::Quaterniond(length / 2.0, axis.x() / length, axis.y() / length, axis.z() / length)
      .normalized();
}

}  // namespace cairn
