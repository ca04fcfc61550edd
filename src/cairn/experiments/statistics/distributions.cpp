// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/statistics/distributions.hpp"

#include <cmath>
#include <numbers>

#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace cairn {

double normal_cdf(double z) {
  return 0.5 * std::erfc(-z / std::numbers::sqrt2);
}

double normal_upper_tail(double z) {
  return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

double normal_quantile(double probability) {
  return boost::math::quantile(boost::math::normal(), probability);
}

double normal_two_sided_quantile(double confidence) {
  return boost::math::quantile(
      boost::math::complement(boost::math::normal(), (1.0 - confidence) / 2.0));
}

double student_t_upper_tail(double t, double degrees_of_freedom) {
  if (std::isinf(t)) return t > 0.0 ? 0.0 : 1.0;
  return boost::math::cdf(boost::math::complement(boost::math::students_t(degrees_of_freedom), t));
}

double student_t_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::students_t(degrees_of_freedom), probability);
}

double chi_squared_upper_tail(double x, double degrees_of_freedom) {
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees_of_freedom), x));
}

double fisher_f_upper_tail(double x, double numerator_degrees, double denominator_degrees) {
  if (std::isinf(x)) return 0.0;
  return boost::math::cdf(
      boost::math::complement(boost::math::fisher_f(numerator_degrees, denominator_degrees), x));
}

double binomial_cdf(std::uint64_t successes, std::uint64_t trials, double probability) {
  if (successes >= trials) return 1.0;
  return boost::math::cdf(boost::math::binomial(static_cast<double>(trials), probability),
                          static_cast<double>(successes));
}

double binomial_probability(std::uint64_t successes, std::uint64_t trials, double probability) {
  if (successes > trials) return 0.0;
  return boost::math::pdf(boost::math::binomial(static_cast<double>(trials), probability),
                          static_cast<double>(successes));
}

double beta_quantile(double probability, double a, double b) {
  return boost::math::quantile(boost::math::beta_distribution<>(a, b), probability);
}

}  // namespace cairn
