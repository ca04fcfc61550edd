// SPDX-License-Identifier: BSD-3-Clause
// Lines, scatter, intervals.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cairn/report/detail/frame.hpp"

namespace cairn::report {
namespace {

constexpr double kRowHeight = 16.0;     // of one series in an intervals chart
constexpr double kRowGap = 12.0;        // between its items
constexpr std::size_t kManyDots = 400;  // beyond which dots of a scatter are small and see-through

template <class Series>
std::vector<std::string> names_of(const std::vector<Series>& series) {
  std::vector<std::string> names;
  for (const Series& one : series) names.push_back(one.name);
  return names;
}

// The two values of an interval that are there, else the value itself.
double end_of(const std::vector<double>& ends, std::size_t i, double value) {
  return ends.empty() || !std::isfinite(ends[i]) ? value : ends[i];
}

void draw_line(Svg& svg, const Frame& frame, const Line& line, const SeriesLook& look) {
  // The line has a gap at values that cannot be shown.
  std::vector<SvgPoint> points;
  std::vector<SvgPoint> upper;
  std::vector<SvgPoint> lower;
  const auto draw = [&] {
    if (!line.low.empty() || !line.high.empty()) {
      std::vector<SvgPoint> band = upper;
      band.insert(band.end(), lower.rbegin(), lower.rend());
      svg.polygon(band, {.fill = look.color, .fill_opacity = 0.15});
    }
    svg.polyline(points, {.stroke = look.color, .stroke_width = 2.0, .dashes = look.dashes});
    if (points.size() == 1) svg.circle(points.front(), 2.5, {.fill = look.color});
    points.clear();
    upper.clear();
    lower.clear();
  };
  for (std::size_t i = 0; i < line.x.size(); ++i) {
    const double x = line.x[i];
    const double y = line.y[i];
    if (!frame.shows(x, y)) {
      draw();
      continue;
    }
    const double low = end_of(line.low, i, y);
    const double high = end_of(line.high, i, y);
    points.push_back(frame.at(x, y));
    lower.push_back(frame.at(x, frame.shows(x, low) ? low : y));
    upper.push_back(frame.at(x, frame.shows(x, high) ? high : y));
  }
  draw();
}

}  // namespace

std::string lines_svg(const LinesChart& chart, const FigureOptions& options) {
  std::vector<double> xs;
  std::vector<double> ys;
  for (const Line& line : chart.series) {
    xs.insert(xs.end(), line.x.begin(), line.x.end());
    for (const auto* const values : {&line.y, &line.low, &line.high}) {
      ys.insert(ys.end(), values->begin(), values->end());
    }
  }
  if (chart.threshold) ys.push_back(chart.threshold->value);
  Axis x(xs, chart.x_scale, 6);
  const Axis any_y({}, chart.y_scale);
  std::size_t left_out = 0;
  double last = 0.0;
  for (const Line& line : chart.series) {
    for (std::size_t i = 0; i < line.x.size(); ++i) {
      if (!x.shows(line.x[i]) || !any_y.shows(line.y[i])) ++left_out;
      if (std::isfinite(line.x[i])) last = std::max(last, line.x[i]);
    }
  }
  // Quantities counted from 0, such as iterations, begin at the axis.
  const bool from_zero = chart.x_scale == AxisScale::kLinear && last > 0.0 &&
                         std::find(xs.begin(), xs.end(), 0.0) != xs.end() && x.low() == 0.0;
  if (from_zero) x = Axis::between(0.0, last, AxisScale::kLinear, 6);

  Svg svg(options.width, options.height);
  const auto names = names_of(chart.series);
  const auto looks = looks_of(names);
  Box space = draw_title(svg, options);
  space = draw_legend(svg, space, names, looks, LegendMark::kLine);
  space = draw_remark(svg, space, left_out_remark(left_out));
  const Frame frame(svg, space, x, Axis(ys, chart.y_scale), chart.x_label, chart.y_label);
  if (chart.threshold) frame.draw_y_threshold(svg, *chart.threshold);
  for (std::size_t i = 0; i < chart.series.size(); ++i) {
    draw_line(svg, frame, chart.series[i], looks[i]);
  }
  return svg.document(options.title.empty() ? chart.y_label : options.title);
}

std::string scatter_svg(const ScatterChart& chart, const FigureOptions& options) {
  std::vector<double> xs;
  std::vector<double> ys;
  std::size_t left_out = 0;
  std::size_t shown = 0;
  const Axis any_x({}, chart.x_scale);
  const Axis any_y({}, chart.y_scale);
  for (const ScatterSeries& series : chart.series) {
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (any_x.shows(series.x[i]) && any_y.shows(series.y[i])) {
        xs.push_back(series.x[i]);
        ys.push_back(series.y[i]);
        ++shown;
      } else {
        ++left_out;
      }
    }
  }
  if (chart.x_threshold) xs.push_back(chart.x_threshold->value);
  if (chart.y_threshold) ys.push_back(chart.y_threshold->value);

