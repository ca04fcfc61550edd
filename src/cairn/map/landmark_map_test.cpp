// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/landmark_map.hpp"

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using testing::EqualsMap;
using testing::full_map;
using testing::full_tables;
using ::testing::IsEmpty;
using testing::plain_map;
using testing::plain_tables;

constexpr double kMapNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kMapInfinity = std::numeric_limits<double>::infinity();

struct Breach {
  const char* what;
  std::function<void(MapTables&)> commit;
  const char* message;
};

void expect_map_refused(const std::vector<Breach>& breaches) {
  for (const Breach& breach : breaches) {
    SCOPED_TRACE(breach.what);
    MapTables tables = full_tables();
    breach.commit(tables);
    try {
      const LandmarkMap map(std::move(tables));
      ADD_FAILURE() << "accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      EXPECT_STREQ(error.what(), breach.message);
    }
  }
}

TEST(LandmarkMap, RefusesBrokenFrames) {
  expect_map_refused({
      {"id twice", [](MapTables& t) { t.frames.ids[2] = t.frames.ids[0]; },
       "frame 7: the id occurs twice; expected distinct ids"},
      {"translations short", [](MapTables& t) { t.frames.translations.pop_back(); },
       "frame translations: 2 entries; expected 3, one a row"},
      {"translations absent", [](MapTables& t) { t.frames.translations.clear(); },
       "frame translations: 0 entries; expected 3, one a row"},
      {"quaternions long",
       [](MapTables& t) {
         t.frames.quaternions.push_back({1, 0, 0, 0});
       },
       "frame quaternions: 4 entries; expected 3, one a row"},
      {"cameras short", [](MapTables& t) { t.frames.cameras.pop_back(); },
       "frame cameras: 2 entries; expected 3, one a row"},
      {"timestamps short", [](MapTables& t) { t.frames.timestamps_s.pop_back(); },
       "frame timestamps: 2 entries; expected 3, one a row"},
      {"image names short", [](MapTables& t) { t.frames.image_names.pop_back(); },
       "frame image names: 2 entries; expected 3, one a row"},
      {"translation NaN", [](MapTables& t) { t.frames.translations[2].y() = kMapNan; },
       "frame 3: translation (1e-310, nan, 0.3333333333333333) is not finite; expected numbers "
       "from -1e9 to 1e9"},
      {"translation far away",
       [](MapTables& t) {
         t.frames.translations[2] = {0, -1e40, 0};
       },
       "frame 3: translation (0, -1e+40, 0) is beyond the limit; expected numbers from -1e9 to "
       "1e9"},
      {"timestamp far away", [](MapTables& t) { t.frames.timestamps_s[0] = 1e300; },
       "frame 7: timestamp 1e+300; expected seconds, from -1e20 to 1e20"},
      {"position far away",
       [](MapTables& t) {
         t.landmarks.positions[1] = {1e200, 0, 0};
       },
       "landmark 10: position (1e+200, 0, 0) is beyond the limit; expected numbers from -1e9 to "
       "1e9"},
      {"variance of no use", [](MapTables& t) { t.landmarks.covariances[0](1, 1) = 1.1e18; },
       "landmark 30: covariance is beyond the limit: it has a variance of more than 1e18; expected "
       "a "
       "symmetric positive semi-definite matrix"},
      {"pixel far away",
       [](MapTables& t) {
         t.observations.pixels[3] = {1e10, 0};
       },
       "landmark 20: pixel (10000000000, 0) is beyond the limit; expected numbers from -1e9 to "
       "1e9"},
      {"depth far away", [](MapTables& t) { t.observations.depths[0] = 1e300; },
       "landmark 30: depth is beyond the limit; expected metres, from -1e9 to 1e9"},
      {"quaternion zero",
       [](MapTables& t) {
         t.frames.quaternions[0] = {0, 0, 0, 0};
       },
       "frame 7: quaternion of norm 0; expected norm 1 within 1e-3"},
      {"quaternion long",
       [](MapTables& t) {
         t.frames.quaternions[0] = {0, 1.25, 0, 0};
       },
       "frame 7: quaternion of norm 1.25; expected norm 1 within 1e-3"},
      {"quaternion a little long",
       [](MapTables& t) {
         t.frames.quaternions[0] = {0, 1.00101, 0, 0};
       },
       "frame 7: quaternion of norm 1.00101; expected norm 1 within 1e-3"},
      {"quaternion a little short",
       [](MapTables& t) {
         t.frames.quaternions[0] = {0.99899, 0, 0, 0};
       },
       "frame 7: quaternion of norm 0.99899; expected norm 1 within 1e-3"},
      {"quaternion NaN",
       [](MapTables& t) {
         t.frames.quaternions[0] = {kMapNan, 0, 0, 0};
       },
       "frame 7: quaternion of norm nan; expected norm 1 within 1e-3"},
      {"camera out of range", [](MapTables& t) { t.frames.cameras[2] = CameraIndex{2}; },
       "frame 3: refers to a camera that the map does not have; expected the index of a camera"},
      {"timestamp infinite", [](MapTables& t) { t.frames.timestamps_s[0] = kMapInfinity; },
       "frame 7: timestamp is not finite; expected seconds, from -1e20 to 1e20"},
  });
}

