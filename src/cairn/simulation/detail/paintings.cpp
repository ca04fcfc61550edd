// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/paintings.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cairn::detail {
namespace {

constexpr Paint kInk{0.08F, 0.08F, 0.1F};
constexpr Paint kWhite{0.95F, 0.95F, 0.93F};

Paint gray(double value) {
  const auto v = static_cast<float>(value);
  return {v, v, v};
}

}  // namespace

Paint Painter::any_paint(double saturation, double value) {
  return random_paint(random, saturation, value);
}

int Painter::whole(int low, int high) {
  return low + static_cast<int>(random.index(static_cast<std::size_t>(high - low) + 1));
}

// A line that wanders, such as a crack or a scribble.
void Painter::wander(double x, double y, double step, int steps, double turn, double thickness,
                     const Paint& paint) {
  double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
  for (int i = 0; i < steps; ++i) {
    angle += turn * random.normal();
    const double next_x = x + step * std::cos(angle);
    const double next_y = y + step * std::sin(angle);
    line(x, y, next_x, next_y, thickness, paint);
    x = next_x;
    y = next_y;
  }
}

void Painter::scatter_marks(double per_square_metre, double size) {
  const int count = static_cast<int>(per_square_metre * w * h);
  for (int i = 0; i < count; ++i) {
    const double x = random.uniform(0.0, w);
    const double y = random.uniform(0.0, h);
    const Paint paint = gray(random.chance(0.7) ? random.uniform(0.15, 0.45) : 0.95);
    const double length = size * random.uniform(0.3, 2.0);
    if (random.chance(0.5)) {
      disc(x, y, 0.25 * length, paint);
    } else {
      const double angle = random.uniform(0.0, std::numbers::pi);
      line(x, y, x + length * std::cos(angle), y + length * std::sin(angle), 0.12 * size, paint);
    }
  }
}

// A photograph seen from afar: sky, hills, something in front.
void Painter::landscape(double x, double y, double across, double down) {
  gradient(x, y, across, down, any_paint(0.5, 0.9), any_paint(0.2, 0.95));
  disc(x + across * random.uniform(0.2, 0.8), y + 0.25 * down, 0.08 * std::min(across, down),
       any_paint(0.4, 1.0));
  for (int range = 0; range < 3; ++range) {
    const Paint paint = any_paint(0.6, 0.75 - 0.2 * range);
    double height = random.uniform(0.3, 0.5) - 0.1 * range;
    const int steps = 24;
    for (int i = 0; i < steps; ++i) {
      height = std::clamp(height + 0.05 * random.normal(), 0.05, 0.6);
      rectangle(x + across * i / steps, y + down * (1.0 - height), across / steps, down * height,
                paint);
    }
  }
  for (int i = 0; i < 10; ++i) {
    const double size = random.uniform(0.03, 0.1) * std::min(across, down);
    const double px = x + random.uniform(0.0, across - size);
    const double py = y + random.uniform(0.6 * down, down - size);
    rectangle(px, py, size, size, any_paint(0.7, random.uniform(0.2, 0.9)));
  }
}

void Painter::bar_chart(double x, double y, double across, double down) {
  const Paint paint = any_paint(0.8, 0.7);
  frame(x, y, across, down, 0.02 * across, kInk);
  const int bars = whole(4, 8);
  for (int i = 0; i < bars; ++i) {
    const double bar = random.uniform(0.15, 0.9) * down;
    rectangle(x + across * (i + 0.2) / bars, y + down - bar, 0.6 * across / bars, bar, paint);
  }
}

void Painter::line_chart(double x, double y, double across, double down) {
  frame(x, y, across, down, 0.015 * across, kInk);
  for (int curve = 0; curve < 2; ++curve) {
    const Paint paint = any_paint(0.9, 0.8);
    double level = random.uniform(0.3, 0.7);
    for (int i = 0; i < 10; ++i) {
      const double next = std::clamp(level + 0.15 * random.normal(), 0.05, 0.95);
      line(x + across * i / 10.0, y + down * level, x + across * (i + 1) / 10.0, y + down * next,
           0.02 * across, paint);
      level = next;
    }
  }
}

void Painter::barcode(double x, double y, double across, double down) {
  rectangle(x - 0.05 * across, y - 0.05 * across, 1.1 * across, down + 0.1 * across, kWhite);
  for (double at = 0.0; at < across;) {
    const double bar = random.uniform(0.01, 0.05) * across;
    rectangle(x + at, y, std::min(bar, across - at), down, kInk);
    at += bar + random.uniform(0.015, 0.05) * across;
  }
}

void Painter::matrix_code(double x, double y, double size) {
  rectangle(x, y, size, size, kWhite);
  const int cells = 17;
  const double cell = size / (cells + 2);
  for (int row = 0; row < cells; ++row) {
    for (int column = 0; column < cells; ++column) {
      if (random.chance(0.5)) {
        rectangle(x + (column + 1) * cell, y + (row + 1) * cell, cell, cell, kInk);
      }
    }
  }
}

