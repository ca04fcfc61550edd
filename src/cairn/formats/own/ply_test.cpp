// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <bit>
#include <cmath>
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

constexpr double kPlyNan = std::numeric_limits<double>::quiet_NaN();

MapTables rich_ply_tables() {
  return testing::rich_tables(LandmarkId{4294967295U});
}

LandmarkMap read_ply_text(std::string_view bytes, const Execution& execution = {}) {
  MemoryReader source(bytes, "test.ply");
  return read_ply(source, execution);
}

std::string ply_text(const LandmarkMap& map, bool ascii) {
  std::string bytes;
  write_ply(map, [&](std::string_view piece) { bytes += piece; }, {.ascii = ascii});
  return bytes;
}

// The message with which `bytes` are refused; empty if they are not.
std::string ply_refusal(std::string_view bytes) {
  return testing::refusal(ErrorKind::kInput, [&] { read_ply_text(bytes); });
}

template <class T>
void put_ply(std::string& bytes, T value, bool big_endian) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (big_endian != (std::endian::native == std::endian::big)) {
    std::reverse(raw, raw + sizeof value);
  }
  bytes.append(raw, sizeof value);
}

TEST(Ply, RoundTripKeepsEveryColumnBitExact) {
  const LandmarkMap map(rich_ply_tables());
  for (const bool ascii : {false, true}) {
    const LandmarkMap back = read_ply_text(ply_text(map, ascii));
    expect_same_landmarks(map, back);
    EXPECT_EQ(back.landmarks().columns.size(), 2U);
    EXPECT_EQ(back.frame_count(), 0U);
    EXPECT_FALSE(back.has_observations());
  }
}

TEST(Ply, WritesAHeaderThatOthersUnderstand) {
  const std::string bytes = ply_text(LandmarkMap(rich_ply_tables()), false);
  EXPECT_EQ(
      bytes.substr(0, bytes.find("end_header\n")),
      "ply\nformat binary_little_endian 1.0\ncomment cairn length_unit metres\nelement vertex 3\n"
      "property double x\nproperty double y\nproperty double z\n"
      "property double cov_xx\nproperty double cov_xy\nproperty double cov_xz\n"
      "property double cov_yy\nproperty double cov_yz\nproperty double cov_zz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property uint id\nproperty double confidence\nproperty double w\n");
}

TEST(Ply, EmptyMapSurvives) {
  for (const bool ascii : {false, true}) {
    EXPECT_EQ(read_ply_text(ply_text(LandmarkMap(), ascii)).landmark_count(), 0U);
  }
}

TEST(Ply, ObservationCountsComeBackAsAColumn) {
  MapTables tables;
  tables.frames.ids = {FrameId{1}, FrameId{2}};
  tables.frames.translations.assign(2, Eigen::Vector3d::Zero());
  tables.frames.quaternions.assign(2, {1, 0, 0, 0});
  tables.landmarks.ids = {LandmarkId{0}, LandmarkId{1}, LandmarkId{2}};
  tables.landmarks.positions.assign(3, Eigen::Vector3d::Zero());
  tables.landmarks.columns = {{"observations", {7, 8, 9}}};  // the truth wins
  tables.observations.offsets = {0, 2, 2, 3};
  tables.observations.frames = {FrameIndex{0}, FrameIndex{1}, FrameIndex{0}};
  tables.observations.pixels.resize(3);
  const LandmarkMap map(std::move(tables));
  for (const bool ascii : {false, true}) {
    const LandmarkMap back = read_ply_text(ply_text(map, ascii));
    ASSERT_NE(back.column("observations"), nullptr);
    EXPECT_THAT(back.column("observations")->values, ElementsAre(2, 0, 1));
    EXPECT_FALSE(back.has_observations());
    // And once more, now from the column.
    EXPECT_THAT(read_ply_text(ply_text(back, ascii)).column("observations")->values,
                ElementsAre(2, 0, 1));
  }
}