TEST(LandmarkMap, RefusesBrokenCamerasAndInfo) {
  expect_map_refused({
      {"camera with a defect", [](MapTables& t) { t.cameras[1].parameters[0] = 0.0; },
       "camera 2: focal length fx is 0, not positive; expected a usable camera"},
      {"camera id twice", [](MapTables& t) { t.cameras[1].id = t.cameras[0].id; },
       "camera 5: the id occurs twice; expected distinct ids"},
      {"gravity long", [](MapTables& t) { t.info.gravity = Eigen::Vector3d(0, 0, -9.81); },
       "gravity: (0, 0, -9.81) is not a unit vector; expected norm 1 within 1e-3"},
      {"gravity NaN", [](MapTables& t) { t.info.gravity = Eigen::Vector3d(0, kMapNan, 1); },
       "gravity: (0, nan, 1) is not a unit vector; expected norm 1 within 1e-3"},
  });
}

TEST(LandmarkMap, RefusesBrokenLandmarks) {
  expect_map_refused({
      {"id twice", [](MapTables& t) { t.landmarks.ids[3] = t.landmarks.ids[1]; },
       "landmark 10: the id occurs twice; expected distinct ids"},
      {"positions short", [](MapTables& t) { t.landmarks.positions.pop_back(); },
       "landmark positions: 3 entries; expected 4, one a row"},
      {"covariances short", [](MapTables& t) { t.landmarks.covariances.pop_back(); },
       "landmark covariances: 3 entries; expected 4, one a row"},
      {"colors long", [](MapTables& t) { t.landmarks.colors.emplace_back(); },
       "landmark colors: 5 entries; expected 4, one a row"},
      {"position infinite", [](MapTables& t) { t.landmarks.positions[1].z() = kMapInfinity; },
       "landmark 10: position (-1, 0.25, inf) is not finite; expected numbers from -1e9 to 1e9"},
      {"covariance not finite",
       [](MapTables& t) { t.landmarks.covariances[0](1, 1) = kMapInfinity; },
       "landmark 30: covariance is an entry is not finite; expected a symmetric positive "
       "semi-definite matrix"},
      {"covariance not symmetric",
       [](MapTables& t) {
         t.landmarks.covariances[0].setIdentity();
         t.landmarks.covariances[0](0, 1) = 0.5;
       },
       "landmark 30: covariance is not symmetric: opposite entries differ by 0.5; expected a "
       "symmetric positive semi-definite matrix"},
      {"covariance indefinite",
       [](MapTables& t) {
         t.landmarks.covariances[0] = Eigen::Vector3d(1.0, -0.25, 1.0).asDiagonal();
       },
       "landmark 30: covariance is indefinite: its smallest eigenvalue is -0.25; expected a "
       "symmetric positive semi-definite matrix"},
  });
}

