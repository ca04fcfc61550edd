// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cairn/report/report.hpp"

namespace cairn::report {

struct Tick {
  double value = 0.0;
  std::string label = {};  ///< empty: a small tick
};

/// The range of an axis, ends on it, and where its ticks are.
class Axis {
 public:
  /// An axis on which all finite `values` (positive ones, if logarithmic) have room, with some to
  /// spare. Ticks are at 1, 2 or 5 times a power of ten, about `ticks` of them; a logarithmic axis has
  /// them at powers of ten, or between if it spans few.
  Axis(std::span<const double> values, AxisScale scale, int ticks = 5);
  /// The same with these ends, exactly.
  /// @param low, high finite, low < high; positive if logarithmic
  static Axis between(double low, double high, AxisScale scale, int ticks = 5);

  double low() const { return low_; }
  double high() const { return high_; }
  const std::vector<Tick>& ticks() const { return ticks_; }
  /// Whether a value can be shown at all: finite, and positive if logarithmic.
  bool shows(double value) const;
  /// Where a value lies: 0 at the low end, 1 at the high one; also beyond.
  double share(double value) const;

 private:
  Axis() = default;
  void make_ticks(int count);
  void make_logarithmic_ticks(double decades, int count);

  AxisScale scale_ = AxisScale::kLinear;
  double low_ = 0.0;
  double high_ = 1.0;
  std::vector<Tick> ticks_;
};

/// Labels of numbers, all with as many decimals as they need to differ: 0.05, 0.10; 1e-05 for what is
/// very small, 2.5e+06 for what is very large. Minus is the sign, not a hyphen.
std::vector<std::string> number_labels(std::span<const double> values);

}  // namespace cairn::report
