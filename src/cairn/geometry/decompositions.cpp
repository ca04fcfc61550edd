// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/decompositions.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace cairn {

template <int kSize>
SymmetricEigen<kSize> symmetric_eigen(const Eigen::Matrix<double, kSize, kSize>& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kSize, kSize>> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

template SymmetricEigen<3> symmetric_eigen(const Eigen::Matrix<double, 3, 3>&);
template SymmetricEigen<6> symmetric_eigen(const Eigen::Matrix<double, 6, 6>&);
template SymmetricEigen<7> symmetric_eigen(const Eigen::Matrix<double, 7, 7>&);

template <int kSize>
Eigen::Matrix<double, kSize, 1> symmetric_eigenvalues(
    const Eigen::Matrix<double, kSize, kSize>& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kSize, kSize>>(matrix,
                                                                            Eigen::EigenvaluesOnly)
      .eigenvalues();
}

template Eigen::Matrix<double, 3, 1> symmetric_eigenvalues(const Eigen::Matrix<double, 3, 3>&);
template Eigen::Matrix<double, 6, 1> symmetric_eigenvalues(const Eigen::Matrix<double, 6, 6>&);
template Eigen::Matrix<double, 7, 1> symmetric_eigenvalues(const Eigen::Matrix<double, 7, 7>&);
template Eigen::Matrix<double, 14, 1> symmetric_eigenvalues(const Eigen::Matrix<double, 14, 14>&);

template <int kSize>
Eigen::Matrix<double, kSize, 1> solve_symmetric(const Eigen::Matrix<double, kSize, kSize>& matrix,
                                                const Eigen::Matrix<double, kSize, 1>& vector) {
  return matrix.ldlt().solve(vector);
}

template Eigen::Matrix<double, 6, 1> solve_symmetric(const Eigen::Matrix<double, 6, 6>&,
                                                     const Eigen::Matrix<double, 6, 1>&);
template Eigen::Matrix<double, 7, 1> solve_symmetric(const Eigen::Matrix<double, 7, 7>&,
                                                     const Eigen::Matrix<double, 7, 1>&);
template Eigen::Matrix<double, 14, 1> solve_symmetric(const Eigen::Matrix<double, 14, 14>&,
                                                      const Eigen::Matrix<double, 14, 1>&);

namespace {

template <class Solver>
bool is_positive_definite(const Solver& solver) {
  return solver.info() == Eigen::Success && (solver.vectorD().array() > 0.0).all();  // NaN is not
}

}  // namespace

template <int kSize>
std::optional<Eigen::Matrix<double, kSize, 1>> solve_positive_definite(
    const Eigen::Matrix<double, kSize, kSize>& matrix,
    const Eigen::Matrix<double, kSize, 1>& vector) {
  const Eigen::LDLT<Eigen::Matrix<double, kSize, kSize>> solver(matrix);
  if (!is_positive_definite(solver)) return std::nullopt;
  return solver.solve(vector);
}

template std::optional<Eigen::Matrix<double, 6, 1>> solve_positive_definite(
    const Eigen::Matrix<double, 6, 6>&, const Eigen::Matrix<double, 6, 1>&);
template std::optional<Eigen::Matrix<double, 12, 1>> solve_positive_definite(
    const Eigen::Matrix<double, 12, 12>&, const Eigen::Matrix<double, 12, 1>&);

std::optional<Eigen::Matrix<double, 6, 6>> inverse_of_positive_definite(
    const Eigen::Matrix<double, 6, 6>& matrix) {
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(matrix);
  if (!is_positive_definite(solver)) return std::nullopt;
  return solver.solve(Eigen::Matrix<double, 6, 6>::Identity());
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