void Painter::plaster() {
  blotches(1.7, 1.3, 0.05);
  blotches(0.35, 0.3, 0.04);
  blotches(0.05, 0.05, 0.03);
  scatter_marks(6.0, 0.02);
  const int cracks = static_cast<int>(0.25 * w * h);
  for (int i = 0; i < cracks; ++i) {
    wander(random.uniform(0.0, w), random.uniform(0.0, h), 0.03, whole(5, 20), 0.5, 0.002,
           gray(0.5));
  }
  // A skirting board, and scuffs above it.
  rectangle(0.0, h - 0.09, w, 0.09, gray(0.45));
  rectangle(0.0, h - 0.095, w, 0.008, gray(0.25));
  for (double x = 0.0; x < w; x += random.uniform(0.05, 0.4)) {
    line(x, h - random.uniform(0.1, 0.25), x + random.uniform(-0.06, 0.06),
         h - random.uniform(0.1, 0.25), 0.003, gray(random.uniform(0.2, 0.6)));
  }
  // Sockets and switches.
  for (double x = random.uniform(0.3, 1.0); x < w; x += random.uniform(1.0, 2.5)) {
    const double y = h - (random.chance(0.6) ? 0.3 : 1.15);
    rectangle(x, y, 0.085, 0.085, kWhite);
    frame(x, y, 0.085, 0.085, 0.005, gray(0.35));
    disc(x + 0.0425, y + 0.0425, 0.02, gray(0.3));
  }
  grain(0.03);
}

void Painter::bricks() {
  blotches(1.5, 1.5, 0.08);
  const Paint joint = gray(0.42);
  const double high = 0.2;
  const double wide = 0.4;
  int course = 0;
  for (double y = 0.0; y < h; y += high, ++course) {
    for (double x = course % 2 == 0 ? 0.0 : -0.5 * wide; x < w; x += wide) {
      const double tone = random.uniform(0.55, 0.8);
      rectangle(x, y, wide, high,
                Paint{static_cast<float>(tone), static_cast<float>(0.97 * tone),
                      static_cast<float>(0.9 * tone)});
      frame(x, y, wide, high, 0.006, joint);
    }
  }
  blotches(0.08, 0.06, 0.08);
  scatter_marks(12.0, 0.03);
  grain(0.06);
}

void Painter::carpet_tiles() {
  const Paint base = any_paint(0.25, 0.45);
  const double tile = 0.5;
  for (double y = 0.0; y < h; y += tile) {
    for (double x = 0.0; x < w; x += tile) {
      const Paint tone = base.scaled(random.uniform(0.8, 1.2));
      rectangle(x, y, tile, tile, tone);
      const bool upright = random.chance(0.5);
      for (int i = 0; i < 14; ++i) {
        const Paint stripe = tone.scaled(random.uniform(0.6, 1.5));
        const double at = random.uniform(0.0, tile - 0.02);
        const double from = random.uniform(0.0, 0.6 * tile);
        const double length = random.uniform(0.05, 0.4 * tile);
        if (upright) {
          rectangle(x + at, y + from, 0.012, length, stripe);
        } else {
          rectangle(x + from, y + at, length, 0.012, stripe);
        }
      }
    }
  }
  scatter_marks(10.0, 0.02);
  blotches(0.02, 0.02, 0.15);
  grain(0.22);
}

void Painter::planks() {
  const Paint base{0.62F, 0.44F, 0.28F};
  const double row = 0.14;
  for (double y = 0.0; y < h; y += row) {
    for (double x = -random.uniform(0.0, 1.2); x < w;) {
      const double board = random.uniform(0.7, 1.5);
      const Paint tone = base.scaled(random.uniform(0.75, 1.15));
      rectangle(x, y, board, row, tone);
      for (int i = 0; i < 9; ++i) {
        const double at = y + random.uniform(0.0, row);
        const double from = x + random.uniform(0.0, 0.6) * board;
        line(from, at, from + random.uniform(0.1, 0.4) * board, at + 0.01 * random.normal(), 0.003,
             tone.scaled(random.uniform(0.6, 0.85)));
      }
      if (random.chance(0.5)) {
        const double kx = x + random.uniform(0.1, 0.9) * board;
        const double ky = y + random.uniform(0.3, 0.7) * row;
        disc(kx, ky, 0.016, tone.scaled(0.55));
        disc(kx, ky, 0.008, tone.scaled(0.35));
      }
      frame(x, y, board, row, 0.003, base.scaled(0.35));
      x += board;
    }
  }
  blotches(0.4, 0.02, 0.1);
  grain(0.05);
}

