// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "cairn/core/statistics.hpp"
#include "cairn/report/detail/frame.hpp"

namespace cairn::report {
namespace {

constexpr double kGolden = 0.6180339887498949;  // spreads points evenly, whatever their number

// Shares of the width that one group has.
constexpr double kPointsAt = 0.17;
constexpr double kPointsSpread = 0.07;
constexpr double kViolinAt = 0.60;
constexpr double kViolinHalf = 0.28;
constexpr double kBoxHalf = 0.07;
constexpr double kLoneBoxHalf = 0.20;  // of box plots

struct Quartiles {
  double first, median, third, mean, low_whisker, high_whisker;
};

Quartiles quartiles_of(const std::vector<double>& values) {
  Quartiles result{};
  result.first = quantile(values, 0.25);
  result.median = quantile(values, 0.5);
  result.third = quantile(values, 0.75);
  result.mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  const double reach = 1.5 * (result.third - result.first);
  result.low_whisker = result.first;
  result.high_whisker = result.third;
  for (const double value : values) {
    if (value >= result.first - reach) result.low_whisker = std::min(result.low_whisker, value);
    if (value <= result.third + reach) result.high_whisker = std::max(result.high_whisker, value);
  }
  return result;
}

// A group as it can be shown on the axis.
struct Group {
  std::string name;
  std::vector<double> values;
  std::vector<DensityPoint> density;  // values as on the axis
};

std::vector<DensityPoint> density_on_axis(const std::vector<double>& values, AxisScale scale,
                                          const DensityFunction& density) {
  if (!density || values.empty()) return {};
  if (scale == AxisScale::kLinear) return density(values);
  std::vector<double> logarithms;
  for (const double value : values) logarithms.push_back(std::log10(value));
  std::vector<DensityPoint> points = density(logarithms);
  for (DensityPoint& point : points) point.value = std::pow(10.0, point.value);
  return points;
}

class DistributionFigure {
 public:
  DistributionFigure(const DistributionChart& chart, const FigureOptions& options,
                     const DensityFunction& density)
      : chart_(chart), options_(options), svg_(options.width, options.height) {
    const Axis any({}, chart.y_scale);
    std::vector<double> extent;
    const bool violins = chart.style == DistributionStyle::kViolin;
    for (const Distribution& distribution : chart.groups) {
      Group group{distribution.name, {}, {}};
      for (const double value : distribution.values) {
        if (any.shows(value)) {
          group.values.push_back(value);
        } else {
          ++left_out_;
        }
      }
      if (violins) group.density = density_on_axis(group.values, chart.y_scale, density);
      extent.insert(extent.end(), group.values.begin(), group.values.end());
      for (const DensityPoint& point : group.density) extent.push_back(point.value);
      groups_.push_back(std::move(group));
    }
    if (chart.threshold) extent.push_back(chart.threshold->value);
    y_axis_ = Axis(extent, chart.y_scale);
  }

  std::string draw() {
    Box space = draw_title(svg_, options_);
    space = draw_remark(svg_, space, left_out_remark(left_out_));
    if (chart_.threshold) space = draw_threshold_key(svg_, space, *chart_.threshold);
    plot_ = {space.left + y_axis_width(y_axis_, chart_.y_label), space.top + 6.0, space.right - 4.0,
             space.bottom - x_axis_height(chart_.x_label) - kTickSize - 2.0};
    draw_y_axis(svg_, plot_, y_axis_, chart_.y_label);
    svg_.line({plot_.left, plot_.bottom}, {plot_.right, plot_.bottom},
              {.stroke = kMuted, .stroke_width = 1.0});
    svg_.text({plot_.middle_x(), space.bottom - 4.0}, chart_.x_label,
              {.size = kLabelSize, .anchor = SvgAnchor::kMiddle, .color = kInk});
    if (chart_.threshold) {
      draw_level(svg_, plot_, y_at(chart_.threshold->value), {});
    }
    std::vector<std::string> names;
    for (const Group& group : groups_) names.push_back(group.name);
    const auto looks = looks_of(names);
    slot_ = plot_.width() / static_cast<double>(std::max<std::size_t>(groups_.size(), 1));
    for (std::size_t i = 0; i < groups_.size(); ++i) {
      draw_group(groups_[i], plot_.left + slot_ * static_cast<double>(i), looks[i].color);
    }
    return svg_.document(options_.title.empty() ? chart_.y_label : options_.title);
  }

