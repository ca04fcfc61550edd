// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/report/detail/axis.hpp"
#include "cairn/report/detail/svg.hpp"
#include "cairn/report/figures/figures.hpp"

/// Shared by the figures: colours, legends, and the frame of a plot.
namespace cairn::report {

inline constexpr std::string_view kInk = "#1d2125";
inline constexpr std::string_view kMuted = "#5c6670";
inline constexpr std::string_view kGrid = "#e6e4df";
inline constexpr std::string_view kThresholdColor = "#a3450a";
inline constexpr double kLabelSize = 13.0;
inline constexpr double kTickSize = 11.5;
inline constexpr double kTitleSize = 15.0;

/// Look of a series: fixed for the paper's strategies, by position for other names.
struct SeriesLook {
  std::string_view color;
  std::string_view dashes;
};
std::vector<SeriesLook> looks_of(const std::vector<std::string>& names);

/// A rectangle of the drawing.
struct Box {
  double left = 0.0;
  double top = 0.0;
  double right = 0.0;
  double bottom = 0.0;

  double width() const { return right - left; }
  double height() const { return bottom - top; }
  double middle_x() const { return 0.5 * (left + right); }
  double middle_y() const { return 0.5 * (top + bottom); }
};

/// A title in the top left corner.
/// @returns the space that is left below it
Box draw_title(Svg& svg, const FigureOptions& options);

enum class LegendMark { kLine, kDot };

/// Draws a legend in rows at the top of `space`; none for a single series.
/// @returns the space that is left below it
Box draw_legend(Svg& svg, const Box& space, const std::vector<std::string>& names,
                const std::vector<SeriesLook>& looks, LegendMark mark);

/// Draws a remark at the bottom; none if empty.
/// @returns the space that is left above it
Box draw_remark(Svg& svg, const Box& space, std::string_view remark);

/// "3 values ... left out"; empty for 0.
std::string left_out_remark(std::size_t count);

/// A plot with numbers on both axes.
class Frame {
 public:
  /// Draws grid, ticks and labels within `space`.
  Frame(Svg& svg, const Box& space, Axis x, Axis y, std::string_view x_label,
        std::string_view y_label);

  const Box& plot() const { return plot_; }
  SvgPoint at(double x, double y) const;
  bool shows(double x, double y) const { return x_.shows(x) && y_.shows(y); }
  void draw_y_threshold(Svg& svg, const Threshold& threshold) const;
  void draw_x_threshold(Svg& svg, const Threshold& threshold) const;

 private:
  Axis x_;
  Axis y_;
  Box plot_;
};

/// Width of a y axis with its labels and title.
double y_axis_width(const Axis& axis, std::string_view label);
/// Grid lines across `plot` and numbers left of it.
void draw_y_axis(Svg& svg, const Box& plot, const Axis& axis, std::string_view label);
/// Ticks and numbers below `plot`.
void draw_x_axis(Svg& svg, const Box& plot, const Axis& axis, std::string_view label, bool grid);
/// Height of an x axis.
double x_axis_height(std::string_view label);
/// A dashed horizontal line across `plot`, with a label on it unless that is empty.
void draw_level(Svg& svg, const Box& plot, double y, std::string_view label);

/// Draws what the dashed line of a threshold means at the top right of `space`, for a plot whose marks leave no room on
/// the line.
/// @returns the space that is left below it
Box draw_threshold_key(Svg& svg, const Box& space, const Threshold& threshold);

}  // namespace cairn::report
