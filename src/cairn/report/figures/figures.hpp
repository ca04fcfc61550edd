// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/map/landmark_map.hpp"
#include "cairn/report/report.hpp"

/// Figures for papers and for who has no browser: the charts of a report and pairs of clouds as SVG.
/// Same input, same bytes. Series have the same colours as in the viewer. Values that a chart cannot
/// show (not finite, or not positive on a logarithmic axis) are left out and counted below it.
namespace cairn::report {

struct FigureOptions {
  std::string title = {};  ///< above the figure; empty: none
  double width = 640.0;    ///< pixels
  double height = 400.0;   ///< pixels; of heat maps and clouds, at most
};

struct DensityPoint {
  double value = 0.0;
  double density = 0.0;
};

/// The density of values as points by ascending value; of any scale, for only the shape is shown. Of a
/// logarithmic axis it is given the decimal logarithms, as is right for what is drawn. It may return no
/// points: then there is no outline.
using DensityFunction = std::function<std::vector<DensityPoint>(std::span<const double> values)>;

/// Violins or boxes side by side, as Figures 3 to 5 of the paper: the outline of the density, a box from
/// the first to the third quartile with the median (solid) and the mean (dashed), whiskers to the
/// outermost values within 1.5 box lengths, and to the left of each box its values as points.
/// @param density of violins; none: boxes
std::string distribution_svg(const DistributionChart& chart, const FigureOptions& options = {},
                             const DensityFunction& density = {});

/// Lines, with intervals as bands.
std::string lines_svg(const LinesChart& chart, const FigureOptions& options = {});

/// Panels side by side with one scale of colours; cells without a value are grey.
std::string heatmap_svg(const HeatmapChart& chart, const FigureOptions& options = {});

/// One row an item, series beside each other, each a dot with its interval. The height grows with the
/// rows.
std::string intervals_svg(const IntervalsChart& chart, const FigureOptions& options = {});

std::string scatter_svg(const ScatterChart& chart, const FigureOptions& options = {});

/// One row a name, each with its bars; marks are not drawn.
std::string spans_svg(const SpansChart& chart, const FigureOptions& options = {});

/// Any of the above.
std::string chart_svg(const Chart& chart, const FigureOptions& options = {},
                      const DensityFunction& density = {});

/// Two clouds in one frame.
struct CloudPanel {
  std::string caption = {};
  std::vector<Eigen::Vector3d> target = {};  ///< black
  std::vector<Eigen::Vector3d> source = {};  ///< green; aligned, in the target's frame
};

/// Clouds side by side as Figure 2 of the paper, all seen along one direction and at one scale.
struct CloudsFigure {
  std::vector<CloudPanel> panels = {};
  /// What points right and what points up in the figure, unit vectors in the target's frame, at right
  /// angles; nothing: the plane in which the clouds spread most.
  std::optional<std::array<Eigen::Vector3d, 2>> axes = {};
  LengthUnit length_unit = LengthUnit::kMetres;  ///< of the scale bar
};

/// Points far from all others are left out of the frame: 0.5 % at either end of either axis.
std::string clouds_svg(const CloudsFigure& figure, const FigureOptions& options = {});

/// The landmarks of a map moved into another frame: for CloudPanel::source.
std::vector<Eigen::Vector3d> moved_positions(std::span<const Eigen::Vector3d> positions,
                                             const Rigid3& target_from_source);

}  // namespace cairn::report