TEST(Ply, ReadsEveryTypeInEveryEncoding) {
  const char* const type_names[2][8] = {
      {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"},
      {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"}};
  for (const auto& names : type_names) {
    for (const std::string encoding : {"ascii", "binary_little_endian", "binary_big_endian"}) {
      std::string file = "ply\nformat " + encoding + " 1.0\nelement vertex 2\n";
      for (const char* const axis : {"x", "y", "z"}) {
        file += std::string("property ") + names[6] + ' ' + axis + '\n';
      }
      for (const char* const name : names) {
        file += std::string("property ") + name + " c_" + name + '\n';
      }
      file += "end_header\n";
      if (encoding == "ascii") {
        file += "1.5 -2 3e1 -128 255 -32768 65535 -2147483648 4294967295 -0.25 0.1\n";
        file += "+4 5 6 127 0 32767 0 2147483647 0 nan -1e300\n";
      } else {
        const bool big = encoding == "binary_big_endian";
        for (const float value : {1.5F, -2.0F, 30.0F}) put_ply(file, value, big);
        put_ply(file, std::int8_t{-128}, big);
        put_ply(file, std::uint8_t{255}, big);
        put_ply(file, std::int16_t{-32768}, big);
        put_ply(file, std::uint16_t{65535}, big);
        put_ply(file, std::numeric_limits<std::int32_t>::min(), big);
        put_ply(file, std::uint32_t{4294967295U}, big);
        put_ply(file, -0.25F, big);
        put_ply(file, 0.1, big);
        for (const float value : {4.0F, 5.0F, 6.0F}) put_ply(file, value, big);
        put_ply(file, std::int8_t{127}, big);
        put_ply(file, std::uint8_t{0}, big);
        put_ply(file, std::int16_t{32767}, big);
        put_ply(file, std::uint16_t{0}, big);
        put_ply(file, std::numeric_limits<std::int32_t>::max(), big);
        put_ply(file, std::uint32_t{0}, big);
        put_ply(file, std::numeric_limits<float>::quiet_NaN(), big);
        put_ply(file, -1e300, big);
      }
      const LandmarkMap map = read_ply_text(file);
      ASSERT_EQ(map.landmark_count(), 2U) << encoding;
      EXPECT_EQ(map.landmarks().positions[0], Eigen::Vector3d(1.5, -2, 30));
      EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(4, 5, 6));
      const double first[] = {-128, 255, -32768, 65535, -2147483648.0, 4294967295.0, -0.25, 0.1};
      const double second[] = {127, 0, 32767, 0, 2147483647.0, 0, kPlyNan, -1e300};
      for (std::size_t i = 0; i < 8; ++i) {
        const NamedColumn* const column = map.column(std::string("c_") + names[i]);
        ASSERT_NE(column, nullptr) << names[i];
        EXPECT_TRUE(same_bits(column->values[0], first[i])) << encoding << names[i];
        EXPECT_TRUE(same_bits(column->values[1], second[i])) << encoding << names[i];
      }
    }
  }
}

// Faces below, cameras above, and lists among the vertices' own properties.
std::string file_with_lists(const std::string& encoding) {
  std::string file = "ply\nformat " + encoding +
                     " 1.0\nelement camera 2\nproperty float fx\nproperty list uchar short k\n"
                     "element marker 2\nproperty double m\nelement nothing 1000000000000\n"
                     "element vertex 2\nproperty list uint8 double weights\nproperty float x\n"
                     "property float y\nproperty list int uchar tags\nproperty float z\n"
                     "property ushort n\nelement face 2\nproperty list uchar int vertex_indices\n"
                     "end_header\n";
  if (encoding == "ascii") {
    return file + "500 2 1 -1\n501 0\n3\n4\n2 0.5 0.5 1 2 0 3 10\n0 4 5 3 7 8 9 6 11\n3 0 1 0\n0\n";
  }
  const bool big = encoding == "binary_big_endian";
  put_ply(file, 500.0F, big);
  put_ply(file, std::uint8_t{2}, big);
  put_ply(file, std::int16_t{1}, big);
  put_ply(file, std::int16_t{-1}, big);
  put_ply(file, 501.0F, big);
  put_ply(file, std::uint8_t{0}, big);
  for (const double value : {3.0, 4.0}) put_ply(file, value, big);
  put_ply(file, std::uint8_t{2}, big);
  put_ply(file, 0.5, big);
  put_ply(file, 0.5, big);
  put_ply(file, 1.0F, big);
  put_ply(file, 2.0F, big);
  put_ply(file, std::int32_t{0}, big);
  put_ply(file, 3.0F, big);
  put_ply(file, std::uint16_t{10}, big);
  put_ply(file, std::uint8_t{0}, big);
  put_ply(file, 4.0F, big);
  put_ply(file, 5.0F, big);
  put_ply(file, std::int32_t{3}, big);
  file += "\x07\x08\x09";
  put_ply(file, 6.0F, big);
  put_ply(file, std::uint16_t{11}, big);
  put_ply(file, std::uint8_t{3}, big);
  for (const std::int32_t value : {0, 1, 0}) put_ply(file, value, big);
  put_ply(file, std::uint8_t{0}, big);
  return file;
}

TEST(Ply, PassesOverListsAndOtherElements) {
  for (const char* const encoding : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    testing::Remarks remarks;
    const Execution execution{.log = remarks.sink()};
    const LandmarkMap map = read_ply_text(file_with_lists(encoding), execution);
    ASSERT_EQ(map.landmark_count(), 2U) << encoding;
    EXPECT_EQ(map.landmarks().positions[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(4, 5, 6));
    ASSERT_EQ(map.landmarks().columns.size(), 1U);
    EXPECT_THAT(map.column("n")->values, ElementsAre(10, 11));
    EXPECT_THAT(remarks.texts,
                ::testing::Contains(HasSubstr("2 records of element 'face' left out")));
    EXPECT_THAT(remarks.texts, ::testing::Contains(HasSubstr("field 'weights' left out")));
  }
}

TEST(Ply, TakesCommentsBlankLinesAndCrLf) {
  const LandmarkMap map = read_ply_text(
      "ply\r\ncomment made by hand\r\nformat ascii 1.0\r\nobj_info what ever\r\n"
      "element vertex 2\r\nproperty float x\r\ncomment\r\nproperty\tfloat  y\r\n"
      "property float z\r\n\r\nend_header\r\n\r\n1 2 3\r\n\r\n  4\t5   6 \r\n\r\n");
  ASSERT_EQ(map.landmark_count(), 2U);
  EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(4, 5, 6));

  std::string binary =
      "ply\r\nformat binary_little_endian 1.0\r\nelement vertex 1\r\nproperty float x\r\n"
      "property float y\r\nproperty float z\r\nend_header\r\n";
  for (const float value : {1.0F, 2.0F, 3.0F}) put_ply(binary, value, false);
  EXPECT_EQ(read_ply_text(binary).landmarks().positions[0], Eigen::Vector3d(1, 2, 3));
}

constexpr std::string_view kXyz = "property float x\nproperty float y\nproperty float z\n";

std::string ascii_file(std::size_t vertices, std::string_view properties, std::string_view body) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(vertices) + '\n' +
         std::string(kXyz) + std::string(properties) + "end_header\n" + std::string(body);
}

TEST(Ply, LeavesOutPointsWithoutAFinitePosition) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const LandmarkMap map = read_ply_text(
      ascii_file(4,
                 "property uint id\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
                 "property float q\n",
                 "nan nan nan 5 1 1 1 0.5\n1 2 3 5 2 2 2 1.5\n1 inf 3 6 3 3 3 2.5\n"
                 "4 5 6 7 4 4 4 3.5\n"),
      execution);
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{5}, LandmarkId{7}));
  EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(map.landmarks().colors[0], (Color{2, 2, 2}));
  EXPECT_THAT(map.column("q")->values, ElementsAre(1.5, 3.5));
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("test.ply: 2 of 4 landmarks left out")));
}

