// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace cairn::report {

/// A point of a drawing: pixels from its top-left corner, y down.
struct SvgPoint {
  double x = 0.0;
  double y = 0.0;
};

enum class SvgAnchor { kStart, kMiddle, kEnd };

/// Style of a shape; a part with an empty colour is not drawn.
struct SvgStyle {
  std::string_view fill = {};
  double fill_opacity = 1.0;
  std::string_view stroke = {};
  double stroke_width = 1.0;
  double stroke_opacity = 1.0;
  std::string_view dashes = {};  ///< e.g. "4 3"; empty: solid
};

struct SvgText {
  double size = 12.0;  ///< pixels
  SvgAnchor anchor = SvgAnchor::kStart;
  std::string_view color = "#222222";
  bool bold = false;
  bool italic = false;
  double turn_deg = 0.0;  ///< clockwise about the text's anchor
};

/// An SVG drawing on white, built shape by shape. The same calls give the same bytes. Numbers are rounded
/// to a tenth of a pixel; text is escaped.
class Svg {
 public:
  Svg(double width, double height);

  void line(SvgPoint from, SvgPoint to, const SvgStyle& style);
  void polyline(std::span<const SvgPoint> points, const SvgStyle& style);
  void polygon(std::span<const SvgPoint> points, const SvgStyle& style);
  void rectangle(SvgPoint corner, double width, double height, const SvgStyle& style);
  void circle(SvgPoint centre, double radius, const SvgStyle& style);
  /// Many dots as one path.
  void dots(std::span<const SvgPoint> centres, double diameter, std::string_view color,
            double opacity);
  void text(SvgPoint at, std::string_view text, const SvgText& style);

  /// Clips the following shapes to the rectangle, until end_clip().
  void begin_clip(SvgPoint corner, double width, double height);
  void end_clip();

  /// The whole document.
  std::string document(std::string_view title) const;

 private:
  double width_;
  double height_;
  int clips_ = 0;
  std::string body_;
};

/// Approximate width of a text, in pixels.
double svg_text_width(std::string_view text, double size);

}  // namespace cairn::report