void Painter::vinyl_tiles() {
  const double tile = 0.33;
  int row = 0;
  for (double y = 0.0; y < h; y += tile, ++row) {
    int column = 0;
    for (double x = 0.0; x < w; x += tile, ++column) {
      const bool dark = (row + column) % 2 == 0 || random.chance(0.12);
      const double tone = dark ? random.uniform(0.3, 0.42) : random.uniform(0.6, 0.75);
      rectangle(x, y, tile, tile, gray(tone));
      for (int i = 0; i < 26; ++i) {
        const double fleck = random.uniform(0.004, 0.012);
        rectangle(x + random.uniform(0.0, tile - fleck), y + random.uniform(0.0, tile - fleck),
                  fleck, fleck, gray(tone * random.uniform(0.5, 1.4)));
      }
      frame(x, y, tile, tile, 0.002, gray(0.25));
    }
  }
  scatter_marks(6.0, 0.05);
  blotches(0.5, 0.5, 0.08);
  grain(0.05);
}

void Painter::concrete() {
  blotches(2.0, 2.0, 0.12);
  blotches(0.5, 0.4, 0.1);
  blotches(0.06, 0.06, 0.12);
  const double area = w * h;
  for (int i = 0; i < static_cast<int>(0.8 * area); ++i) {  // oil and water
    disc(random.uniform(0.0, w), random.uniform(0.0, h), random.uniform(0.01, 0.06),
         gray(random.uniform(0.2, 0.4)));
  }
  for (int i = 0; i < static_cast<int>(0.7 * area); ++i) {
    wander(random.uniform(0.0, w), random.uniform(0.0, h), 0.06, whole(6, 30), 0.4, 0.006,
           gray(random.uniform(0.15, 0.3)));
  }
  for (double x = 3.0; x < w; x += 3.0) rectangle(x, 0.0, 0.015, h, gray(0.2));
  for (double y = 3.0; y < h; y += 3.0) rectangle(0.0, y, w, 0.015, gray(0.2));
  const Paint yellow{0.85F, 0.7F, 0.12F};
  for (int i = 0; i < static_cast<int>(0.12 * area); ++i) {  // stencilled bay numbers
    const double x = random.uniform(0.0, w);
    const double y = random.uniform(0.0, h);
    word(x, y, 0.25, 3, yellow.scaled(random.uniform(0.6, 1.0)));
  }
  scatter_marks(8.0, 0.06);
  grain(0.08);
}

void Painter::ceiling_panels() {
  const double panel = 0.6;
  for (double y = 0.0; y < h; y += panel) {
    for (double x = 0.0; x < w; x += panel) {
      rectangle(x, y, panel, panel, gray(random.uniform(0.78, 0.88)));
      const int holes = 60;
      for (int i = 0; i < holes; ++i) {
        disc(x + random.uniform(0.02, panel - 0.02), y + random.uniform(0.02, panel - 0.02),
             random.uniform(0.003, 0.008), gray(0.45));
      }
      frame(x, y, panel, panel, 0.01, gray(0.6));
    }
  }
  grain(0.03);
}

void Painter::wood() {
  blotches(0.7, 0.05, 0.12);
  blotches(0.25, 0.012, 0.12);
  blotches(0.08, 0.004, 0.08);
  for (int i = 0; i < static_cast<int>(2.0 * w * h) + 1; ++i) {
    const double x = random.uniform(0.0, w);
    const double y = random.uniform(0.0, h);
    const double radius = random.uniform(0.006, 0.016);
    disc(x, y, radius, Paint{0.36F, 0.24F, 0.14F});
    disc(x, y, 0.5 * radius, Paint{0.24F, 0.15F, 0.08F});
  }
  scatter_marks(7.0, 0.015);
  // Rings that cups left.
  for (int i = 0; i < static_cast<int>(1.5 * w * h); ++i) {
    const double x = random.uniform(0.0, w);
    const double y = random.uniform(0.0, h);
    for (int a = 0; a < 24; ++a) {
      const double angle = 2.0 * std::numbers::pi * a / 30.0;
      disc(x + 0.04 * std::cos(angle), y + 0.04 * std::sin(angle), 0.003,
           Paint{0.38F, 0.27F, 0.18F});
    }
  }
  grain(0.04);
}

void Painter::fabric() {
  blotches(0.2, 0.2, 0.12);
  blotches(0.02, 0.003, 0.15);
  blotches(0.003, 0.02, 0.15);
  const Paint stitch = any_paint(0.3, 0.7);
  for (double x = 0.02; x < w; x += 0.016) {
    rectangle(x, 0.02, 0.009, 0.003, stitch);
    rectangle(x, h - 0.023, 0.009, 0.003, stitch);
  }
  grain(0.12);
}

void Painter::metal() {
  blotches(0.5, 0.02, 0.08);
  blotches(0.1, 0.1, 0.08);
  scatter_marks(20.0, 0.02);
  grain(0.04);
}

