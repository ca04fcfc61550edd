// SPDX-License-Identifier: BSD-3-Clause
#include "support/ply_splats.hpp"

#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::ply_of;
using testing::random_splats;
using testing::read_splats;

// The header as trainers write it, but for the unit, and the body.
std::string trainers_ply(const LandmarkMap& splats, int degree) {
  std::string ply = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
                                splats.landmark_count());
  for (const char* name : {"x", "y", "z"}) ply += fmt::format("property float {}\n", name);
  for (const std::string& name : testing::splat_names(degree)) {
    ply += fmt::format("property float {}\n", name);
  }
  ply += "end_header\n";
  const auto append = [&](double value) {
    const auto single = static_cast<float>(value);
    ply.append(reinterpret_cast<const char*>(&single), sizeof single);
  };
  for (std::size_t i = 0; i < splats.landmark_count(); ++i) {
    for (const double coordinate : splats.landmarks().positions[i]) append(coordinate);
    for (const NamedColumn& column : splats.landmarks().columns) append(column.values[i]);
  }
  return ply;
}

TEST(PlySplats, AreReadWithTheirLooksAndWrittenAsTheyWere) {
  for (int degree = 0; degree <= kMostSplatDegree; ++degree) {
    const LandmarkMap splats = random_splats(20, degree, 1);
    std::string ply = trainers_ply(splats, degree);
    const LandmarkMap read = read_splats(ply);
    EXPECT_EQ(read.info().length_unit, LengthUnit::kFree);
    EXPECT_EQ(read.landmarks().colors, splats.landmarks().colors);
    EXPECT_EQ(read.landmarks().covariances, splats.landmarks().covariances);
    ply.insert(ply.find("end_header"), "comment cairn length_unit free\n");
    EXPECT_EQ(ply_of(read), ply) << degree;
    EXPECT_EQ(ply_of(read_splats(ply_of(read, true))), ply) << "by way of text";
  }
}

TEST(PlySplats, FarFromTheOriginKeepTheirPlaces) {
  const Rigid3 to_utm = Rigid3::from_roll_pitch_yaw({512345.0, 5412345.0, 0.0}, 0.0, 0.0, 0.0);
  const LandmarkMap splats = transformed(random_splats(20, 0, 1), to_utm);
  const std::string ply = ply_of(splats);
  EXPECT_THAT(ply, HasSubstr("property double x\n"));
  EXPECT_THAT(ply, HasSubstr("property float opacity\n"));
  EXPECT_EQ(read_splats(ply).landmarks().positions, splats.landmarks().positions);
}

TEST(PlySplats, KeepPropertiesThatAreNotOfSplats) {
  LandmarkMap splats = random_splats(2, 0, 2);
  splats = with_column(splats, "label", {1.0, 7.0});
  splats = with_column(splats, "time", {1e9 + 0.25, 0.1});
  const std::string ply = ply_of(splats);
  EXPECT_THAT(ply, HasSubstr("property float label\nproperty double time\n"));
  const LandmarkMap read = read_splats(ply);
  EXPECT_EQ(read.column("label")->values, splats.column("label")->values);
  EXPECT_EQ(read.column("time")->values, splats.column("time")->values);
}

TEST(PlySplats, OfInfiniteLogarithmsStayOpaqueOrFlat) {
  LandmarkMap splats = random_splats(1, 0, 3);
  std::string ply = ply_of(splats, true);
  const std::string old =
      fmt::format("{}", static_cast<float>(splats.column("opacity")->values[0]));
  ply.replace(ply.rfind(" " + old + " "), old.size() + 2, " inf ");
  const LandmarkMap read = read_splats(ply);
  EXPECT_EQ(1.0 / (1.0 + std::exp(-read.column("opacity")->values[0])), 1.0);
}

TEST(PlySplats, MayHaveColoursInPlaceOfHarmonics) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property float opacity\nproperty float scale_0\nproperty float scale_1\n"
      "property float scale_2\nproperty float rot_0\nproperty float rot_1\n"
      "property float rot_2\nproperty float rot_3\ncomment cairn length_unit free\nend_header\n"
      "1 2 3 10 20 30 0.5 -1 -2 -3 1 0 0 0\n";
  const LandmarkMap read = read_splats(ply);
  EXPECT_EQ(read.landmarks().colors[0], (Color{10, 20, 30}));
  EXPECT_NEAR((*read.covariance(LandmarkIndex{0}))(1, 1), std::exp(-4.0), 1e-15);
  EXPECT_EQ(ply_of(read, true), ply);
}

TEST(PlySplats, SayThatTheyHaveColoursTwice) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
      "property float opacity\nproperty float scale_0\nproperty float scale_1\n"
      "property float scale_2\nproperty float rot_0\nproperty float rot_1\n"
      "property float rot_2\nproperty float rot_3\nend_header\n"
      "1 2 3 10 20 30 0 0 0 0.5 -1 -2 -3 1 0 0 0\n";
  testing::Remarks remarks;
  MemoryReader source(ply, "s.ply");
  Execution execution;
  execution.log = remarks.sink();
  const LandmarkMap read = read_ply(source, execution);
  EXPECT_EQ(read.landmarks().colors[0], (Color{128, 128, 128}));
  EXPECT_THAT(remarks.losses, ElementsAre(HasSubstr("s.ply: red, green and blue left out")));
}

TEST(PlySplats, ThatAreCompressedAreNamed) {
  const std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\n"
      "element vertex 1\nproperty uint packed_position\nend_header\n";
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { read_splats(ply); }),
              HasSubstr("these are Gaussian splats in compressed PLY; expected splats as PLY, to "
                        "which 'npx @playcanvas/splat-transform IN OUT.ply' converts it"));
}

}  // namespace
}  // namespace cairn
