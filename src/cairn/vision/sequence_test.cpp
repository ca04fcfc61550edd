// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/sequence.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/image.hpp"

#include "support/real_data.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::UnorderedElementsAre;

const ColorImage kColor(32, 24, 50);

std::string message_of(auto&& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename());
  }
  return names;
}

TEST(ImageSequence, ComesBackAsWritten) {
  const TemporaryFolder folder;
  DepthImage depth(32, 24, 1.5F);
  depth.at(0, 0) = 0.0F;
  depth.at(1, 0) = std::numeric_limits<float>::quiet_NaN();
  depth.at(2, 0) = 20.0F;  // beyond what 16 bits hold
  depth.at(3, 0) = -1.0F;
  SequenceWriter writer(folder / "s");
  writer.add(1.0, kColor, depth);
  writer.add(1.04, kColor, depth);
  EXPECT_THROW(ImageSequence(folder / "s"), Error) << "unfinished";
  writer.finish();
  const ImageSequence sequence(folder / "s");
  ASSERT_EQ(sequence.frames().size(), 2U);
  EXPECT_EQ(sequence.frames()[1].timestamp_s, 1.04);
  EXPECT_EQ(sequence.frames_without_depth(), 0U);
  const ImageSequence::Images images = sequence.read(1);
  EXPECT_EQ(images.gray, GrayImage(32, 24, 50));
  EXPECT_FLOAT_EQ(images.depth.at(5, 5), 1.5F);
  for (std::size_t column = 0; column < 4; ++column) EXPECT_EQ(images.depth.at(column, 0), 0.0F);
}

TEST(ImageSequence, CountsFramesWithoutDepthAndDepthWithoutFrames) {
  const TemporaryFolder folder;
  folder.write("rgb.txt", "1 a.png\n2 b.png\n3 c.png\n");
  folder.write("depth.txt", "2.001 d.png\n5 e.png\n");
  const ImageSequence sequence(folder.path());
  EXPECT_EQ(sequence.frames().size(), 3U);
  EXPECT_EQ(sequence.frames_without_depth(), 2U);
  EXPECT_EQ(sequence.unused_depth_images(), 1U);
  EXPECT_FALSE(sequence.frames()[0].depth);
  EXPECT_TRUE(sequence.frames()[1].depth);
}

TEST(ImageSequence, NamesWhatIsMissingOrDoesNotFit) {
  const TemporaryFolder folder;
  EXPECT_THAT(message_of([&] { ImageSequence(folder / "none"); }),
              HasSubstr("none: does not exist"));
  EXPECT_THAT(message_of([&] { ImageSequence(folder.path()); }), HasSubstr("holds no sequence"));
  folder.write("rgb.txt", "1 a.png\n2 b.png\n");
  folder.write("depth.txt", "1 d.png\n");
  write_png(folder / "a.png", kColor);
  write_png(folder / "d.png", StoredDepthImage(10, 10, 1));
  const ImageSequence sequence(folder.path());
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
  const DepthImage depth(32, 24, 1.5F);
  SequenceWriter writer(folder / "s", ColorFormat::kJpeg);
  std::thread other([&] {
    for (int i = 9; i > 0; i -= 2) writer.add(i, kColor, depth);
  });
  for (int i = 8; i > 0; i -= 2) writer.add(i, kColor, depth);
  other.join();
  writer.finish();
  const ImageSequence sequence(folder / "s");
  ASSERT_EQ(sequence.frames().size(), 9U);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(sequence.frames()[i].timestamp_s, static_cast<double>(i + 1));
    EXPECT_EQ(sequence.frames()[i].color.extension(), ".jpg");
    EXPECT_NEAR(sequence.read(i).gray.at(16, 12), 50.0, 1.0);
  }
}

TEST(SequenceWriter, UnfinishedLeavesNothingOfItsOwn) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "s");
  folder.write("s/notes.txt", "mine");
  const DepthImage depth(32, 24, 1.5F);
  {
    SequenceWriter writer(folder / "s");
    writer.add(1.0, kColor, depth);
    SequenceWriter another(folder / "t");
    another.add(1.0, kColor, depth);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "t"));
  EXPECT_FALSE(std::filesystem::exists(folder / "s/rgb"));
  EXPECT_TRUE(std::filesystem::exists(folder / "s/notes.txt"));
}

