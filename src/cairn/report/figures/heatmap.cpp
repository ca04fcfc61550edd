// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/report/detail/frame.hpp"

namespace cairn::report {
namespace {

constexpr double kPanelGap = 22.0;
constexpr double kBarWidth = 14.0;
constexpr double kBarRoom = 78.0;  // of the colours' bar with its numbers and label
constexpr double kCaption = 22.0;
constexpr double kTallest = 1.25;  // of a panel, as a share of its width
constexpr std::string_view kNoValue = "#dcdcdc";

// Cividis (Nuñez, Anderton and Renslow 2018), alike for all kinds of colour vision, at even steps.
constexpr std::array<std::array<int, 3>, 9> kCividis = {{{0, 34, 78},
                                                         {35, 62, 108},
                                                         {69, 87, 108},
                                                         {96, 111, 114},
                                                         {123, 123, 120},
                                                         {152, 148, 118},
                                                         {184, 174, 108},
                                                         {218, 203, 89},
                                                         {254, 232, 56}}};

std::array<int, 3> color_at(double share) {
  const double place = std::clamp(share, 0.0, 1.0) * static_cast<double>(kCividis.size() - 1);
  const auto index = std::min(static_cast<std::size_t>(place), kCividis.size() - 2);
  const double rest = place - static_cast<double>(index);
  std::array<int, 3> color{};
  for (std::size_t i = 0; i < 3; ++i) {
    color[i] = static_cast<int>(
        std::lround((1.0 - rest) * kCividis[index][i] + rest * kCividis[index + 1][i]));
  }
  return color;
}

std::string hex(const std::array<int, 3>& color) {
  return fmt::format("#{:02x}{:02x}{:02x}", color[0], color[1], color[2]);
}

bool is_dark(const std::array<int, 3>& color) {
  return 0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2] < 128.0;
}

std::array<double, 2> range_of(const HeatmapChart& chart) {
  if (chart.range) return *chart.range;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const HeatmapPanel& panel : chart.panels) {
    for (const auto& row : panel.values) {
      for (const double value : row) {
        if (!std::isfinite(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
      }
    }
  }
  if (low > high) return {0.0, 1.0};
  return {low, high > low ? high : low + 1.0};
}

// So many that a hundredth of the range shows.
int decimals_of(const std::array<double, 2>& range) {
  const double extent = range[1] - range[0];
  if (!(extent > 0.0)) return 2;
  return std::clamp(static_cast<int>(std::ceil(2.0 - std::log10(extent) - 1e-9)), 0, 6);
}

class HeatmapFigure {
 public:
  HeatmapFigure(const HeatmapChart& chart, const FigureOptions& options)
      : chart_(chart),
        options_(options),
        range_(range_of(chart)),
        decimals_(decimals_of(range_)),
        x_(Axis::between(chart.x.front(), chart.x.back(), AxisScale::kLinear, 5)),
        y_(Axis::between(chart.y.front(), chart.y.back(), AxisScale::kLinear, 5)) {}

  std::string draw() {
    FigureOptions sized = options_;
    Svg ignored(sized.width, sized.height);
    Box space = draw_title(ignored, sized);
    const double axis_width = y_axis_width(y_, chart_.y_label);
    const auto count = static_cast<double>(std::max<std::size_t>(chart_.panels.size(), 1));
    const double width =
        (space.width() - axis_width - kBarRoom - (count - 1.0) * kPanelGap) / count;
    const double room = space.height() - kCaption - x_axis_height(chart_.x_label);
    const double height = std::min(room, kTallest * width);
    sized.height -= room - height;
    Svg svg(sized.width, sized.height);
    space = draw_title(svg, sized);
    Box plot{space.left + axis_width, space.top + kCaption, 0.0, space.top + kCaption + height};
    for (std::size_t i = 0; i < chart_.panels.size(); ++i) {
      plot.left = space.left + axis_width + static_cast<double>(i) * (width + kPanelGap);
      plot.right = plot.left + width;
      draw_panel(svg, chart_.panels[i], plot, i == 0);
    }
    plot.left = plot.right + kPanelGap;
    plot.right = plot.left + kBarWidth;
    draw_bar(svg, plot);
    return svg.document(options_.title.empty() ? chart_.value_label : options_.title);
  }

 private:
  double share_of(double value) const { return (value - range_[0]) / (range_[1] - range_[0]); }

  void draw_panel(Svg& svg, const HeatmapPanel& panel, const Box& plot, bool first) const {
    svg.text({plot.left, plot.top - 8.0}, panel.name,
             {.size = kLabelSize, .color = kInk, .bold = true});
    for (std::size_t row = 0; row + 1 < chart_.y.size() && row < panel.values.size(); ++row) {
      const double bottom = plot.bottom - y_.share(chart_.y[row]) * plot.height();
      const double top = plot.bottom - y_.share(chart_.y[row + 1]) * plot.height();
      for (std::size_t k = 0; k + 1 < chart_.x.size() && k < panel.values[row].size(); ++k) {
        const double left = plot.left + x_.share(chart_.x[k]) * plot.width();
        const double right = plot.left + x_.share(chart_.x[k + 1]) * plot.width();
        draw_cell(svg, {left, top, right, bottom}, panel.values[row][k]);
      }
    }
    if (first) {
      draw_numbers(svg, plot);
    }
    draw_x_axis(svg, plot, x_, chart_.x_label, false);
  }

  void draw_cell(Svg& svg, const Box& cell, double value) const {
    const bool known = std::isfinite(value);
    const auto color = color_at(known ? share_of(value) : 0.0);
    // White edges separate cells; NaN must not look like a low value.
    svg.rectangle({cell.left, cell.top}, cell.width(), cell.height(),
                  {.fill = known ? std::string_view(hex(color)) : kNoValue, .stroke = "#ffffff"});
    const std::string text = known ? fmt::format("{:.{}f}", value, decimals_) : "–";
    if (svg_text_width(text, 10.5) + 4.0 > cell.width() || cell.height() < 14.0) return;
    svg.text({cell.middle_x(), cell.middle_y() + 3.6}, text,
             {.size = 10.5,
              .anchor = SvgAnchor::kMiddle,
              .color = !known           ? kMuted
                       : is_dark(color) ? std::string_view("#ffffff")
                                        : kInk});
  }

  // Of the y axis, without lines across the cells.
  void draw_numbers(Svg& svg, const Box& plot) const {
    draw_y_axis(svg, {plot.left, plot.top, plot.left, plot.bottom}, y_, chart_.y_label);
  }

  void draw_bar(Svg& svg, const Box& bar) const {
    constexpr int kSteps = 40;
    const double step = bar.height() / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      // A little higher than the step, so that no seam shows.
      svg.rectangle({bar.left, bar.bottom - step * (i + 1)}, bar.width(),
                    step + (i > 0 ? 0.6 : 0.0), {.fill = hex(color_at((i + 0.5) / kSteps))});
    }
    const Axis axis = Axis::between(range_[0], range_[1], AxisScale::kLinear, 5);
    double widest = 0.0;
    for (const Tick& tick : axis.ticks()) {
      const double y = bar.bottom - axis.share(tick.value) * bar.height();
      svg.line({bar.right, y}, {bar.right + 4.0, y}, {.stroke = kMuted});
      svg.text({bar.right + 7.0, y + 0.35 * kTickSize}, tick.label,
               {.size = kTickSize, .color = kInk});
      widest = std::max(widest, svg_text_width(tick.label, kTickSize));
    }
    svg.text({bar.right + widest + 14.0 + 0.5 * kLabelSize, bar.middle_y()}, chart_.value_label,
             {.size = kLabelSize, .anchor = SvgAnchor::kMiddle, .color = kInk, .turn_deg = -90.0});
  }

  const HeatmapChart& chart_;
  const FigureOptions& options_;
  std::array<double, 2> range_;
  int decimals_;
  Axis x_;
  Axis y_;
};

}  // namespace

std::string heatmap_svg(const HeatmapChart& chart, const FigureOptions& options) {
  if (chart.x.size() < 2 || chart.y.size() < 2) {
    return Svg(options.width, options.height).document(options.title);
  }
  return HeatmapFigure(chart, options).draw();
}

}  // namespace cairn::report