void Painter::rug() {
  const Paint colors[4] = {any_paint(0.7, 0.45), any_paint(0.5, 0.7), any_paint(0.3, 0.85),
                           any_paint(0.8, 0.25)};
  rectangle(0.0, 0.0, w, h, colors[0]);
  const double cell = 0.2;
  for (double y = 0.1; y + cell < h; y += cell) {
    for (double x = 0.1; x + cell < w; x += cell) {
      const Paint& outer = colors[random.index(4)];
      const Paint& inner = colors[random.index(4)];
      const double m = 0.5 * cell;
      switch (random.index(4)) {
        case 0:
          triangle(x + m, y, x + cell, y + m, x, y + m, outer);
          triangle(x + m, y + cell, x + cell, y + m, x, y + m, inner);
          break;
        case 1:
          rectangle(x + 0.02, y + 0.02, cell - 0.04, cell - 0.04, outer);
          rectangle(x + 0.06, y + 0.06, cell - 0.12, cell - 0.12, inner);
          break;
        case 2:
          line(x, y, x + cell, y + cell, 0.03, outer);
          line(x + cell, y, x, y + cell, 0.03, inner);
          break;
        default:
          disc(x + m, y + m, 0.4 * cell, outer);
          disc(x + m, y + m, 0.2 * cell, inner);
      }
    }
  }
  frame(0.0, 0.0, w, h, 0.05, colors[3]);
  frame(0.05, 0.05, w - 0.1, h - 0.1, 0.02, colors[2]);
  blotches(0.012, 0.012, 0.15);
  grain(0.15);
}

void Painter::book_spines() {
  rectangle(0.0, 0.0, w, h, gray(0.07));
  for (double x = 0.002; x < w - 0.015;) {
    const double wide = std::min(random.uniform(0.014, 0.055), w - x);
    const double high = h * random.uniform(0.68, 0.97);
    const double top = h - high;
    if (random.chance(0.06)) {  // a gap
      x += random.uniform(0.02, 0.06);
      continue;
    }
    const bool pale = random.chance(0.35);
    const Paint cover = any_paint(random.uniform(0.15, 0.85),
                                  pale ? random.uniform(0.75, 0.95) : random.uniform(0.2, 0.7));
    const Paint print = pale ? any_paint(0.7, 0.25) : any_paint(0.3, 0.95);
    rectangle(x, top, wide, high, cover);
    rectangle(x, top, 0.0015, high, cover.scaled(1.3));
    rectangle(x + wide - 0.002, top, 0.002, high, cover.scaled(0.5));
    const int bands = whole(0, 3);
    for (int i = 0; i < bands; ++i) {
      rectangle(x + 0.001, top + high * random.uniform(0.04, 0.9), wide - 0.002,
                random.uniform(0.003, 0.02), random.chance(0.5) ? print : cover.scaled(0.5));
    }
    // The title runs down the spine, a sign below the other.
    const double size = 0.62 * wide;
    const double end = top + high * random.uniform(0.55, 0.8);
    for (double y = top + 0.12 * high; y + size < end; y += size * 0.95) {
      if (random.chance(0.15)) continue;
      word(x + 0.22 * wide, y, size * 0.8, 1, print);
    }
    rectangle(x + 0.25 * wide, top + 0.88 * high, 0.5 * wide, 0.5 * wide, print);
    x += wide + 0.001;
  }
  grain(0.04);
}

void Painter::book_cover() {
  const bool pale = random.chance(0.4);
  const Paint cover = any_paint(random.uniform(0.3, 0.9), pale ? 0.85 : 0.4);
  const Paint print = pale ? any_paint(0.8, 0.2) : any_paint(0.2, 0.95);
  rectangle(0.0, 0.0, w, h, cover);
  frame(0.04 * w, 0.04 * w, 0.92 * w, h - 0.08 * w, 0.012 * w, print);
  text(0.1 * w, 0.08 * h, 0.8 * w, 0.22 * h, 0.09 * w, print);
  if (random.chance(0.5)) {
    landscape(0.1 * w, 0.36 * h, 0.8 * w, 0.4 * h);
  } else {
    for (int i = 0; i < 12; ++i) {
      const Paint paint = any_paint(0.7, random.uniform(0.3, 0.95));
      const double x = random.uniform(0.1, 0.7) * w;
      const double y = random.uniform(0.36, 0.65) * h;
      const double size = random.uniform(0.05, 0.22) * w;
      if (random.chance(0.5)) {
        rectangle(x, y, size, size, paint);
      } else {
        triangle(x, y, x + size, y + 0.3 * size, x + 0.4 * size, y + size, paint);
      }
    }
  }
  text(0.1 * w, 0.82 * h, 0.8 * w, 0.12 * h, 0.045 * w, print);
  grain(0.04);
}