TEST(LandmarkMap, RefusesBrokenDescriptorsAndNamedColumns) {
  constexpr const char* kRanges =
      "offsets of further descriptors: do not cut the further descriptors into one range a "
      "landmark; expected ascending from 0 to their number, one more than there are landmarks";
  const auto further = [](std::vector<std::uint64_t> offsets, std::size_t bytes) {
    return [=](MapTables& t) {
      t.landmarks.descriptors->further_offsets = offsets;
      t.landmarks.descriptors->further.assign(bytes, 1);
    };
  };
  expect_map_refused({
      {"further without offsets", further({}, 2),
       "further descriptor bytes: 2 entries; expected 0, one a row"},
      {"too few offsets", further({0, 1, 1, 1}, 2), kRanges},
      {"offsets from 1", further({1, 1, 1, 1, 1}, 2), kRanges},
      {"offsets that descend", further({0, 1, 0, 1, 1}, 2), kRanges},
      {"offsets beyond the end", further({0, 2, 2, 2, 2}, 2), kRanges},
      {"half a further descriptor", further({0, 1, 1, 1, 1}, 3),
       "further descriptor bytes: 3 entries; expected 2, one a row"},
      {"further without a first", further({0, 0, 1, 1, 1}, 2),
       "landmark 10: further descriptors without a first one; expected a descriptor that "
       "represents the landmark"},
      {"too many", further({0, 16, 16, 16, 16}, 32),
       "landmark 30: 17 descriptors; expected at most 16"},
      {"known short", [](MapTables& t) { t.landmarks.descriptors->known.pop_back(); },
       "landmark descriptors: 3 entries; expected 4, one a row"},
      {"no bytes", [](MapTables& t) { t.landmarks.descriptors->bytes_each = 0; },
       "landmark descriptors: of 0 bytes; expected 1 to 4096"},
      {"too many bytes", [](MapTables& t) { t.landmarks.descriptors->bytes_each = 4097; },
       "landmark descriptors: of 4097 bytes; expected 1 to 4096"},
      {"bytes short", [](MapTables& t) { t.landmarks.descriptors->bytes.pop_back(); },
       "descriptor bytes: 7 entries; expected 8, one a row"},
      {"kind empty", [](MapTables& t) { t.landmarks.descriptors->kind = ""; },
       "landmark descriptors: kind is not a name; expected visible ASCII, no blanks"},
      {"kind with a blank", [](MapTables& t) { t.landmarks.descriptors->kind = "O RB"; },
       "landmark descriptors: kind is not a name; expected visible ASCII, no blanks"},
      {"known neither 0 nor 1", [](MapTables& t) { t.landmarks.descriptors->known[2] = 2; },
       "landmark 9223372036854775808: descriptor is neither known nor zero; expected 1 for known, "
       "or 0 and all its bytes zero"},
      {"unknown but not zero", [](MapTables& t) { t.landmarks.descriptors->bytes[7] = 1; },
       "landmark 20: descriptor is neither known nor zero; expected 1 for known, or 0 and all its "
       "bytes zero"},
      {"column short", [](MapTables& t) { t.landmarks.columns[1].values.resize(3); },
       "column 'never_set': 3 entries; expected 4, one a row"},
      {"column infinite", [](MapTables& t) { t.landmarks.columns[0].values.set(1, -kMapInfinity); },
       "landmark 10: infinite in column 'confidence'; expected a number, or NaN where unknown"},
      {"column without name", [](MapTables& t) { t.landmarks.columns[0].name = ""; },
       "column '': not a name; expected visible ASCII, no blanks"},
      {"column with a line end", [](MapTables& t) { t.landmarks.columns[0].name = "a\nb"; },
       "column 'a\\x0ab': not a name; expected visible ASCII, no blanks"},
      {"column not ASCII", [](MapTables& t) { t.landmarks.columns[0].name = "\xc3\xa9"; },
       "column '\\xc3\\xa9': not a name; expected visible ASCII, no blanks"},
      {"column twice", [](MapTables& t) { t.landmarks.columns[1].name = "confidence"; },
       "column 'confidence': occurs twice; expected distinct names"},
      {"too many columns", [](MapTables& t) { t.landmarks.columns.resize(513); },
       "named columns: 513 of them; expected at most 512"},
  });
}

