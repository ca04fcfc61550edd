// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

/// The distributions that the tests of this folder need, as plain functions, so that only one source
/// file sees the library that computes them. Upper tails are computed as such, hence exact to many
/// digits where they are tiny.
namespace cairn {

/// P(Z <= z) of the standard normal distribution.
double normal_cdf(double z);
/// P(Z >= z) of the standard normal distribution.
double normal_upper_tail(double z);
/// The z with P(Z <= z) = `probability`, which lies within (0, 1).
double normal_quantile(double probability);
/// The z > 0 with P(|Z| <= z) = `confidence`, which lies within (0, 1): 1.96 for 0.95.
double normal_two_sided_quantile(double confidence);

/// P(T >= t) of Student's distribution; `degrees_of_freedom` > 0; t may be infinite.
double student_t_upper_tail(double t, double degrees_of_freedom);
/// The t with P(T <= t) = `probability`, which lies within (0, 1).
double student_t_quantile(double probability, double degrees_of_freedom);

/// P(X >= x) of the chi-squared distribution; x >= 0.
double chi_squared_upper_tail(double x, double degrees_of_freedom);
/// P(X >= x) of Fisher's F distribution; x >= 0, may be infinite.
double fisher_f_upper_tail(double x, double numerator_degrees, double denominator_degrees);

/// P(X <= successes) of the binomial distribution with the given probability of success.
double binomial_cdf(std::uint64_t successes, std::uint64_t trials, double probability);
/// P(X = successes) of the same.
double binomial_probability(std::uint64_t successes, std::uint64_t trials, double probability);

/// The x with P(X <= x) = `probability`, which lies within (0, 1), of the beta distribution.
double beta_quantile(double probability, double a, double b);

}  // namespace cairn