void Painter::poster() {
  const double unit = std::min(w, h);
  const bool pale = random.chance(0.6);
  const Paint ground = any_paint(random.uniform(0.1, 0.6), pale ? 0.93 : 0.3);
  const Paint print = pale ? any_paint(0.6, 0.2) : any_paint(0.2, 0.97);
  rectangle(0.0, 0.0, w, h, ground);
  rectangle(0.0, 0.0, w, 0.16 * h, any_paint(0.8, 0.55));
  text(0.06 * w, 0.04 * h, 0.88 * w, 0.1 * h, 0.075 * unit, kWhite);
  const int columns = w > h ? 3 : 2;
  const int rows = w > h ? 2 : 3;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double cw = 0.88 * w / columns;
      const double ch = 0.78 * h / rows;
      const double x = 0.06 * w + column * cw;
      const double y = 0.19 * h + row * ch;
      text(x, y, 0.9 * cw, 0.12 * ch, 0.035 * unit, print);
      switch (random.index(5)) {
        case 0:
          landscape(x, y + 0.15 * ch, 0.9 * cw, 0.75 * ch);
          break;
        case 1:
          bar_chart(x, y + 0.15 * ch, 0.9 * cw, 0.75 * ch);
          break;
        case 2:
          line_chart(x, y + 0.15 * ch, 0.9 * cw, 0.75 * ch);
          break;
        case 3:
          for (int i = 0; i < 16; ++i) {
            disc(x + cw * random.uniform(0.1, 0.8), y + ch * random.uniform(0.25, 0.8),
                 unit * random.uniform(0.01, 0.05), any_paint(0.8, random.uniform(0.3, 0.95)));
          }
          break;
        default:
          text(x, y + 0.16 * ch, 0.9 * cw, 0.72 * ch, 0.02 * unit, print);
      }
    }
  }
  frame(0.0, 0.0, w, h, 0.012, gray(0.15));
  grain(0.03);
}

void Painter::screen() {
  landscape(0.0, 0.0, w, h);
  for (int i = 0; i < 8; ++i) {  // symbols on the background
    const double y = h * (0.05 + 0.11 * i);
    rectangle(0.015 * w, y, 0.035 * w, 0.035 * w, any_paint(0.8, 0.9));
    word(0.012 * w, y + 0.04 * w, 0.012 * w, 5, kWhite);
  }
  const int windows = whole(2, 4);
  for (int i = 0; i < windows; ++i) {
    const double ww = random.uniform(0.35, 0.6) * w;
    const double wh = random.uniform(0.35, 0.7) * h;
    const double x = random.uniform(0.08 * w, w - ww);
    const double y = random.uniform(0.02 * h, 0.93 * h - wh);
    const bool dark = random.chance(0.5);
    const Paint ground = dark ? gray(0.12) : gray(0.96);
    rectangle(x, y, ww, wh, ground);
    rectangle(x, y, ww, 0.045 * h, any_paint(0.5, 0.55));
    word(x + 0.01 * w, y + 0.01 * h, 0.022 * h, 12, kWhite);
    for (int button = 1; button <= 3; ++button) {
      disc(x + ww - 0.025 * w * button, y + 0.022 * h, 0.008 * w, any_paint(0.9, 0.95));
    }
    // Source text: indented lines in several colours.
    const double size = 0.018 * h;
    for (double line = y + 0.07 * h; line + size < y + wh - 0.02 * h; line += 1.7 * size) {
      if (random.chance(0.12)) continue;
      double column = x + 0.02 * w + 0.02 * w * static_cast<double>(random.index(4));
      const int words = whole(1, 6);
      for (int k = 0; k < words; ++k) {
        const int letters = whole(2, 8);
        if (column + letters * 0.7 * size > x + ww - 0.02 * w) break;
        column += word(column, line, size, letters, any_paint(0.5, dark ? 0.9 : 0.35)) + 0.6 * size;
      }
    }
    frame(x, y, ww, wh, 0.003 * w, gray(0.3));
  }
  rectangle(0.0, 0.95 * h, w, 0.05 * h, gray(0.15));
  for (int i = 0; i < 9; ++i) {
    rectangle((0.01 + 0.04 * i) * w, 0.958 * h, 0.03 * w, 0.034 * h, any_paint(0.6, 0.8));
  }
}

void Painter::keyboard() {
  const bool dark = random.chance(0.6);
  const Paint body = dark ? gray(0.09) : gray(0.72);
  const Paint key = dark ? gray(0.2) : gray(0.9);
  const Paint print = dark ? gray(0.9) : gray(0.1);
  rectangle(0.0, 0.0, w, h, body);
  const int rows = 6;
  for (int row = 0; row < rows; ++row) {
    const double high = 0.9 * h / rows;
    const double y = 0.05 * h + row * high;
    for (double x = 0.02 * w; x < 0.96 * w;) {
      double wide = 0.042 * w;
      if (row == rows - 1 && x > 0.2 * w && x < 0.25 * w) wide = 0.28 * w;  // the space bar
      if (random.chance(0.1)) wide *= 1.5;
      wide = std::min(wide, 0.98 * w - x);
      rectangle(x, y, 0.9 * wide, 0.86 * high, key);
      rectangle(x, y + 0.76 * high, 0.9 * wide, 0.1 * high, key.scaled(0.6));
      word(x + 0.15 * wide, y + 0.15 * high, 0.4 * high, 1, print);
      x += wide;
      if (std::abs(x - 0.7 * w) < 0.02 * w) x += 0.02 * w;
    }
  }
  grain(0.05);
}

