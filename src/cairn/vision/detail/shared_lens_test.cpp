// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/shared_lens.hpp"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn::detail {
namespace {

LensPrior usual() {
  return LensPrior::usual({{1}, "SIMPLE_PINHOLE", 640, 480, {500.0, 319.5, 239.5}});
}

const LensVector kTruth = {-0.2, -0.1, 0.02, 0.51, 0.37};
const LensVector kSigmas = {0.03, 0.05, 0.05, 0.01, 0.01};

// As an image tells it, with the prior.
ImageLens seen(const LensVector& lens, const LensVector& sigmas, const LensPrior& prior) {
  const LensMatrix own = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
  ImageLens image;
  image.covariance = (own + prior.information).inverse();
  image.covariance_by_noise = image.covariance;
  image.lens = image.covariance * (own * lens + prior.information * prior.mean);
  return image;
}

LensVector noisy(Random& random, double times = 1.0) {
  LensVector lens = kTruth;
  for (int k = 0; k < lens.size(); ++k) lens[k] += times * kSigmas[k] * random.normal();
  return lens;
}

TEST(SharedLens, IsTheWeightedMeanOfWhatEachImageTells) {
  const LensPrior prior = usual();
  Random random(1);
  std::vector<ImageLens> images;
  LensMatrix information = prior.information;
  LensVector vector = prior.information * prior.mean;
  for (int k = 0; k < 3; ++k) {
    const LensVector sigmas = (1.0 + k) * kSigmas;
    const LensVector lens = noisy(random, 0.2);
    images.push_back(seen(lens, sigmas, prior));
    const LensMatrix own = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
    information += own;
    vector += own * lens;
  }
  const SharedLens shared(prior, images, 1.0);
  const LensVector mean = information.inverse() * vector;
  EXPECT_LT((shared.of_all().mean - mean).norm(), 1e-6);
  EXPECT_LT((shared.of_all().information - information).norm(), 1e-6 * information.norm());
  // Without one, as if it had not been there.
  const std::vector<ImageLens> others = {images[0], images[2]};
  const LensPrior without = shared.without(1);
  const LensPrior of_others = SharedLens(prior, others, 1.0).of_all();
  EXPECT_LT((without.mean - of_others.mean).norm(), 1e-6);
  EXPECT_LT((without.information - of_others.information).norm(), 1e-6 * information.norm());
}

// A lens whose error is stated larger was not pulled more by the prior.
TEST(SharedLens, DoesNotMoveForLargerStatedErrors) {
  const LensPrior prior = usual();
  std::vector<ImageLens> images(60, seen(kTruth, kSigmas, prior));
  for (ImageLens& image : images) image.covariance *= 2.0;
  EXPECT_LT((SharedLens(prior, images, 1.0).of_all().mean - kTruth).cwiseQuotient(kSigmas).norm(),
            0.3);
}

TEST(SharedLens, TellsLessWhereImagesRepeatEachOther) {
  const LensPrior prior = usual();
  const std::vector<ImageLens> images(4, seen(kTruth, kSigmas, prior));
  const LensPrior one = SharedLens(prior, std::vector{images[0]}, 1.0).of_all();
  const LensPrior repeated = SharedLens(prior, images, 0.25).of_all();
  EXPECT_LT((repeated.information - one.information).norm(), 1e-6 * one.information.norm());
}

TEST(SharedLens, TellsThePriorIfNoImageTellsAnything) {
  const LensPrior prior = usual();
  const std::vector<ImageLens> images(
      3, {prior.mean, prior.information.inverse(), prior.information.inverse()});
  const LensPrior found = SharedLens(prior, images, 1.0).of_all();
  EXPECT_LT((found.mean - prior.mean).norm(), 1e-9);
  EXPECT_LT((found.information - prior.information).norm(), 1e-6 * prior.information.norm());
}

// However much the images understate their errors, the mean is about as often within its deviation as it says.
TEST(SharedLens, StatesItsErrorByTheScatter) {
  const LensPrior prior = usual();
  constexpr int kTrials = 300;
  for (const double times : {1.0, 4.0}) {
    int inside = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      Random random(10 + static_cast<std::uint64_t>(trial));
      std::vector<ImageLens> images;
      for (int k = 0; k < 8; ++k) images.push_back(seen(noisy(random, times), kSigmas, prior));
      const LensPrior found = SharedLens(prior, images, 1.0).of_all();
      const double sigma = std::sqrt(found.information.inverse()(0, 0));
      inside += std::abs(found.mean[0] - kTruth[0]) <= 1.96 * sigma ? 1 : 0;
    }
    EXPECT_GE(inside, kTrials * 90 / 100) << times;
  }
}

TEST(SharedLens, HardlyMovesForOneImageThatContradicts) {
  const LensPrior prior = usual();
  Random random(5);
  std::vector<ImageLens> images;
  for (int k = 0; k < 9; ++k) images.push_back(seen(noisy(random), kSigmas, prior));
  LensVector wrong = kTruth;
  wrong[0] += 20.0 * kSigmas[0];
  images.push_back(seen(wrong, kSigmas, prior));
  EXPECT_LT(std::abs(SharedLens(prior, images, 1.0).of_all().mean[0] - kTruth[0]), kSigmas[0]);
}

}  // namespace
}  // namespace cairn::detail
