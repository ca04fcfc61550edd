// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/own/point_columns.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using cairn::testing::refusal;
using ::testing::HasSubstr;

PointTable table_of(std::vector<PointField> fields, const Execution& execution = {},
                    PointFormat format = PointFormat::kPly) {
  return {format, "points", "no header has", std::move(fields), execution};
}

PointField field(const char* name, ScalarType type = ScalarType::kFloat64) {
  PointField made;
  made.name = name;
  made.type = type;
  return made;
}

template <class T>
void append(std::string& bytes, T value, bool big_endian = false) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (big_endian) std::reverse(std::begin(raw), std::end(raw));
  bytes.append(raw, sizeof(T));
}

const std::vector<PointField> kPoint = {field("x"), field("y", ScalarType::kFloat32), field("z")};

TEST(PointTable, ReadsTextAndBinaryOfEitherOrderAlike) {
  for (const int way : {0, 1, 2, 3}) {
    const Execution execution;
    PointTable table = table_of(kPoint, execution);
    if (way == 0) {
      table.append_text("1.5 -2 3", 1);
      table.append_text("4 5 -6.25", 2);
    } else if (way < 3) {
      std::string bytes;
      for (const auto& [x, y, z] : {std::array{1.5, -2.0, 3.0}, std::array{4.0, 5.0, -6.25}}) {
        append(bytes, x, way == 2);
        append(bytes, static_cast<float>(y), way == 2);
        append(bytes, z, way == 2);
      }
      table.append_binary(bytes.data(), 2, way == 2);
    } else {
      const double x[] = {1.5, 4.0};
      const float y[] = {-2.0F, 5.0F};
      const double z[] = {3.0, -6.25};
      table.append_columns({reinterpret_cast<const char*>(x), reinterpret_cast<const char*>(y),
                            reinterpret_cast<const char*>(z)},
                           2);
    }
    ASSERT_EQ(table.size(), 2U) << way;
    const LandmarkMap map = std::move(table).finish(LengthUnit::kMetres);
    EXPECT_EQ(map.landmarks().positions[0], Eigen::Vector3d(1.5, -2.0, 3.0)) << way;
    EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(4.0, 5.0, -6.25)) << way;
    EXPECT_FALSE(map.has_covariances());
    EXPECT_FALSE(map.has_observations());
  }
}

TEST(PointTable, KeepsAllDigitsOfTextAndTheFloatsOfBinary) {
  const std::vector<PointField> fields = {field("x"), field("y"), field("z"),
                                          field("time", ScalarType::kFloat32)};
  const Execution execution;
  PointTable text = table_of(fields, execution);
  text.append_text("1 2 3 1403636579.763", 1);
  text.append_text("1 2 3 1e39", 2);
  const LandmarkMap of_text = std::move(text).finish(LengthUnit::kMetres);
  EXPECT_EQ(of_text.column("time")->values[0], 1403636579.763);
  EXPECT_EQ(of_text.column("time")->values[1], 1e39);
  PointTable binary = table_of(fields, execution);
  binary.expect_binary();
  std::string bytes;
  for (const double coordinate : {1.0, 2.0, 3.0}) append(bytes, coordinate);
  append(bytes, 0.1F);
  binary.append_binary(bytes.data(), 1, false);
  const LandmarkMap of_binary = std::move(binary).finish(LengthUnit::kMetres);
  EXPECT_TRUE(of_binary.column("time")->values.is_single());
  EXPECT_EQ(of_binary.column("time")->values[0], static_cast<double>(0.1F));
}

