// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/tum_layout.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<ImageEntry> parsed(std::string_view text, const LogSink& log = {}) {
  MemoryReader reader(text, "rgb.txt");
  return read_image_list(reader, log);
}

std::string refusal(std::string_view text) {
  return testing::refusal(ErrorKind::kInput, [&] { parsed(text); });
}

std::vector<ImageEntry> at(const std::vector<double>& times) {
  std::vector<ImageEntry> entries;
  for (const double time : times) entries.push_back({time, "x.png"});
  return entries;
}

std::vector<int> depth_of(const std::vector<std::optional<std::size_t>>& pairs) {
  std::vector<int> result;
  for (const auto& depth : pairs) result.push_back(depth ? static_cast<int>(*depth) : -1);
  return result;
}

TEST(ImageList, TakesCommentsBlanksAndNamesWithSpaces) {
  EXPECT_THAT(parsed("# timestamp filename\n\n1.5 rgb/1.5.png\r\n  2\trgb/my image.png \n"),
              ElementsAre(ImageEntry{1.5, "rgb/1.5.png"}, ImageEntry{2.0, "rgb/my image.png"}));
}

TEST(ImageList, SortsWhatIsOutOfOrderAndSaysSo) {
  std::string remark;
  const auto log = [&](std::string_view text) { remark = text; };
  EXPECT_THAT(parsed("2 b\n1 a\n", log), ElementsAre(ImageEntry{1.0, "a"}, ImageEntry{2.0, "b"}));
  EXPECT_THAT(remark, HasSubstr("rgb.txt: the images are not in the order of time"));
}

TEST(ImageList, NamesLineAndFieldOfWhatItRefuses) {
  EXPECT_THAT(refusal("# nothing\n"), HasSubstr("rgb.txt: no images"));
  EXPECT_THAT(refusal("1 a\nx b\n"), HasSubstr("rgb.txt:2: field 1 (timestamp): 'x'"));
  EXPECT_THAT(refusal("1\n"), HasSubstr("rgb.txt:1: field 2 (file): missing"));
  EXPECT_THAT(refusal("1 ../a.png\n"), HasSubstr("leaves the sequence's folder"));
  EXPECT_THAT(refusal("1 /etc/passwd\n"), HasSubstr("leaves the sequence's folder"));
  EXPECT_THAT(refusal("1 a\n2 b\n1 c\n"), HasSubstr("rgb.txt:3: field 1 (timestamp)"));
}

TEST(AssociateImages, IsOneToOneTheClosestFirst) {
  // Both colour images are near the one depth image; the nearer gets it.
  EXPECT_THAT(depth_of(associate_images(at({1.0, 1.01}), at({1.008}), 0.02)), ElementsAre(-1, 0));
  EXPECT_THAT(depth_of(associate_images(at({1.0, 1.03, 1.06}), at({1.001, 1.031, 1.059}), 0.02)),
              ElementsAre(0, 1, 2));
}

TEST(AssociateImages, KeepsColourImagesWithoutDepth) {
  EXPECT_THAT(depth_of(associate_images(at({1.0, 2.0}), at({2.005, 9.0}), 0.02)),
              ElementsAre(-1, 0));
  EXPECT_THAT(depth_of(associate_images(at({1.0}), {}, 0.02)), ElementsAre(-1));
  EXPECT_THAT(associate_images({}, at({1.0}), 0.02), IsEmpty());
}

}  // namespace
}  // namespace cairn::detail
