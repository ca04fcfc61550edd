// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/canvas.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace cairn::detail {
namespace {

std::uint64_t hashed(std::uint64_t x) {
  x ^= x >> 33;
  x *= 0xff51afd7ed558ccdULL;
  x ^= x >> 33;
  x *= 0xc4ceb9fe1a85ec53ULL;
  return x ^ (x >> 33);
}

// Uniform in [-1, 1) at a point of a lattice.
float lattice(std::uint64_t key, int x, int y) {
  const auto cell = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32) |
                    static_cast<std::uint32_t>(y);
  return static_cast<float>(hashed(key ^ (cell * 0x9e3779b97f4a7c15ULL)) >> 40) * 0x1p-23F - 1.0F;
}

float smooth(float t) {
  return t * t * (3.0F - 2.0F * t);
}

// A sign's strokes between the nine points of a 3 x 3 raster, as pairs of points.
using Strokes = std::vector<std::pair<int, int>>;

// An alphabet of 40 signs, no two alike: strokes as letters have them, half of them with a stem.
const std::vector<Strokes>& alphabet() {
  static const std::vector<Strokes> signs = [] {
    constexpr std::array<std::pair<int, int>, 18> kStrokes = {{{0, 2},
                                                               {3, 5},
                                                               {6, 8},
                                                               {0, 6},
                                                               {2, 8},
                                                               {1, 7},
                                                               {0, 3},
                                                               {3, 6},
                                                               {2, 5},
                                                               {5, 8},
                                                               {0, 4},
                                                               {4, 8},
                                                               {2, 4},
                                                               {4, 6},
                                                               {1, 3},
                                                               {5, 7},
                                                               {0, 8},
                                                               {2, 6}}};
    Random random(40);
    std::vector<Strokes> result;
    while (result.size() < 40) {
      Strokes sign;
      if (result.size() % 2 == 0) sign.push_back(kStrokes[3]);
      const std::size_t count = 2 + random.index(2);
      while (sign.size() < count + (result.size() % 2 == 0 ? 1 : 0)) {
        const auto& stroke = kStrokes[random.index(kStrokes.size())];
        if (std::find(sign.begin(), sign.end(), stroke) == sign.end()) sign.push_back(stroke);
      }
      std::sort(sign.begin(), sign.end());
      if (std::find(result.begin(), result.end(), sign) == result.end()) result.push_back(sign);
    }
    return result;
  }();
  return signs;
}

}  // namespace

Paint Paint::scaled(double factor) const {
  const auto f = static_cast<float>(factor);
  return {r * f, g * f, b * f};
}

Paint Paint::mixed(const Paint& other, double share) const {
  const auto s = static_cast<float>(share);
  return {r + (other.r - r) * s, g + (other.g - g) * s, b + (other.b - b) * s};
}

Paint random_paint(Random& random, double saturation, double value) {
  const double hue = random.uniform(0.0, 6.0);
  const auto channel = [&](double offset) {
    const double h = std::fmod(hue + offset, 6.0);
    const double share = std::clamp(std::abs(h - 3.0) - 1.0, 0.0, 1.0);
    return static_cast<float>(value * (1.0 - saturation + saturation * share));
  };
  return {channel(0.0), channel(4.0), channel(2.0)};
}

Canvas::Canvas(double width_m, double height_m, double texels_per_metre, const Paint& background,
               const Random& its_random)
    : random(its_random), w(width_m), h(height_m) {
  constexpr double kMost = 4096.0;
  scale_ = std::min(texels_per_metre, kMost / std::max(width_m, height_m));
  columns_ = static_cast<std::size_t>(std::max(1.0, std::round(width_m * scale_)));
  rows_ = static_cast<std::size_t>(std::max(1.0, std::round(height_m * scale_)));
  pixels_.assign(columns_ * rows_, background);
}

