// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/simulation/detail/canvas.hpp"

namespace cairn::detail {

/// Pictures for walls, floors, furniture and items. Each function fills the canvas with a picture that
/// depends on the random numbers and is rich in corners. Only the tiles have a repeating pattern.
struct Painter : Canvas {
  using Canvas::Canvas;

  void plaster();       ///< a wall, with stains, scuffs and cracks
  void bricks();        ///< a painted wall of blocks
  void carpet_tiles();  ///< an office's floor
  void planks();        ///< a floor of boards
  void vinyl_tiles();   ///< a corridor's floor
  void concrete();      ///< a hall's floor, with marks
  void ceiling_panels();
  void wood();    ///< grain along x; the canvas's own colour
  void fabric();  ///< the canvas's own colour
  void metal();   ///< the canvas's own colour, scratched
  void rug();
  void book_spines();  ///< a shelf's row of books
  void book_cover();
  void poster();
  void screen();  ///< windows, text, symbols
  void keyboard();
  void paper();   ///< printed: text, figures, tables
  void carton();  ///< a side of a printed box
  void cup();     ///< the side of a cup or bottle
  void notice_board();
  void whiteboard();
  void door();
  void window_view();  ///< panes, houses and trees outside
  void drawers();      ///< a cabinet's front with labels
  void wall_tiles();   ///< equal tiles, a few with a picture
  void cupboard();     ///< a door of the canvas's own colour
  void oven();
  void leaf();

 private:
  Paint any_paint(double saturation, double value);
  int whole(int low, int high);
  // A line that wanders, such as a crack or a scribble.
  void wander(double x, double y, double step, int steps, double turn, double thickness,
              const Paint& paint);
  void scatter_marks(double per_square_metre, double size);
  // A photograph seen from afar: sky, hills, something in front.
  void landscape(double x, double y, double across, double down);
  void bar_chart(double x, double y, double across, double down);
  void line_chart(double x, double y, double across, double down);
  void barcode(double x, double y, double across, double down);
  void matrix_code(double x, double y, double size);
};

}  // namespace cairn::detail
