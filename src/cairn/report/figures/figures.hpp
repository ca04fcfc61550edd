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

/// Figures for papers: charts of a report and pairs of clouds as SVG. The same input gives the same bytes.
/// Series have the viewer's colours. Values that a chart cannot show (not finite, or not positive on a
/// logarithmic axis) are left out and counted below it.
namespace cairn::report {

struct FigureOptions {
  std::string title = {};  ///< above the figure; empty: none
  double width = 640.0;    ///< pixels
  double height = 400.0;   ///< pixels; upper bound for heat maps and clouds
};

struct DensityPoint {
  double value = 0.0;
  double density = 0.0;
};

/// Density of values as points by ascending value; any scale, because only the shape is shown. For a
/// logarithmic axis it gets the decimal logarithms. It may return no points: then there is no outline.
using DensityFunction = std::function<std::vector<DensityPoint>(std::span<const double> values)>;

/// Violins or boxes side by side, as in the paper's Figures 3 to 5: outline of the density, box from the
/// first to the third quartile with median (solid) and mean (dashed), whiskers to the outermost values
/// within 1.5 box lengths, and the values as points to the left of each box.
/// @param density of violins; none: boxes
std::string distribution_svg(const DistributionChart& chart, const FigureOptions& options = {},
                             const DensityFunction& density = {});

/// Lines, with intervals as bands.
std::string lines_svg(const LinesChart& chart, const FigureOptions& options = {});

/// Panels side by side with one colour scale; cells without a value are grey.
std::string heatmap_svg(const HeatmapChart& chart, const FigureOptions& options = {});

/// One row per item, series next to each other, each a dot with its interval. The height grows with the
/// number of rows.
std::string intervals_svg(const IntervalsChart& chart, const FigureOptions& options = {});

std::string scatter_svg(const ScatterChart& chart, const FigureOptions& options = {});

/// One row per name, with its bars; marks are not drawn.
std::string spans_svg(const SpansChart& chart, const FigureOptions& options = {});

/// Any of the charts above.
std::string chart_svg(const Chart& chart, const FigureOptions& options = {},
                      const DensityFunction& density = {});

/// Two clouds in one frame.
struct CloudPanel {
  std::string caption = {};
  std::vector<Eigen::Vector3d> target = {};  ///< black
  std::vector<Eigen::Vector3d> source = {};  ///< green; aligned, in the target's frame
};

/// Clouds side by side as in the paper's Figure 2, all in one view direction and scale.
struct CloudsFigure {
  std::vector<CloudPanel> panels = {};
  /// Directions to the right and up in the figure, orthogonal unit vectors in the target's frame;
  /// std::nullopt: the plane in which the clouds spread most.
  std::optional<std::array<Eigen::Vector3d, 2>> axes = {};
  LengthUnit length_unit = LengthUnit::kMetres;  ///< of the scale bar
};

/// The figure's frame excludes outliers: 0.5 % at each end of each axis.
std::string clouds_svg(const CloudsFigure& figure, const FigureOptions& options = {});

/// The landmarks of a map in another frame, for CloudPanel::source.
std::vector<Eigen::Vector3d> moved_positions(std::span<const Eigen::Vector3d> positions,
                                             const Rigid3& target_from_source);

}  // namespace cairn::report