TEST(LandmarkMap, RefusesBrokenObservations) {
  constexpr const char* kOffsets =
      "observation offsets: do not cut the observations into one range a landmark; expected "
      "ascending from 0 to their number, one more than there are landmarks";
  expect_map_refused({
      {"pixels short", [](MapTables& t) { t.observations.pixels.pop_back(); },
       "observation pixels: 4 entries; expected 5, one a row"},
      {"keypoints short", [](MapTables& t) { t.observations.keypoints.pop_back(); },
       "observation keypoints: 4 entries; expected 5, one a row"},
      {"depths short", [](MapTables& t) { t.observations.depths.pop_back(); },
       "observation depths: 4 entries; expected 5, one a row"},
      {"octaves short", [](MapTables& t) { t.observations.octaves.pop_back(); },
       "observation octaves: 4 entries; expected 5, one a row"},
      {"sources short", [](MapTables& t) { t.observations.sources.pop_back(); },
       "observation sources: 4 entries; expected 5, one a row"},
      {"sigmas short", [](MapTables& t) { t.observations.sigmas_px.pop_back(); },
       "observation sigmas: 4 entries; expected 5, one a row"},
      {"offsets absent", [](MapTables& t) { t.observations.offsets.clear(); },
       "observation offsets: missing; expected one a landmark and one more"},
      {"offsets short", [](MapTables& t) { t.observations.offsets.pop_back(); }, kOffsets},
      {"offsets start late", [](MapTables& t) { t.observations.offsets[0] = 1; }, kOffsets},
      {"offsets end early", [](MapTables& t) { t.observations.offsets[4] = 4; }, kOffsets},
      {"offsets end late", [](MapTables& t) { t.observations.offsets[4] = 6; }, kOffsets},
      {"offsets descend", [](MapTables& t) { t.observations.offsets[2] = 1; }, kOffsets},
      {"offset far out", [](MapTables& t) { t.observations.offsets[2] = 1U << 30; }, kOffsets},
      {"unknown frame", [](MapTables& t) { t.observations.frames[4] = FrameIndex{3}; },
       "landmark 20: observed by a frame that the map does not have; expected the index of a "
       "frame"},
      {"pixel NaN", [](MapTables& t) { t.observations.pixels[2].v = kMapNan; },
       "landmark 10: pixel (0.1, nan) is not finite; expected numbers from -1e9 to 1e9"},
      {"depth NaN", [](MapTables& t) { t.observations.depths[0] = kMapNan; },
       "landmark 30: depth is not finite; expected metres, from -1e9 to 1e9"},
  });
}

TEST(LandmarkMap, SaysWhereABrokenEntryWasReadFrom) {
  const auto refusal = [](const std::function<void(MapTables&)>& breach) -> std::string {
    MapTables tables = full_tables();
    breach(tables);
    try {
      const LandmarkMap map(std::move(tables), [](MapColumn column, std::size_t row) {
        return fmt::format("column {} row {}", static_cast<int>(column), row);
      });
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal([](MapTables& t) { t.landmarks.positions[1].z() = kMapInfinity; }),
            "column 13 row 1: landmark 10: position (-1, 0.25, inf) is not finite; expected "
            "numbers from -1e9 to 1e9");
  EXPECT_EQ(
      refusal([](MapTables& t) { t.landmarks.columns[1].values.set(2, kMapInfinity); }),
      "column 20 row 6: landmark 9223372036854775808: infinite in column 'never_set'; expected "
      "a number, or NaN where unknown");
  EXPECT_EQ(refusal([](MapTables& t) { t.observations.pixels[3].v = kMapNan; }),
            "column 23 row 3: landmark 20: pixel (1e-05, nan) is not finite; expected numbers from "
            "-1e9 to 1e9");
}

// Ids of a counter are sorted otherwise than ids from afar.
TEST(LandmarkMap, FindsTheSecondOfTheFirstRepeatedId) {
  for (const std::uint64_t step : {std::uint64_t{1}, std::uint64_t{1} << 40}) {
    MapTables tables;
    for (const std::uint64_t id : {5, 1, 9, 2, 5, 1}) {
      tables.landmarks.ids.push_back(LandmarkId{id * step});
    }
    tables.landmarks.positions.resize(6, Eigen::Vector3d::Zero());
    try {
      const LandmarkMap map(std::move(tables),
                            [](MapColumn, std::size_t row) { return fmt::format("row {}", row); });
      ADD_FAILURE() << "accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.what(), fmt::format("row 4: landmark {}: the id occurs twice; expected "
                                          "distinct ids",
                                          5 * step));
    }
  }
}

