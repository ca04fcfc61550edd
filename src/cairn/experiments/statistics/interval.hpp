// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn {

/// A closed interval of numbers: a confidence interval, or an equivalence margin.
struct Interval {
  double low = 0.0;
  double high = 0.0;

  double width() const { return high - low; }
  bool contains(double value) const { return low <= value && value <= high; }
};

}  // namespace cairn
