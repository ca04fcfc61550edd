// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sequence/sequence.hpp"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "cairn/core/error.hpp"
#include "cairn/sequence/image_file.hpp"
#include "cairn/sequence/sequence_writer.hpp"

#include "support/real_data.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

const cv::Mat kGray(24, 32, CV_8UC1, cv::Scalar(50));

std::string message_of(auto&& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(RgbdSequence, ComesBackAsWritten) {
  const TemporaryFolder folder;
  cv::Mat depth(24, 32, CV_32FC1, cv::Scalar(1.5F));
  depth.at<float>(0, 0) = 0.0F;
  depth.at<float>(0, 1) = std::numeric_limits<float>::quiet_NaN();
  depth.at<float>(0, 2) = 20.0F;  // beyond what 16 bits hold
  depth.at<float>(0, 3) = -1.0F;
  SequenceWriter writer(folder / "s");
  writer.add(1.0, kGray, depth);
  writer.add(1.04, kGray, depth);
  EXPECT_THROW(RgbdSequence(folder / "s"), Error) << "unfinished";
  writer.finish();
  const RgbdSequence sequence(folder / "s");
  ASSERT_EQ(sequence.frames().size(), 2U);
  EXPECT_EQ(sequence.frames()[1].timestamp_s, 1.04);
  EXPECT_EQ(sequence.frames_without_depth(), 0U);
  const RgbdSequence::Images images = sequence.read(1);
  EXPECT_EQ(cv::norm(images.gray, kGray, cv::NORM_INF), 0.0);
  EXPECT_FLOAT_EQ(images.depth.at<float>(5, 5), 1.5F);
  for (int column = 0; column < 4; ++column) EXPECT_EQ(images.depth.at<float>(0, column), 0.0F);
}

TEST(RgbdSequence, CountsFramesWithoutDepthAndDepthWithoutFrames) {
  const TemporaryFolder folder;
  folder.write("rgb.txt", "1 a.png\n2 b.png\n3 c.png\n");
  folder.write("depth.txt", "2.001 d.png\n5 e.png\n");
  const RgbdSequence sequence(folder.path());
  EXPECT_EQ(sequence.frames().size(), 3U);
  EXPECT_EQ(sequence.frames_without_depth(), 2U);
  EXPECT_EQ(sequence.unused_depth_images(), 1U);
  EXPECT_FALSE(sequence.frames()[0].depth);
  EXPECT_TRUE(sequence.frames()[1].depth);
}

TEST(RgbdSequence, NamesWhatIsMissingOrDoesNotFit) {
  const TemporaryFolder folder;
  EXPECT_THAT(message_of([&] { RgbdSequence(folder / "none"); }), HasSubstr("none: not a folder"));
  EXPECT_THAT(message_of([&] { RgbdSequence(folder.path()); }),
              HasSubstr("rgb.txt: cannot be read"));
  folder.write("rgb.txt", "1 a.png\n2 b.png\n");
  folder.write("depth.txt", "1 d.png\n");
  write_png(folder / "a.png", kGray);
  write_png(folder / "d.png", cv::Mat(10, 10, CV_16UC1, cv::Scalar(1)));
  const RgbdSequence sequence(folder.path());
  EXPECT_THAT(message_of([&] { sequence.read(0); }),
              HasSubstr("d.png: 10 x 10 pixels; expected 32 x 24"));
  EXPECT_THAT(message_of([&] { sequence.read(1); }), HasSubstr("b.png: cannot be read"));
  EXPECT_THAT(message_of([&] { sequence.read(2); }), HasSubstr("frame: 2 of 2"));
}

TEST(SequenceWriter, DoesNotOverwriteASequence) {
  const TemporaryFolder folder;
  SequenceWriter writer(folder / "s");
  writer.finish();
  EXPECT_THAT(message_of([&] { SequenceWriter(folder / "s"); }),
              HasSubstr("holds a sequence already"));
}

TEST(SequenceWriter, ListsFramesInTheOrderOfTimeHoweverTheyCame) {
  const TemporaryFolder folder;
  const cv::Mat depth(24, 32, CV_32FC1, cv::Scalar(1.5F));
  SequenceWriter writer(folder / "s", {.color_format = ColorFormat::kJpeg});
  std::thread other([&] {
    for (int i = 9; i > 0; i -= 2) writer.add(i, kGray, depth);
  });
  for (int i = 8; i > 0; i -= 2) writer.add(i, kGray, depth);
  other.join();
  writer.finish();
  const RgbdSequence sequence(folder / "s");
  ASSERT_EQ(sequence.frames().size(), 9U);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(sequence.frames()[i].timestamp_s, static_cast<double>(i + 1));
    EXPECT_EQ(sequence.frames()[i].color.extension(), ".jpg");
    EXPECT_NEAR(cv::mean(sequence.read(i).gray)[0], 50.0, 1.0);
  }
}

TEST(SequenceWriter, UnfinishedLeavesNothingOfItsOwn) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "s");
  folder.write("s/notes.txt", "mine");
  const cv::Mat depth(24, 32, CV_32FC1, cv::Scalar(1.5F));
  {
    SequenceWriter writer(folder / "s");
    writer.add(1.0, kGray, depth);
    SequenceWriter another(folder / "t");
    another.add(1.0, kGray, depth);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "t"));
  EXPECT_FALSE(std::filesystem::exists(folder / "s/rgb"));
  EXPECT_TRUE(std::filesystem::exists(folder / "s/notes.txt"));
}

TEST(SequenceWriter, RefusesATimeTwiceAndUnitsThatAreNone) {
  const TemporaryFolder folder;
  const cv::Mat depth(24, 32, CV_32FC1, cv::Scalar(1.5F));
  SequenceWriter writer(folder / "s");
  writer.add(1.0, kGray, depth);
  EXPECT_THAT(message_of([&] { writer.add(1.0, kGray, depth); }), HasSubstr("added before"));
  EXPECT_THAT(message_of([&] { SequenceWriter(folder / "t", {.depth_units_per_metre = 0.0}); }),
              HasSubstr("depth_units_per_metre"));
}

TEST(SequenceWriter, RefusesImagesThatDoNotGoTogether) {
  const TemporaryFolder folder;
  SequenceWriter writer(folder / "s");
  EXPECT_THROW(writer.add(1.0, kGray, cv::Mat(3, 3, CV_32FC1)), Error);
  EXPECT_THROW(writer.add(1.0, kGray, cv::Mat(24, 32, CV_16UC1)), Error);
}

TEST(RgbdSequence, ReadsTheBenchmark) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const RgbdSequence sequence(*data / "tum_fr1_desk");
  EXPECT_EQ(sequence.frames().size(), 613U);
  EXPECT_GT(sequence.frames_without_depth(), 17U) << "the first colour frames precede the depth";
  EXPECT_EQ(
      sequence.frames().size() - sequence.frames_without_depth() + sequence.unused_depth_images(),
      595U);
  const RgbdSequence::Images images = sequence.read(300);
  EXPECT_EQ(images.gray.size(), cv::Size(640, 480));
  EXPECT_GT(cv::countNonZero(images.depth), 640 * 480 / 2);
}

}  // namespace
}  // namespace cairn
