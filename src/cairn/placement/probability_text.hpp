// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <fmt/format.h>

namespace cairn {

/// A probability for people, in per cent. It is never said to be one, nor nought.
inline std::string probability_text(double probability) {
  if (probability > 0.9999) return "over 99.99 %";
  if (probability < 0.0001) return "below 0.01 %";
  return fmt::format("{:.2f} %", 100.0 * probability);
}

}  // namespace cairn