 private:
  double y_at(double value) const { return plot_.bottom - y_axis_.share(value) * plot_.height(); }

  void draw_group(const Group& group, double left, std::string_view color) {
    const double centre = left + kViolinAt * slot_;
    svg_.text({left + 0.5 * slot_, plot_.bottom + kTickSize + 5.0}, group.name,
              {.size = kLabelSize, .anchor = SvgAnchor::kMiddle, .color = kInk});
    svg_.text({left + 0.5 * slot_, plot_.bottom + 2.0 * kTickSize + 7.0},
              fmt::format("n = {}", group.values.size()),
              {.size = 10.5, .anchor = SvgAnchor::kMiddle, .color = kMuted});
    if (group.values.empty()) return;
    draw_density(group, centre, color);
    draw_box(quartiles_of(group.values), centre, color, group.density.empty());
    draw_points(group.values, left, color);
  }

  void draw_density(const Group& group, double centre, std::string_view color) {
    double highest = 0.0;
    for (const DensityPoint& point : group.density) highest = std::max(highest, point.density);
    if (highest <= 0.0) return;
    std::vector<SvgPoint> outline;
    const double half = kViolinHalf * slot_ / highest;
    for (const DensityPoint& point : group.density) {
      outline.push_back({centre + half * point.density, y_at(point.value)});
    }
    const std::size_t right_side = outline.size();
    for (std::size_t i = right_side; i-- > 0;) {
      outline.push_back({2.0 * centre - outline[i].x, outline[i].y});
    }
    svg_.polygon(outline,
                 {.fill = color, .fill_opacity = 0.25, .stroke = color, .stroke_width = 1.3});
  }

  void draw_box(const Quartiles& q, double centre, std::string_view color, bool lone) {
    const double half = (lone ? kLoneBoxHalf : kBoxHalf) * slot_;
    const SvgStyle edge = {.stroke = kInk, .stroke_width = 1.2};
    svg_.line({centre, y_at(q.high_whisker)}, {centre, y_at(q.third)}, edge);
    svg_.line({centre, y_at(q.first)}, {centre, y_at(q.low_whisker)}, edge);
    for (const double end : {q.high_whisker, q.low_whisker}) {
      svg_.line({centre - 0.5 * half, y_at(end)}, {centre + 0.5 * half, y_at(end)}, edge);
    }
    svg_.rectangle({centre - half, y_at(q.third)}, 2.0 * half, y_at(q.first) - y_at(q.third),
                   {.fill = lone ? color : std::string_view("#ffffff"),
                    .fill_opacity = lone ? 0.3 : 0.85,
                    .stroke = kInk,
                    .stroke_width = 1.2});
    // The mean may lie beyond the box.
    svg_.line({centre - half, y_at(q.mean)}, {centre + half, y_at(q.mean)},
              {.stroke = kInk, .stroke_width = 1.4, .dashes = "3 2"});
    svg_.line({centre - half, y_at(q.median)}, {centre + half, y_at(q.median)},
              {.stroke = kInk, .stroke_width = 2.4});
  }

  void draw_points(const std::vector<double>& values, double left, std::string_view color) {
    std::vector<SvgPoint> points;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double turn = kGolden * static_cast<double>(i);
      const double spread = 2.0 * (turn - std::floor(turn)) - 1.0;
      points.push_back({left + (kPointsAt + kPointsSpread * spread) * slot_, y_at(values[i])});
    }
    svg_.dots(points, values.size() > 100 ? 3.5 : 5.0, color, values.size() > 100 ? 0.5 : 0.75);
  }

  const DistributionChart& chart_;
  const FigureOptions& options_;
  Svg svg_;
  std::vector<Group> groups_;
  std::size_t left_out_ = 0;
  Axis y_axis_ = Axis({}, AxisScale::kLinear);
  Box plot_;
  double slot_ = 0.0;
};

}  // namespace

std::string distribution_svg(const DistributionChart& chart, const FigureOptions& options,
                             const DensityFunction& density) {
  return DistributionFigure(chart, options, density).draw();
}

}  // namespace cairn::report