Canvas::Bounds Canvas::bounds(double x, double y, double width, double height) const {
  const auto clamped = [&](double value, std::size_t size) {
    return static_cast<int>(std::clamp(std::round(value * scale_), 0.0, static_cast<double>(size)));
  };
  Bounds result{clamped(x, columns_), clamped(y, rows_), clamped(x + width, columns_),
                clamped(y + height, rows_)};
  // What is thinner than a texel still shows.
  if (result.x1 == result.x0 && x >= 0.0 && result.x1 < static_cast<int>(columns_)) ++result.x1;
  if (result.y1 == result.y0 && y >= 0.0 && result.y1 < static_cast<int>(rows_)) ++result.y1;
  return result;
}

void Canvas::rectangle(double x, double y, double width, double height, const Paint& paint) {
  const Bounds b = bounds(x, y, width, height);
  for (int row = b.y0; row < b.y1; ++row) {
    for (int column = b.x0; column < b.x1; ++column) at(column, row) = paint;
  }
}

void Canvas::frame(double x, double y, double width, double height, double thickness,
                   const Paint& paint) {
  rectangle(x, y, width, thickness, paint);
  rectangle(x, y + height - thickness, width, thickness, paint);
  rectangle(x, y, thickness, height, paint);
  rectangle(x + width - thickness, y, thickness, height, paint);
}

void Canvas::disc(double x, double y, double radius, const Paint& paint) {
  const Bounds b = bounds(x - radius, y - radius, 2.0 * radius, 2.0 * radius);
  for (int row = b.y0; row < b.y1; ++row) {
    for (int column = b.x0; column < b.x1; ++column) {
      const double dx = (column + 0.5) / scale_ - x;
      const double dy = (row + 0.5) / scale_ - y;
      if (dx * dx + dy * dy <= radius * radius) at(column, row) = paint;
    }
  }
}

void Canvas::line(double x0, double y0, double x1, double y1, double thickness,
                  const Paint& paint) {
  const double half = 0.5 * std::max(thickness, texel());
  const Bounds b = bounds(std::min(x0, x1) - half, std::min(y0, y1) - half,
                          std::abs(x1 - x0) + 2.0 * half, std::abs(y1 - y0) + 2.0 * half);
  const double dx = x1 - x0;
  const double dy = y1 - y0;
  const double squared = std::max(dx * dx + dy * dy, 1e-12);
  for (int row = b.y0; row < b.y1; ++row) {
    for (int column = b.x0; column < b.x1; ++column) {
      const double px = (column + 0.5) / scale_ - x0;
      const double py = (row + 0.5) / scale_ - y0;
      const double share = std::clamp((px * dx + py * dy) / squared, 0.0, 1.0);
      if (std::hypot(px - share * dx, py - share * dy) <= half) at(column, row) = paint;
    }
  }
}

void Canvas::triangle(double x0, double y0, double x1, double y1, double x2, double y2,
                      const Paint& paint) {
  const auto [left, right] = std::minmax({x0, x1, x2});
  const auto [top, bottom] = std::minmax({y0, y1, y2});
  const Bounds b = bounds(left, top, right - left, bottom - top);
  for (int row = b.y0; row < b.y1; ++row) {
    for (int column = b.x0; column < b.x1; ++column) {
      const double x = (column + 0.5) / scale_;
      const double y = (row + 0.5) / scale_;
      const bool a = (x1 - x0) * (y - y0) >= (y1 - y0) * (x - x0);
      const bool c = (x2 - x1) * (y - y1) >= (y2 - y1) * (x - x1);
      const bool d = (x0 - x2) * (y - y2) >= (y0 - y2) * (x - x2);
      if (a == c && c == d) at(column, row) = paint;
    }
  }
}

void Canvas::gradient(double x, double y, double width, double height, const Paint& top,
                      const Paint& bottom) {
  const Bounds b = bounds(x, y, width, height);
  for (int row = b.y0; row < b.y1; ++row) {
    const Paint paint = top.mixed(bottom, (row - b.y0 + 0.5) / std::max(1, b.y1 - b.y0));
    for (int column = b.x0; column < b.x1; ++column) at(column, row) = paint;
  }
}

