// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// Eigen's decompositions for the matrix sizes of poses and points. Compiled here once, because each
// instantiation costs seconds of compile time.

/// Eigendecomposition of a symmetric matrix.
template <int kSize>
struct SymmetricEigen {
  Eigen::Matrix<double, kSize, 1> values;       ///< ascending
  Eigen::Matrix<double, kSize, kSize> vectors;  ///< columns of unit length
};

/// Reads the lower triangle. For sizes 3, 6, 7.
template <int kSize>
SymmetricEigen<kSize> symmetric_eigen(const Eigen::Matrix<double, kSize, kSize>& matrix);

/// Eigenvalues alone, ascending. Reads the lower triangle. For sizes 3, 6, 7.
template <int kSize>
Eigen::Matrix<double, kSize, 1> symmetric_eigenvalues(
    const Eigen::Matrix<double, kSize, kSize>& matrix);

/// Solves matrix·x = vector for x by LDLᵀ; undefined for a singular matrix. For sizes 6, 7, 14.
template <int kSize>
Eigen::Matrix<double, kSize, 1> solve_symmetric(const Eigen::Matrix<double, kSize, kSize>& matrix,
                                                const Eigen::Matrix<double, kSize, 1>& vector);

/// As solve_symmetric(); std::nullopt if the matrix is not positive definite. For sizes 6, 12, 14.
template <int kSize>
std::optional<Eigen::Matrix<double, kSize, 1>> solve_positive_definite(
    const Eigen::Matrix<double, kSize, kSize>& matrix,
    const Eigen::Matrix<double, kSize, 1>& vector);

/// The inverse of a positive definite matrix; std::nullopt for any other matrix.
std::optional<Eigen::Matrix<double, 6, 6>> inverse_of_positive_definite(
    const Eigen::Matrix<double, 6, 6>& matrix);

/// matrix = u·diag(values)·vᵀ with orthogonal u and v.
struct SingularValues3 {
  Eigen::Matrix3d u;
  Eigen::Vector3d values;  ///< descending
  Eigen::Matrix3d v;
};

SingularValues3 singular_values(const Eigen::Matrix3d& matrix);

/// The rotation R that minimises |R - matrix| and thus maximises trace(Rᵀ·matrix).
Eigen::Matrix3d nearest_rotation(const SingularValues3& matrix);

/// The similarity (s, R, t) that minimises Σ|to - (s·R·from + t)|², as a homogeneous matrix
/// (Umeyama, 1991).
/// @param from, to  of equal length, not empty
/// @param with_scale  true: estimates s; false: s = 1
Eigen::Matrix4d least_squares_similarity(std::span<const Eigen::Vector3d> from,
                                         std::span<const Eigen::Vector3d> to, bool with_scale);

/// The smallest rotation that turns the direction `from` into `to`; neither is zero.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace cairn