TEST(Ply, TakesInfiniteValuesAsUnknown) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const LandmarkMap map = read_ply_text(
      ascii_file(3, "property float q\n", "0 0 0 inf\n0 0 1 2.5\n0 0 2 -inf\n"), execution);
  ASSERT_EQ(map.landmark_count(), 3U);
  EXPECT_TRUE(std::isnan(map.column("q")->values[0]));
  EXPECT_EQ(map.column("q")->values[1], 2.5);
  EXPECT_THAT(remarks.texts, ElementsAre(HasSubstr("2 infinite values of field 'q'")));
}

TEST(Ply, TakesColoursAndCovariancesOnlyIfComplete) {
  const LandmarkMap partial = read_ply_text(ascii_file(
      1, "property uchar red\nproperty uchar green\nproperty double cov_xx\n", "1 2 3 9 8 7\n"));
  EXPECT_TRUE(partial.landmarks().colors.empty());
  EXPECT_FALSE(partial.has_covariances());
  EXPECT_THAT(partial.column("green")->values, ElementsAre(8));
  EXPECT_THAT(partial.column("cov_xx")->values, ElementsAre(7));
  expect_same_landmarks(partial, read_ply_text(ply_text(partial, false)));

  // Shares from 0 to 1 are not what a colour is here.
  const LandmarkMap shares = read_ply_text(ascii_file(
      1, "property float red\nproperty float green\nproperty float blue\n", "1 2 3 0.5 1 0\n"));
  EXPECT_TRUE(shares.landmarks().colors.empty());
  EXPECT_THAT(shares.column("red")->values, ElementsAre(0.5));

  MapTables tables = rich_ply_tables();
  tables.landmarks.colors[1].reset();
  EXPECT_TRUE(
      read_ply_text(ply_text(LandmarkMap(std::move(tables)), false)).landmarks().colors.empty());
}

