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

/// Range and ticks of an axis.
class Axis {
 public:
  /// An axis with room for all finite `values` (positive ones, if logarithmic). Ticks are at 1, 2 or 5
  /// times a power of ten, about `ticks` of them; a logarithmic axis has them at powers of ten, or closer
  /// if it spans few.
  Axis(std::span<const double> values, AxisScale scale, int ticks = 5);
  /// The same with these ends, exactly.
  /// @param low, high finite, low < high; positive if logarithmic
  static Axis between(double low, double high, AxisScale scale, int ticks = 5);

  double low() const { return low_; }
  double high() const { return high_; }
  const std::vector<Tick>& ticks() const { return ticks_; }
  /// Whether a value can be shown: finite, and positive if logarithmic.
  bool shows(double value) const;
  /// Position of a value: 0 at the low end, 1 at the high end; extrapolated beyond.
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

/// Labels of numbers, all with as many decimals as needed to differ: 0.05, 0.10; 1e-05 for very small ones,
/// 2.5e+06 for very large ones. Uses the minus sign, not a hyphen.
std::vector<std::string> number_labels(std::span<const double> values);

}  // namespace cairn::report
