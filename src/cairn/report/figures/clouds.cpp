// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/statistics.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/report/detail/frame.hpp"

namespace cairn::report {
namespace {

constexpr std::string_view kTargetColor = "#1d2125";
constexpr std::string_view kSourceColor = "#009e73";
constexpr double kOuter = 0.005;  // share of the points at either end that do not widen the frame
constexpr double kPanelGap = 16.0;
constexpr double kCaption = 24.0;
constexpr double kInset = 12.0;

using Axes = std::array<Eigen::Vector3d, 2>;

// The plane in which the targets spread most, each axis with its largest component positive.
Axes principal_axes(const CloudsFigure& figure) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::size_t count = 0;
  const auto for_each = [&](const auto& use) {
    for (const CloudPanel& panel : figure.panels) {
      for (const Eigen::Vector3d& point : panel.target) {
        if (point.allFinite()) use(point);
      }
    }
  };
  for_each([&](const Eigen::Vector3d& point) {
    mean += point;
    ++count;
  });
  if (count == 0) return {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()};
  mean /= static_cast<double>(count);
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for_each(
      [&](const Eigen::Vector3d& point) { spread += (point - mean) * (point - mean).transpose(); });
  const Eigen::Matrix3d directions = symmetric_eigen<3>(spread).vectors;
  Axes axes = {directions.col(2), directions.col(1)};
  for (Eigen::Vector3d& axis : axes) {
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    if (axis[largest] < 0.0) axis = -axis;
  }
  return axes;
}

// Ends along one axis of what the frame shows.
struct Extent {
  double low = 0.0;
  double high = 1.0;
};

Extent extent_along(const CloudsFigure& figure, const Eigen::Vector3d& axis) {
  std::vector<double> values;
  for (const CloudPanel& panel : figure.panels) {
    for (const auto* const cloud : {&panel.target, &panel.source}) {
      for (const Eigen::Vector3d& point : *cloud) {
        const double value = axis.dot(point);
        if (std::isfinite(value)) values.push_back(value);
      }
    }
  }
  if (values.empty()) return {};
  Extent extent{quantile(values, kOuter), quantile(values, 1.0 - kOuter)};
  const double room = std::max(0.02 * (extent.high - extent.low), 1e-9);
  return {extent.low - room, extent.high + room};
}

// The longest length of 1, 2 or 5 times a power of ten that is at most `longest`.
double bar_length(double longest) {
  const double power = std::pow(10.0, std::floor(std::log10(longest)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= longest) return factor * power;
  }
  return power;
}

std::string bar_label(double length, LengthUnit unit) {
  if (unit == LengthUnit::kFree) return fmt::format("{:g} map units", length);
  if (length < 0.01) return fmt::format("{:g} mm", 1e3 * length);
  if (length < 1.0) return fmt::format("{:g} cm", 1e2 * length);
  return fmt::format("{:g} m", length);
}

class CloudsDrawing {
 public:
  CloudsDrawing(const CloudsFigure& figure, const FigureOptions& options)
      : figure_(figure),
        options_(options),
        axes_(figure.axes ? *figure.axes : principal_axes(figure)),
        right_(extent_along(figure, axes_[0])),
        up_(extent_along(figure, axes_[1])) {}

  std::string draw() {
    FigureOptions sized = options_;
    Svg ignored(sized.width, sized.height);
    Box space = draw_title(ignored, sized);
    const auto count = static_cast<double>(std::max<std::size_t>(figure_.panels.size(), 1));
    const double width = (space.width() - (count - 1.0) * kPanelGap) / count;
    const double room = space.height() - kCaption - kLegendRoom;
    scale_ = std::min((width - 2.0 * kInset) / (right_.high - right_.low),
                      (room - 2.0 * kInset) / (up_.high - up_.low));
    const double height = scale_ * (up_.high - up_.low) + 2.0 * kInset;
    sized.height -= room - height;
    Svg svg(sized.width, sized.height);
    space = draw_title(svg, sized);
    draw_key(svg, {space.left, space.top + 8.0});
    Box panel{space.left, space.top + kLegendRoom, 0.0, space.top + kLegendRoom + height};
    for (std::size_t i = 0; i < figure_.panels.size(); ++i) {
      panel.left = space.left + static_cast<double>(i) * (width + kPanelGap);
      panel.right = panel.left + width;
      draw_panel(svg, figure_.panels[i], panel);
    }
    return svg.document(options_.title.empty() ? "Aligned clouds" : options_.title);
  }

