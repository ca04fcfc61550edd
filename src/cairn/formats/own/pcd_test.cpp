// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/point_clouds.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using testing::expect_same_landmarks;
using ::testing::HasSubstr;
using testing::peak_memory_kb;
using testing::Pipe;
using testing::same_bits;

constexpr double kPcdNan = std::numeric_limits<double>::quiet_NaN();

MapTables rich_pcd_tables() {
  return testing::rich_tables(LandmarkId{18446744073709551615U});
}

LandmarkMap read_pcd_text(std::string_view bytes, const Execution& execution = {}) {
  MemoryReader source(bytes, "test.pcd");
  return read_pcd(source, execution);
}

std::string pcd_text(const LandmarkMap& map, bool ascii) {
  std::string bytes;
  write_pcd(map, [&](std::string_view piece) { bytes += piece; },
            {.ascii = ascii, .double_precision = true});
  return bytes;
}

// The message with which `bytes` are refused; empty if they are not.
std::string pcd_refusal(std::string_view bytes) {
  return testing::refusal(ErrorKind::kInput, [&] { read_pcd_text(bytes); });
}

// PCD data is little-endian.
template <class T>
void put_pcd(std::string& bytes, T value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (std::endian::native == std::endian::big) std::reverse(raw, raw + sizeof value);
  bytes.append(raw, sizeof value);
}

// A header as PCL writes it.
std::string header(std::string_view fields, std::string_view sizes, std::string_view types,
                   std::string_view counts, std::string_view points, std::string_view data) {
  std::string text = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n";
  for (const auto& [name, value] : {std::pair<std::string, std::string_view>{"FIELDS", fields},
                                    {"SIZE", sizes},
                                    {"TYPE", types},
                                    {"COUNT", counts},
                                    {"WIDTH", points},
                                    {"HEIGHT", "1"},
                                    {"VIEWPOINT", "0 0 0 1 0 0 0"},
                                    {"POINTS", points},
                                    {"DATA", data}}) {
    text.append(name).append(" ").append(value).append("\n");
  }
  return text;
}

std::string xyz_header(std::string_view points, std::string_view data) {
  return header("x y z", "4 4 4", "F F F", "1 1 1", points, data);
}

TEST(Pcd, RoundTripKeepsEveryColumnBitExact) {
  const LandmarkMap map(rich_pcd_tables());
  for (const bool ascii : {false, true}) {
    const LandmarkMap back = read_pcd_text(pcd_text(map, ascii));
    expect_same_landmarks(map, back);
    EXPECT_EQ(back.landmarks().columns.size(), 2U);
    EXPECT_FALSE(back.has_observations());
  }
}

TEST(Pcd, WritesAHeaderThatOthersUnderstand) {
  const std::string bytes = pcd_text(LandmarkMap(rich_pcd_tables()), true);
  const std::size_t size = bytes.find("DATA ascii\n");
  EXPECT_EQ(bytes.substr(0, size),
            "# .PCD v0.7 - Point Cloud Data file format\n# cairn length_unit metres\nVERSION 0.7\n"
            "FIELDS x y z cov_xx cov_xy cov_xz cov_yy cov_yz cov_zz rgb id confidence w\n"
            "SIZE 8 8 8 8 8 8 8 8 8 4 8 8 8\nTYPE F F F F F F F F F U U F F\n"
            "COUNT 1 1 1 1 1 1 1 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
            "POINTS 3\n");
  // 0x00RRGGBB of the first colour, (255, 0, 1).
  EXPECT_THAT(bytes, HasSubstr(" 16711681 7 0.1 -0\n"));
}

TEST(Pcd, EmptyMapSurvives) {
  for (const bool ascii : {false, true}) {
    EXPECT_EQ(read_pcd_text(pcd_text(LandmarkMap(), ascii)).landmark_count(), 0U);
  }
}

