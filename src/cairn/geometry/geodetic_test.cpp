// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/geodetic.hpp"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace cairn {
namespace {

constexpr double kEquator_m = 6378137.0;
constexpr double kPole_m = 6356752.314245179;  // the semi-minor axis of WGS 84

TEST(Geodetic, AxesOfTheEarthAreThoseOfWgs84) {
  EXPECT_LT((ecef_from_geodetic({0, 0, 0}) - Eigen::Vector3d(kEquator_m, 0, 0)).norm(), 1e-8);
  EXPECT_LT((ecef_from_geodetic({0, 90, 10}) - Eigen::Vector3d(0, kEquator_m + 10, 0)).norm(),
            1e-8);
  EXPECT_LT((ecef_from_geodetic({90, 0, 0}) - Eigen::Vector3d(0, 0, kPole_m)).norm(), 1e-8);
  EXPECT_LT((ecef_from_geodetic({-90, 0, 5}) - Eigen::Vector3d(0, 0, -kPole_m - 5)).norm(), 1e-8);
}

TEST(Geodetic, ADegreeOfLatitudeIsLongerAtThePole) {
  // Lengths of one degree of the meridian, from the tables of the ellipsoid: 110 574 and 111 694 m.
  const auto length = [](double from_deg, double to_deg) {
    return (ecef_from_geodetic({to_deg, 0, 0}) - ecef_from_geodetic({from_deg, 0, 0})).norm();
  };
  EXPECT_NEAR(length(0, 1), 110574, 3);
  EXPECT_NEAR(length(89, 90), 111694, 3);
}

TEST(Geodetic, IsUndoneByItsInverse) {
  for (const double latitude : {-90.0, -89.999999, -45.0, -1e-9, 0.0, 12.5, 47.37, 90.0}) {
    for (const double longitude : {-180.0, -93.2, 0.0, 8.54, 179.5, 180.0}) {
      for (const double altitude : {-1e5, -400.0, 0.0, 408.0, 9e3, 4e5, 1e9}) {
        const GeodeticPosition place{latitude, longitude, altitude};
        const Eigen::Vector3d ecef = ecef_from_geodetic(place);
        const GeodeticPosition back = geodetic_from_ecef(ecef);
        EXPECT_NEAR(back.latitude_deg, latitude, 1e-9);
        EXPECT_NEAR(back.altitude_m, altitude, 1e-4);
        EXPECT_LT((ecef_from_geodetic(back) - ecef).norm(), 1e-3);
        if (std::abs(latitude) < 90.0) {
          EXPECT_NEAR(std::remainder(back.longitude_deg - longitude, 360.0), 0.0, 1e-9);
        }
      }
    }
  }
}

TEST(Geodetic, TheTopocentricFramePointsEastNorthAndUp) {
  const GeodeticPosition origin{47.0, 8.0, 400.0};
  const Rigid3 enu_from_ecef = ecef_from_enu(origin).inverse();
  const auto enu = [&](const GeodeticPosition& place) {
    return Eigen::Vector3d(enu_from_ecef * ecef_from_geodetic(place));
  };
  EXPECT_LT(enu(origin).norm(), 1e-8);
  EXPECT_LT((enu({47.0, 8.0, 425.0}) - Eigen::Vector3d(0, 0, 25)).norm(), 1e-8);
  const Eigen::Vector3d north = enu({47.0001, 8.0, 400.0});
  EXPECT_NEAR(north.x(), 0.0, 1e-8);
  EXPECT_NEAR(north.y(), 11.12, 0.01);
  const Eigen::Vector3d east = enu({47.0, 8.0001, 400.0});
  EXPECT_NEAR(east.x(), 7.61, 0.01);
  EXPECT_NEAR(east.y(), 0.0, 1e-4);
}

TEST(Geodetic, TheTopocentricFrameIsARotationAtThePolesToo) {
  for (const GeodeticPosition& origin :
       {GeodeticPosition{90, 0, 0}, GeodeticPosition{-90, 30, 0}, GeodeticPosition{0, 180, 0}}) {
    const Eigen::Matrix3d rotation = ecef_from_enu(origin).rotation();
    EXPECT_NEAR(rotation.determinant(), 1.0, 1e-12);
    const Eigen::Vector3d up = ecef_from_geodetic(origin).normalized();
    EXPECT_LT((rotation.col(2) - up).norm(), 1e-12);
  }
}

TEST(Geodetic, NamesWhatIsOutOfRange) {
  EXPECT_EQ(geodetic_defect({90, -180, -1e9}), "");
  EXPECT_EQ(geodetic_defect({90.5, 0, 0}), "latitude 90.5 is out of range");
  EXPECT_EQ(geodetic_defect({0, -181, 0}), "longitude -181 is out of range");
  EXPECT_EQ(geodetic_defect({0, 0, 2e9}), "altitude 2000000000 is out of range");
  EXPECT_EQ(geodetic_defect({std::numeric_limits<double>::quiet_NaN(), 0, 0}),
            "latitude nan is out of range");
}

}  // namespace
}  // namespace cairn
