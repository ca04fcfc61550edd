// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace cairn {

/// An image on a surface with its mip levels, each half the size of the previous, so that distant surfaces
/// are averaged and do not flicker.
///
/// A texel is 0x00RRGGBB, 8 bits per channel. Row by row from the top left.
class Texture {
 public:
  /// @param texels width * height values
  /// @throws Error (misuse) for another number of texels, or a side of 0 or more than 8192
  Texture(std::uint32_t width, std::uint32_t height, std::vector<std::uint32_t> texels);

  std::uint32_t width() const { return levels_.front().width; }
  std::uint32_t height() const { return levels_.front().height; }
  std::size_t levels() const { return levels_.size(); }
  const std::vector<std::uint32_t>& texels() const { return levels_.front().texels; }

  /// Colour at a point: bilinear between texels, and linear between mip levels. Outside points take the
  /// colour of the border.
  /// @param u,v   in texels of level 0 from the texture's corner; the first texel's centre is 0.5
  /// @param level 0 and up, fractional; clamped to the last level
  std::uint32_t sample(float u, float v, float level) const;

 private:
  struct Level {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    float scale_u = 1.0F;  // of coordinates in level 0: sizes are rounded down, so not quite 2^-n
    float scale_v = 1.0F;
    std::vector<std::uint32_t> texels;
  };
  static std::uint32_t bilinear(const Level& level, float u, float v);

  std::vector<Level> levels_;
};

}  // namespace cairn