TEST(Pcd, ReadsEveryTypeInEveryEncoding) {
  const std::string head_fields = "x y z i1 u1 i2 u2 i4 u4 i8 u8 f4 f8";
  for (const std::string encoding : {"ascii", "binary"}) {
    std::string file = header(head_fields, "8 4 2 1 1 2 2 4 4 8 8 4 8", "F F I I U I U I U I U F F",
                              "1 1 1 1 1 1 1 1 1 1 1 1 1", "1", encoding);
    if (encoding == "ascii") {
      file +=
          "0.1 1.5 -3 -128 255 -32768 65535 -2147483648 4294967295 -9007199254740992 "
          "9007199254740992 -0.25 -nan\n";
    } else {
      put_pcd(file, 0.1);
      put_pcd(file, 1.5F);
      put_pcd(file, std::int16_t{-3});
      put_pcd(file, std::int8_t{-128});
      put_pcd(file, std::uint8_t{255});
      put_pcd(file, std::int16_t{-32768});
      put_pcd(file, std::uint16_t{65535});
      put_pcd(file, std::numeric_limits<std::int32_t>::min());
      put_pcd(file, std::uint32_t{4294967295U});
      put_pcd(file, std::int64_t{-9007199254740992});
      put_pcd(file, std::uint64_t{9007199254740992});
      put_pcd(file, -0.25F);
      put_pcd(file, kPcdNan);
    }
    const LandmarkMap map = read_pcd_text(file);
    ASSERT_EQ(map.landmark_count(), 1U);
    EXPECT_EQ(map.landmarks().positions[0], Eigen::Vector3d(0.1, 1.5, -3));
    const std::vector<std::pair<const char*, double>> expected = {{"i1", -128},
                                                                  {"u1", 255},
                                                                  {"i2", -32768},
                                                                  {"u2", 65535},
                                                                  {"i4", -2147483648.0},
                                                                  {"u4", 4294967295.0},
                                                                  {"i8", -9.007199254740992e15},
                                                                  {"u8", 9.007199254740992e15},
                                                                  {"f4", -0.25},
                                                                  {"f8", kPcdNan}};
    for (const auto& [name, value] : expected) {
      ASSERT_NE(map.column(name), nullptr) << name;
      EXPECT_TRUE(same_bits(map.column(name)->values[0], value)) << encoding << name;
    }
  }
}

TEST(Pcd, ReadsPackedColoursOfEitherType) {
  // The bits of the second are those of a signalling NaN, which a detour over double would change.
  const std::uint32_t packed_colors[] = {0x00c88028, 0xff8001feU, 0x00000000};
  for (const std::string name : {"rgb", "rgba"}) {
    for (const std::string type : {"U", "F", "I"}) {
      std::string file =
          header("x y z " + name, "4 4 4 4", "F F F " + type, "1 1 1 1", "3", "binary");
      for (const std::uint32_t packed : packed_colors) {
        for (const float value : {1.0F, 2.0F, 3.0F}) put_pcd(file, value);
        put_pcd(file, packed);
      }
      EXPECT_THAT(read_pcd_text(file).landmarks().colors,
                  ElementsAre(Color{0xc8, 0x80, 0x28}, Color{0x80, 0x01, 0xfe}, Color{0, 0, 0}))
          << name << type;
    }
  }
  const std::string body_of_floats = "1 2 3 1.8413073e-38\n1 2 3 nan\n1 2 3 0\n";
  const LandmarkMap floats = read_pcd_text(
      header("x y z rgb", "4 4 4 4", "F F F F", "1 1 1 1", "3", "ascii") + body_of_floats);
  EXPECT_THAT(floats.landmarks().colors,
              ElementsAre(Color{0xc8, 0x80, 0x28}, std::nullopt, Color{0, 0, 0}));
  const LandmarkMap integers = read_pcd_text(
      header("x y z rgb", "4 4 4 4", "F F F U", "1 1 1 1", "1", "ascii") + "1 2 3 13139968\n");
  EXPECT_THAT(integers.landmarks().colors, ElementsAre(Color{0xc8, 0x80, 0x00}));
  // A number of eight bytes is no packed colour.
  const LandmarkMap wide = read_pcd_text(
      header("x y z rgb", "4 4 4 8", "F F F F", "1 1 1 1", "1", "ascii") + "1 2 3 0.5\n");
  EXPECT_TRUE(wide.landmarks().colors.empty());
  EXPECT_THAT(wide.column("rgb")->values, ElementsAre(0.5));
  // Its name stays its own when the map is written: no other field is a colour then.
  const LandmarkMap both =
      read_pcd_text(header("x y z rgb rgba red green blue", "4 4 4 8 4 1 1 1", "F F F F U U U U",
                           "1 1 1 1 1 1 1 1", "1", "ascii") +
                    "1 2 3 0.5 9 1 1 1\n");
  EXPECT_TRUE(both.landmarks().colors.empty());
  expect_same_landmarks(both, read_pcd_text(pcd_text(both, false)));
  // Neither are separate channels lost.
  const LandmarkMap channels = read_pcd_text(
      header("x y z red green blue", "4 4 4 1 1 1", "F F F U U U", "1 1 1 1 1 1", "1", "ascii") +
      "1 2 3 4 5 6\n");
  EXPECT_THAT(channels.landmarks().colors, ElementsAre(Color{4, 5, 6}));
}

