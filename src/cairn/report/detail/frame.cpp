// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/frame.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <utility>

#include <fmt/format.h>

namespace cairn::report {
namespace {

// Okabe and Ito's colours in the viewer's order (viewer/src/theme.ts), which keeps neighbours apart.
constexpr std::array<std::string_view, 8> kColors = {"#0072b2", "#e69f00", "#009e73", "#cc79a7",
                                                     "#d55e00", "#56b4e9", "#4d4d4d", "#b8a800"};
constexpr std::array<std::string_view, 8> kDashes = {"",     "7 3", "2 3", "8 3 2 3",
                                                     "12 3", "4 2", "1 4", "10 2 2 2 2 2"};
constexpr std::array<std::string_view, 4> kStrategies = {"base", "covariance", "observations",
                                                         "distance"};
constexpr double kEdge = 14.0;  // around the whole figure
constexpr double kTickLength = 4.0;
constexpr double kLegendRow = 20.0;
constexpr double kAcross = -90.0;  // degrees, of text that reads upwards

const SvgStyle kGridStyle = {.stroke = kGrid, .stroke_width = 1.0};
const SvgStyle kAxisStyle = {.stroke = kMuted, .stroke_width = 1.0};
const SvgStyle kThresholdStyle = {.stroke = kThresholdColor, .stroke_width = 1.2, .dashes = "5 3"};

}  // namespace

std::vector<SeriesLook> looks_of(const std::vector<std::string>& names) {
  std::vector<SeriesLook> looks;
  std::size_t next = kStrategies.size();
  const bool any_strategy = std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return std::find(kStrategies.begin(), kStrategies.end(), name) != kStrategies.end();
  });
  if (!any_strategy) next = 0;
  for (const std::string& name : names) {
    const auto known = std::find(kStrategies.begin(), kStrategies.end(), name);
    const std::size_t index =
        known != kStrategies.end() ? static_cast<std::size_t>(known - kStrategies.begin()) : next++;
    looks.push_back({kColors[index % kColors.size()], kDashes[index % kDashes.size()]});
  }
  return looks;
}

Box draw_title(Svg& svg, const FigureOptions& options) {
  Box space{kEdge, kEdge, options.width - kEdge, options.height - kEdge};
  if (options.title.empty()) return space;
  svg.text({space.left, space.top + kTitleSize - 2.0}, options.title,
           {.size = kTitleSize, .color = kInk, .bold = true});
  space.top += kTitleSize + 12.0;
  return space;
}

Box draw_legend(Svg& svg, const Box& space, const std::vector<std::string>& names,
                const std::vector<SeriesLook>& looks, LegendMark mark) {
  if (names.size() < 2) return space;
  constexpr double kMark = 22.0;
  constexpr double kGap = 18.0;
  Box rest = space;
  double x = space.left;
  double y = space.top + 8.0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double width = kMark + 6.0 + svg_text_width(names[i], kLabelSize);
    if (x > space.left && x + width > space.right) {
      x = space.left;
      y += kLegendRow;
    }
    if (mark == LegendMark::kLine) {
      svg.line({x, y}, {x + kMark, y},
               {.stroke = looks[i].color, .stroke_width = 2.2, .dashes = looks[i].dashes});
    } else {
      svg.circle({x + 0.7 * kMark, y}, 4.5, {.fill = looks[i].color});
    }
    svg.text({x + kMark + 6.0, y + 4.5}, names[i], {.size = kLabelSize, .color = kInk});
    x += width + kGap;
  }
  rest.top = y + kLegendRow - 4.0;
  return rest;
}

Box draw_remark(Svg& svg, const Box& space, std::string_view remark) {
  if (remark.empty()) return space;
  svg.text({space.right, space.bottom}, remark,
           {.size = 10.5, .anchor = SvgAnchor::kEnd, .color = kMuted, .italic = true});
  Box rest = space;
  rest.bottom -= 16.0;
  return rest;
}

std::string left_out_remark(std::size_t count) {
  if (count == 0) return {};
  return fmt::format("{} value{} that the axes cannot show {} left out", count,
                     count == 1 ? "" : "s", count == 1 ? "is" : "are");
}

double y_axis_width(const Axis& axis, std::string_view label) {
  double widest = 0.0;
  for (const Tick& tick : axis.ticks()) {
    widest = std::max(widest, svg_text_width(tick.label, kTickSize));
  }
  return widest + kTickLength + 6.0 + (label.empty() ? 0.0 : kLabelSize + 8.0);
}

double x_axis_height(std::string_view label) {
  return kTickLength + kTickSize + 6.0 + (label.empty() ? 0.0 : kLabelSize + 8.0);
}