TEST(Ply, TakesIdsOnlyIfTheyAreDistinctIntegers) {
  const std::string body = "0 0 0 9\n0 0 1 3\n";
  EXPECT_THAT(read_ply_text(ascii_file(2, "property int id\n", body)).landmarks().ids,
              ElementsAre(LandmarkId{9}, LandmarkId{3}));
  for (const auto& [properties, rows] :
       {std::pair<std::string, std::string>{"property float id\n", body},
        {"property int id\n", "0 0 0 -1\n0 0 1 3\n"},
        {"property uchar id\n", "0 0 0 3\n0 0 1 3\n"}}) {
    const LandmarkMap map = read_ply_text(ascii_file(2, properties, rows));
    EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{0}, LandmarkId{1})) << rows;
    ASSERT_NE(map.column("id"), nullptr);
    EXPECT_EQ(map.column("id")->values[1], 3.0);
    expect_same_landmarks(map, read_ply_text(ply_text(map, true)));
  }
}

TEST(Ply, LeavesOutIdsThatDoNotFit) {
  MapTables tables = rich_ply_tables();
  tables.landmarks.ids[2] = LandmarkId{1ULL << 32};
  const std::string bytes = ply_text(LandmarkMap(std::move(tables)), false);
  EXPECT_EQ(bytes.find("property uint id"), std::string::npos);
  EXPECT_THAT(read_ply_text(bytes).landmarks().ids,
              ElementsAre(LandmarkId{0}, LandmarkId{1}, LandmarkId{2}));
}

TEST(Ply, AColumnOfATakenNameIsNotWritten) {
  for (const char* const name : {"x", "cov_yz", "blue"}) {
    MapTables tables = rich_ply_tables();
    tables.landmarks.columns[0].name = name;
    const LandmarkMap map(std::move(tables));
    try {
      ply_text(map, true);
      FAIL() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
      EXPECT_THAT(error.what(), HasSubstr("column '" + std::string(name) + "'"));
    }
  }
}

TEST(Ply, AlmostSymmetricCovarianceIsStillOneAfterwards) {
  // Rank one, so that only the tolerance makes it pass.
  Eigen::Matrix3d covariance = Eigen::Vector3d(1, 2, 3) * Eigen::RowVector3d(1, 2, 3);
  covariance(0, 1) += 8e-6;
  covariance(0, 2) -= 8e-6;
  MapTables tables;
  tables.landmarks.ids = {LandmarkId{0}};
  tables.landmarks.positions = {Eigen::Vector3d::Zero()};
  tables.landmarks.covariances = {covariance};
  const LandmarkMap back = read_ply_text(ply_text(LandmarkMap(std::move(tables)), false));
  EXPECT_EQ(back.covariance(LandmarkIndex{0})->coeff(0, 1), covariance(1, 0));
}

