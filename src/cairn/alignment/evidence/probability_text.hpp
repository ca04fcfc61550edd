// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>

#include <fmt/format.h>

namespace cairn {

/// A probability in percent, rounded down to so many digits.
inline double percent_rounded_down(double probability, int digits) {
  constexpr double kRounding = 1e-6;  // 0.9983 is stored as a little less
  const double units = std::pow(10.0, digits);
  return std::floor(100.0 * units * probability + kRounding) / units;
}

/// A probability for people, in percent, rounded down to two digits, from 99.99 % on to four. It never reads
/// 0 % or 100 %.
inline std::string probability_text(double probability) {
  if (probability < 0.0001) return "<0.01 %";
  if (probability > 0.999999) return ">99.9999 %";
  const int digits = probability < 0.9999 ? 2 : 4;
  return fmt::format("{:.{}f} %", percent_rounded_down(probability, digits), digits);
}

/// "probability 12.30 %, below the required 99 %": the start of a reason.
inline std::string decision_text(double probability, double required) {
  return fmt::format("probability {}, {} the required {:g} %", probability_text(probability),
                     probability < required ? "below" : "at least", 100.0 * required);
}

}  // namespace cairn