TEST(Pcd, PassesOverPaddingAndFieldsOfManyValues) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const auto head = [](const std::string& data) {
    return header("_ x y z _ descriptor n", "1 4 4 4 1 4 2", "U F F F U F U", "3 1 1 1 4 2 1", "2",
                  data);
  };
  std::string binary = head("binary");
  for (const float offset : {0.0F, 10.0F}) {
    binary += "abc";
    for (const float value : {1.0F, 2.0F, 3.0F}) put_pcd(binary, value + offset);
    binary += "defg";
    for (const float value : {0.5F, 0.25F}) put_pcd(binary, value);
    put_pcd(binary, static_cast<std::uint16_t>(offset));
  }
  const std::string ascii =
      head("ascii") + "0 0 0 1 2 3 0 0 0 0 0.5 0.25 0\n0 0 0 11 12 13 0 0 0 0 0.5 0.25 10\n";
  for (const std::string& file : {binary, ascii}) {
    const LandmarkMap map = read_pcd_text(file, execution);
    ASSERT_EQ(map.landmark_count(), 2U);
    EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(11, 12, 13));
    ASSERT_EQ(map.landmarks().columns.size(), 1U);
    EXPECT_THAT(map.column("n")->values, ElementsAre(0, 10));
  }
  EXPECT_THAT(remarks.texts, ::testing::Each(HasSubstr("field 'descriptor' left out")));
  EXPECT_EQ(remarks.texts.size(), 2U);
}

TEST(Pcd, LeavesOutPointsWithoutAFinitePosition) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const LandmarkMap map =
      read_pcd_text(header("x y z id", "4 4 4 8", "F F F U", "1 1 1 1", "3", "ascii") +
                        "nan nan nan 5\n1 2 3 18446744073709551615\n1 inf 3 5\n",
                    execution);
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{18446744073709551615U}));
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("test.pcd: 2 of 3 landmarks left out")));
}

TEST(Pcd, TakesOlderHeadersAndTellsOfAViewpoint) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const LandmarkMap old = read_pcd_text(
      "# .PCD v.5 - Point Cloud Data file format\r\nVERSION .5\r\nCOLUMNS x y z\r\nSIZE 4 4 4\r\n"
      "TYPE F F F\r\nWIDTH 2\r\nHEIGHT 1\r\nDATA ascii\r\n1 2 3\r\n4 5 6\r\n",
      execution);
  EXPECT_EQ(old.landmark_count(), 2U);
  EXPECT_TRUE(remarks.texts.empty());
  const LandmarkMap moved = read_pcd_text(
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n# a remark\nWIDTH 1\n"
      "HEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2 3\n",
      execution);
  EXPECT_EQ(moved.landmarks().positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("test.pcd:9: the VIEWPOINT is not applied")));
  EXPECT_EQ(read_pcd_text(
                "VERSION 0.6\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n")
                .landmark_count(),
            1U);
}

// Compressed data of `size` bytes, with the sizes in front.
std::string compressed_block(const std::string& instructions, std::uint32_t size) {
  std::string bytes;
  put_pcd(bytes, static_cast<std::uint32_t>(instructions.size()));
  put_pcd(bytes, size);
  return bytes + instructions;
}

// Twelve points, field by field: x 1.0, y 1.0 and z 2.0 throughout.
std::string compressed_points() {
  std::string one;
  put_pcd(one, 1.0F);
  std::string two;
  put_pcd(two, 2.0F);
  std::string instructions;
  instructions += '\x03';  // four bytes as they are
  instructions += one;
  // 92 bytes from distance 4: all ones, 83 more than 9, over what is written on the way.
  instructions += '\xe0';
  instructions += '\x53';
  instructions += '\x03';
  instructions += '\x03';
  instructions += two;
  instructions += '\x80';  // 6 bytes from distance 4
  instructions += '\x03';
  instructions += '\xe0';  // 38 bytes from distance 8
  instructions += '\x1d';
  instructions += '\x07';
  return instructions;
}

