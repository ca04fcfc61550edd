// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image.hpp"

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;
using testing::read_text;
using testing::TemporaryFolder;

template <class ImageOf>
std::span<unsigned char> bytes_of(ImageOf& image) {
  return {reinterpret_cast<unsigned char*>(image.values.data()),
          image.values.size() * sizeof(image.values[0])};
}

template <class ImageOf>
ImageOf pattern() {
  ImageOf image(32, 24);
  std::size_t i = 0;
  for (unsigned char& byte : bytes_of(image)) byte = static_cast<unsigned char>(7 * i++);
  return image;
}

template <class Read>
std::string refusal(Read&& read, const std::filesystem::path& path) {
  std::string message = testing::refusal(ErrorKind::kInput, [&] { read(path); });
  if (!message.empty()) {
    EXPECT_THAT(message, HasSubstr(path.string()));
  }
  return message;
}

TEST(ImageFile, ComesBackAsWritten) {
  const TemporaryFolder folder;
  write_png(folder / "gray.png", pattern<GrayImage>());
  write_png(folder / "color.png", pattern<ColorImage>());
  write_png(folder / "depth.png", pattern<StoredDepthImage>());
  EXPECT_EQ(read_gray_image(folder / "gray.png"), pattern<GrayImage>());
  EXPECT_EQ(read_color_image(folder / "color.png"), pattern<ColorImage>());
  EXPECT_EQ(read_depth_image(folder / "depth.png"), pattern<StoredDepthImage>());
  EXPECT_TRUE(read_gray_image(folder / "color.png").consistent());
}

TEST(ImageFile, ReadsJpeg) {
  const TemporaryFolder folder;
  write_jpeg(folder / "a.jpg", ColorImage(32, 24, 90));
  const GrayImage gray = read_gray_image(folder / "a.jpg");
  ASSERT_EQ(gray.values.size(), 32U * 24U);
  EXPECT_EQ(gray.width, 32U);
  EXPECT_THAT(gray.values, Each(AllOf(Ge(88), Le(92))));
}

TEST(ImageFile, JpegInMemoryIsThatOfAFile) {
  const TemporaryFolder folder;
  const auto image = pattern<ColorImage>();
  write_jpeg(folder / "a.jpg", image, 80);
  EXPECT_EQ(jpeg_bytes(image, 80), read_text(folder / "a.jpg"));
  EXPECT_LT(jpeg_bytes(image, 20).size(), jpeg_bytes(image, 95).size());
}

TEST(ImageFile, RefusesWhatIsCutOffAtAnyByte) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", pattern<StoredDepthImage>());
  write_jpeg(folder / "a.jpg", pattern<ColorImage>());
  for (const char* name : {"a.png", "a.jpg"}) {
    const std::string whole = read_text(folder / name);
    for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 200) {
      const auto path = folder.write("cut", whole.substr(0, size));
      EXPECT_THAT(refusal(read_gray_image, path), HasSubstr("expected")) << name << " " << size;
    }
  }
}

TEST(ImageFile, RefusesWhatIsNoImage) {
  const TemporaryFolder folder;
  EXPECT_THAT(refusal(read_gray_image, folder / "missing.png"), HasSubstr("No such file"));
  EXPECT_THAT(refusal(read_gray_image, folder.path()), HasSubstr("Is a directory"));
  EXPECT_THAT(refusal(read_gray_image, folder.write("a", "")), HasSubstr("empty"));
  EXPECT_THAT(refusal(read_gray_image, folder.write("a", "text")),
              HasSubstr("neither PNG nor JPEG"));
  EXPECT_THAT(refusal(read_gray_image, folder.write("a", "GIF89a")), HasSubstr("is an image"));
  EXPECT_THAT(refusal(read_gray_image, folder.write("a", std::string_view("\0\0\0\x18"
                                                                          "ftypmp42",
                                                                          12))),
              HasSubstr("is a video; expected a PNG or JPEG image"));
  write_png(folder / "gray.png", pattern<GrayImage>());
  EXPECT_THAT(refusal(read_depth_image, folder / "gray.png"), HasSubstr("one channel of 16 bits"));
}

// FNV-1a over all pixels.
template <class ImageOf>
std::uint64_t hash_of(ImageOf image) {
  std::uint64_t hash = 14695981039346656037U;
  for (const unsigned char byte : bytes_of(image)) hash = (hash ^ byte) * 1099511628211U;
  return hash;
}

