// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/exif.hpp"

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

// A tag of the EXIF directory with one value: of 16 bits, or a ratio.
struct Tag {
  int number = 0;
  std::uint32_t value = 0;
  std::uint32_t denominator = 0;  // 0: no ratio
};

// The start of a JPEG file with EXIF data, little-endian.
std::string jpeg_with(const std::vector<Tag>& tags) {
  const auto bytes = [](std::uint32_t value, int count) {
    std::string text;
    for (int i = 0; i < count; ++i) text += static_cast<char>(value >> (8 * i) & 0xff);
    return text;
  };
  constexpr std::uint32_t kDirectory = 26;  // behind a first directory that refers to it
  std::string tiff = "II" + bytes(42, 2) + bytes(8, 4);
  tiff += bytes(1, 2) + bytes(0x8769, 2) + bytes(4, 2) + bytes(1, 4) + bytes(kDirectory, 4) +
          bytes(0, 4);
  const auto end = kDirectory + 2 + 12 * static_cast<std::uint32_t>(tags.size()) + 4;
  std::string ratios;
  tiff += bytes(static_cast<std::uint32_t>(tags.size()), 2);
  for (const Tag& tag : tags) {
    const bool ratio = tag.denominator > 0;
    tiff +=
        bytes(static_cast<std::uint32_t>(tag.number), 2) + bytes(ratio ? 5 : 3, 2) + bytes(1, 4);
    tiff += bytes(ratio ? end + static_cast<std::uint32_t>(ratios.size()) : tag.value, 4);
    if (ratio) ratios += bytes(tag.value, 4) + bytes(tag.denominator, 4);
  }
  tiff += bytes(0, 4) + ratios;
  const std::string body = std::string("Exif\0\0", 6) + tiff;
  const auto size = body.size() + 2;
  return std::string("\xff\xd8\xff\xe1") + static_cast<char>(size >> 8) +
         static_cast<char>(size & 0xff) + body + "\xff\xd9";
}

constexpr int kOfFilm = 0xa405;
constexpr int kFocalLength = 0x920a;
constexpr int kResolution = 0xa20e;
constexpr int kResolutionUnit = 0xa210;
constexpr int kWidth = 0xa002;

TEST(Exif, FocalLengthOfAnEquivalentFilmCamera) {
  const auto found = exif_focal_length(jpeg_with({{kOfFilm, 26}}), 4000, 3000);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(*found, 26.0 / 43.2666 * 5000.0, 1e-6);
  // The angle is the same in a smaller image, and with the camera turned.
  EXPECT_NEAR(exif_focal_length(jpeg_with({{kOfFilm, 26}}), 300, 400).value(), 0.1 * *found, 1e-6);
}

TEST(Exif, FocalLengthByTheResolutionOfTheSensor) {
  std::vector<Tag> tags = {{kWidth, 5000}, {kFocalLength, 24, 1}, {kResolution, 254'000, 50}};
  EXPECT_NEAR(exif_focal_length(jpeg_with(tags), 5000, 3000).value(), 24.0 * 200.0, 1e-6);
  EXPECT_NEAR(exif_focal_length(jpeg_with(tags), 1000, 600).value(), 24.0 * 40.0, 1e-6);
  tags.push_back({kResolutionUnit, 3});
  EXPECT_NEAR(exif_focal_length(jpeg_with(tags), 5000, 3000).value(), 24.0 * 508.0, 1e-6);
}

TEST(Exif, IsUnknownWhereItIsNotStated) {
  EXPECT_FALSE(exif_focal_length(jpeg_with({{kOfFilm, 0}}), 640, 480));
  EXPECT_FALSE(exif_focal_length(jpeg_with({{kFocalLength, 24, 1}}), 640, 480));
  EXPECT_FALSE(exif_focal_length("\xff\xd8\xff\xd9", 640, 480));
  EXPECT_FALSE(exif_focal_length("", 640, 480));
}

TEST(Exif, DamagedDataGiveNothingOrANumber) {
  const std::string whole =
      jpeg_with({{kWidth, 5000}, {kFocalLength, 24, 1}, {kResolution, 254'000, 50}});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto found = exif_focal_length(std::string_view(whole).substr(0, size), 5000, 3000);
    EXPECT_TRUE(!found || *found > 0.0);
  }
  for (std::size_t i = 4; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    const auto found = exif_focal_length(damaged, 5000, 3000);
    EXPECT_TRUE(!found || *found > 0.0);
  }
}

}  // namespace
}  // namespace cairn
