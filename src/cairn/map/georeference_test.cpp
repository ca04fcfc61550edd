// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/georeference.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

const GeodeticPosition kZurich{47.3769, 8.5417, 408.0};

// A map that was turned, shifted and shrunk away from the topocentric frame.
LandmarkMap referenced_map() {
  MapTables tables = testing::plain_tables();
  tables.info.length_unit = LengthUnit::kFree;
  tables.info.georeference = GeoReference{kZurich, 2.5, {0.8, 0.0, 0.0, 0.6}, {30.0, -20.0, 5.0}};
  tables.frames.gnss = {GnssFix{kZurich, 4.0}, std::nullopt};
  return LandmarkMap(std::move(tables));
}

std::vector<GeodeticPosition> places(const LandmarkMap& map) {
  std::vector<GeodeticPosition> result;
  for (const Eigen::Vector3d& x : map.landmarks().positions) {
    result.push_back(map.info().georeference->geodetic(x));
  }
  return result;
}

void expect_same_places(const LandmarkMap& a, const LandmarkMap& b) {
  const auto before = places(a);
  const auto after = places(b);
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    // 1e-12 degrees are a ten-thousandth of a millimetre; altitudes come from lengths of 6e6 m.
    EXPECT_NEAR(after[i].latitude_deg, before[i].latitude_deg, 1e-12);
    EXPECT_NEAR(after[i].longitude_deg, before[i].longitude_deg, 1e-12);
    EXPECT_NEAR(after[i].altitude_m, before[i].altitude_m, 1e-7);
  }
}

TEST(GeoReference, AMapThatIsMovedKeepsItsLandmarksOnTheEarth) {
  const LandmarkMap map = referenced_map();
  const Rigid3 pose = Rigid3::from_roll_pitch_yaw({4.0, -7.0, 2.0}, 0.4, -1.1, 2.9);
  expect_same_places(map, transformed(map, pose));
  expect_same_places(map, transformed(map, Similarity3(0.3, pose)));
  const LandmarkMap twice = transformed(transformed(map, Similarity3(7.0, pose)), pose.inverse());
  expect_same_places(map, twice);
  EXPECT_EQ(twice.frames().gnss, map.frames().gnss);
}

TEST(GeoReference, EastNorthAndUpOfTheOriginAreAxesOfItsFrame) {
  const GeoReference reference{kZurich};
  EXPECT_TRUE(reference.is_enu());
  const GeodeticPosition up = reference.geodetic({0.0, 0.0, 12.5});
  EXPECT_NEAR(up.latitude_deg, kZurich.latitude_deg, 1e-11);
  EXPECT_NEAR(up.longitude_deg, kZurich.longitude_deg, 1e-11);
  EXPECT_NEAR(up.altitude_m, 420.5, 1e-6);
  EXPECT_GT(reference.geodetic({0.0, 10.0, 0.0}).latitude_deg, kZurich.latitude_deg + 8e-5);
  EXPECT_GT(reference.geodetic({10.0, 0.0, 0.0}).longitude_deg, kZurich.longitude_deg + 1e-4);
}

TEST(GeoReference, InMapIsTheInverseOfGeodetic) {
  const GeoReference reference = *referenced_map().info().georeference;
  const Eigen::Vector3d x(3.0, -40.0, 12.0);
  EXPECT_LT((reference.in_map(reference.geodetic(x)) - x).norm(), 1e-6);
  EXPECT_FALSE(reference.is_enu());
}

TEST(GeoReference, InEnuFrameMovesTheMapAndNotItsPlaces) {
  const LandmarkMap map = referenced_map();
  const LandmarkMap enu = in_enu_frame(map);
  EXPECT_EQ(enu.info().georeference, GeoReference{kZurich});
  EXPECT_EQ(enu.info().length_unit, LengthUnit::kMetres);
  expect_same_places(map, enu);
  const Eigen::Vector3d moved =
      map.info().georeference->enu_from_map() * map.landmarks().positions[0];
  EXPECT_LT((enu.landmarks().positions[0] - moved).norm(), 1e-12);
  EXPECT_EQ(testing::message_of(ErrorKind::kInput, [] { in_enu_frame(testing::plain_map()); }),
            "map: has no georeference; expected a map whose place on the Earth is known");
}