TEST(LandmarkMap, HoldsWhatItWasMadeOf) {
  const MapTables tables = full_tables();
  const LandmarkMap map = full_map();
  EXPECT_EQ(map.frame_count(), 3U);
  EXPECT_EQ(map.landmark_count(), 4U);
  EXPECT_EQ(map.observation_count(), 5U);
  EXPECT_EQ(map.frames().quaternions[2], tables.frames.quaternions[2]);
  EXPECT_THAT(map, EqualsMap(LandmarkMap(LandmarkMap(full_map()).tables())));
}

TEST(LandmarkMap, IsEmptyByDefault) {
  const LandmarkMap map;
  EXPECT_EQ(map.frame_count(), 0U);
  EXPECT_EQ(map.landmark_count(), 0U);
  EXPECT_EQ(map.observation_count(), 0U);
  EXPECT_TRUE(map.has_observations());
  EXPECT_FALSE(map.has_covariances());
  EXPECT_EQ(map.find(LandmarkId{0}), std::nullopt);
  EXPECT_THAT(LandmarkMap(MapTables{}), EqualsMap(map));
}

TEST(LandmarkMap, NormalisesPosesOnlyWhenAsked) {
  MapTables tables = plain_tables();
  tables.frames.quaternions[1] = {0.0, 1.0009, 0.0, 0.0};
  const LandmarkMap map(std::move(tables));
  EXPECT_EQ(map.frames().quaternions[1][1], 1.0009);
  const Rigid3 pose = map.world_from_camera(FrameIndex{1});
  EXPECT_NEAR(pose.quaternion().norm(), 1.0, 1e-15);
  EXPECT_TRUE(
      pose.rotation().isApprox(Eigen::Matrix3d(Eigen::Vector3d(1, -1, -1).asDiagonal()), 1e-15));
  EXPECT_EQ(pose.translation(), Eigen::Vector3d(0.1, 0.0, 0.0));
}

TEST(LandmarkMap, KnowsWhichLandmarksHaveCovariances) {
  const LandmarkMap map = full_map();
  EXPECT_TRUE(map.has_covariances());
  ASSERT_TRUE(map.covariance(LandmarkIndex{0}).has_value());
  EXPECT_EQ((*map.covariance(LandmarkIndex{0}))(2, 2), 9e-4);
  EXPECT_FALSE(map.covariance(LandmarkIndex{1}).has_value());
  EXPECT_EQ(map.covariance(LandmarkIndex{2}), Eigen::Matrix3d::Zero());
  MapTables tables = plain_tables();
  tables.landmarks.covariances.clear();
  EXPECT_FALSE(LandmarkMap(std::move(tables)).covariance(LandmarkIndex{0}).has_value());
}

