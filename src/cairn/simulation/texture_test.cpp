// SPDX-License-Identifier: BSD-3-Clause
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/simulation/scene.hpp"

namespace cairn {
namespace {

TEST(Texture, TexelsAppearAtTheirCentres) {
  const Texture texture(2, 2, {0x102030, 0xff0000, 0x00ff00, 0x0000ff});
  EXPECT_EQ(texture.sample(0.5F, 0.5F, 0.0F), 0x102030U);
  EXPECT_EQ(texture.sample(1.5F, 0.5F, 0.0F), 0xff0000U);
  EXPECT_EQ(texture.sample(0.5F, 1.5F, 0.0F), 0x00ff00U);
  EXPECT_EQ(texture.sample(1.5F, 1.5F, 0.0F), 0x0000ffU);
}

TEST(Texture, IsLinearBetweenTexels) {
  const Texture texture(2, 1, {0x000000, 0xc86400});
  EXPECT_EQ(texture.sample(1.0F, 0.5F, 0.0F), 0x643200U);
  EXPECT_EQ(texture.sample(0.75F, 0.5F, 0.0F), 0x321900U);
}

TEST(Texture, TakesTheBordersColourOutside) {
  const Texture texture(2, 1, {0x111111, 0x222222});
  EXPECT_EQ(texture.sample(-1e9F, -5.0F, 0.0F), 0x111111U);
  EXPECT_EQ(texture.sample(1e9F, 7.0F, 0.0F), 0x222222U);
}

TEST(Texture, SeenFromAfarIsTheMean) {
  std::vector<std::uint32_t> board;
  for (std::uint32_t i = 0; i < 64; ++i)
    board.push_back((i + i / 8) % 2 == 0 ? 0x000000 : 0xfefefe);
  const Texture texture(8, 8, board);
  EXPECT_EQ(texture.levels(), 4U);
  for (const float level : {1.0F, 2.0F, 3.0F, 100.0F}) {
    EXPECT_EQ(texture.sample(2.3F, 6.1F, level), 0x7f7f7fU);
  }
}

TEST(Texture, LevelsOfOddSizesStayInPlace) {
  // Left half black, right half white, 5 texels wide: the border stays in the middle.
  std::vector<std::uint32_t> texels;
  for (int i = 0; i < 25; ++i) texels.push_back(i % 5 < 2 ? 0x000000 : 0xffffff);
  const Texture texture(5, 5, texels);
  EXPECT_EQ(texture.sample(0.5F, 2.5F, 1.0F), 0x000000U);
  EXPECT_EQ(texture.sample(4.5F, 2.5F, 1.0F), 0xffffffU);
}

TEST(Texture, RefusesSizesThatDoNotFit) {
  EXPECT_THROW(Texture(0, 1, {}), Error);
  EXPECT_THROW(Texture(2, 2, {1, 2, 3}), Error);
  EXPECT_THROW(Texture(9000, 1, std::vector<std::uint32_t>(9000)), Error);
}

}  // namespace
}  // namespace cairn