TEST(GeoReference, PartsOfAMapKeepIt) {
  const LandmarkMap map = referenced_map();
  const std::vector<LandmarkIndex> one = {LandmarkIndex{1}};
  EXPECT_EQ(with_landmarks(map, one).info().georeference, map.info().georeference);
  const LandmarkMap second = cut_frames(map, FrameId{1}, FrameId{2});
  EXPECT_EQ(second.info().georeference, map.info().georeference);
  EXPECT_EQ(second.frames().gnss.size(), 1U);
  EXPECT_EQ(with_georeference(map, std::nullopt).info().georeference, std::nullopt);
}

TEST(ControlPoints, StayWhereTheyAreOnTheEarth) {
  MapTables tables = testing::plain_tables();
  tables.info.georeference = GeoReference{kZurich};
  tables.info.control_points = {{"nail", 47.0, 8.0, 4.0, {{"a.jpg", {1.0, 2.0}}}}};
  const LandmarkMap map(std::move(tables));
  const LandmarkMap moved = transformed(map, Similarity3(2.0, Rigid3()));
  EXPECT_EQ(moved.info().control_points, map.info().control_points);
  EXPECT_EQ(in_enu_frame(moved).info().control_points, map.info().control_points);
}

TEST(GeoReference, AMapRefusesWhatIsNone) {
  const auto refused = [](const auto& change) {
    MapTables tables = testing::plain_tables();
    tables.info.georeference = GeoReference{kZurich};
    tables.frames.gnss = {GnssFix{kZurich, 4.0}, std::nullopt};
    change(tables);
    return testing::message_of(ErrorKind::kInput, [&] { LandmarkMap(std::move(tables)); });
  };
  constexpr const char* kPlace =
      "; expected degrees from -90 to 90 and -180 to 180, metres from -1e9 to 1e9";
  EXPECT_EQ(refused([](MapTables& t) { t.info.georeference->origin.latitude_deg = 91; }),
            std::string("georeference: latitude 91 is out of range") + kPlace);
  EXPECT_EQ(refused([](MapTables& t) { t.info.georeference->scale = 0; }),
            "georeference: scale 0; expected a scale from 1e-9 to 1e9");
  EXPECT_EQ(refused([](MapTables& t) {
              t.info.georeference->quaternion = {2, 0, 0, 0};
            }),
            "georeference: quaternion of norm 2; expected norm 1 within 1e-3");
  EXPECT_EQ(refused([](MapTables& t) {
              t.info.control_points = {{"nail", 47.0, 181.0, std::nullopt, {}}};
            }),
            std::string("control point 'nail': longitude 181 is out of range") + kPlace);
  EXPECT_EQ(refused([](MapTables& t) { t.info.control_points.emplace_back(); }),
            "control point '': has no name; expected a name");
  EXPECT_EQ(refused([](MapTables& t) {
              t.info.control_points = {{"nail", 47.0, 8.0, 4.0, {{"", {1.0, 2.0}}}}};
            }),
            "control point 'nail': is seen by an image without a name; expected a name");
  EXPECT_EQ(refused([](MapTables& t) {
              t.info.control_points = {{"nail", 47.0, 8.0, 4.0, {{"a.jpg", {1.0, NAN}}}}};
            }),
            "control point 'nail': pixel is not finite in 'a.jpg'; expected finite coordinates");
  EXPECT_EQ(refused([](MapTables& t) { t.info.georeference->translation.x() = 2e9; }),
            "georeference: translation (2000000000, 0, 0) is beyond the limit; expected numbers "
            "from -1e9 to 1e9");
  EXPECT_EQ(refused([](MapTables& t) {
              t.frames.gnss[0] = GnssFix{{0, 200, 0}, 1.0};
            }),
            std::string("frame 1: GNSS position: longitude 200 is out of range") + kPlace);
  EXPECT_EQ(refused([](MapTables& t) {
              t.frames.gnss[0] = GnssFix{kZurich, 0.0};
            }),
            "frame 1: GNSS accuracy 0; expected a positive number of metres, at most 1e9");
}

}  // namespace
}  // namespace cairn