// Recorded with the image codecs of OpenCV 4.6, which read and wrote these files before.
TEST(ImageFile, PixelsAreThoseOfOpenCv) {
  const TemporaryFolder folder;
  write_jpeg(folder / "gray.jpg", pattern<GrayImage>());
  write_jpeg(folder / "color.jpg", pattern<ColorImage>());
  write_png(folder / "gray.png", pattern<GrayImage>());
  write_png(folder / "color.png", pattern<ColorImage>());
  struct Recorded {
    const char* name;
    std::uint64_t gray;
    std::uint64_t color;
  };
  for (const auto& [name, gray, color] :
       {Recorded{"gray.jpg", 0xcd10aba0bfae4656, 0x72e3c6745654f7f0},
        Recorded{"color.jpg", 0x80ce06a533b4b8e4, 0x3108fec43ba09499},
        Recorded{"gray.png", 0x21b0aa78f1d59c25, 0xaed8c2179b874025},
        Recorded{"color.png", 0xbaecf3f36bdea0c7, 0xcc97eefa23408e25}}) {
    EXPECT_EQ(hash_of(read_gray_image(folder / name)), gray) << name;
    EXPECT_EQ(hash_of(read_color_image(folder / name)), color) << name;
  }
}

// A PNG with another header: its checksum is that of the header.
std::string with_png_size(std::string bytes, std::uint32_t width, std::uint32_t height) {
  const auto put = [&bytes](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<char>(value >> (24 - 8 * i));
  };
  put(16, width);
  put(20, height);
  std::uint32_t crc = 0xffffffff;
  for (std::size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<unsigned char>(bytes[i]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320 : 0);
  }
  put(29, ~crc);
  return bytes;
}

TEST(ImageFile, RefusesBeforeDecodingWhatClaimsToBeHuge) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", pattern<GrayImage>());
  const std::string png = read_text(folder / "a.png");
  // The same header as the file's own is no reason to refuse: the checksum above is right.
  EXPECT_EQ(refusal(read_gray_image, folder.write("b.png", with_png_size(png, 32, 24))), "");
  for (const auto& [width, height] : {std::pair{30000U, 30000U}, std::pair{16385U, 1U},
                                      std::pair{1U, 16385U}, std::pair{16384U, 4097U}}) {
    const auto path = folder.write("huge.png", with_png_size(png, width, height));
    EXPECT_THAT(refusal(read_gray_image, path), HasSubstr("16384 pixels a side"));
  }
  EXPECT_THAT(refusal(read_gray_image, folder.write("c.png", with_png_size(png, 0, 24))),
              HasSubstr("cannot be decoded"));

  write_jpeg(folder / "a.jpg", pattern<ColorImage>());
  std::string jpeg = read_text(folder / "a.jpg");
  const std::size_t frame = jpeg.find("\xff\xc0");  // the marker that the image's size follows
  ASSERT_NE(frame, std::string::npos);
  for (std::size_t i = 5; i < 9; ++i) jpeg[frame + i] = '\x7f';
  EXPECT_THAT(refusal(read_gray_image, folder.write("huge.jpg", jpeg)), HasSubstr("32639 x 32639"));
}

// Damage anywhere gives an image or a refusal, and neither a crash nor another kind of error.
TEST(ImageFile, SurvivesDamageAtAnyByte) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", pattern<ColorImage>());
  write_jpeg(folder / "a.jpg", pattern<ColorImage>());
  for (const char* name : {"a.png", "a.jpg"}) {
    const std::string whole = read_text(folder / name);
    int refused = 0;
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const char flip : {'\x01', '\x80', '\xff'}) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        const auto path = folder.write("damaged", damaged);
        if (!refusal(read_color_image, path).empty()) ++refused;
      }
    }
    EXPECT_GT(refused, 20) << name;
  }
}

TEST(ImageFile, WritesOnlyWhatIsAnImage) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_png(folder / "a.png", GrayImage()), Error);
  EXPECT_THROW(write_jpeg(folder / "a.jpg", GrayImage()), Error);
  EXPECT_THROW(write_png(folder / "a.png", ColorImage(2, 2, {1, 2, 3, 4})), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.png"));
  EXPECT_THROW(jpeg_bytes(ColorImage()), Error);
  EXPECT_THROW(jpeg_bytes(ColorImage(2, 2, {1, 2, 3, 4})), Error);
  EXPECT_THROW(jpeg_bytes(ColorImage(65501, 1)), Error) << "more than the format holds";
}

}  // namespace
}  // namespace cairn
