// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/simulation/scene.hpp"

namespace cairn::detail {

/// A colour as displayed on a screen, each channel in [0, 1].
struct Paint {
  float r = 0.0F;
  float g = 0.0F;
  float b = 0.0F;

  Paint scaled(double factor) const;
  /// (1 - share) of this plus `share` of the other.
  Paint mixed(const Paint& other, double share) const;
};

/// A colour of random hue.
Paint random_paint(Random& random, double saturation, double value);

/// A picture being painted. Coordinates are in metres from the top left corner, x to the right and y down.
/// Shapes are clipped to the canvas.
class Canvas {
 public:
  /// @param texels_per_metre reduced if a side would exceed 4096 texels
  Canvas(double width_m, double height_m, double texels_per_metre, const Paint& background,
         const Random& its_random);

  /// Side of a texel, metres.
  double texel() const { return 1.0 / scale_; }

  void rectangle(double x, double y, double width, double height, const Paint& paint);
  /// A frame of the given thickness, inside the rectangle.
  void frame(double x, double y, double width, double height, double thickness, const Paint& paint);
  void disc(double x, double y, double radius, const Paint& paint);
  void line(double x0, double y0, double x1, double y1, double thickness, const Paint& paint);
  void triangle(double x0, double y0, double x1, double y1, double x2, double y2,
                const Paint& paint);
  /// A rectangle whose colour changes from top to bottom.
  void gradient(double x, double y, double width, double height, const Paint& top,
                const Paint& bottom);
  /// Strokes that look like a word of `letters` letters, up to `size` high.
  /// @return its width
  double word(double x, double y, double size, int letters, const Paint& paint);
  /// A block of text: lines of words, ragged on the right, as many as fit.
  void text(double x, double y, double width, double height, double size, const Paint& paint);

  /// Lightens and darkens the canvas by smooth noise with blotches of the given size.
  void blotches(double size_x, double size_y, double strength);
  /// Lightens and darkens each texel independently.
  void grain(double strength);

  /// @return the picture so far
  Texture texture() const;

 protected:
  Random random;
  const double w;  // metres
  const double h;

 private:
  struct Bounds {
    int x0, y0, x1, y1;
  };
  Bounds bounds(double x, double y, double width, double height) const;
  Paint& at(int x, int y) {
    return pixels_[static_cast<std::size_t>(y) * columns_ + static_cast<std::size_t>(x)];
  }

  double scale_;
  std::size_t columns_;
  std::size_t rows_;
  std::vector<Paint> pixels_;
};

}  // namespace cairn::detail
