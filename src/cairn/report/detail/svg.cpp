// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/svg.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

#include "cairn/report/detail/markup.hpp"

namespace cairn::report {
namespace {

constexpr std::string_view kFont =
    "'Source Sans 3','Source Sans Pro','Helvetica Neue',Helvetica,Arial,'Liberation "
    "Sans',sans-serif";
constexpr double kFarAway = 1e5;  // beyond any drawing; renderers choke on larger numbers

// With one decimal, none where it is 0.
std::string number(double value) {
  if (!std::isfinite(value)) value = 0.0;
  const auto tenths =
      static_cast<std::int64_t>(std::llround(10.0 * std::clamp(value, -kFarAway, kFarAway)));
  const std::int64_t whole = std::abs(tenths) / 10;
  const std::int64_t rest = std::abs(tenths) % 10;
  const char* const sign = tenths < 0 ? "-" : "";
  return rest == 0 ? fmt::format("{}{}", sign, whole) : fmt::format("{}{}.{}", sign, whole, rest);
}

std::string attributes(const SvgStyle& style) {
  std::string text = fmt::format(R"( fill="{}")", style.fill.empty() ? "none" : style.fill);
  if (!style.fill.empty() && style.fill_opacity < 1.0) {
    text += fmt::format(R"( fill-opacity="{:.2g}")", style.fill_opacity);
  }
  if (style.stroke.empty()) return text;
  text += fmt::format(R"( stroke="{}" stroke-width="{:.3g}")", style.stroke, style.stroke_width);
  if (style.stroke_opacity < 1.0) {
    text += fmt::format(R"( stroke-opacity="{:.2g}")", style.stroke_opacity);
  }
  if (!style.dashes.empty()) text += fmt::format(R"( stroke-dasharray="{}")", style.dashes);
  return text;
}

std::string path_of(std::span<const SvgPoint> points) {
  std::string path;
  for (const SvgPoint& point : points) {
    path += path.empty() ? 'M' : 'L';
    path += number(point.x);
    path += ' ';
    path += number(point.y);
  }
  return path;
}

}  // namespace

Svg::Svg(double width, double height) : width_(width), height_(height) {}

void Svg::line(SvgPoint from, SvgPoint to, const SvgStyle& style) {
  body_ += fmt::format("<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"{}/>\n", number(from.x),
                       number(from.y), number(to.x), number(to.y), attributes(style));
}

void Svg::polyline(std::span<const SvgPoint> points, const SvgStyle& style) {
  if (points.size() < 2) return;
  body_ += fmt::format("<path d=\"{}\"{} stroke-linejoin=\"round\" stroke-linecap=\"{}\"/>\n",
                       path_of(points), attributes(style), style.dashes.empty() ? "round" : "butt");
}

void Svg::polygon(std::span<const SvgPoint> points, const SvgStyle& style) {
  if (points.empty()) return;
  body_ += fmt::format("<path d=\"{}Z\"{} stroke-linejoin=\"round\"/>\n", path_of(points),
                       attributes(style));
}

void Svg::rectangle(SvgPoint corner, double width, double height, const SvgStyle& style) {
  body_ += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{}/>\n", number(corner.x),
                       number(corner.y), number(width), number(height), attributes(style));
}

void Svg::circle(SvgPoint centre, double radius, const SvgStyle& style) {
  body_ += fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{}/>\n", number(centre.x),
                       number(centre.y), number(radius), attributes(style));
}

void Svg::dots(std::span<const SvgPoint> centres, double diameter, std::string_view color,
               double opacity) {
  if (centres.empty()) return;
  body_ += "<path d=\"";
  // A line of no length with round ends is a dot, the shortest that SVG has.
  for (const SvgPoint& centre : centres) {
    body_ += fmt::format("M{} {}h0", number(centre.x), number(centre.y));
  }
  body_ += fmt::format(
      "\" fill=\"none\" stroke=\"{}\" stroke-width=\"{:.3g}\" stroke-opacity=\"{:.2g}\" "
      "stroke-linecap=\"round\"/>\n",
      color, diameter, opacity);
}

void Svg::text(SvgPoint at, std::string_view text, const SvgText& style) {
  static constexpr std::string_view kAnchors[] = {"start", "middle", "end"};
  std::string turn;
  if (style.turn_deg != 0.0) {
    turn = fmt::format(" transform=\"rotate({} {} {})\"", number(style.turn_deg), number(at.x),
                       number(at.y));
  }
  body_ += fmt::format(
      "<text x=\"{}\" y=\"{}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"{}\"{}{}{}>{}</text>\n",
      number(at.x), number(at.y), number(style.size),
      kAnchors[static_cast<std::size_t>(style.anchor)], style.color,
      style.bold ? " font-weight=\"600\"" : "", style.italic ? " font-style=\"italic\"" : "", turn,
      markup_text(text));
}

void Svg::begin_clip(SvgPoint corner, double width, double height) {
  const int id = clips_++;
  body_ += fmt::format(
      "<clipPath id=\"clip{}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>\n"
      "<g clip-path=\"url(#clip{})\">\n",
      id, number(corner.x), number(corner.y), number(width), number(height), id);
}

void Svg::end_clip() {
  body_ += "</g>\n";
}

std::string Svg::document(std::string_view title) const {
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 "
             "{0} {1}\" font-family=\"{2}\" role=\"img\">\n<title>{3}</title>\n"
             "<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
             number(width_), number(height_), kFont, markup_text(title)) +
         body_ + "</svg>\n";
}

double svg_text_width(std::string_view text, double size) {
  double width = 0.0;
  for (const char c : text) {
    const auto byte = static_cast<std::uint8_t>(c);
    if ((byte & 0xc0U) == 0x80) continue;  // the rest of a character
    if (std::string_view("iljtf.,:;|'! ()[]I-").find(c) != std::string_view::npos) {
      width += 0.32;
    } else if (std::string_view("mwMW%@").find(c) != std::string_view::npos) {
      width += 0.85;
    } else {
      width += byte >= 'A' && byte <= 'Z' ? 0.68 : 0.55;
    }
  }
  return width * size;
}

}  // namespace cairn::report
