// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/simulation/detail/canvas.hpp"

/// Pictures for walls, floors, furniture and items. Each function fills the canvas with a picture that
/// depends on the random numbers and is rich in corners. Only the tiles have a repeating pattern.
namespace cairn::detail::paintings {

void plaster(Canvas& canvas, Random& random);       ///< a wall, with stains, scuffs and cracks
void bricks(Canvas& canvas, Random& random);        ///< a painted wall of blocks
void carpet_tiles(Canvas& canvas, Random& random);  ///< an office's floor
void planks(Canvas& canvas, Random& random);        ///< a floor of boards
void vinyl_tiles(Canvas& canvas, Random& random);   ///< a corridor's floor
void concrete(Canvas& canvas, Random& random);      ///< a hall's floor, with marks
void ceiling_panels(Canvas& canvas, Random& random);
void wood(Canvas& canvas, Random& random);    ///< grain along x; the canvas's own colour
void fabric(Canvas& canvas, Random& random);  ///< the canvas's own colour
void metal(Canvas& canvas, Random& random);   ///< the canvas's own colour, scratched
void rug(Canvas& canvas, Random& random);
void book_spines(Canvas& canvas, Random& random);  ///< a shelf's row of books
void book_cover(Canvas& canvas, Random& random);
void poster(Canvas& canvas, Random& random);
void screen(Canvas& canvas, Random& random);  ///< windows, text, symbols
void keyboard(Canvas& canvas, Random& random);
void paper(Canvas& canvas, Random& random);   ///< printed: text, figures, tables
void carton(Canvas& canvas, Random& random);  ///< a side of a printed box
void cup(Canvas& canvas, Random& random);     ///< the side of a cup or bottle
void notice_board(Canvas& canvas, Random& random);
void whiteboard(Canvas& canvas, Random& random);
void door(Canvas& canvas, Random& random);
void window_view(Canvas& canvas, Random& random);  ///< panes, houses and trees outside
void drawers(Canvas& canvas, Random& random);      ///< a cabinet's front with labels
void wall_tiles(Canvas& canvas, Random& random);   ///< equal tiles, a few with a picture
void cupboard(Canvas& canvas, Random& random);     ///< a door of the canvas's own colour
void oven(Canvas& canvas, Random& random);
void leaf(Canvas& canvas, Random& random);

}  // namespace cairn::detail::paintings
