// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/map_file.hpp"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::refusal;
using testing::TemporaryFolder;

LandmarkMap map_at(double x) {
  MapTables tables;
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{x, 0, 0}};
  return LandmarkMap(std::move(tables));
}

// A format whose files start with "DOTS", several maps a file, and whose folders hold a file "dots".
MapFormat dots() {
  return {.name = "dots",
          .title = "Dots",
          .endings = {".dots", "/"},
          .is_folder = true,
          .holds_several = true,
          .recognises =
              [](const MapInput& input) {
                return input.source == nullptr ? std::filesystem::exists(input.path / "dots")
                                               : input.first_bytes.starts_with("DOTS");
              },
          .read =
              [](const MapInput& input, const Execution&) {
                if (input.source == nullptr) return map_at(-1);
                EXPECT_EQ(read_all(*input.source).substr(0, 4), "DOTS");
                return map_at(std::stod(input.part.value_or("0")));
              }};
}

double x_of(const LandmarkMap& map) {
  return map.landmarks().positions.at(0).x();
}

TEST(FormatRegistry, ListsWhatTheNativeFormatsAre) {
  EXPECT_EQ(native_formats().endings_text(), ".map, .txt, .cairn, .ply or .pcd");
  EXPECT_EQ(native_formats().written_names_text(), "text, binary, ply or pcd");
  EXPECT_EQ(native_formats().format_of_ending("a/b.pcd")->name, "pcd");
  EXPECT_EQ(native_formats().format_of_ending("a/b.jpg"), nullptr);
  EXPECT_EQ(native_formats().format_of_ending(".map"), nullptr) << "a hidden file, no extension";
  EXPECT_EQ(native_formats().format_of_ending("a.map/"), nullptr);
}

TEST(FormatRegistry, EachNativeFormatIsReadBackByItsContent) {
  const TemporaryFolder folder;
  for (const MapFormat& format : native_formats().formats()) {
    SCOPED_TRACE(format.name);
    native_formats().write(testing::full_map(), folder / "map",
                           {.format = format.name, .double_precision = true});
    const LandmarkMap back = native_formats().read(folder / "map");
    EXPECT_EQ(back.landmark_count(), testing::full_map().landmark_count());
    EXPECT_EQ(back.frame_count() > 0, format.holds_frames);
  }
}

TEST(FormatRegistry, PointCloudsSayWhatTheyCannotHold) {
  MapTables tables;
  tables.info.length_unit = LengthUnit::kMetres;
  tables.landmarks.ids = {LandmarkId{1}};
  tables.landmarks.positions = {{1, 2, 3}};
  tables.landmarks.descriptors = DescriptorColumn{"ORB", 2, {1}, {1, 2}};
  const LandmarkMap map(std::move(tables));
  for (const char* const name : {"ply", "pcd"}) {
    std::string remark;
    Execution execution;
    execution.log = [&](const Remark& said) {
      EXPECT_EQ(said.kind, RemarkKind::kLoss);
      remark = said.text;
    };
    native_formats().find(name)->write_to(
        map, [](std::string_view) {}, {}, execution);
    EXPECT_THAT(remark, HasSubstr("has no place for: descriptors"));
  }
}

TEST(FormatRegistry, PointCloudsKeepTheUnitOfLength) {
  const TemporaryFolder folder;
  for (const LengthUnit unit : {LengthUnit::kMetres, LengthUnit::kFree}) {
    MapTables tables;
    tables.info.length_unit = unit;
    tables.landmarks.ids = {LandmarkId{0}};
    tables.landmarks.positions = {{1, 2, 3}};
    const LandmarkMap map(std::move(tables));
    for (const char* const name : {"map.ply", "map.pcd"}) {
      for (const bool ascii : {false, true}) {
        const LogSink log = [&](const Remark& said) { ADD_FAILURE() << said.text; };
        native_formats().write(map, folder / name, {.ascii = ascii}, {.log = log});
        EXPECT_EQ(native_formats().read(folder / name).info().length_unit, unit) << name;
      }
    }
  }
}

TEST(FormatRegistry, IsExtendedAsAValue) {
  const TemporaryFolder folder;
  const auto file = folder.write("a.txt", "DOTS and more than eight bytes");
  const FormatRegistry more = native_formats().extended_by({dots()});
  EXPECT_EQ(x_of(more.read(file)), 0.0);
  EXPECT_THAT(
      refusal(ErrorKind::kInput, [&] { native_formats().read(file); }),
      HasSubstr("a.txt: is in no known map format: it begins with 'DOTS and more than eight "
                "bytes'; expected Cairn text, Cairn binary, PLY or PCD"));
  EXPECT_THAT(
      refusal(ErrorKind::kInput, [&] { native_formats().read(folder.write("a.map", "DOTS and")); }),
      HasSubstr("a.map:1: unknown record 'DOTS'"))
      << "its name says what it is";
  EXPECT_EQ(native_formats().formats().size() + 1, more.formats().size());
  EXPECT_THAT(refusal(ErrorKind::kMisuse, [&] { (void)more.extended_by({dots()}); }),
              HasSubstr("map format 'dots': is there twice"));
}

