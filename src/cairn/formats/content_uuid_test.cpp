// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

namespace cairn {
namespace {

using ::testing::MatchesRegex;

LandmarkMap small_map(std::uint64_t seed = 1) {
  SyntheticOptions options;
  options.seed = seed;
  options.landmarks = 50;
  options.frames = 5;
  return synthetic_map(options);
}

TEST(ContentUuid, IsAUuidOfVersion8) {
  EXPECT_THAT(content_uuid(small_map()),
              MatchesRegex("[0-9a-f]{8}-[0-9a-f]{4}-8[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}"));
}

TEST(ContentUuid, IsTheSameOfTheSameContentWhateverItsUuid) {
  const LandmarkMap map = small_map();
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  tables.info.uuid = "another";
  EXPECT_EQ(content_uuid(LandmarkMap(std::move(tables))), content_uuid(map));
  EXPECT_EQ(with_content_uuid(map).info().uuid, content_uuid(map));
  EXPECT_EQ(content_uuid(with_content_uuid(map)), content_uuid(map));
}

TEST(ContentUuid, DiffersWhereAnyContentDoes) {
  const LandmarkMap map = small_map();
  EXPECT_NE(content_uuid(map), content_uuid(small_map(2)));
  LandmarkMap copy = map;
  MapTables tables = std::move(copy).tables();
  tables.observations.pixels.back().u += 1e-9;
  EXPECT_NE(content_uuid(LandmarkMap(std::move(tables))), content_uuid(map));
}

TEST(UuidOf, DiffersByBytes) {
  EXPECT_EQ(uuid_of("a"), uuid_of("a"));
  EXPECT_NE(uuid_of("a"), uuid_of("b"));
}

}  // namespace
}  // namespace cairn
