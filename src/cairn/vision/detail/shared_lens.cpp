// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/shared_lens.hpp"

#include <algorithm>

#include "cairn/geometry/decompositions.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn::detail {
namespace {

// The decompositions are compiled for six; the sixth unknown has the value one.
Matrix6d padded(const LensMatrix& matrix) {
  Matrix6d result = Matrix6d::Identity();
  result.topLeftCorner<kLensUnknowns, kLensUnknowns>() = matrix;
  return result;
}

LensVector solve(const LensMatrix& information, const LensVector& vector) {
  Vector6d six = Vector6d::Zero();
  six.head<kLensUnknowns>() = vector;
  return solve_symmetric<6>(padded(information), six).head<kLensUnknowns>();
}

// What the matches of one image tell without the prior.
struct OwnLens {
  LensMatrix information = LensMatrix::Zero();
  LensVector vector = LensVector::Zero();
  LensMatrix inverse = LensMatrix::Zero();  // of the information, where there is any
  double unknowns = 0.0;                    // of which the matches tell anything
};

// What the image's matches tell of a lens that the prior has pulled towards zero.
LensVector unpulled(const LensVector& lens, const LensMatrix& covariance_by_noise) {
  const auto inverse = inverse_of_positive_definite(padded(covariance_by_noise));
  if (!inverse) return lens;
  const SymmetricEigen<6> eigen = symmetric_eigen<6>(*inverse);
  LensVector result = LensVector::Zero();
  for (int k = 0; k < 6; ++k) {
    const LensVector axis = eigen.vectors.col(k).head<kLensUnknowns>();
    constexpr double kLeast = 0.1;  // where the matches tell less, the prior's pull is kept
    const double more = eigen.values[k] - 1.0;
    result += (more > kLeast ? eigen.values[k] / more : 1.0) * axis.dot(lens) * axis;
  }
  return result;
}

// In units of the prior's standard deviations.
OwnLens without_prior(const ImageLens& image) {
  OwnLens own;
  const auto inverse = inverse_of_positive_definite(padded(image.covariance));
  if (!inverse) return own;
  const SymmetricEigen<6> eigen = symmetric_eigen<6>(*inverse);
  for (int k = 0; k < 6; ++k) {
    const LensVector axis = eigen.vectors.col(k).head<kLensUnknowns>();
    const double more = eigen.values[k] - 1.0;  // than the prior
    constexpr double kAnything = 1e-6;
    if (more < kAnything) continue;
    own.information += more * axis * axis.transpose();
    own.inverse += axis * axis.transpose() / more;
    own.unknowns += 1.0;
  }
  own.vector = own.information * unpulled(image.lens, image.covariance_by_noise);
  return own;
}

}  // namespace

SharedLens::SharedLens(const LensPrior& prior, std::span<const ImageLens> images,
                       double independent)
    : prior_(prior) {
  constexpr int kRounds = 10;
  constexpr double k95 = 11.07;  // quantile of chi-squared with five degrees of freedom
  const LensVector inverse_sigmas = prior.information.diagonal().cwiseSqrt();
  std::vector<OwnLens> owns;
  for (const ImageLens& image : images) {
    const LensMatrix inverse = inverse_sigmas.asDiagonal();
    owns.push_back(
        without_prior({inverse * (image.lens - prior.mean), inverse * image.covariance * inverse,
                       inverse * image.covariance_by_noise * inverse}));
  }
  std::vector<double> weights(owns.size(), 1.0);
  double scatter = 1.0;
  const auto add_up = [&] {
    told_.clear();
    information_ = LensMatrix::Identity();
    vector_ = LensVector::Zero();
    for (std::size_t k = 0; k < owns.size(); ++k) {
      const double weight = independent / scatter * weights[k];
      told_.push_back({weight * owns[k].information, weight * owns[k].vector});
      information_ += told_.back().information;
      vector_ += told_.back().vector;
    }
  };
  for (int round = 0; round < kRounds; ++round) {
    add_up();
    const LensVector lens = solve(information_, vector_);
    double squares = 0.0;
    double unknowns = -static_cast<double>(kLensUnknowns);
    for (std::size_t k = 0; k < owns.size(); ++k) {
      const LensVector off = owns[k].vector - owns[k].information * lens;
      const double squared = off.dot(owns[k].inverse * off);
      weights[k] = huber_weight(squared, k95);
      squares += weights[k] * squared;
      unknowns += weights[k] * owns[k].unknowns;
    }
    scatter = std::max(1.0, squares / std::max(1.0, unknowns));
  }
  add_up();
}

LensPrior SharedLens::with_information(const LensMatrix& information,
                                       const LensVector& vector) const {
  const LensVector inverse_sigmas = prior_.information.diagonal().cwiseSqrt();
  LensPrior result;
  result.mean = prior_.mean + solve(information, vector).cwiseQuotient(inverse_sigmas);
  result.information = inverse_sigmas.asDiagonal() * information * inverse_sigmas.asDiagonal();
  return result;
}

}  // namespace cairn::detail
