// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/covariance.hpp"

#include <Eigen/Eigenvalues>

#include "cairn/core/number_text.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {

std::string covariance_defect(const Eigen::Matrix3d& covariance) {
  if (is_plainly_covariance(covariance)) return {};
  if (!covariance.allFinite()) return "an entry is not finite";
  const double largest = covariance.cwiseAbs().maxCoeff();
  const double tolerance = 1e-6 * largest;
  const double asymmetry = (covariance - covariance.transpose()).cwiseAbs().maxCoeff();
  if (asymmetry > tolerance) {
    std::string text = "not symmetric: opposite entries differ by ";
    append_number(text, asymmetry);
    return text;
  }
  // The eigenvalues of a diagonal matrix are exact.
  const Eigen::Matrix3d off_diagonal =
      covariance - Eigen::Matrix3d(covariance.diagonal().asDiagonal());
  double smallest = covariance.diagonal().minCoeff();
  if (!off_diagonal.isZero(0.0)) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    smallest = solver.computeDirect(covariance, Eigen::EigenvaluesOnly).eigenvalues()[0];
  }
  if (smallest < -tolerance) {
    std::string text = "indefinite: its smallest eigenvalue is ";
    append_number(text, smallest);
    return text;
  }
  return {};
}

std::string pose_covariance_defect(const Matrix6d& covariance) {
  if (!covariance.allFinite()) return "has an entry that is not finite";
  constexpr double kTolerance = 1e-6;
  const Matrix6d symmetric = 0.5 * (covariance + covariance.transpose());
  Matrix6d correlations = Matrix6d::Zero();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      const double size = std::sqrt(std::abs(covariance(row, row) * covariance(column, column)));
      const double entry = symmetric(row, column);
      if (std::abs(covariance(row, column) - entry) > kTolerance * size) return "is not symmetric";
      if (std::abs(entry) > (1.0 + kTolerance) * size) {
        return "has a correlation that is greater than 1";
      }
      if (size > 0.0) correlations(row, column) = entry / size;
    }
  }
  if (symmetric_eigenvalues<6>(correlations)[0] < -kTolerance) return "is indefinite";
  return {};
}

double spectral_norm(const Eigen::Matrix3d& symmetric) {
  return symmetric_eigenvalues<3>(symmetric).cwiseAbs().maxCoeff();
}

Eigen::Matrix3d rotated_covariance(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& r) {
  return r * covariance * r.transpose();
}

Matrix6d left_transformed_covariance(const Matrix6d& covariance, const Rigid3& c_from_a) {
  // c_from_a * (t + δt, Exp(δφ)·R) has translation perturbed by R_c·δt and rotation by R_c·δφ.
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = c_from_a.rotation();
  jacobian.bottomRightCorner<3, 3>() = c_from_a.rotation();
  return propagated_covariance(jacobian, covariance);
}

Matrix6d left_transformed_covariance(const Matrix6d& covariance, const Similarity3& c_from_a) {
  Matrix6d result = left_transformed_covariance(covariance, c_from_a.rigid());
  result.topRows<3>() *= c_from_a.scale();
  result.leftCols<3>() *= c_from_a.scale();
  return result;
}

Matrix6d inverse_covariance(const Rigid3& pose, const Matrix6d& covariance) {
  // The inverse of (t + δt, Exp(δφ)·R) is perturbed by a rotation -Rᵀδφ and by a translation that depends on
  // both.
  const Rigid3 inverse = pose.inverse();
  const Eigen::Matrix3d rotation = inverse.rotation();
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = -rotation;
  jacobian.topRightCorner<3, 3>() = skew(inverse.translation()) * rotation;
  jacobian.bottomRightCorner<3, 3>() = -rotation;
  return propagated_covariance(jacobian, covariance);
}

Matrix7d inverse_covariance(const Similarity3& pose, const Matrix7d& covariance) {
  // As for a rigid motion, with the inverse's translation as lever arm; it shrinks as the scale grows.
  const Similarity3 inverse = pose.inverse();
  const Eigen::Matrix3d linear = inverse.linear();
  Matrix7d jacobian = Matrix7d::Zero();
  jacobian.block<3, 3>(0, 0) = -linear;
  jacobian.block<3, 3>(0, 3) = skew(inverse.translation()) * inverse.rigid().rotation();
  jacobian.block<3, 1>(0, 6) = -inverse.translation();
  jacobian.block<3, 3>(3, 3) = -inverse.rigid().rotation();
  jacobian(6, 6) = -1.0;
  return propagated_covariance(jacobian, covariance);
}

double normalised_squared_error(const Rigid3& estimate, const Matrix6d& covariance,
                                const Rigid3& truth) {
  const Eigen::Matrix<double, 6, 1> error = estimate.difference_to(truth);
  return error.dot(solve_symmetric<6>(covariance, error));
}

double normalised_squared_error(const Similarity3& estimate, const Matrix7d& covariance,
                                const Similarity3& truth) {
  Eigen::Matrix<double, 7, 1> error;
  error << estimate.rigid().difference_to(truth.rigid()),
      std::log(truth.scale() / estimate.scale());
  return error.dot(solve_symmetric<7>(covariance, error));
}

}  // namespace cairn