TEST(LandmarkMap, GroupsObservationsByLandmark) {
  const LandmarkMap map = plain_map();
  EXPECT_EQ(map.observation_count(LandmarkIndex{0}), 2U);
  EXPECT_EQ(map.observation_count(LandmarkIndex{1}), 1U);
  EXPECT_EQ(map.observation_count(LandmarkIndex{2}), 0U);
  EXPECT_THAT(map.observing_frames(LandmarkIndex{0}), ElementsAre(FrameIndex{0}, FrameIndex{1}));
  EXPECT_THAT(map.observed_pixels(LandmarkIndex{1}), ElementsAre(Pixel{292.735, 255.3}));
  EXPECT_THAT(map.observing_frames(LandmarkIndex{2}), IsEmpty());
}

TEST(LandmarkMap, TellsUnknownObservationsFromNone) {
  MapTables tables = plain_tables();
  tables.observations = {};
  const LandmarkMap unknown(tables);
  EXPECT_FALSE(unknown.has_observations());
  EXPECT_EQ(unknown.observation_count(LandmarkIndex{0}), 0U);
  EXPECT_THAT(unknown.observed_pixels(LandmarkIndex{0}), IsEmpty());
  tables.observations.offsets = {0, 0, 0, 0};
  const LandmarkMap none(tables);
  EXPECT_TRUE(none.has_observations());
  EXPECT_EQ(none.observation_count(LandmarkIndex{0}), 0U);
}

TEST(LandmarkMap, FindsByIdInAnyOrderOfIds) {
  for (const std::vector<std::uint64_t>& ids :
       {std::vector<std::uint64_t>{2, 5, 9, 18446744073709551615U},
        std::vector<std::uint64_t>{18446744073709551615U, 9, 5, 2},
        std::vector<std::uint64_t>{9, 2, 18446744073709551615U, 5},
        std::vector<std::uint64_t>{9, 2, 12, 5}}) {
    MapTables tables;
    for (const std::uint64_t id : ids) {
      tables.frames.ids.push_back(FrameId{id});
      tables.frames.translations.emplace_back(0, 0, 0);
      tables.frames.quaternions.push_back({1, 0, 0, 0});
      tables.landmarks.ids.push_back(LandmarkId{id});
      tables.landmarks.positions.emplace_back(0, 0, 0);
    }
    const LandmarkMap map(std::move(tables));
    for (std::uint32_t i = 0; i < ids.size(); ++i) {
      EXPECT_EQ(map.find(FrameId{ids[i]}), FrameIndex{i});
      EXPECT_EQ(map.find(LandmarkId{ids[i]}), LandmarkIndex{i});
    }
    for (const std::uint64_t absent : {0U, 1U, 3U, 7U, 10U, 1000U}) {
      EXPECT_EQ(map.find(FrameId{absent}), std::nullopt);
      EXPECT_EQ(map.find(LandmarkId{absent}), std::nullopt);
    }
  }
}

TEST(ColumnValues, RoundInSinglePrecisionOnly) {
  ColumnValues single = std::vector<float>{0.5F};
  ColumnValues twice = {0.5};
  EXPECT_TRUE(single.is_single());
  EXPECT_FALSE(twice.is_single());
  EXPECT_EQ(single, twice) << "equal numbers";
  for (ColumnValues* const values : {&single, &twice}) {
    values->push_back(0.1);
    values->resize(4, 0.3);
    values->set(3, kMapNan);
  }
  EXPECT_EQ(twice[1], 0.1);
  EXPECT_EQ(single[1], static_cast<double>(0.1F));
  EXPECT_EQ(single[2], static_cast<double>(0.3F));
  EXPECT_TRUE(std::isnan(single[3]) && std::isnan(twice.back()));
  EXPECT_NE(single, twice);
  const ColumnValues two = {1.0, 2.0};
  EXPECT_EQ(std::vector<double>(two.begin(), two.end()), std::vector<double>({1.0, 2.0}));
}

TEST(LandmarkMap, FindsNamedColumns) {
  const LandmarkMap map = full_map();
  ASSERT_NE(map.column("confidence"), nullptr);
  EXPECT_EQ(map.column("confidence")->values[0], 0.25);
  EXPECT_EQ(map.column("confidenc"), nullptr);
  EXPECT_EQ(map.column(""), nullptr);
}

