// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sequence/image_file.hpp"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "cairn/core/error.hpp"

#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::read_text;
using testing::TemporaryFolder;

cv::Mat pattern(int type) {
  cv::Mat image(24, 32, type);
  for (std::size_t i = 0; i < image.total() * image.elemSize(); ++i) {
    image.data[i] = static_cast<unsigned char>(i * 7);
  }
  return image;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

template <class Read>
std::string message_of(Read&& read, const std::filesystem::path& path) {
  try {
    read(path);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr(path.string()));
    return error.what();
  }
  return "no error";
}

TEST(ImageFile, ComesBackAsWritten) {
  const TemporaryFolder folder;
  write_png(folder / "gray.png", pattern(CV_8UC1));
  write_png(folder / "color.png", pattern(CV_8UC3));
  write_png(folder / "depth.png", pattern(CV_16UC1));
  EXPECT_TRUE(same(read_gray_image(folder / "gray.png"), pattern(CV_8UC1)));
  EXPECT_TRUE(same(read_color_image(folder / "color.png"), pattern(CV_8UC3)));
  EXPECT_TRUE(same(read_depth_image(folder / "depth.png"), pattern(CV_16UC1)));
  EXPECT_EQ(read_gray_image(folder / "color.png").type(), CV_8UC1);
}

TEST(ImageFile, ReadsJpeg) {
  const TemporaryFolder folder;
  cv::imwrite((folder / "a.jpg").string(), cv::Mat(24, 32, CV_8UC3, cv::Scalar(90, 90, 90)));
  const cv::Mat gray = read_gray_image(folder / "a.jpg");
  EXPECT_EQ(gray.size(), cv::Size(32, 24));
  EXPECT_NEAR(cv::mean(gray)[0], 90.0, 2.0);
}

TEST(ImageFile, RefusesWhatIsCutOffAtAnyByte) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", pattern(CV_16UC1));
  cv::imwrite((folder / "a.jpg").string(), pattern(CV_8UC3));
  for (const char* name : {"a.png", "a.jpg"}) {
    const std::string whole = read_text(folder / name);
    for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 200) {
      const auto path = folder.write("cut", whole.substr(0, size));
      EXPECT_THAT(message_of(read_gray_image, path), HasSubstr("expected")) << name << " " << size;
    }
  }
}

TEST(ImageFile, RefusesWhatIsNoImage) {
  const TemporaryFolder folder;
  EXPECT_THAT(message_of(read_gray_image, folder / "missing.png"), HasSubstr("No such file"));
  EXPECT_THAT(message_of(read_gray_image, folder.path()), HasSubstr("Is a directory"));
  EXPECT_THAT(message_of(read_gray_image, folder.write("a", "")), HasSubstr("empty"));
  EXPECT_THAT(message_of(read_gray_image, folder.write("a", "text")),
              HasSubstr("neither PNG nor JPEG"));
  write_png(folder / "gray.png", pattern(CV_8UC1));
  EXPECT_THAT(message_of(read_depth_image, folder / "gray.png"),
              HasSubstr("one channel of 16 bits"));
}

TEST(ImageFile, RefusesAPngThatClaimsToBeHuge) {
  const TemporaryFolder folder;
  write_png(folder / "a.png", pattern(CV_8UC1));
  std::string bytes = read_text(folder / "a.png");
  bytes[16] = '\x7f';
  EXPECT_THAT(message_of(read_gray_image, folder.write("huge.png", bytes)), HasSubstr("65536"));
}

}  // namespace
}  // namespace cairn