 private:
  static constexpr double kLegendRoom = 24.0;

  static void draw_key(Svg& svg, SvgPoint at) {
    double x = at.x + 5.0;
    for (const auto& [name, color] :
         {std::pair<std::string_view, std::string_view>{"target", kTargetColor},
          {"source, aligned", kSourceColor}}) {
      svg.circle({x, at.y}, 4.0, {.fill = color});
      svg.text({x + 10.0, at.y + 4.5}, name, {.size = kLabelSize, .color = kInk});
      x += svg_text_width(name, kLabelSize) + 36.0;
    }
  }

  void draw_panel(Svg& svg, const CloudPanel& panel, const Box& box) const {
    svg.rectangle({box.left, box.top}, box.width(), box.height(),
                  {.fill = "#fcfcfb", .stroke = kGrid});
    svg.begin_clip({box.left, box.top}, box.width(), box.height());
    draw_cloud(svg, panel.target, box, kTargetColor);
    draw_cloud(svg, panel.source, box, kSourceColor);
    svg.end_clip();
    draw_bar(svg, box);
    svg.text({box.middle_x(), box.bottom + 17.0}, panel.caption,
             {.size = kLabelSize, .anchor = SvgAnchor::kMiddle, .color = kInk});
  }

  void draw_cloud(Svg& svg, const std::vector<Eigen::Vector3d>& cloud, const Box& box,
                  std::string_view color) const {
    const double middle_right = 0.5 * (right_.low + right_.high);
    const double middle_up = 0.5 * (up_.low + up_.high);
    std::vector<SvgPoint> points;
    for (const Eigen::Vector3d& position : cloud) {
      const SvgPoint point{box.middle_x() + scale_ * (axes_[0].dot(position) - middle_right),
                           box.middle_y() - scale_ * (axes_[1].dot(position) - middle_up)};
      const bool inside = point.x > box.left - 2.0 && point.x < box.right + 2.0 &&
                          point.y > box.top - 2.0 && point.y < box.bottom + 2.0;
      if (inside) points.push_back(point);
    }
    const bool many = points.size() > 1500;
    svg.dots(points, many ? 1.8 : 2.6, color, 0.75);
  }

  void draw_bar(Svg& svg, const Box& box) const {
    const double length = bar_length(0.25 * box.width() / scale_);
    const double width = scale_ * length;
    const double x = box.right - 10.0 - width;
    const double y = box.bottom - 10.0;
    svg.rectangle({x - 6.0, y - 19.0}, width + 12.0, 25.0,
                  {.fill = "#ffffff", .fill_opacity = 0.8});
    svg.line({x, y}, {x + width, y}, {.stroke = kInk, .stroke_width = 2.0});
    svg.text({x + 0.5 * width, y - 6.0}, bar_label(length, figure_.length_unit),
             {.size = 10.5, .anchor = SvgAnchor::kMiddle, .color = kInk});
  }

  const CloudsFigure& figure_;
  const FigureOptions& options_;
  Axes axes_;
  Extent right_;
  Extent up_;
  double scale_ = 1.0;
};

}  // namespace

std::string clouds_svg(const CloudsFigure& figure, const FigureOptions& options) {
  return CloudsDrawing(figure, options).draw();
}

std::vector<Eigen::Vector3d> moved_positions(std::span<const Eigen::Vector3d> positions,
                                             const Rigid3& target_from_source) {
  std::vector<Eigen::Vector3d> moved;
  moved.reserve(positions.size());
  for (const Eigen::Vector3d& position : positions) moved.push_back(target_from_source * position);
  return moved;
}

}  // namespace cairn::report