TEST(Ply, RefusesMalformedInput) {
  struct Case {
    std::string file;
    std::vector<std::string> fragments;
  };
  const std::string head = "ply\nformat ascii 1.0\n";
  const std::string xyz(kXyz);
  const std::string vertex = head + "element vertex 1\n" + xyz;
  const std::vector<Case> cases = {
      {"", {"test.ply:1:", "ends within its header"}},
      {"plyx\n", {"test.ply:1:", "does not start with 'ply'"}},
      {"ply\n", {"test.ply:2:", "ends within its header", "end_header"}},
      {"ply\nformat ascii 1.0", {"test.ply:2:", "ends within its header"}},
      {"ply\nformat text 1.0\n", {"test.ply:2:", "unknown format 'text'", "binary_big_endian"}},
      {"ply\nformat ascii 2.0\n", {"test.ply:2:", "PLY version '2.0'", "1.0"}},
      {"ply\nformat ascii 1.0 x\n", {"test.ply:2:", "'x' is too much"}},
      {head + "format ascii 1.0\n", {"test.ply:3:", "above already"}},
      {"ply\nelement vertex 0\n" + xyz + "end_header\n", {"test.ply:6:", "without the format"}},
      {head + "end_header\n", {"test.ply:3:", "no element 'vertex'"}},
      {head + "bogus\n", {"test.ply:3:", "unknown keyword 'bogus'"}},
      {head + "element\n", {"test.ply:3:", "without a name"}},
      {head + "element vertex\n", {"test.ply:3:", "count '' is no unsigned integer"}},
      {head + "element vertex -1\n", {"test.ply:3:", "'-1' is no unsigned integer"}},
      {head + "element vertex 99999999999999999999\n", {"test.ply:3:", "no unsigned integer"}},
      {head + "element vertex 4294967296\n", {"test.ply:3:", "4294967296 vertices", "2^32"}},
      {head + "element a 1\nelement a 1\n", {"test.ply:4:", "'a' stands above already"}},
      {head + "property float x\n", {"test.ply:3:", "above all elements"}},
      {vertex + "property float x\n", {"test.ply:7:", "'x' stands above already"}},
      {vertex + "property int64 t\n", {"test.ply:7:", "unknown type 'int64'", "uchar"}},
      {vertex + "property float\n", {"test.ply:7:", "without a name"}},
      {vertex + "property float a b\n", {"test.ply:7:", "'b' is too much"}},
      {vertex + "property list float int a\n", {"test.ply:7:", "'float'", "integer type"}},
      {vertex + "property list uchar a\n", {"test.ply:7:", "unknown type 'a'"}},
      {vertex + "end_header now\n", {"test.ply:7:", "'now' is too much"}},
      {vertex + std::string(3 << 20, 'a'), {"test.ply:7:", "more than a megabyte"}},
      {head + "element vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n",
       {"test.ply:3:", "no scalar field 'z'", "x, y and z"}},
      {vertex + "end_header\n", {"test.ply:7:", "ends after 0 of 1 vertices"}},
      {vertex + "end_header\n1 2", {"test.ply:8: field 3 (z)", "missing"}},
      {vertex + "end_header\n1 2\n", {"test.ply:8: field 3 (z)", "missing"}},
      {vertex + "end_header\n1 2 3 4\n", {"test.ply:8: field 4", "'4' is too much"}},
      {vertex + "end_header\n1 abc 3\n",
       {"test.ply:8: field 2 (y)", "'abc' is not a number", "decimal number"}},
      {vertex + "end_header\n1 0x1 3\n", {"test.ply:8: field 2 (y)", "'0x1'"}},
      {vertex + "end_header\n1 1e999 3\n", {"test.ply:8: field 2 (y)", "'1e999'"}},
      {vertex + "end_header\n1 +-2 3\n", {"test.ply:8: field 2 (y)", "'+-2'"}},
      {vertex + "end_header\n1 2 3\n\n4 5 6\n", {"test.ply:10:", "'4 5 6' is more"}},
      {vertex + "property uchar c\nend_header\n1 2 3 256\n",
       {"test.ply:9: field 4 (c)", "'256'", "an integer from 0 to 255"}},
      {vertex + "property char c\nend_header\n1 2 3 1.5\n",
       {"test.ply:9: field 4 (c)", "'1.5'", "an integer from -128 to 127"}},
      {vertex + "property list uchar int l\nend_header\n1 2 3 x\n",
       {"test.ply:9: field 4 (l)", "'x' is no length of a list"}},
      {vertex + "property list uchar int l\nend_header\n1 2 3 99999999999 1\n",
       {"test.ply:9: field 6 (l)", "missing"}},
      {vertex + "element face 3\nproperty list uchar int l\nend_header\n1 2 3\n0\n0\n",
       {"test.ply:12:", "ends after 2 of 3 records of element 'face'"}},
      {vertex + "property float cov_xx\nproperty float cov_xy\nproperty float cov_xz\n"
                "property float cov_yy\nproperty float cov_yz\nproperty float cov_zz\nend_header\n"
                "1 2 3 1 0 0 -1 0 1\n",
       {"test.ply: landmark 0: covariance is indefinite"}},
  };
  for (const Case& malformed : cases) {
    const std::string message = ply_refusal(malformed.file);
    for (const std::string& fragment : malformed.fragments) {
      EXPECT_THAT(message, HasSubstr(fragment)) << malformed.file.substr(0, 400);
    }
  }
}