void Painter::paper() {
  rectangle(0.0, 0.0, w, h, kWhite.scaled(random.uniform(0.92, 1.0)));
  text(0.1 * w, 0.06 * h, 0.8 * w, 0.07 * h, 0.04 * w, kInk);
  double y = 0.15 * h;
  while (y < 0.9 * h) {
    const double block = std::min(random.uniform(0.12, 0.3) * h, 0.92 * h - y);
    switch (random.index(5)) {
      case 0:
        bar_chart(0.2 * w, y, 0.6 * w, 0.9 * block);
        break;
      case 1:
        line_chart(0.2 * w, y, 0.6 * w, 0.9 * block);
        break;
      default:
        text(0.1 * w, y, 0.8 * w, block, 0.016 * w + 0.0015, kInk.mixed(kWhite, 0.1));
    }
    y += block + 0.02 * h;
  }
  if (random.chance(0.4)) {  // marked by hand
    wander(random.uniform(0.2, 0.8) * w, random.uniform(0.2, 0.8) * h, 0.03 * w, 18, 0.6, 0.002,
           any_paint(0.9, 0.7));
  }
  grain(0.02);
}

void Painter::carton() {
  const bool printed = random.chance(0.35);
  const Paint board = printed ? any_paint(random.uniform(0.2, 0.8), 0.7)
                              : Paint{0.62F, 0.46F, 0.3F}.scaled(random.uniform(0.85, 1.1));
  const Paint print = printed ? kWhite : Paint{0.2F, 0.13F, 0.09F};
  const double unit = std::min(w, h);
  rectangle(0.0, 0.0, w, h, board);
  blotches(0.2, 0.02, 0.05);
  // Tape across the middle.
  rectangle(0.0, 0.46 * h, w, 0.07 * h, board.mixed(Paint{0.8F, 0.7F, 0.5F}, 0.6));
  text(0.06 * w, 0.07 * h, 0.5 * w, 0.18 * h, 0.12 * unit, print);
  text(0.06 * w, 0.27 * h, 0.5 * w, 0.17 * h, 0.045 * unit, print);
  // A shipping label.
  const double lx = random.uniform(0.5, 0.6) * w;
  const double ly = random.uniform(0.05, 0.15) * h;
  rectangle(lx, ly, 0.36 * w, 0.36 * h, kWhite);
  text(lx + 0.02 * w, ly + 0.02 * h, 0.32 * w, 0.16 * h, 0.035 * unit, kInk);
  barcode(lx + 0.03 * w, ly + 0.2 * h, 0.28 * w, 0.12 * h);
  // This side up.
  for (int i = 0; i < 2; ++i) {
    const double x = (0.1 + 0.14 * i) * w;
    triangle(x, 0.72 * h, x + 0.05 * w, 0.6 * h, x + 0.1 * w, 0.72 * h, print);
    rectangle(x + 0.035 * w, 0.72 * h, 0.03 * w, 0.14 * h, print);
  }
  rectangle(0.08 * w, 0.88 * h, 0.28 * w, 0.02 * h, print);
  if (random.chance(0.6)) matrix_code(0.68 * w, 0.6 * h, 0.3 * unit);
  for (int i = 0; i < 3; ++i) {
    const double x = (0.42 + 0.08 * i) * w;
    frame(x, 0.62 * h, 0.065 * w, 0.065 * w, 0.006 * w, print);
    word(x + 0.018 * w, 0.62 * h + 0.012 * w, 0.04 * w, 1, print);
  }
  scatter_marks(60.0, 0.02);
  grain(0.05);
}

void Painter::cup() {
  const Paint base = any_paint(random.uniform(0.1, 0.9), random.uniform(0.4, 0.95));
  rectangle(0.0, 0.0, w, h, base);
  const int bands = whole(1, 3);
  for (int i = 0; i < bands; ++i) {
    rectangle(0.0, random.uniform(0.05, 0.9) * h, w, random.uniform(0.03, 0.1) * h,
              any_paint(0.8, random.uniform(0.2, 0.9)));
  }
  for (int i = 0; i < 9; ++i) {
    const Paint paint = any_paint(0.8, random.uniform(0.1, 0.95));
    const double x = w * (i + random.uniform(0.1, 0.5)) / 9.0;
    const double y = random.uniform(0.25, 0.6) * h;
    if (random.chance(0.4)) {
      word(x, y, 0.16 * h, 3, paint);
    } else if (random.chance(0.5)) {
      triangle(x, y, x + 0.07 * w, y, x + 0.035 * w, y + 0.25 * h, paint);
    } else {
      disc(x, y, 0.1 * h, paint);
    }
  }
  grain(0.02);
}