TEST(PointTable, TakesTheFieldsThatItKnowsAndKeepsOthersByName) {
  std::vector<PointField> fields = kPoint;
  for (const char* name : {"cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz", "quality"}) {
    fields.push_back(field(name));
  }
  for (const char* name : {"red", "green", "blue"}) {
    fields.push_back(field(name, ScalarType::kUint8));
  }
  fields.push_back(field("id", ScalarType::kUint32));
  const Execution execution;
  PointTable table = table_of(fields, execution);
  table.append_text("1 2 3  4 0.5 0.25 5 0.125 6  0.75  10 20 30  77", 1);
  const LandmarkMap map = std::move(table).finish(LengthUnit::kMetres);
  const LandmarkTable& landmarks = map.landmarks();
  Eigen::Matrix3d covariance;
  covariance << 4, 0.5, 0.25, 0.5, 5, 0.125, 0.25, 0.125, 6;
  EXPECT_EQ(*map.covariance({0}), covariance);
  EXPECT_EQ(landmarks.colors[0], (Color{10, 20, 30}));
  EXPECT_EQ(landmarks.ids[0], LandmarkId{77});
  ASSERT_NE(map.column("quality"), nullptr);
  EXPECT_EQ(map.column("quality")->values[0], 0.75);
}

TEST(PointTable, LeavesOutPointsWithoutAPositionAndSaysSo) {
  std::string remarks;
  Execution execution;
  execution.log = [&](std::string_view text) { remarks += text; };
  PointTable table = table_of(kPoint, execution);
  table.append_text("1 2 3", 1);
  table.append_text("nan 2 3", 2);
  table.append_text("4 5 6", 3);
  const LandmarkMap map = std::move(table).finish(LengthUnit::kMetres);
  EXPECT_EQ(map.landmark_count(), 2U);
  EXPECT_EQ(map.landmarks().positions[1].x(), 4.0);
  EXPECT_THAT(remarks, HasSubstr("1"));
}

TEST(PointTable, NamesLineFieldAndValueOfWhatItRefuses) {
  const Execution execution;
  PointTable table = table_of(kPoint, execution);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { table.append_text("1 two 3", 12); }),
              AllOf(HasSubstr("points:12"), HasSubstr("(y)"), HasSubstr("two")));
  PointTable other = table_of(kPoint, execution);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { other.append_text("1 2", 7); }),
              HasSubstr("points:7"));
  EXPECT_THAT(refusal(ErrorKind::kInput,
                      [&] {
                        table_of({field("x"), field("y")}, execution);
                      }),
              HasSubstr("z"));
}

TEST(PointRows, ComeBackThroughATable) {
  MapTables tables;
  tables.landmarks.ids = {LandmarkId{5}, LandmarkId{9}};
  tables.landmarks.positions = {{1.25, 2.5, -3.0}, {0.1, 0.2, 0.3}};
  tables.landmarks.covariances = {Eigen::Vector3d(1, 2, 3).asDiagonal(),
                                  Eigen::Vector3d(4, 5, 6).asDiagonal()};
  tables.landmarks.colors = {Color{1, 2, 3}, Color{4, 5, 6}};
  const LandmarkMap map(std::move(tables));
  const PointRows rows(map, PointFormat::kPly, ScalarType::kFloat64);
  for (const bool ascii : {true, false}) {
    std::string body;
    rows.write("", ascii, [&](std::string_view bytes) { body += bytes; });
    const Execution execution;
    PointTable table = table_of(rows.fields(), execution);
    if (ascii) {
      const auto end = body.find('\n');
      table.append_text(std::string_view(body).substr(0, end), 1);
      const std::string_view second = std::string_view(body).substr(end + 1);
      table.append_text(second.substr(0, second.find('\n')), 2);
    } else {
      table.append_binary(body.data(), 2, false);
    }
    const LandmarkMap back = std::move(table).finish(LengthUnit::kMetres);
    EXPECT_EQ(back.landmarks().ids, map.landmarks().ids) << ascii;
    EXPECT_EQ(back.landmarks().positions, map.landmarks().positions) << ascii;
    EXPECT_EQ(back.landmarks().covariances, map.landmarks().covariances) << ascii;
    ASSERT_EQ(back.landmarks().colors.size(), 2U) << ascii;
    EXPECT_EQ(back.landmarks().colors[1], (Color{4, 5, 6})) << ascii;
  }
}

}  // namespace
}  // namespace cairn::detail