TEST(Ply, RefusesMalformedBinaryInput) {
  const std::string head =
      "ply\nformat binary_big_endian 1.0\nelement vertex 2\n" + std::string(kXyz) + "end_header\n";
  const std::string whole = head + std::string(24, '\0');
  EXPECT_EQ(ply_refusal(whole), "");
  EXPECT_EQ(ply_refusal(whole + 'x'),
            "test.ply: byte " + std::to_string(whole.size()) +
                ": more data than the header announces; expected the file "
                "to end here");
  EXPECT_EQ(ply_refusal(whole + '\n'), "");
  EXPECT_EQ(ply_refusal(head + std::string(17, '\0')),
            "test.ply: byte " + std::to_string(head.size() + 17) +
                ": field 2 (y): the file ends after 1 of 2 vertices; expected 12 bytes for each");

  const std::string negative =
      "ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list char int l\n"
      "element vertex 0\n" +
      std::string(kXyz) + "end_header\n\xff";
  EXPECT_THAT(ply_refusal(negative),
              HasSubstr("field 1 (l): a list of -1 values; expected 0 or more"));
}

TEST(Ply, RefusesEveryTruncation) {
  for (const std::string& whole :
       {ply_text(LandmarkMap(rich_ply_tables()), false), file_with_lists("binary_big_endian"),
        file_with_lists("binary_little_endian"), file_with_lists("ascii")}) {
    EXPECT_EQ(ply_refusal(whole), "");
    // Within the last number of a text, the cut is only remarked on.
    const bool is_text = whole.find("format ascii") != std::string::npos;
    const std::size_t end =
        is_text ? whole.find_last_of(" \n", whole.size() - 2) + 1 : whole.size() - 1;
    for (std::size_t size = 0; size <= end; ++size) {
      const std::string_view cut = std::string_view(whole).substr(0, size);
      const std::string message = ply_refusal(cut);
      EXPECT_THAT(message, HasSubstr("test.ply:")) << size;
      Pipe pipe(cut, 5);
      EXPECT_THROW(read_ply(pipe), Error) << size;
    }
  }
}

TEST(Ply, SaysThatTheLastLineDoesNotEnd) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const std::string text =
      "ply\r\nformat ascii 1.0\r\nelement vertex 1\r\n" + std::string(kXyz) + "end_header\r\n1 2 3";
  EXPECT_EQ(read_ply_text(text, execution).landmark_count(), 1U);
  EXPECT_THAT(remarks.losses, ElementsAre(HasSubstr("test.ply:8: the last line does not end")));
  EXPECT_EQ(remarks.texts, remarks.losses);
}

TEST(Ply, StatesItsUnitOrHasNone) {
  const auto unit_of = [](const std::string& comment, const std::string& properties) {
    return read_ply_text("ply\nformat ascii 1.0\n" + comment + "element vertex 0\n" +
                         std::string(kXyz) + properties + "end_header\n")
        .info()
        .length_unit;
  };
  EXPECT_EQ(unit_of("", ""), LengthUnit::kFree);
  EXPECT_EQ(unit_of("comment made by others\n", ""), LengthUnit::kFree);
  EXPECT_EQ(unit_of("comment cairn length_unit metres\n", ""), LengthUnit::kMetres);
  EXPECT_EQ(unit_of("comment cairn length_unit free\n", ""), LengthUnit::kFree);
  // Cairn once stated free scales only. Its maps in metres have covariances, or observations and ids.
  std::string covariance;
  for (const char* const entry : {"xx", "xy", "xz", "yy", "yz", "zz"}) {
    covariance += std::string("property double cov_") + entry + "\n";
  }
  EXPECT_EQ(unit_of("", covariance), LengthUnit::kMetres);
  EXPECT_EQ(unit_of("comment cairn length_unit free\n", covariance), LengthUnit::kFree);
  EXPECT_EQ(unit_of("", covariance.substr(covariance.find('\n') + 1)), LengthUnit::kFree);
  EXPECT_EQ(unit_of("", "property uint observations\nproperty uint id\n"), LengthUnit::kMetres);
  EXPECT_EQ(unit_of("", "property uchar red\nproperty uint id\n"), LengthUnit::kFree);
}