void Painter::notice_board() {
  rectangle(0.0, 0.0, w, h, Paint{0.55F, 0.4F, 0.25F});
  grain(0.25);
  const int sheets = static_cast<int>(16.0 * w * h);
  for (int i = 0; i < sheets; ++i) {
    const double sw = random.uniform(0.1, 0.24);
    const double sh = sw * random.uniform(0.7, 1.42);
    const double x = random.uniform(0.04, std::max(0.05, w - sw - 0.04));
    const double y = random.uniform(0.04, std::max(0.05, h - sh - 0.04));
    const Paint sheet = random.chance(0.6) ? kWhite : any_paint(0.5, 0.95);
    rectangle(x + 0.004, y + 0.004, sw, sh, gray(0.2));
    rectangle(x, y, sw, sh, sheet);
    if (random.chance(0.35)) {
      landscape(x + 0.01, y + 0.01, sw - 0.02, 0.5 * sh);
      text(x + 0.01, y + 0.55 * sh, sw - 0.02, 0.4 * sh, 0.009, kInk);
    } else {
      text(x + 0.01, y + 0.02, sw - 0.02, 0.05, 0.018, any_paint(0.9, 0.5));
      text(x + 0.01, y + 0.07, sw - 0.02, sh - 0.08, 0.007, kInk);
    }
    disc(x + 0.5 * sw, y + 0.008, 0.006, any_paint(0.9, 0.8));
  }
  frame(0.0, 0.0, w, h, 0.03, Paint{0.4F, 0.3F, 0.2F});
}

void Painter::whiteboard() {
  rectangle(0.0, 0.0, w, h, gray(0.93));
  blotches(0.3, 0.15, 0.04);
  const Paint pens[3] = {{0.1F, 0.1F, 0.15F}, {0.1F, 0.2F, 0.7F}, {0.75F, 0.1F, 0.1F}};
  for (int i = 0; i < 7; ++i) {
    const Paint& pen = pens[random.index(3)];
    const double x = random.uniform(0.05, 0.7) * w;
    const double y = random.uniform(0.05, 0.75) * h;
    text(x, y, random.uniform(0.2, 0.3) * w, random.uniform(0.08, 0.2) * h, 0.035, pen);
  }
  for (int i = 0; i < 6; ++i) {
    const Paint& pen = pens[random.index(3)];
    const double x = random.uniform(0.1, 0.8) * w;
    const double y = random.uniform(0.2, 0.8) * h;
    frame(x, y, 0.2, 0.12, 0.006, pen);
    line(x + 0.2, y + 0.06, x + 0.32, y + random.uniform(-0.1, 0.2), 0.006, pen);
  }
  for (int i = 0; i < 8; ++i) {
    const double x = random.uniform(0.03, 0.9) * w;
    const double y = random.uniform(0.03, 0.85) * h;
    rectangle(x, y, 0.076, 0.076, any_paint(0.6, 0.95));
    text(x + 0.006, y + 0.01, 0.064, 0.06, 0.01, kInk);
  }
  frame(0.0, 0.0, w, h, 0.025, gray(0.55));
  grain(0.01);
}

void Painter::door() {
  blotches(0.03, 0.5, 0.1);
  frame(0.0, 0.0, w, h, 0.06, gray(0.4));
  rectangle(0.62 * w, 0.2 * h, 0.16 * w, 0.3 * h, Paint{0.3F, 0.36F, 0.4F});
  frame(0.62 * w, 0.2 * h, 0.16 * w, 0.3 * h, 0.012, gray(0.2));
  rectangle(0.1 * w, 0.52 * h, 0.14 * w, 0.02 * h, gray(0.75));
  disc(0.13 * w, 0.58 * h, 0.018, gray(0.1));
  // The name plate and what people stick to doors.
  rectangle(0.2 * w, 0.24 * h, 0.3 * w, 0.07 * h, kWhite);
  text(0.22 * w, 0.25 * h, 0.26 * w, 0.055 * h, 0.03, kInk);
  for (int i = 0; i < whole(1, 4); ++i) {
    const double x = random.uniform(0.12, 0.45) * w;
    const double y = random.uniform(0.33, 0.45) * h;
    rectangle(x, y, 0.15, 0.11, any_paint(0.4, 0.95));
    text(x + 0.01, y + 0.012, 0.13, 0.09, 0.012, kInk);
  }
  rectangle(0.07 * w, 0.9 * h, 0.86 * w, 0.08 * h, gray(0.6));
  scatter_marks(25.0, 0.025);
  grain(0.03);
}

void Painter::window_view() {
  gradient(0.0, 0.0, w, h, {0.6F, 0.75F, 0.95F}, {0.85F, 0.9F, 0.95F});
  blotches(0.5, 0.15, 0.08);
  for (double x = -0.1; x < w; x += random.uniform(0.15, 0.4)) {
    const double wide = random.uniform(0.2, 0.4);
    const double high = random.uniform(0.25, 0.65) * h;
    const Paint wall = any_paint(0.25, random.uniform(0.5, 0.8));
    rectangle(x, h - high, wide, high, wall);
    for (double wy = h - high + 0.03; wy < h - 0.05; wy += 0.09) {
      for (double wx = x + 0.025; wx < x + wide - 0.04; wx += 0.07) {
        rectangle(wx, wy, 0.035, 0.05, gray(random.uniform(0.15, 0.45)));
      }
    }
  }
  for (int i = 0; i < 40; ++i) {
    disc(random.uniform(0.0, w), h - random.uniform(0.0, 0.12), random.uniform(0.02, 0.06),
         Paint{0.2F, 0.4F, 0.15F}.scaled(random.uniform(0.6, 1.3)));
  }
  const int panes = std::max(1, static_cast<int>(w / 0.7));
  for (int i = 1; i < panes; ++i) rectangle(w * i / panes - 0.03, 0.0, 0.06, h, gray(0.85));
  frame(0.0, 0.0, w, h, 0.05, gray(0.8));
}