TEST(Pcd, ReadsCompressedData) {
  const LandmarkMap map = read_pcd_text(xyz_header("12", "binary_compressed") +
                                        compressed_block(compressed_points(), 144));
  ASSERT_EQ(map.landmark_count(), 12U);
  for (const auto& position : map.landmarks().positions) {
    EXPECT_EQ(position, Eigen::Vector3d(1, 1, 2));
  }
}

TEST(Pcd, BinaryDataMayBeFilledUpWithAPageOfZeros) {
  for (const std::string& file :
       {xyz_header("12", "binary_compressed") + compressed_block(compressed_points(), 144),
        xyz_header("12", "binary") + std::string(144, '\0')}) {
    EXPECT_EQ(read_pcd_text(file + std::string(4096, '\0')).landmark_count(), 12U);
    EXPECT_EQ(read_pcd_text(file + std::string(65536, '\0')).landmark_count(), 12U);
    EXPECT_THAT(pcd_refusal(file + std::string(65537, '\0')), HasSubstr("more data"));
    EXPECT_THAT(pcd_refusal(file + std::string(50, '\0') + 'a'),
                HasSubstr("test.pcd: byte " + std::to_string(file.size() + 50) + ": more data"));
  }
}

TEST(Pcd, SaysThatLineEndsFollowTheData) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  for (const std::string& file :
       {xyz_header("12", "binary_compressed") + compressed_block(compressed_points(), 144),
        xyz_header("12", "binary") + std::string(144, '\0')}) {
    remarks.clear();
    EXPECT_EQ(read_pcd_text(file + "\r\n", execution).landmark_count(), 12U);
    EXPECT_THAT(remarks.losses,
                ElementsAre(HasSubstr("test.pcd: byte " + std::to_string(file.size()) +
                                      ": 2 bytes after the data")));
    EXPECT_THAT(pcd_refusal(file + "\n1"), HasSubstr("more data"));
  }
  EXPECT_EQ(remarks.texts, remarks.losses);
}

TEST(Pcd, SaysThatTheLastLineDoesNotEnd) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  EXPECT_EQ(read_pcd_text(xyz_header("2", "ascii") + "1 2 3\n4 5 6", execution).landmark_count(),
            2U);
  EXPECT_THAT(remarks.losses, ElementsAre(HasSubstr("test.pcd:13: the last line does not end")));
  EXPECT_EQ(remarks.texts, remarks.losses);
}

TEST(Pcd, TakesThePointsOfAHeaderWithoutAnArea) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const std::string head =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 0\nHEIGHT 0\nPOINTS 2\nDATA "
      "binary\n";
  EXPECT_EQ(read_pcd_text(head + std::string(24, '\0'), execution).landmark_count(), 2U);
  EXPECT_THAT(remarks.texts,
              ElementsAre(HasSubstr("test.pcd:7: WIDTH times HEIGHT is 0; POINTS, 2")));
  EXPECT_THAT(pcd_refusal(head + std::string(12, '\0')), HasSubstr("ends after 1 of 2 points"));
  EXPECT_THAT(pcd_refusal(head + std::string(36, '\0') + 'x'), HasSubstr("more data"));
  EXPECT_TRUE(remarks.losses.empty()) << "nothing is left out";
}

TEST(Pcd, LeavesOutPointsThatAreTooFarAway) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const LandmarkMap map =
      read_pcd_text(xyz_header("2", "ascii") + "1 2 3\n-1.687745e+09 -213.4 -1.5e-11\n", execution);
  EXPECT_EQ(map.landmark_count(), 1U);
  EXPECT_THAT(remarks.losses, ElementsAre(HasSubstr("1 of 2 landmarks left out")));
}

TEST(Pcd, StatesItsUnitOrHasNone) {
  EXPECT_EQ(read_pcd_text(xyz_header("0", "ascii")).info().length_unit, LengthUnit::kFree);
  EXPECT_EQ(
      read_pcd_text("# cairn length_unit metres\n" + xyz_header("0", "ascii")).info().length_unit,
      LengthUnit::kMetres);
  // Cairn once stated free scales only.
  const auto unit_of = [](std::string_view fields, std::string_view types) {
    return read_pcd_text(header(fields, "4 4 4 4 4", types, "1 1 1 1 1", "0", "ascii"))
        .info()
        .length_unit;
  };
  EXPECT_EQ(unit_of("x y z observations id", "F F F U U"), LengthUnit::kMetres);
  EXPECT_EQ(unit_of("x y z observations id", "F F F F U"), LengthUnit::kFree);
  EXPECT_EQ(unit_of("x y z observations w", "F F F U U"), LengthUnit::kFree);
}