TEST(LandmarkMap, DropsOptionalColumnsInWhichNothingIsKnown) {
  MapTables tables = full_tables();
  tables.info.world_frame = "";
  tables.info.uuid = "";
  tables.info.provenance = {"", "one", ""};
  tables.frames.cameras.assign(3, std::nullopt);
  tables.frames.timestamps_s.assign(3, std::nullopt);
  tables.frames.image_names.assign(3, "");
  tables.landmarks.covariances.assign(4, Eigen::Matrix3d::Constant(kMapNan));
  tables.landmarks.colors.assign(4, std::nullopt);
  tables.observations.keypoints.assign(5, std::nullopt);
  tables.observations.depths.assign(5, std::nullopt);
  tables.observations.octaves.assign(5, std::nullopt);
  tables.observations.sources.assign(5, std::nullopt);
  tables.observations.sigmas_px.assign(5, std::nullopt);
  const LandmarkMap map(std::move(tables));

  MapTables expected = full_tables();
  expected.info.world_frame.reset();
  expected.info.uuid.reset();
  expected.info.provenance = {"one"};
  expected.frames.cameras.clear();
  expected.frames.timestamps_s.clear();
  expected.frames.image_names.clear();
  expected.landmarks.covariances.clear();
  expected.landmarks.colors.clear();
  expected.observations.keypoints.clear();
  expected.observations.depths.clear();
  expected.observations.octaves.clear();
  expected.observations.sources.clear();
  expected.observations.sigmas_px.clear();
  EXPECT_THAT(map, EqualsMap(LandmarkMap(std::move(expected))));
  EXPECT_THAT(map.frames().image_names, IsEmpty());
  EXPECT_FALSE(map.has_covariances());
  EXPECT_THAT(map.observations().octaves, IsEmpty());
}

TEST(LandmarkMap, KeepsDescriptorsAndNamedColumnsInWhichNothingIsKnown) {
  MapTables tables = full_tables();
  tables.landmarks.descriptors->known.assign(4, 0);
  tables.landmarks.descriptors->bytes.assign(8, 0);
  const LandmarkMap map(std::move(tables));
  ASSERT_TRUE(map.landmarks().descriptors.has_value());
  EXPECT_EQ(map.landmarks().descriptors->kind, "ORB");
  EXPECT_NE(map.column("never_set"), nullptr);
}

TEST(LandmarkMap, GivesEachOfSeveralDescriptors) {
  const LandmarkMap map(testing::several_tables());
  const DescriptorColumn& column = *map.landmarks().descriptors;
  const auto bytes = [&](std::size_t landmark, std::size_t k) {
    const auto found = column.descriptor(landmark, k);
    return std::vector<int>(found.begin(), found.end());
  };
  EXPECT_TRUE(column.has_further());
  EXPECT_EQ(column.count(0), 3U);
  EXPECT_EQ(bytes(0, 0), (std::vector<int>{0x00, 0xff}));
  EXPECT_EQ(bytes(0, 1), (std::vector<int>{0x01, 0xfe}));
  EXPECT_EQ(bytes(0, 2), (std::vector<int>{0x00, 0x00}));
  EXPECT_EQ(column.count(1), 0U);
  EXPECT_EQ(column.count(2), 2U);
  EXPECT_EQ(bytes(2, 1), (std::vector<int>{0x7f, 0x80}));
  EXPECT_EQ(full_map().landmarks().descriptors->count(0), 1U);
}

TEST(LandmarkMap, HasOneFormWithoutFurtherDescriptors) {
  MapTables tables = full_tables();
  tables.landmarks.descriptors->further_offsets.assign(5, 0);
  EXPECT_THAT(LandmarkMap(std::move(tables)), EqualsMap(full_map()));
}

TEST(LandmarkMap, HasOneFormWithoutLandmarks) {
  MapTables tables;
  tables.observations.offsets = {0};
  const LandmarkMap map(std::move(tables));
  EXPECT_THAT(map, EqualsMap(LandmarkMap{}));
  EXPECT_TRUE(map.has_observations());
}

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