void draw_y_axis(Svg& svg, const Box& plot, const Axis& axis, std::string_view label) {
  for (const Tick& tick : axis.ticks()) {
    const double y = plot.bottom - axis.share(tick.value) * plot.height();
    if (tick.label.empty()) {
      svg.line({plot.left - 0.6 * kTickLength, y}, {plot.left, y}, kAxisStyle);
      continue;
    }
    svg.line({plot.left, y}, {plot.right, y}, kGridStyle);
    svg.line({plot.left - kTickLength, y}, {plot.left, y}, kAxisStyle);
    svg.text({plot.left - kTickLength - 4.0, y + 0.35 * kTickSize}, tick.label,
             {.size = kTickSize, .anchor = SvgAnchor::kEnd, .color = kInk});
  }
  svg.line({plot.left, plot.top}, {plot.left, plot.bottom}, kAxisStyle);
  if (label.empty()) return;
  svg.text({plot.left - y_axis_width(axis, label) + kLabelSize, plot.middle_y()}, label,
           {.size = kLabelSize, .anchor = SvgAnchor::kMiddle, .color = kInk, .turn_deg = kAcross});
}

void draw_x_axis(Svg& svg, const Box& plot, const Axis& axis, std::string_view label, bool grid) {
  double free_from = plot.left - 100.0;
  for (const Tick& tick : axis.ticks()) {
    const double x = plot.left + axis.share(tick.value) * plot.width();
    const double half = 0.5 * svg_text_width(tick.label, kTickSize);
    const bool labelled = !tick.label.empty() && x - half >= free_from;
    if (labelled && grid) svg.line({x, plot.top}, {x, plot.bottom}, kGridStyle);
    const double length = labelled ? kTickLength : 0.6 * kTickLength;
    svg.line({x, plot.bottom}, {x, plot.bottom + length}, kAxisStyle);
    if (!labelled) continue;
    svg.text({x, plot.bottom + kTickLength + kTickSize + 1.0}, tick.label,
             {.size = kTickSize, .anchor = SvgAnchor::kMiddle, .color = kInk});
    free_from = x + half + 4.0;
  }
  svg.line({plot.left, plot.bottom}, {plot.right, plot.bottom}, kAxisStyle);
  svg.text({plot.middle_x(), plot.bottom + x_axis_height(label) - 4.0}, label,
           {.size = kLabelSize, .anchor = SvgAnchor::kMiddle, .color = kInk});
}

void draw_level(Svg& svg, const Box& plot, double y, std::string_view label) {
  svg.line({plot.left, y}, {plot.right, y}, kThresholdStyle);
  if (label.empty()) return;
  // Above the line unless that is out of the plot.
  const double text_y = y - 5.0 > plot.top + kTickSize ? y - 5.0 : y + kTickSize + 3.0;
  svg.text({plot.right - 4.0, text_y}, label,
           {.size = kTickSize, .anchor = SvgAnchor::kEnd, .color = kThresholdColor});
}

Box draw_threshold_key(Svg& svg, const Box& space, const Threshold& threshold) {
  constexpr double kMark = 22.0;
  const double y = space.top + 6.0;
  const double left = space.right - 4.0 - svg_text_width(threshold.label, kTickSize);
  svg.text({space.right - 4.0, y + 4.0}, threshold.label,
           {.size = kTickSize, .anchor = SvgAnchor::kEnd, .color = kThresholdColor});
  svg.line({left - 6.0 - kMark, y}, {left - 6.0, y}, kThresholdStyle);
  Box rest = space;
  rest.top += 16.0;
  return rest;
}

Frame::Frame(Svg& svg, const Box& space, Axis x, Axis y, std::string_view x_label,
             std::string_view y_label)
    : x_(std::move(x)),
      y_(std::move(y)),
      plot_{space.left + y_axis_width(y_, y_label), space.top + 6.0, space.right - 4.0,
            space.bottom - x_axis_height(x_label)} {
  draw_y_axis(svg, plot_, y_, y_label);
  draw_x_axis(svg, plot_, x_, x_label, true);
}

SvgPoint Frame::at(double x, double y) const {
  return {plot_.left + x_.share(x) * plot_.width(), plot_.bottom - y_.share(y) * plot_.height()};
}

void Frame::draw_y_threshold(Svg& svg, const Threshold& threshold) const {
  if (!y_.shows(threshold.value)) return;
  const double share = y_.share(threshold.value);
  if (share < 0.0 || share > 1.0) return;
  draw_level(svg, plot_, plot_.bottom - share * plot_.height(), threshold.label);
}

void Frame::draw_x_threshold(Svg& svg, const Threshold& threshold) const {
  if (!x_.shows(threshold.value)) return;
  const double share = x_.share(threshold.value);
  if (share < 0.0 || share > 1.0) return;
  const double x = plot_.left + share * plot_.width();
  svg.line({x, plot_.top}, {x, plot_.bottom}, kThresholdStyle);
  // On the side of what does not exceed it, if there is room.
  const bool left = x - plot_.left > svg_text_width(threshold.label, kTickSize) + 10.0;
  svg.text({left ? x - 5.0 : x + 5.0, plot_.top + kTickSize + 2.0}, threshold.label,
           {.size = kTickSize,
            .anchor = left ? SvgAnchor::kEnd : SvgAnchor::kStart,
            .color = kThresholdColor});
}

}  // namespace cairn::report