TEST(Pcd, CompressedDataMayHoldPaddingOrNot) {
  const std::string head = header("x y z _ pair n", "4 4 4 1 1 2", "F F F U U U", "1 1 1 4 2 1",
                                  "2", "binary_compressed");
  for (const bool has_padding : {false, true}) {
    std::string bytes;
    for (const float value : {1.0F, 4.0F, 2.0F, 5.0F, 3.0F, 6.0F}) put_pcd(bytes, value);
    if (has_padding) bytes += "________";
    bytes += "aabb";
    put_pcd(bytes, std::uint16_t{7});
    put_pcd(bytes, std::uint16_t{8});
    // As they are: no more than 32 at once.
    std::string instructions;
    for (std::size_t i = 0; i < bytes.size(); i += 32) {
      const std::string part = bytes.substr(i, 32);
      instructions += static_cast<char>(part.size() - 1);
      instructions += part;
    }
    const LandmarkMap map = read_pcd_text(
        head + compressed_block(instructions, static_cast<std::uint32_t>(bytes.size())));
    ASSERT_EQ(map.landmark_count(), 2U);
    EXPECT_EQ(map.landmarks().positions[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(4, 5, 6));
    EXPECT_THAT(map.column("n")->values, ElementsAre(7, 8));
  }
}

TEST(Pcd, RefusesMalformedCompressedData) {
  const std::string head = xyz_header("12", "binary_compressed");
  const std::string good = compressed_points();
  const auto at = [&](std::size_t offset) {
    return "test.pcd: byte " + std::to_string(head.size() + offset) + ": ";
  };
  const std::string size_144 = compressed_block(good, 144);
  EXPECT_EQ(pcd_refusal(head + size_144), "");
  EXPECT_THAT(pcd_refusal(head), HasSubstr(at(0) + "the file ends before the compressed data"));
  EXPECT_THAT(pcd_refusal(head + size_144 + "x"),
              HasSubstr(at(8 + good.size()) + "more data than the header announces"));
  EXPECT_THAT(pcd_refusal(head + compressed_block(good, 145)),
              HasSubstr(at(4) + "an uncompressed size of 145 bytes; expected 12 points of 12"));
  EXPECT_THAT(pcd_refusal(head + size_144.substr(0, 20)),
              HasSubstr(at(20) + "the file ends after 12 bytes of compressed data"));
  // Literals and references that are cut off.
  for (const char* const cut : {"\5ab", "\40", "\340\1"}) {
    EXPECT_THAT(pcd_refusal(head + compressed_block(std::string(good).append(cut), 144)),
                HasSubstr(at(8 + good.size()) + "the compressed data ends within an instruction"));
  }
  EXPECT_THAT(pcd_refusal(head + compressed_block(std::string("\x00"
                                                              "a\x20\x01",
                                                              4),
                                                  144)),
              HasSubstr(at(10) + "the compressed data refers to before its start"));
  EXPECT_THAT(pcd_refusal(head + compressed_block(good + std::string("\x20\x00", 2), 144)),
              HasSubstr(at(8 + good.size()) + "the compressed data holds more than announced"));
  EXPECT_THAT(pcd_refusal(head + compressed_block(good + std::string("\x00x", 2), 144)),
              HasSubstr("the compressed data holds more than announced"));
  EXPECT_THAT(pcd_refusal(head + compressed_block(good.substr(0, good.size() - 3), 144)),
              HasSubstr(at(8 + good.size() - 3) + "the compressed data holds less than announced"));
  EXPECT_THAT(pcd_refusal(xyz_header("300000000", "binary_compressed") +
                          compressed_block(good, 3600000000U)),
              HasSubstr("at most 88 times as many"));
  EXPECT_EQ(pcd_refusal(xyz_header("0", "binary_compressed") + compressed_block("", 0)), "");
}

TEST(Pcd, RefusesMalformedInput) {
  struct Case {
    std::string file;
    std::vector<std::string> fragments;
  };
  const std::string top = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
  const std::string one = xyz_header("1", "ascii");
  const std::vector<Case> cases = {
      {"", {"test.pcd:1:", "ends within its header", "DATA"}},
      {"VERSION 0.7\nFIELDS x", {"test.pcd:2:", "ends within its header"}},
      {"VERSION 0.8\n", {"test.pcd:1:", "PCD version '0.8'", "0.7 or older"}},
      {"VERSION\n", {"test.pcd:1:", "0 values", "the version"}},
      {"VERSION 0.7\nBOGUS 1\n", {"test.pcd:2:", "unknown entry 'BOGUS'"}},
      {top + "FIELDS a\n", {"test.pcd:6:", "FIELDS stands above already"}},
      {"FIELDS x y x\n", {"test.pcd:1:", "'x' occurs twice"}},
      {"SIZE 4 4 4\n", {"test.pcd:1:", "no FIELDS"}},
      {"FIELDS x y z\nSIZE 4 4\n", {"test.pcd:2:", "2 values", "3, one a field"}},
      {"FIELDS x y z\nSIZE 4 4 3\n", {"test.pcd:2:", "3 bytes for field 'z'"}},
      {"FIELDS x y z\nSIZE 4 a 4\n", {"test.pcd:2:", "value 2 ('a')", "unsigned integer"}},
      {"FIELDS x y z\nTYPE F F Q\n", {"test.pcd:2:", "type 'Q' for field 'z'", "I, U, F or B"}},
      {"FIELDS x y z\nCOUNT 1 1 0\n", {"test.pcd:2:", "a count of 0 for field 'z'"}},
      {"FIELDS x y z\nCOUNT 1 1 4294967296\n", {"test.pcd:2:", "'4294967296'", "2^32"}},
      {"FIELDS x y z\nSIZE 4 4 2\nTYPE F F F\nPOINTS 0\nDATA ascii\n",
       {"test.pcd:3:", "type F with 2 bytes for field 'z'"}},
      {"FIELDS x y z\nTYPE F F F\nPOINTS 0\nDATA ascii\n", {"test.pcd:4:", "no SIZE above DATA"}},
      {"FIELDS x y i\nSIZE 4 4 4\nTYPE F F F\nPOINTS 0\nDATA ascii\n",
       {"test.pcd:1:", "no scalar field 'z'"}},
      {"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 2\nPOINTS 0\nDATA ascii\n",
       {"test.pcd:1:", "no scalar field 'z'"}},
      {top + "WIDTH 2 3\n", {"test.pcd:6:", "2 values", "1, the number of points"}},
      {top + "WIDTH -2\n", {"test.pcd:6:", "'-2'"}},
      {top + "WIDTH 1000000000000000000\n", {"test.pcd:6:", "2^32"}},
      {top + "WIDTH 4294967295\nHEIGHT 4294967295\nDATA ascii\n",
       {"test.pcd:8:", "18446744065119617025 points", "2^32"}},
      {top + "WIDTH 2\nHEIGHT 3\nPOINTS 5\nDATA ascii\n",
       {"test.pcd:8:", "5 points", "WIDTH times HEIGHT, 6"}},
      {top + "DATA ascii\n", {"test.pcd:6:", "neither WIDTH nor POINTS"}},
      {top + "VIEWPOINT 0 0 0\n", {"test.pcd:6:", "3 values", "qw"}},
      {top + "VIEWPOINT 0 0 0 1 0 0 a\n", {"test.pcd:6:", "value 7 ('a') is not a number"}},
      {top + "POINTS 0\nDATA text\n", {"test.pcd:7:", "unknown kind of data 'text'"}},
      {one, {"test.pcd:11:", "ends after 0 of 1 points"}},
      {one + "1 2", {"test.pcd:12: field 3 (z)", "missing"}},
      {one + "1 2\n", {"test.pcd:12: field 3 (z)", "missing"}},
      {one + "1 abc 3\n", {"test.pcd:12: field 2 (y)", "'abc' is not a number"}},
      {one + "1 2 3 4\n", {"test.pcd:12: field 4", "'4' is too much"}},
      {one + "1 2 3\n4 5 6\n", {"test.pcd:13:", "'4 5 6' is more"}},
      {header("x y z rgb", "4 4 4 4", "F F F F", "1 1 1 1", "1", "ascii") + "1 2 3 1e60\n",
       {"test.pcd:12: field 4 (rgb)", "'1e60' is no colour"}},
      {header("x y z rgb", "4 4 4 4", "F F F U", "1 1 1 1", "1", "ascii") + "1 2 3 4294967296\n",
       {"test.pcd:12: field 4 (rgb)", "an integer from 0 to 4294967295"}},
      {header("x y z d", "4 4 4 4", "F F F F", "1 1 1 4294967295", "1", "ascii") + "1 2 3 4 5\n",
       {"test.pcd:12: field 6 (d)", "missing"}},
  };
  for (const Case& malformed : cases) {
    const std::string message = pcd_refusal(malformed.file);
    for (const std::string& fragment : malformed.fragments) {
      EXPECT_THAT(message, HasSubstr(fragment)) << malformed.file.substr(0, 400);
    }
  }
  const std::string binary = xyz_header("2", "binary");
  EXPECT_EQ(pcd_refusal(binary + std::string(24, '\0')), "");
  EXPECT_EQ(pcd_refusal(binary + std::string(17, '\0')),
            "test.pcd: byte " + std::to_string(binary.size() + 17) +
                ": field 2 (y): the file ends after 1 of 2 points; expected 12 bytes for each");
  EXPECT_THAT(pcd_refusal(binary + std::string(24, '\0') + 'x'), HasSubstr("the file to end here"));
}

TEST(Pcd, AColumnOfATakenNameIsNotWritten) {
  for (const char* const name : {"x", "rgb", "_"}) {
    MapTables tables = rich_pcd_tables();
    tables.landmarks.columns[0].name = name;
    try {
      pcd_text(LandmarkMap(std::move(tables)), true);
      FAIL() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
      EXPECT_THAT(error.what(), HasSubstr("column '" + std::string(name) + "'"));
    }
  }
}

std::vector<std::string> samples() {
  const LandmarkMap map(rich_pcd_tables());
  return {pcd_text(map, false), pcd_text(map, true),
          xyz_header("12", "binary_compressed") + compressed_block(compressed_points(), 144)};
}

TEST(Pcd, RefusesEveryTruncation) {
  for (const std::string& whole : samples()) {
    EXPECT_EQ(pcd_refusal(whole), "");
    // Within the last number of a text, the cut is only remarked on.
    const bool is_text = whole.back() == '\n';
    const std::size_t end = is_text ? whole.rfind(' ') + 1 : whole.size() - 1;
    for (std::size_t size = 0; size <= end; ++size) {
      const std::string_view cut = std::string_view(whole).substr(0, size);
      EXPECT_THAT(pcd_refusal(cut), HasSubstr("test.pcd:")) << size;
      Pipe pipe(cut, 5);
      EXPECT_THROW(read_pcd(pipe), Error) << size;
    }
  }
}

TEST(Pcd, AnyDamageIsReadOrRefused) {
  std::mt19937 random(1);
  for (const std::string& whole : samples()) {
    for (int i = 0; i < 1000; ++i) {
      std::string damaged = whole;
      for (std::uint32_t k = random() % 4; k < 4; ++k) {
        damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
      }
      pcd_refusal(damaged);
    }
  }
}

TEST(Pcd, AnnouncedCountsCostNoMemory) {
  const std::int64_t before = peak_memory_kb();
  for (const std::string& file :
       {xyz_header("1000000000000000000", "binary"), xyz_header("4294967295", "binary") + "0123",
        xyz_header("4294967295", "ascii") + "1 2 3\n",
        header("x y z d", "4 4 4 8", "F F F F", "1 1 1 4294967295", "4294967295", "binary") +
            "0123",
        xyz_header("300000000", "binary_compressed") +
            compressed_block(compressed_points(), 3600000000U),
        xyz_header("12", "binary_compressed") + "\xff\xff\xff\xff\x90" + std::string(3, '\0')}) {
    EXPECT_NE(pcd_refusal(file), "");
    Pipe pipe(file, 1 << 20);
    EXPECT_THROW(read_pcd(pipe), Error);
  }
  EXPECT_LT(peak_memory_kb() - before, 100 << 10);
}

TEST(Pcd, APipeIsReadLikeAFile) {
  for (const std::size_t piece : {1, 7, 100000}) {
    for (const std::string& bytes : samples()) {
      Pipe pipe(bytes, piece);
      expect_same_landmarks(read_pcd_text(bytes), read_pcd(pipe));
    }
  }
}

TEST(Pcd, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  Execution execution;
  execution.stop = stop.get_token();
  for (const std::string& bytes : samples()) {
    try {
      read_pcd_text(bytes, execution);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
    }
  }
}

}  // namespace
}  // namespace cairn