double Canvas::word(double x, double y, double size, int letters, const Paint& paint) {
  const double advance = 0.68 * size;
  const double thickness = 0.15 * size;
  for (int i = 0; i < letters; ++i) {
    const Strokes& sign = alphabet()[random.index(alphabet().size())];
    // Capitals now and then; else without ascender.
    const double high = i == 0 || random.chance(0.3) ? size : 0.72 * size;
    const double left = x + i * advance + 0.5 * thickness;
    const double top = y + size - high + 0.5 * thickness;
    const double wide = 0.5 * size - thickness;
    for (const auto& [from, to] : sign) {
      const int from_row = from / 3;
      const int to_row = to / 3;
      line(left + 0.5 * wide * (from % 3), top + 0.5 * (high - thickness) * from_row,
           left + 0.5 * wide * (to % 3), top + 0.5 * (high - thickness) * to_row, thickness, paint);
    }
  }
  return letters * advance;
}

void Canvas::text(double x, double y, double width, double height, double size,
                  const Paint& paint) {
  const double right = x + width;
  for (double line_y = y; line_y + size <= y + height; line_y += 1.6 * size) {
    if (random.chance(0.08)) continue;  // a paragraph ends
    const double end = right - (random.chance(0.2) ? random.uniform(0.1, 0.6) * width : 0.0);
    double column = x;
    for (;;) {
      const int letters = 2 + static_cast<int>(random.index(7));
      if (column + letters * 0.68 * size > end) break;
      column += word(column, line_y, size, letters, paint) + 0.5 * size;
    }
  }
}

void Canvas::blotches(double size_x, double size_y, double strength) {
  const std::uint64_t key = random.draw_seed();
  const auto step_x = static_cast<float>(1.0 / (scale_ * size_x));
  const auto step_y = static_cast<float>(1.0 / (scale_ * size_y));
  std::vector<float> upper;
  std::vector<float> lower;
  const auto cells = static_cast<std::size_t>(static_cast<float>(columns_) * step_x) + 2;
  const auto fill = [&](std::vector<float>& values, int y) {
    values.resize(cells);
    for (std::size_t i = 0; i < cells; ++i) values[i] = lattice(key, static_cast<int>(i), y);
  };
  int current = -1;
  for (std::size_t row = 0; row < rows_; ++row) {
    const float y = static_cast<float>(row) * step_y;
    const int cell_y = static_cast<int>(y);
    if (cell_y != current) {
      fill(upper, cell_y);
      fill(lower, cell_y + 1);
      current = cell_y;
    }
    const float ty = smooth(y - static_cast<float>(cell_y));
    for (std::size_t column = 0; column < columns_; ++column) {
      const float x = static_cast<float>(column) * step_x;
      const auto cell_x = static_cast<std::size_t>(x);
      const float tx = smooth(x - static_cast<float>(cell_x));
      const float a = upper[cell_x] + (upper[cell_x + 1] - upper[cell_x]) * tx;
      const float b = lower[cell_x] + (lower[cell_x + 1] - lower[cell_x]) * tx;
      Paint& pixel = pixels_[row * columns_ + column];
      pixel = pixel.scaled(1.0F + static_cast<float>(strength) * (a + (b - a) * ty));
    }
  }
}

void Canvas::grain(double strength) {
  const std::uint64_t key = random.draw_seed();
  for (std::size_t row = 0; row < rows_; ++row) {
    for (std::size_t column = 0; column < columns_; ++column) {
      Paint& pixel = pixels_[row * columns_ + column];
      pixel =
          pixel.scaled(1.0F + static_cast<float>(strength) *
                                  lattice(key, static_cast<int>(column), static_cast<int>(row)));
    }
  }
}

Texture Canvas::texture() const {
  std::vector<std::uint32_t> texels;
  texels.reserve(pixels_.size());
  const auto byte = [](float value) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(value, 0.0F, 1.0F) * 255.0F));
  };
  for (const Paint& pixel : pixels_) {
    texels.push_back((byte(pixel.r) << 16) | (byte(pixel.g) << 8) | byte(pixel.b));
  }
  return {static_cast<std::uint32_t>(columns_), static_cast<std::uint32_t>(rows_),
          std::move(texels)};
}

}  // namespace cairn::detail
