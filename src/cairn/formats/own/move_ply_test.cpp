// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/ply_splats.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using testing::refusal;

// Two times, turned by 90 degrees about z, one to the right.
Similarity3 quarter_turn() {
  return {2.0, Rigid3::from_roll_pitch_yaw({1.0, 0.0, 0.0}, 0.0, 0.0, std::acos(-1.0) / 2.0)};
}

std::string moved(const std::string& ply, const Similarity3& by = quarter_turn()) {
  MemoryReader source(ply, "mesh.ply");
  std::string out;
  move_ply(source, by, [&](std::string_view bytes) { out += bytes; });
  return out;
}

constexpr const char* kHeader =
    "ply\nformat ascii 1.0\ncomment kept\nelement vertex 2\nproperty uchar red\nproperty double x\n"
    "property double y\nproperty double z\nproperty float nx\nproperty float ny\nproperty float "
    "nz\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

TEST(CarryAlong, PositionsAndNormalsMoveAndTheRestStays) {
  const std::string out = moved(std::string(kHeader) + "7 0 0 3 0 0 1\n9 0 0 0 0 0 -1\n3 0 1 0\n");
  EXPECT_EQ(out, std::string(kHeader) + "7 1 0 6 0 0 1\n9 1 0 0 0 0 -1\n3 0 1 0\n");
  EXPECT_THAT(moved(std::string(kHeader) + "7 1 0 3 0 0 1\n9 0 0 0 0 0 -1\n3 0 1 0\n"),
              HasSubstr(" 2 6 0 0 1\n9 1 0 0 "));
}

TEST(CarryAlong, FloatsAreNotMovedToWhereTheyRoundPositions) {
  const auto points = [](const std::string& type) {
    return fmt::format(
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty {0} x\nproperty {0} y\nproperty {0} "
        "z\nend_header\n0 0 0\n1 2 3\n",
        type);
  };
  const Rigid3 to_utm = Rigid3::from_roll_pitch_yaw({512345.0, 5412345.0, 0.0}, 0.0, 0.0, 0.0);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { moved(points("float"), to_utm); }),
              HasSubstr("mesh.ply: header: x, y and z are float, which rounds positions"));
  EXPECT_THAT(moved(points("double"), to_utm), HasSubstr("512346 5412347 3\n"));
  EXPECT_THAT(moved(points("float"), Rigid3::from_roll_pitch_yaw({50, 0, 0}, 0, 0, 0)),
              HasSubstr("51 2 3\n"));
}

TEST(CarryAlong, SplatsInNoKnownLayoutMayChangeTheirPlaceAlone) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float f_rest_0\nproperty float rot_0\nend_header\n";
  EXPECT_EQ(moved(header + "1 2 3 4 5\n", Rigid3::from_roll_pitch_yaw({1, 0, 0}, 0, 0, 0)),
            header + "2 2 3 4 5\n");
}

TEST(CarryAlong, AllFormsOfAMapMoveAsTheMapDoes) {
  const LandmarkMap map = testing::full_map();
  const LandmarkMap expected = transformed(map, quarter_turn());
  for (const bool ascii : {true, false}) {
    std::string ply;
    write_ply(map, [&](std::string_view bytes) { ply += bytes; }, {.ascii = ascii});
    const std::string out = moved(ply);
    MemoryReader source(out, "out.ply");
    const LandmarkMap back = read_ply(source);
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      EXPECT_LT((back.landmarks().positions[i] - expected.landmarks().positions[i]).norm(),
                1e-9 * (1.0 + expected.landmarks().positions[i].norm()));
    }
    EXPECT_LT((*back.covariance(LandmarkIndex{0}) - *expected.covariance(LandmarkIndex{0})).norm(),
              1e-15);
    EXPECT_FALSE(back.covariance(LandmarkIndex{1})) << "unknown stays unknown";
    EXPECT_EQ(back.column("confidence")->values[0], 0.25);
  }
}

TEST(CarryAlong, SplatsMoveAsTheMapDoes) {
  const LandmarkMap splats = testing::random_splats(30, 3, 1);
  const LandmarkMap expected = transformed(splats, quarter_turn());
  for (const bool ascii : {true, false}) {
    const LandmarkMap out = testing::read_splats(moved(testing::ply_of(splats, ascii)));
    for (const NamedColumn& column : expected.landmarks().columns) {
      for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
        EXPECT_NEAR(out.column(column.name)->values[i], column.values[i], 1e-6) << column.name;
      }
    }
  }
}

TEST(CarryAlong, SplatsComeBackInSinglePrecision) {
  const LandmarkMap splats = testing::random_splats(30, 4, 2);
  const Similarity3 there(3.0, Rigid3::from_roll_pitch_yaw({1.0, 2.0, -1.0}, 0.3, 1.0, -2.0));
  const std::string out = moved(moved(testing::ply_of(splats), there), there.inverse());
  const LandmarkMap back = testing::read_splats(out);
  for (const NamedColumn& column : splats.landmarks().columns) {
    const double most = column.name.starts_with("f_rest") ? 1e-6 : 1e-5;
    for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
      EXPECT_NEAR(back.column(column.name)->values[i], column.values[i], most) << column.name;
    }
  }
  for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
    EXPECT_LT((back.landmarks().positions[i] - splats.landmarks().positions[i]).norm(), 1e-5);
  }
}

TEST(CarryAlong, BigEndianFloatsAndListsBeforeThem) {
  const std::string header =
      "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty list uchar uchar ids\n"
      "property float x\nproperty float y\nproperty float z\nend_header\n";
  // A list of two, then (1, 0, 0).
  const std::string body("\x02\x07\x08\x3f\x80\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00", 15);
  const std::string out = moved(header + body + "tail");
  EXPECT_THAT(out, EndsWith("tail"));
  EXPECT_EQ(out.substr(header.size(), 3), "\x02\x07\x08");
  EXPECT_EQ(out.substr(header.size() + 7, 4), std::string("\x40\x00\x00\x00", 4)) << "y is 2";
}

TEST(CarryAlong, WhatIsNoCloudIsRefused) {
  const auto refused = [](const std::string& ply) {
    return refusal(ErrorKind::kInput, [&] { moved(ply); });
  };
  EXPECT_THAT(refused("solid\n"), HasSubstr("mesh.ply:1: the file does not start with 'ply'"));
  EXPECT_THAT(refused("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
              HasSubstr("has no x, y and z"));
  EXPECT_THAT(refused(std::string(kHeader) + "7 0 0 3 0 0 1\n"), HasSubstr("the file ends here"));
  EXPECT_THAT(refused(std::string(kHeader) + "7 0 0 3\n"), HasSubstr("line 15: has 4 fields"));
  EXPECT_THAT(refused(std::string(kHeader) + "7 0 zero 3 0 0 1\n"),
              HasSubstr("'zero' is not a number"));
  std::string ply;
  write_ply(testing::full_map(), [&](std::string_view bytes) { ply += bytes; });
  for (std::size_t size = 0; size < ply.size(); size += 5) {
    EXPECT_THAT(refused(ply.substr(0, size)), HasSubstr("mesh.ply:")) << size;
  }
  EXPECT_THAT(
      refused("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
              "property float z\nproperty float f_dc_0\nproperty float rot_0\nend_header\n"),
      HasSubstr("Gaussian splats"));
  EXPECT_THAT(refused("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float "
                      "y\nproperty float z\nproperty char nx\nproperty char ny\nproperty char "
                      "nz\nend_header\n"),
              HasSubstr("property 'nx' is no number of type float or double"));
}

}  // namespace
}  // namespace cairn