TEST(SequenceWriter, FailingItLeavesNothingOfItsOwn) {
  const TemporaryFolder folder;
  {
    SequenceWriter writer(folder / "s");
    writer.add(1.0, kColor, DepthImage(32, 24, 1.5F));
    writer.add_file("camera.yaml", [](const ByteSink& sink) { sink("mine"); });
    std::filesystem::create_directory(folder / "s/rgb.txt");  // cannot be written over
    EXPECT_THAT(message_of([&] { writer.finish(); }), HasSubstr("rgb.txt"));
    EXPECT_TRUE(std::filesystem::exists(folder / "s/depth.txt"));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "s"));
}

TEST(SequenceWriter, TakesOverWhatAKilledOneLeft) {
  const TemporaryFolder folder;
  const DepthImage depth(32, 24, 1.5F);
  std::filesystem::create_directories(folder / "s/rgb");
  folder.write("s/rgb/mine.png", "of the user");
  const auto killed = [&] {
    SequenceWriter writer(folder / "s");
    writer.add(1.0, kColor, depth);
    writer.add(2.0, kColor, depth);
    writer.add_file("groundtruth.txt", [](const ByteSink& sink) { sink("old"); });
    EXPECT_TRUE(SequenceWriter::is_unfinished(folder / "s"));
    std::_Exit(::testing::Test::HasFailure() ? 1 : 0);
  };
  EXPECT_EXIT(killed(), ::testing::ExitedWithCode(0), "");
  EXPECT_TRUE(SequenceWriter::is_unfinished(folder / "s"));
  {
    SequenceWriter writer(folder / "s");
    writer.add(3.0, kColor, depth);
    writer.finish();
  }
  EXPECT_FALSE(SequenceWriter::is_unfinished(folder / "s"));
  EXPECT_EQ(ImageSequence(folder / "s").frames().size(), 1U);
  EXPECT_THAT(names_in(folder / "s"), UnorderedElementsAre("rgb", "depth", "rgb.txt", "depth.txt"));
  EXPECT_THAT(names_in(folder / "s/rgb"), UnorderedElementsAre("mine.png", "3.000000.png"));
  EXPECT_THAT(names_in(folder / "s/depth"), UnorderedElementsAre("3.000000.png"));
  EXPECT_THROW(SequenceWriter(folder / "s"), Error);
}

TEST(SequenceWriter, LeavesTheFolderOfAWriterAtWorkAlone) {
  const TemporaryFolder folder;
  const DepthImage depth(32, 24, 1.5F);
  SequenceWriter first(folder / "s");
  first.add(1.0, kColor, depth);
  EXPECT_THAT(message_of([&] { SequenceWriter(folder / "s"); }),
              HasSubstr("another process is writing it"));
  first.add(2.0, kColor, depth);
  first.finish();
  EXPECT_EQ(ImageSequence(folder / "s").frames().size(), 2U);
  EXPECT_FALSE(ImageSequence(folder / "s").read(0).gray.empty());
}

TEST(SequenceWriter, RefusesATimeTwiceAndUnitsThatAreNone) {
  const TemporaryFolder folder;
  const DepthImage depth(32, 24, 1.5F);
  SequenceWriter writer(folder / "s");
  writer.add(1.0, kColor, depth);
  EXPECT_THAT(message_of([&] { writer.add(1.0, kColor, depth); }), HasSubstr("added before"));
  EXPECT_THAT(message_of([&] { SequenceWriter(folder / "t", ColorFormat::kPng, 0.0); }),
              HasSubstr("depth_units_per_metre"));
}

TEST(SequenceWriter, RefusesImagesThatDoNotGoTogether) {
  const TemporaryFolder folder;
  SequenceWriter writer(folder / "s");
  EXPECT_THROW(writer.add(1.0, kColor, DepthImage(3, 3)), Error);
  EXPECT_THROW(writer.add(1.0, kColor, DepthImage(32, 24, std::vector<float>{1.0F})), Error);
  EXPECT_THROW(writer.add(1.0, ColorImage(), DepthImage()), Error);
}

TEST(ImageSequence, ReadsTheBenchmark) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const ImageSequence sequence(*data / "tum_fr1_desk");
  EXPECT_EQ(sequence.frames().size(), 613U);
  EXPECT_GT(sequence.frames_without_depth(), 17U) << "the first colour frames precede the depth";
  EXPECT_EQ(
      sequence.frames().size() - sequence.frames_without_depth() + sequence.unused_depth_images(),
      595U);
  const ImageSequence::Images images = sequence.read(300);
  EXPECT_EQ(images.gray.width, 640U);
  EXPECT_EQ(images.gray.height, 480U);
  EXPECT_GT(std::count_if(images.depth.values.begin(), images.depth.values.end(),
                          [](float depth_m) { return depth_m > 0.0F; }),
            640 * 480 / 2);
}

}  // namespace
}  // namespace cairn