TEST(Ply, AnyDamageIsReadOrRefused) {
  std::mt19937 random(1);
  for (const std::string& whole :
       {ply_text(LandmarkMap(rich_ply_tables()), false),
        ply_text(LandmarkMap(rich_ply_tables()), true), file_with_lists("binary_big_endian"),
        file_with_lists("ascii")}) {
    for (int i = 0; i < 1000; ++i) {
      std::string damaged = whole;
      for (std::uint32_t k = random() % 4; k < 4; ++k) {
        damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
      }
      ply_refusal(damaged);
    }
  }
}

TEST(Ply, AnnouncedCountsCostNoMemory) {
  const std::int64_t before = peak_memory_kb();
  const auto binary_file = [](const std::string& element, const std::string& rest) {
    return "ply\nformat binary_little_endian 1.0\nelement " + element + '\n' + std::string(kXyz) +
           rest;
  };
  for (const std::string& file :
       {binary_file("vertex 1000000000000000000", "end_header\n"),
        binary_file("vertex 4294967295", "end_header\n0123456789abcdef"),
        binary_file("vertex 4294967295",
                    "property list uint double l\nend_header\n" + std::string(40, '\xff')),
        binary_file("face 18446744073709551615",
                    "element vertex 0\n" + std::string(kXyz) + "end_header\n"),
        ascii_file(4294967295, "", "1 2 3\n")}) {
    EXPECT_NE(ply_refusal(file), "");
    Pipe pipe(file, 1 << 20);
    EXPECT_THROW(read_ply(pipe), Error);
  }
  EXPECT_LT(peak_memory_kb() - before, 100 << 10);
}

TEST(Ply, APipeIsReadLikeAFile) {
  const LandmarkMap map(rich_ply_tables());
  for (const std::size_t piece : {1, 7, 100000}) {
    for (const bool ascii : {false, true}) {
      const std::string bytes = ply_text(map, ascii);
      Pipe pipe(bytes, piece);
      expect_same_landmarks(map, read_ply(pipe));
    }
    for (const char* const encoding : {"ascii", "binary_big_endian"}) {
      const std::string bytes = file_with_lists(encoding);
      Pipe pipe(bytes, piece);
      expect_same_landmarks(read_ply_text(bytes), read_ply(pipe));
    }
  }
}

// More than fits into one block, so that blocks end within points.
LandmarkMap large_map(std::size_t size) {
  MapTables tables;
  for (std::size_t i = 0; i < size; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{3 * i});
    tables.landmarks.positions.emplace_back(
        static_cast<double>(i), 1.0 / static_cast<double>(i + 1), -0.1 * static_cast<double>(i));
    tables.landmarks.colors.emplace_back(Color{static_cast<std::uint8_t>(i % 256), 1, 2});
  }
  return LandmarkMap(std::move(tables));
}

TEST(Ply, BlocksMayEndAnywhere) {
  const LandmarkMap map = large_map(200000);
  for (const bool ascii : {false, true})
    expect_same_landmarks(map, read_ply_text(ply_text(map, ascii)));
}

TEST(Ply, ReportsProgressAndStops) {
  const std::string bytes = ply_text(large_map(400000), false);
  std::vector<double> shares;
  Execution execution;
  execution.progress = [&](double share) { shares.push_back(share); };
  read_ply_text(bytes, execution);
  ASSERT_GE(shares.size(), 3U);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.back(), 1.0);

  std::stop_source stop;
  execution.stop = stop.get_token();
  execution.progress = [&](double share) {
    if (share > 0.2) stop.request_stop();
  };
  try {
    read_ply_text(bytes, execution);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
  }
}

}  // namespace
}  // namespace cairn