TEST(FormatRegistry, FoldersAreReadByFormatsThatKnowThem) {
  const TemporaryFolder folder;
  const FormatRegistry more = native_formats().extended_by({dots()});
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { more.read(folder.path()); }),
              HasSubstr(folder.path().string()));
  folder.write("dots", "");
  EXPECT_EQ(x_of(more.read(folder.path())), -1.0);
}

TEST(FormatRegistry, NamesThePointerOfGitInsteadOfItsDefects) {
  const TemporaryFolder folder;
  const std::string pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n";
  const auto message = [&](const std::filesystem::path& path) {
    return refusal(ErrorKind::kInput, [&] { native_formats().read(path); });
  };
  for (const char* const name : {"a.map", "a.ply", "a.bin"}) {
    EXPECT_THAT(
        message(folder.write(name, pointer)),
        HasSubstr("is a Git LFS pointer, not the file itself; expected the file itself: run "
                  "'git lfs pull'"));
  }
  // Also a file of a folder, which a reader finds damaged.
  MapFormat of_folders = dots();
  of_folders.read = [](const MapInput& input, const Execution&) -> LandmarkMap {
    throw Error(ErrorKind::kInput, (input.path / "dots").string() + ": byte 0", "is damaged", "");
  };
  const FormatRegistry more = native_formats().extended_by({of_folders});
  std::filesystem::create_directory(folder / "b");
  folder.write("b/dots", pointer);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { more.read(folder / "b"); }),
              HasSubstr("b/dots: is a Git LFS pointer"));
  folder.write("b/dots", "other");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { more.read(folder / "b"); }),
              HasSubstr("b/dots: byte 0: is damaged"));
}

TEST(FormatRegistry, PartNamesOneMapOfSeveral) {
  const TemporaryFolder folder;
  const FormatRegistry more = native_formats().extended_by({dots()});
  folder.write("a.txt", "DOTS");
  EXPECT_EQ(x_of(more.read(folder / "a.txt#3")), 3.0);
  folder.write("a.txt#3", "DOTS");
  EXPECT_EQ(x_of(more.read(folder / "a.txt#3")), 0.0) << "a file of that very name";
  write_map(map_at(5), folder / "b.map");
  EXPECT_THAT(
      refusal(ErrorKind::kInput, [&] { more.read(folder / "b.map#1"); }),
      HasSubstr("b.map#1: a map in format Cairn text is one map, not several; expected a path "
                "without '#1'"));
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { more.read(folder / "absent#1"); }),
              HasSubstr("absent: "));
}

TEST(FormatRegistry, SaysWhatAFolderIsThatIsNoMap) {
  const TemporaryFolder folder;
  const auto message = [&] {
    return refusal(ErrorKind::kInput, [&] { native_formats().read(folder.path()); });
  };
  EXPECT_THAT(message(),
              HasSubstr("is a folder, but no map in a format of Cairn's own; expected a map "
                        "file; all_formats().read() of cairn::foreign_formats"));
  folder.write("a.map", "");
  folder.write("b.cairn", "");
  folder.write("notes.txt", "");
  EXPECT_THAT(message(), HasSubstr("is a folder; it holds 2 files with the ending of a map; "
                                   "expected the path of one map, such as " +
                                   (folder / "a.map").string()));
}

TEST(FormatRegistry, RefusesToWriteWhatItCannot) {
  const TemporaryFolder folder;
  const FormatRegistry more = native_formats().extended_by({dots()});
  EXPECT_THAT(
      refusal(ErrorKind::kMisuse, [&] { more.write(map_at(1), folder / "a.jpg"); }),
      HasSubstr("the extension '.jpg' names no map format; expected .map, .txt, .cairn, .ply, "
                ".pcd, .dots or / (Dots)"));
  EXPECT_THAT(refusal(ErrorKind::kMisuse, [&] { more.write(map_at(1), folder / "a.dots"); }),
              HasSubstr("names no map format"));
  EXPECT_THAT(
      refusal(ErrorKind::kMisuse,
              [&] { more.write(map_at(1), folder / "a.map", {.format = "dots"}); }),
      HasSubstr(
          "'dots' names no map format that can be written; expected text, binary, ply or pcd"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace cairn
