// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/axis.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>

#include <fmt/format.h>

namespace cairn::report {
namespace {

constexpr double kSlack = 1e-9;      // for ticks that are at an end but for rounding
constexpr double kFewDecades = 0.7;  // up to which a logarithmic axis has the ticks of a linear one
constexpr double kMargin = 0.05;     // share of the range that is spared at either end

// The step of 1, 2 or 5 times a power of ten nearest to `rough`.
double nice_step(double rough) {
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double share = rough / power;
  if (share < std::sqrt(2.0)) return power;
  if (share < std::sqrt(10.0)) return 2.0 * power;
  if (share < std::sqrt(50.0)) return 5.0 * power;
  return 10.0 * power;
}

std::string with_sign(std::string text) {
  if (text.starts_with('-')) text.replace(0, 1, "\xe2\x88\x92");
  return text;
}

std::string superscript(int number) {
  static constexpr std::string_view kDigits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = number < 0 ? "⁻" : "";
  for (const char digit : fmt::format("{}", std::abs(number))) {
    text += kDigits[static_cast<std::size_t>(digit - '0')];
  }
  return text;
}

std::string power_label(int exponent) {
  if (exponent >= -3 && exponent <= 3) return fmt::format("{:g}", std::pow(10.0, exponent));
  return "10" + superscript(exponent);
}

}  // namespace

std::vector<std::string> number_labels(std::span<const double> values) {
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  std::vector<std::string> labels;
  if (largest >= 1e6 || (largest > 0.0 && largest < 1e-4)) {
    for (const double value : values) labels.push_back(with_sign(fmt::format("{:.3g}", value)));
    return labels;
  }
  int decimals = 0;
  for (const double value : values) {
    int needed = 0;
    double scaled = std::abs(value);
    while (needed < 9 && std::abs(scaled - std::round(scaled)) > 1e-6 * std::max(1.0, scaled)) {
      scaled *= 10.0;
      ++needed;
    }
    decimals = std::max(decimals, needed);
  }
  for (const double value : values) {
    // Never -0.
    labels.push_back(with_sign(fmt::format("{:.{}f}", value == 0.0 ? 0.0 : value, decimals)));
  }
  return labels;
}

Axis::Axis(std::span<const double> values, AxisScale scale, int ticks) : scale_(scale) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!shows(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  const bool is_log = scale == AxisScale::kLog;
  if (low > high) {  // no values
    low = is_log ? 0.1 : 0.0;
    high = 1.0;
  }
  if (is_log) {
    // Quotients of what is very large and very small would leave the range of doubles.
    const double decades = std::log10(high) - std::log10(low);
    const double room = high > low ? kMargin * decades : 0.5;
    low_ = std::max(low / std::pow(10.0, room), std::numeric_limits<double>::min());
    high_ = std::min(high * std::pow(10.0, room), std::numeric_limits<double>::max());
  } else {
    const double extent = high - low;
    const double spare = std::max(std::abs(high), std::abs(low));
    const double room =
        extent > 1e-12 * spare ? kMargin * extent : (spare > 0.0 ? 0.1 * spare : 1.0);
    low_ = low - room;
    high_ = high + room;
    // Without negative values, the axis does not extend below zero.
    if (low >= 0.0 && low_ < 0.0) low_ = 0.0;
  }
  make_ticks(ticks);
}

Axis Axis::between(double low, double high, AxisScale scale, int ticks) {
  Axis axis;
  axis.scale_ = scale;
  axis.low_ = low;
  axis.high_ = high;
  axis.make_ticks(ticks);
  return axis;
}

bool Axis::shows(double value) const {
  return std::isfinite(value) && (scale_ == AxisScale::kLinear || value > 0.0);
}

double Axis::share(double value) const {
  if (scale_ == AxisScale::kLog) {
    return (std::log(value) - std::log(low_)) / (std::log(high_) - std::log(low_));
  }
  return (value - low_) / (high_ - low_);
}

void Axis::make_logarithmic_ticks(double decades, int count) {
  const int first = static_cast<int>(std::floor(std::log10(low_)));
  const int last = static_cast<int>(std::ceil(std::log10(high_)));
  const int stride = std::max(1, static_cast<int>(std::ceil(decades / (count + 2))));
  for (int exponent = first; exponent <= last; ++exponent) {
    for (int digit = 1; digit <= 9; ++digit) {
      const double value = digit * std::pow(10.0, exponent);
      if (value < low_ * (1.0 - kSlack) || value > high_ * (1.0 + kSlack)) continue;
      std::string label;
      if (digit == 1 && exponent % stride == 0) label = power_label(exponent);
      if (decades < 2.0 && (digit == 2 || digit == 5)) label = fmt::format("{:g}", value);
      if (stride == 1 || !label.empty()) ticks_.push_back({value, std::move(label)});
    }
  }
}

void Axis::make_ticks(int count) {
  ticks_.clear();
  const double decades = scale_ == AxisScale::kLog ? std::log10(high_) - std::log10(low_) : 0.0;
  if (decades > kFewDecades) {
    make_logarithmic_ticks(decades, count);
    return;
  }
  const double step = nice_step((high_ - low_) / std::max(count, 1));
  std::vector<double> values;
  const double first = std::ceil(low_ / step - kSlack);
  for (double i = first; i * step <= high_ + kSlack * step && values.size() < 100; ++i) {
    values.push_back(i * step);
  }
  const std::vector<std::string> labels = number_labels(values);
  for (std::size_t i = 0; i < values.size(); ++i) ticks_.push_back({values[i], labels[i]});
}

}  // namespace cairn::report
