// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/vision/detail/lens_estimation.hpp"

namespace cairn::detail {

/// A lens found in one image.
struct ImageLens {
  LensVector lens = LensVector::Zero();
  LensMatrix covariance = LensMatrix::Zero();  ///< includes the prior
  /// The same by the noise alone, with which the prior was weighed.
  LensMatrix covariance_by_noise = LensMatrix::Zero();
};

/// The lens of one camera, by the lenses found in its images. Images that contradict the others count less, and if the
/// lenses scatter more than their covariances state, all count less.
class SharedLens {
 public:
  /// @param prior       that with which each lens was found
  /// @param independent share of the matches that the images do not repeat
  SharedLens(const LensPrior& prior, std::span<const ImageLens> images, double independent);

  /// What all images tell.
  LensPrior of_all() const { return with_information(information_, vector_); }
  /// What the images but one tell.
  LensPrior without(std::size_t image) const {
    const Told& own = told_[image];
    return with_information(information_ - own.information, vector_ - own.vector);
  }

 private:
  // In units of the prior's standard deviations: information, and its product with the lens.
  struct Told {
    LensMatrix information;
    LensVector vector;
  };
  LensPrior with_information(const LensMatrix& information, const LensVector& vector) const;

  LensPrior prior_;
  std::vector<Told> told_;
  LensMatrix information_;
  LensVector vector_;
};

}  // namespace cairn::detail