void Painter::drawers() {
  const int rows = std::max(1, static_cast<int>(std::round(h / 0.3)));
  const int columns = std::max(1, static_cast<int>(std::round(w / 0.5)));
  blotches(0.4, 0.02, 0.06);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double cw = w / columns;
      const double ch = h / rows;
      const double x = column * cw;
      const double y = row * ch;
      frame(x, y, cw, ch, 0.006, gray(0.15));
      rectangle(x + 0.35 * cw, y + 0.2 * ch, 0.3 * cw, 0.018, gray(0.2));
      rectangle(x + 0.35 * cw, y + 0.2 * ch, 0.3 * cw, 0.006, gray(0.85));
      rectangle(x + 0.36 * cw, y + 0.45 * ch, 0.28 * cw, 0.05, kWhite);
      text(x + 0.38 * cw, y + 0.45 * ch + 0.01, 0.24 * cw, 0.035, 0.013, kInk);
      if (random.chance(0.25)) {
        rectangle(x + 0.1 * cw, y + 0.4 * ch, 0.07, 0.07, any_paint(0.8, 0.8));
      }
    }
  }
  scatter_marks(25.0, 0.015);
  grain(0.03);
}

void Painter::wall_tiles() {
  const double tile = random.uniform(0.1, 0.2);
  const Paint motif = any_paint(0.6, 0.6);
  for (double y = 0.0; y < h; y += tile) {
    for (double x = 0.0; x < w; x += tile) {
      rectangle(x, y, tile, tile, gray(random.uniform(0.8, 0.88)));
      if (random.chance(0.08)) {
        disc(x + 0.5 * tile, y + 0.5 * tile, 0.3 * tile, motif);
        rectangle(x + 0.42 * tile, y + 0.42 * tile, 0.16 * tile, 0.16 * tile, gray(0.9));
      }
      frame(x, y, tile, tile, 0.003, gray(0.45));
    }
  }
  scatter_marks(5.0, 0.012);
  blotches(0.6, 0.4, 0.05);
  grain(0.03);
}

void Painter::cupboard() {
  blotches(0.03, 0.5, 0.08);
  frame(0.0, 0.0, w, h, 0.004, gray(0.15));
  frame(0.06, 0.06, w - 0.12, h - 0.12, 0.008, gray(0.35));
  const double x = random.chance(0.5) ? 0.08 : w - 0.11;
  rectangle(x, 0.3 * h, 0.02, 0.16, gray(0.2));
  rectangle(x, 0.3 * h, 0.007, 0.16, gray(0.9));
  scatter_marks(12.0, 0.01);
  grain(0.03);
}

void Painter::oven() {
  rectangle(0.0, 0.0, w, h, gray(0.55));
  rectangle(0.08 * w, 0.3 * h, 0.84 * w, 0.55 * h, gray(0.1));
  frame(0.08 * w, 0.3 * h, 0.84 * w, 0.55 * h, 0.012, gray(0.75));
  rectangle(0.1 * w, 0.22 * h, 0.8 * w, 0.02, gray(0.9));
  const int knobs = 3 + whole(0, 3);
  for (int i = 0; i < knobs; ++i) {
    const double x = w * (i + 0.5) / knobs;
    disc(x, 0.1 * h, 0.022, gray(0.12));
    line(x, 0.1 * h, x + random.uniform(-0.015, 0.015), 0.1 * h - 0.018, 0.004, kWhite);
    text(x - 0.02, 0.14 * h, 0.05, 0.02, 0.008, kInk);
  }
  grain(0.03);
}

void Painter::leaf() {
  const Paint green{0.22F, 0.42F, 0.16F};
  rectangle(0.0, 0.0, w, h, green.scaled(random.uniform(0.7, 1.4)));
  line(0.0, 0.5 * h, w, 0.5 * h, 0.05 * h, green.scaled(1.9));
  for (int i = 1; i < 7; ++i) {
    const double x = w * i / 8.0;
    line(x, 0.5 * h, x + 0.12 * w, 0.1 * h, 0.03 * h, green.scaled(1.6));
    line(x, 0.5 * h, x + 0.12 * w, 0.9 * h, 0.03 * h, green.scaled(1.6));
  }
  grain(0.15);
}

}  // namespace cairn::detail
