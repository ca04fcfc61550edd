// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/search/likeness.hpp"

#include <cmath>

namespace cairn {

Likeness& Likeness::operator+=(const Likeness& other) {
  compared += other.compared;
  alike += other.alike;
  return *this;
}

Likeness Likeness::operator-(const Likeness& other) const {
  return {compared - other.compared, alike - other.alike};
}

double Likeness::evidence() const {
  const auto all = static_cast<double>(compared);
  const auto like = static_cast<double>(alike);
  if (like <= kChance * all) return 0.0;
  const double unlike = all - like;
  // Where all are alike, 0·log 0 is 0.
  const double by_others = unlike > 0.0 ? unlike * std::log(unlike / (all * (1.0 - kChance))) : 0.0;
  return like * std::log(like / (all * kChance)) + by_others;
}

}  // namespace cairn