  Svg svg(options.width, options.height);
  const auto names = names_of(chart.series);
  const auto looks = looks_of(names);
  Box space = draw_title(svg, options);
  space = draw_legend(svg, space, names, looks, LegendMark::kDot);
  space = draw_remark(svg, space, left_out_remark(left_out));
  const Frame frame(svg, space, Axis(xs, chart.x_scale), Axis(ys, chart.y_scale), chart.x_label,
                    chart.y_label);
  if (chart.x_threshold) frame.draw_x_threshold(svg, *chart.x_threshold);
  if (chart.y_threshold) frame.draw_y_threshold(svg, *chart.y_threshold);
  const bool many = shown > kManyDots;
  for (std::size_t k = 0; k < chart.series.size(); ++k) {
    const ScatterSeries& series = chart.series[k];
    std::vector<SvgPoint> points;
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (frame.shows(series.x[i], series.y[i]))
        points.push_back(frame.at(series.x[i], series.y[i]));
    }
    svg.dots(points, many ? 3.5 : 5.5, looks[k].color, many ? 0.45 : 0.7);
  }
  return svg.document(options.title.empty() ? chart.y_label : options.title);
}

std::string intervals_svg(const IntervalsChart& chart, const FigureOptions& options) {
  // Rows in the order in which items are first named.
  std::vector<std::string> items;
  std::vector<double> extent;
  for (const IntervalSeries& series : chart.series) {
    for (const IntervalItem& item : series.items) {
      if (std::find(items.begin(), items.end(), item.name) == items.end()) {
        items.push_back(item.name);
      }
      extent.insert(extent.end(), {item.value, item.low, item.high});
    }
  }
  const bool is_share =
      chart.x_scale == AxisScale::kLinear &&
      std::all_of(extent.begin(), extent.end(), [](double v) { return !(v < 0.0) && !(v > 1.0); });
  const Axis x =
      is_share ? Axis::between(0.0, 1.0, AxisScale::kLinear) : Axis(extent, chart.x_scale);
  const auto names = names_of(chart.series);
  const auto looks = looks_of(names);
  const double row =
      kRowHeight * static_cast<double>(std::max<std::size_t>(names.size(), 1)) + kRowGap;
  double label_width = 0.0;
  for (const std::string& item : items) {
    label_width = std::max(label_width, svg_text_width(item, kLabelSize));
  }

  // Drawn twice; the first time only to measure the legend's height.
  FigureOptions sized = options;
  const auto head = [&](Svg& svg) {
    return draw_legend(svg, draw_title(svg, sized), names, looks, LegendMark::kDot);
  };
  Svg ignored(sized.width, sized.height);
  const double edge = sized.height - head(ignored).bottom;
  sized.height = head(ignored).top + 6.0 + row * static_cast<double>(items.size()) +
                 x_axis_height(chart.x_label) + edge;
  Svg svg(sized.width, sized.height);
  const Box space = head(svg);
  const Box plot{space.left + label_width + 12.0, space.top + 6.0, space.right - 10.0,
                 space.bottom - x_axis_height(chart.x_label)};
  const auto x_at = [&](double value) { return plot.left + x.share(value) * plot.width(); };
  for (std::size_t i = 0; i < items.size(); ++i) {
    const double top = plot.top + row * static_cast<double>(i);
    if (i % 2 == 1) {
      svg.rectangle({plot.left, top}, plot.width(), row, {.fill = "#f4f3ef"});
    }
    svg.text({plot.left - 10.0, top + 0.5 * row + 0.35 * kLabelSize}, items[i],
             {.size = kLabelSize, .anchor = SvgAnchor::kEnd, .color = kInk});
  }
  draw_x_axis(svg, plot, x, chart.x_label, true);
  for (std::size_t k = 0; k < chart.series.size(); ++k) {
    for (const IntervalItem& item : chart.series[k].items) {
      if (!x.shows(item.value)) continue;
      const auto place = std::find(items.begin(), items.end(), item.name) - items.begin();
      const double y = plot.top + row * static_cast<double>(place) + 0.5 * kRowGap +
                       kRowHeight * (static_cast<double>(k) + 0.5);
      const double low = x.shows(item.low) ? item.low : item.value;
      const double high = x.shows(item.high) ? item.high : item.value;
      svg.line({x_at(low), y}, {x_at(high), y}, {.stroke = looks[k].color, .stroke_width = 2.2});
      for (const double end : {low, high}) {
        svg.line({x_at(end), y - 4.0}, {x_at(end), y + 4.0},
                 {.stroke = looks[k].color, .stroke_width = 1.6});
      }
      svg.circle({x_at(item.value), y}, 4.2, {.fill = looks[k].color, .stroke = "#ffffff"});
    }
  }
  return svg.document(options.title.empty() ? chart.x_label : options.title);
}

std::string spans_svg(const SpansChart& chart, const FigureOptions& options) {
  IntervalsChart intervals;
  intervals.x_label = chart.x_label;
  for (const SpanSeries& series : chart.series) {
    IntervalSeries shown{series.name, {}};
    for (const Span& span : series.spans) {
      const double middle = span.start + 0.5 * (span.end - span.start);
      shown.items.push_back({span.name, middle, span.start, span.end});
    }
    intervals.series.push_back(std::move(shown));
  }
  return intervals_svg(intervals, options);
}

std::string chart_svg(const Chart& chart, const FigureOptions& options,
                      const DensityFunction& density) {
  struct Draw {
    const FigureOptions& options;
    const DensityFunction& density;
    std::string operator()(const DistributionChart& c) const {
      return distribution_svg(c, options, density);
    }
    std::string operator()(const LinesChart& c) const { return lines_svg(c, options); }
    std::string operator()(const HeatmapChart& c) const { return heatmap_svg(c, options); }
    std::string operator()(const IntervalsChart& c) const { return intervals_svg(c, options); }
    std::string operator()(const ScatterChart& c) const { return scatter_svg(c, options); }
    std::string operator()(const SpansChart& c) const { return spans_svg(c, options); }
  };
  return std::visit(Draw{options, density}, chart);
}

}  // namespace cairn::report
