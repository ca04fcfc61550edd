// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/operations.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using testing::EqualsMap;
using testing::full_map;
using testing::full_tables;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::plain_map;
using testing::plain_tables;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

MapTables tables_of(LandmarkMap map) {
  return std::move(map).tables();
}

LandmarkMap without_observations() {
  MapTables tables = plain_tables();
  tables.observations = {};
  return LandmarkMap(std::move(tables));
}

template <class Call>
void expect_refused(const Call& call, ErrorKind kind, const std::string& message) {
  try {
    call();
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind);
    EXPECT_THAT(error.what(), HasSubstr(message));
  }
}

// Frames 10, 20, 30, 40 and landmarks seen by: 1: 10 20; 2: 20 30; 3: 30; 4: none; 5: 40 30.
LandmarkMap four_frames() {
  MapTables tables;
  for (const std::uint64_t id : {40U, 10U, 30U, 20U}) {
    tables.frames.ids.push_back(FrameId{id});
    tables.frames.translations.emplace_back(static_cast<double>(id), 0, 0);
    tables.frames.quaternions.push_back({1, 0, 0, 0});
    tables.frames.timestamps_s.emplace_back(static_cast<double>(id) / 10.0);
  }
  const std::vector<std::vector<std::uint32_t>> observing = {{1, 3}, {3, 2}, {2}, {}, {0, 2}};
  tables.observations.offsets = {0};
  for (std::uint32_t i = 0; i < observing.size(); ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i + 1});
    tables.landmarks.positions.emplace_back(i, 0, 0);
    for (const std::uint32_t frame : observing[i]) {
      tables.observations.frames.push_back(FrameIndex{frame});
      tables.observations.pixels.push_back({static_cast<double>(i), static_cast<double>(frame)});
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  tables.info.uuid = "of the whole";
  return LandmarkMap(std::move(tables));
}

std::vector<std::uint64_t> values(const auto& ids) {
  std::vector<std::uint64_t> result;
  result.reserve(ids.size());
  for (const auto id : ids) result.push_back(id.value);
  return result;
}

TEST(Operations, LargerMapsPrecedeAndOneOrderIsTotal) {
  const auto with = [](std::vector<Eigen::Vector3d> positions) {
    MapTables tables;
    for (std::size_t i = 0; i < positions.size(); ++i)
      tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions = std::move(positions);
    return LandmarkMap(std::move(tables));
  };
  const std::vector<LandmarkMap> ordered = {
      with({{5, 5, 5}, {6, 6, 6}, {7, 7, 7}}), with({{1, 2, 3}, {0, 0, 0}}),
      with({{1, 2, 3}, {0, 0, 1}}), with({{1, 2.5, 0}, {0, 0, 0}}), with({{0, 0, 0}})};
  for (std::size_t i = 0; i < ordered.size(); ++i) {
    for (std::size_t j = 0; j < ordered.size(); ++j) {
      EXPECT_EQ(precedes(ordered[i], ordered[j]), i < j) << i << ", " << j;
    }
  }
}

TEST(LandmarksObserved, CountsObservations) {
  const LandmarkMap map = plain_map();
  EXPECT_THAT(landmarks_observed(map, 0),
              ElementsAre(LandmarkIndex{0}, LandmarkIndex{1}, LandmarkIndex{2}));
  EXPECT_THAT(landmarks_observed(map, 1), ElementsAre(LandmarkIndex{0}, LandmarkIndex{1}));
  EXPECT_THAT(landmarks_observed(map, 2), ElementsAre(LandmarkIndex{0}));
  EXPECT_THAT(landmarks_observed(map, 3), IsEmpty());
}

TEST(LandmarksObserved, AreAllWhereObservationsAreUnknown) {
  EXPECT_EQ(landmarks_observed(without_observations(), 2).size(), 3U);
}

TEST(WithLandmarks, KeepsTheGivenOrderAndAllTheirColumns) {
  const LandmarkMap map = full_map();
  const std::vector<LandmarkIndex> picked = {LandmarkIndex{3}, LandmarkIndex{0}};
  MapTables expected = full_tables();
  expected.info.uuid.reset();
  LandmarkTable& landmarks = expected.landmarks;
  landmarks.ids = {landmarks.ids[3], landmarks.ids[0]};
  landmarks.positions = {landmarks.positions[3], landmarks.positions[0]};
  landmarks.covariances = {landmarks.covariances[3], landmarks.covariances[0]};
  landmarks.colors = {landmarks.colors[3], landmarks.colors[0]};
  landmarks.descriptors->known = {0, 1};
  landmarks.descriptors->bytes = {0, 0, 0x00, 0xff};
  landmarks.columns = {{"confidence", {1.0, 0.25}}, {"never_set", {kNan, kNan}}};
  ObservationTable& observations = expected.observations;
  observations.offsets = {0, 2, 4};
  observations.frames = {FrameIndex{2}, FrameIndex{1}, FrameIndex{0}, FrameIndex{2}};
  observations.pixels = {{1e-5, 1e5}, {-0.0, 3.0}, {447.925, 255.3}, {-0.5, 479.5}};
  observations.keypoints = {0U, std::nullopt, 12U, std::nullopt};
  observations.depths = {std::nullopt, std::nullopt, 2.01, 1.99};
  observations.octaves = {0, std::nullopt, std::nullopt, 1};
  observations.sources = {PixelSource::kCorner, std::nullopt, PixelSource::kReference,
                          PixelSource::kPatch};
  observations.sigmas_px = {std::nullopt, std::nullopt, 0.05, 0.4};
  EXPECT_THAT(with_landmarks(map, picked), EqualsMap(LandmarkMap(std::move(expected))));
}

TEST(WithLandmarks, KeepsAllFramesEvenWithoutLandmarks) {
  const LandmarkMap none = with_landmarks(full_map(), {});
  EXPECT_EQ(none.landmark_count(), 0U);
  EXPECT_EQ(none.frame_count(), 3U);
  EXPECT_EQ(none.observation_count(), 0U);
  EXPECT_EQ(none.cameras().size(), 2U);
}

TEST(WithLandmarks, LeavesUnknownObservationsUnknown) {
  const std::vector<LandmarkIndex> picked = {LandmarkIndex{1}};
  EXPECT_FALSE(with_landmarks(without_observations(), picked).has_observations());
}

TEST(WithLandmarks, RefusesWhatTheMapDoesNotHave) {
  expect_refused([] { with_landmarks(plain_map(), std::vector<LandmarkIndex>{LandmarkIndex{3}}); },
                 ErrorKind::kMisuse, "landmarks: index 3; expected below 3");
  expect_refused(
      [] {
        with_landmarks(plain_map(), std::vector<LandmarkIndex>{LandmarkIndex{1}, LandmarkIndex{1}});
      },
      ErrorKind::kInput, "landmark 2: the id occurs twice");
}

TEST(DropFarLandmarks, DropsWhatBelongsToThem) {
  MapTables tables = testing::several_tables();
  EXPECT_TRUE(drop_far_landmarks(tables).empty());
  tables.landmarks.positions[0].y() = 2e9;
  tables.landmarks.positions[1].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(drop_far_landmarks(tables), (std::vector<std::uint32_t>{0, 1}));
  const std::vector<LandmarkIndex> others = {LandmarkIndex{2}, LandmarkIndex{3}};
  EXPECT_THAT(LandmarkMap(std::move(tables)),
              EqualsMap(with_landmarks(testing::several_map(), others)));
}

TEST(CutFrames, KeepsLandmarksAllOfWhoseObservationsLieInside) {
  const LandmarkMap map = four_frames();
  const LandmarkMap first = cut_frames(map, FrameId{10}, FrameId{30});
  EXPECT_THAT(values(first.frames().ids), ElementsAre(10, 20));
  EXPECT_THAT(values(first.landmarks().ids), ElementsAre(1));
  const LandmarkMap second = cut_frames(map, FrameId{30}, FrameId{41});
  EXPECT_THAT(values(second.frames().ids), ElementsAre(40, 30));
  EXPECT_THAT(values(second.landmarks().ids), ElementsAre(3, 5));
  // Observations name their frames by the new positions, in the old order.
  EXPECT_THAT(second.observing_frames(LandmarkIndex{1}), ElementsAre(FrameIndex{0}, FrameIndex{1}));
  EXPECT_THAT(second.observed_pixels(LandmarkIndex{1}), ElementsAre(Pixel{4, 0}, Pixel{4, 2}));
  EXPECT_THAT(second.frames().timestamps_s, ElementsAre(4.0, 3.0));
  EXPECT_EQ(second.info().uuid, std::nullopt);
}

TEST(CutFrames, TakesTheRangeHalfOpen) {
  const LandmarkMap map = four_frames();
  EXPECT_THAT(values(cut_frames(map, FrameId{10}, FrameId{11}).frames().ids), ElementsAre(10));
  EXPECT_THAT(values(cut_frames(map, FrameId{11}, FrameId{40}).frames().ids), ElementsAre(30, 20));
  // Even the whole range leaves out the landmark that nothing observed.
  const LandmarkMap whole = cut_frames(map, FrameId{0}, FrameId{18446744073709551615U});
  EXPECT_EQ(whole.frame_count(), 4U);
  EXPECT_THAT(values(whole.landmarks().ids), ElementsAre(1, 2, 3, 5));
}

TEST(CutFrames, RefusesARangeWithoutFrames) {
  const LandmarkMap map = four_frames();
  expect_refused([&] { cut_frames(map, FrameId{11}, FrameId{20}); }, ErrorKind::kMisuse,
                 "frames: the map has no frame with an id from 11 to below 20");
  expect_refused([&] { cut_frames(map, FrameId{20}, FrameId{20}); }, ErrorKind::kMisuse,
                 "no frame");
  expect_refused([&] { cut_frames(map, FrameId{40}, FrameId{10}); }, ErrorKind::kMisuse,
                 "no frame");
}

TEST(CutFrames, RefusesAMapThatDoesNotKnowItsObservations) {
  expect_refused([] { cut_frames(without_observations(), FrameId{1}, FrameId{2}); },
                 ErrorKind::kMisuse, "does not know which frame observed what");
}

const Rigid3 kFirst = Rigid3::from_roll_pitch_yaw({1.0, -2.0, 0.5}, 0.3, -0.4, 2.0);
const Rigid3 kSecond = Rigid3::from_roll_pitch_yaw({-0.2, 0.1, 3.0}, -1.0, 0.2, 0.7);

// The same numbers but for rounding; NaN equals NaN.
void expect_near(const LandmarkMap& a, const LandmarkMap& b) {
  ASSERT_EQ(a.frame_count(), b.frame_count());
  ASSERT_EQ(a.landmark_count(), b.landmark_count());
  for (std::uint32_t i = 0; i < a.frame_count(); ++i) {
    EXPECT_LT(
        a.world_from_camera(FrameIndex{i}).difference_to(b.world_from_camera(FrameIndex{i})).norm(),
        1e-13);
  }
  for (std::uint32_t i = 0; i < a.landmark_count(); ++i) {
    EXPECT_TRUE(a.landmarks().positions[i].isApprox(b.landmarks().positions[i], 1e-14));
    const auto ca = a.covariance(LandmarkIndex{i});
    const auto cb = b.covariance(LandmarkIndex{i});
    ASSERT_EQ(ca.has_value(), cb.has_value());
    if (ca) {
      EXPECT_LE((*ca - *cb).norm(), 1e-14 * ca->norm());
    }
  }
  ASSERT_EQ(a.info().gravity.has_value(), b.info().gravity.has_value());
  if (a.info().gravity) {
    EXPECT_TRUE(a.info().gravity->isApprox(*b.info().gravity, 1e-14));
  }
}

TEST(Transformed, ByTheIdentityChangesNothingButRounding) {
  expect_near(transformed(full_map(), Rigid3()), full_map());
}

TEST(Transformed, TwiceIsOnceByTheProduct) {
  expect_near(transformed(transformed(full_map(), kFirst), kSecond),
              transformed(full_map(), kSecond * kFirst));
}

TEST(Transformed, IsUndoneByTheInverse) {
  MapTables tables = full_tables();
  tables.landmarks.positions[2] = {7.0, 8.0, 9.0};  // one at 1e8 leaves no digits for the rest
  const LandmarkMap map(std::move(tables));
  const LandmarkMap back = transformed(transformed(map, kFirst), kFirst.inverse());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    EXPECT_LT((back.landmarks().positions[i] - map.landmarks().positions[i]).norm(), 1e-13);
  }
  expect_near(transformed(back, kSecond), transformed(map, kSecond));
}

TEST(Transformed, MovesAPointMapAsOneExpects) {
  // A quarter turn about z and a step of (10, 0, 0): x -> y, y -> -x.
  MapTables tables = plain_tables();
  tables.info.gravity = Eigen::Vector3d(0.0, 1.0, 0.0);
  tables.landmarks.positions[0] = {1.0, 2.0, 3.0};
  tables.landmarks.covariances[0] = Eigen::Vector3d(1.0, 4.0, 9.0).asDiagonal();
  const LandmarkMap moved =
      transformed(LandmarkMap(std::move(tables)),
                  Rigid3::from_roll_pitch_yaw({10.0, 0.0, 0.0}, 0.0, 0.0, std::acos(0.0)));
  EXPECT_TRUE(moved.landmarks().positions[0].isApprox(Eigen::Vector3d(8.0, 1.0, 3.0), 1e-15));
  EXPECT_TRUE(moved.landmarks().covariances[0].isApprox(
      Eigen::Matrix3d(Eigen::Vector3d(4.0, 1.0, 9.0).asDiagonal()), 1e-15));
  EXPECT_TRUE(moved.info().gravity->isApprox(Eigen::Vector3d(-1.0, 0.0, 0.0), 1e-15));
  EXPECT_TRUE(moved.frames().translations[1].isApprox(Eigen::Vector3d(10.0, 0.1, 0.0), 1e-15));
  const Eigen::Vector3d forward =
      moved.world_from_camera(FrameIndex{1}).rotation() * Eigen::Vector3d::UnitX();
  EXPECT_TRUE(forward.isApprox(Eigen::Vector3d::UnitY(), 1e-15));
}

TEST(Transformed, KeepsCovariancesExactlySymmetricAndUnknownOnesUnknown) {
  const LandmarkMap moved = transformed(full_map(), kFirst);
  const auto covariance = moved.covariance(LandmarkIndex{0});
  ASSERT_TRUE(covariance.has_value());
  EXPECT_EQ(*covariance, covariance->transpose());
  EXPECT_FALSE(moved.covariance(LandmarkIndex{1}).has_value());
}

TEST(Transformed, LeavesReprojectionUnchanged) {
  const Camera camera{CameraId{0}, "PINHOLE", 640, 480, {517.3, 516.5, 318.6, 255.3}};
  MapTables tables = plain_tables();
  tables.frames.quaternions[1] = {0.995, 0.05, -0.07, 0.05};
  const LandmarkMap map(std::move(tables));
  const LandmarkMap moved = transformed(map, kFirst);
  std::size_t compared = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    for (const FrameIndex frame : map.observing_frames(LandmarkIndex{i})) {
      const auto before =
          project(camera, map.world_from_camera(frame).inverse() * map.landmarks().positions[i]);
      const auto after = project(
          camera, moved.world_from_camera(frame).inverse() * moved.landmarks().positions[i]);
      ASSERT_TRUE(before && after);
      EXPECT_NEAR(after->u, before->u, 1e-10);
      EXPECT_NEAR(after->v, before->v, 1e-10);
      ++compared;
    }
  }
  EXPECT_EQ(compared, 3U);
}

TEST(Transformed, ByASimilarityScalesAllLengthsAndLeavesReprojectionUnchanged) {
  constexpr double kScale = 2.5;
  const LandmarkMap map = full_map();
  const LandmarkMap moved = transformed(map, kFirst);
  const LandmarkMap grown = transformed(map, Similarity3(kScale, kFirst));
  const Eigen::Vector3d& shift = kFirst.translation();
  const auto expect_grown = [&](const Eigen::Vector3d& large, const Eigen::Vector3d& small) {
    EXPECT_TRUE((large - shift).isApprox(kScale * (small - shift), 1e-12));
  };
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    expect_grown(grown.landmarks().positions[i], moved.landmarks().positions[i]);
    const auto large = grown.covariance(LandmarkIndex{i});
    const auto small = moved.covariance(LandmarkIndex{i});
    ASSERT_EQ(large.has_value(), small.has_value());
    if (large) {
      EXPECT_TRUE(large->isApprox(kScale * kScale * *small, 1e-12));
    }
  }
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    expect_grown(grown.frames().translations[i], moved.frames().translations[i]);
  }
  EXPECT_EQ(grown.frames().quaternions, moved.frames().quaternions);
  std::size_t known = 0;
  for (std::size_t i = 0; i < map.observations().depths.size(); ++i) {
    const auto& depth = map.observations().depths[i];
    ASSERT_EQ(grown.observations().depths[i].has_value(), depth.has_value());
    if (!depth) continue;
    EXPECT_DOUBLE_EQ(*grown.observations().depths[i], kScale * *depth);
    ++known;
  }
  EXPECT_GT(known, 0U);
  EXPECT_EQ(with_length_unit(grown, LengthUnit::kMetres).info().length_unit, LengthUnit::kMetres);
}

TEST(Transformed, KeepsAllElseAndDropsTheUuid) {
  const LandmarkMap map = full_map();
  MapTables moved = tables_of(transformed(map, kFirst));
  EXPECT_EQ(moved.info.uuid, std::nullopt);
  moved.info.uuid = map.info().uuid;
  moved.info.gravity = map.info().gravity;
  moved.info.georeference = map.info().georeference;
  moved.frames.translations = map.frames().translations;
  moved.frames.quaternions = map.frames().quaternions;
  moved.landmarks.positions = map.landmarks().positions;
  moved.landmarks.covariances = map.landmarks().covariances;
  EXPECT_THAT(LandmarkMap(std::move(moved)), EqualsMap(map));
}

TEST(Transformed, TurnsNormals) {
  LandmarkMap map = plain_map();
  const std::vector<double> one(map.landmark_count(), 1.0);
  for (const char* name : {"ny", "nz", "Normal_Y", "Normal_Z", "weight"}) {
    map = with_column(map, name, one);
  }
  for (const char* name : {"nx", "Normal_X"}) {
    map = with_column(map, name, std::vector<double>(map.landmark_count(), 2.0));
  }
  // By 90 degrees about z, three times the size.
  const Similarity3 turn(3.0, Rigid3::from_roll_pitch_yaw({5, 6, 7}, 0, 0, std::acos(-1.0) / 2));
  const LandmarkMap moved = transformed(map, turn);
  for (const auto& [name, value] :
       {std::pair{"nx", -1.0}, {"ny", 2.0}, {"nz", 1.0}, {"Normal_X", -1.0}, {"Normal_Y", 2.0}}) {
    EXPECT_NEAR(moved.column(name)->values[1], value, 1e-15) << name;
  }
  EXPECT_EQ(moved.column("weight")->values, one);
}

TEST(WithLandmarks, KeepsTheirColumnsPrecision) {
  const LandmarkMap map = with_column(synthetic_map({.seed = 1, .landmarks = 3, .frames = 2}), "n",
                                      std::vector<float>{0.1F, 0.2F, 0.3F});
  const LandmarkMap last = with_landmarks(map, std::vector<LandmarkIndex>{{2}});
  EXPECT_TRUE(last.column("n")->values.is_single());
  EXPECT_EQ(last.column("n")->values[0], static_cast<double>(0.3F));
}

TEST(WithColumn, AddsAColumn) {
  const LandmarkMap map = with_column(plain_map(), "weight", {1.0, kNan, 3.0});
  ASSERT_NE(map.column("weight"), nullptr);
  EXPECT_EQ(map.column("weight")->values[2], 3.0);
  MapTables tables = tables_of(map);
  tables.landmarks.columns.clear();
  EXPECT_THAT(LandmarkMap(std::move(tables)), EqualsMap(plain_map()));
}

TEST(WithColumn, ReplacesAColumnOfThatNameInItsPlace) {
  const LandmarkMap map = with_column(full_map(), "confidence", {1.0, 2.0, 3.0, 4.0});
  MapTables expected = full_tables();
  expected.info.uuid.reset();
  expected.landmarks.columns[0].values = {1.0, 2.0, 3.0, 4.0};
  EXPECT_THAT(map, EqualsMap(LandmarkMap(std::move(expected))));
}

TEST(WithColumn, RefusesAWrongNumberOfValues) {
  expect_refused(
      [] {
        with_column(plain_map(), "weight", {1.0, 2.0});
      },
      ErrorKind::kInput, "column 'weight': 2 entries; expected 3, one a row");
  expect_refused(
      [] {
        with_column(plain_map(), "two words", {1.0, 2.0, 3.0});
      },
      ErrorKind::kInput, "column 'two words': not a name");
}

TEST(WithCamera, GivesAllFramesTheOneCamera) {
  const Camera camera{CameraId{9}, "SIMPLE_PINHOLE", 64, 48, {50.0, 32.0, 24.0}};
  const LandmarkMap map = with_camera(full_map(), camera);
  MapTables expected = full_tables();
  expected.info.uuid.reset();
  expected.cameras = {camera};
  expected.frames.cameras.assign(3, CameraIndex{0});
  EXPECT_THAT(map, EqualsMap(LandmarkMap(std::move(expected))));
}

TEST(WithLandmarks, KeepsTheirFurtherDescriptors) {
  const LandmarkMap map = testing::several_map();
  const std::vector<LandmarkIndex> kept = {LandmarkIndex{3}, LandmarkIndex{2}, LandmarkIndex{0}};
  const LandmarkMap some = with_landmarks(map, kept);
  const DescriptorColumn& column = *some.landmarks().descriptors;
  EXPECT_EQ(column.further_offsets, (std::vector<std::uint64_t>{0, 0, 1, 3}));
  EXPECT_EQ(column.further, (std::vector<std::uint8_t>{0x7f, 0x80, 0x01, 0xfe, 0x00, 0x00}));
  const std::vector<LandmarkIndex> last = {LandmarkIndex{3}};
  EXPECT_FALSE(with_landmarks(map, last).landmarks().descriptors->has_further());
}

TEST(Transformed, KeepsFurtherDescriptors) {
  const LandmarkMap moved = transformed(testing::several_map(), Rigid3());
  EXPECT_EQ(moved.landmarks().descriptors->further,
            testing::several_map().landmarks().descriptors->further);
}

// The error of a pose, moved by hand, is that of the moved pose.
TEST(Transformed, MovesTheCovariancesOfPoses) {
  const LandmarkMap map = testing::several_map();
  const Similarity3 move(
      2.0, Rigid3(Eigen::Quaterniond(rotation_exp({0.3, -0.7, 1.1})), {4.0, -5.0, 6.0}));
  const LandmarkMap moved = transformed(map, move);
  const auto& covariances = moved.frames().pose_covariances;
  ASSERT_EQ(covariances.size(), 3U);
  EXPECT_FALSE(covariances[1]);
  EXPECT_TRUE(covariances[0]->isZero(0.0));
  Eigen::Matrix<double, 6, 6> jacobian;
  const Rigid3 pose = map.world_from_camera(FrameIndex{2});
  const Rigid3 moved_pose = moved.world_from_camera(FrameIndex{2});
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const Rigid3 off = pose.perturbed(kStep * Vector6d::Unit(i));
    const Rigid3 moved_off(move.rigid().quaternion() * off.quaternion(), move * off.translation());
    jacobian.col(i) = moved_pose.difference_to(moved_off) / kStep;
  }
  const Matrix6d expected = jacobian * *map.frames().pose_covariances[2] * jacobian.transpose();
  EXPECT_LT((*covariances[2] - expected).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(CutFrames, KeepsTheCovariancesOfTheirPoses) {
  const LandmarkMap map = testing::several_map();
  const FrameId last = map.frames().ids[2];
  const LandmarkMap part = cut_frames(map, last, FrameId{last.value + 1});
  ASSERT_EQ(part.frames().pose_covariances.size(), 1U);
  EXPECT_EQ(*part.frames().pose_covariances[0], *map.frames().pose_covariances[2]);
}

using Bytes = std::vector<std::uint8_t>;

std::vector<std::span<const std::uint8_t>> spans(const std::vector<Bytes>& rows) {
  return {rows.begin(), rows.end()};
}

TEST(DistinctDescriptors, ChooseTheFarthestFromThoseChosen) {
  const std::vector<Bytes> rows = {{0x00}, {0x01}, {0xff}, {0x0f}, {0x00}};
  EXPECT_THAT(distinct_descriptors(spans(rows), 0, 3, DescriptorNorm::kHamming),
              ElementsAre(0, 2, 3));
  EXPECT_THAT(distinct_descriptors(spans(rows), 3, 1, DescriptorNorm::kHamming), ElementsAre(3));
  // By bytes, 0x0f is nearer to 0 than 0xff is to it.
  EXPECT_THAT(distinct_descriptors(spans(rows), 2, 2, DescriptorNorm::kSquared), ElementsAre(2, 0));
}

TEST(DistinctDescriptors, StopWhereAllOthersAreEqualToAChosenOne) {
  const std::vector<Bytes> rows = {{7, 7}, {7, 7}, {8, 7}, {7, 7}};
  EXPECT_THAT(distinct_descriptors(spans(rows), 1, 4, DescriptorNorm::kHamming), ElementsAre(1, 2));
}

TEST(DistinctDescriptors, AreThreeOrMoreWhereThereAreSoManyDifferentOnes) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Bytes> rows(2 + random.index(9));
    for (Bytes& row : rows) {
      for (int i = 0; i < 4; ++i) row.push_back(static_cast<std::uint8_t>(random.index(256)));
    }
    const std::size_t first = random.index(rows.size());
    const auto chosen =
        distinct_descriptors(spans(rows), first, kDistinctViews, DescriptorNorm::kHamming);
    EXPECT_EQ(chosen.size(), std::min(rows.size(), kDistinctViews));
    EXPECT_EQ(std::set<std::size_t>(chosen.begin(), chosen.end()).size(), chosen.size());
    EXPECT_EQ(chosen.front(), first);
    // Each is as far from those before as any.
    for (std::size_t k = 1; k < chosen.size(); ++k) {
      const auto away = [&](std::size_t i) {
        auto least = std::numeric_limits<std::uint64_t>::max();
        for (std::size_t j = 0; j < k; ++j) {
          least = std::min(
              least, descriptor_difference(rows[i], rows[chosen[j]], DescriptorNorm::kHamming));
        }
        return least;
      };
      for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_LE(away(i), away(chosen[k]));
    }
  }
}

TEST(AppendDescriptors, AddsRowsWithAndWithoutFurtherOnes) {
  DescriptorColumn column{"ORB", 1, {}, {}};
  append_descriptors(column, spans({{1}}));
  EXPECT_FALSE(column.has_further());
  append_descriptors(column, {});
  append_descriptors(column, spans({{2}, {3}, {4}}));
  append_descriptors(column, spans({{5}}));
  EXPECT_THAT(column.known, ElementsAre(1, 0, 1, 1));
  EXPECT_THAT(column.bytes, ElementsAre(1, 0, 2, 5));
  EXPECT_THAT(column.further_offsets, ElementsAre(0, 0, 0, 2, 2));
  EXPECT_THAT(column.further, ElementsAre(3, 4));
}

TEST(DescriptorBytes, KeepTheAnglesBetweenVectors) {
  Random random(5);
  const auto difference = [](const std::vector<float>& a, const std::vector<float>& b) {
    return std::sqrt(static_cast<double>(
        descriptor_difference(descriptor_bytes(a), descriptor_bytes(b), DescriptorNorm::kSquared)));
  };
  for (int trial = 0; trial < 50; ++trial) {
    Eigen::VectorXf a(128);
    Eigen::VectorXf b(128);
    for (int i = 0; i < 128; ++i) {
      a[i] = static_cast<float>(random.normal());
      b[i] = a[i] + static_cast<float>(0.5 * random.normal());
    }
    const std::vector<float> first(a.begin(), a.end());
    std::vector<float> second(b.begin(), b.end());
    const double exact = (a.normalized() - b.normalized()).norm();
    const double steps = 31.875 * std::sqrt(128.0);
    EXPECT_NEAR(difference(first, second) / steps, exact, 0.01 * exact);
    for (float& value : second) value *= 7.0F;
    EXPECT_NEAR(difference(first, second) / steps, exact, 0.01 * exact) << "of any length";
  }
}

TEST(WithoutFrames, DropsWhatFewerThanTwoOthersSee) {
  const LandmarkMap map = synthetic_map({.seed = 3, .landmarks = 200, .frames = 6});
  const std::vector<FrameIndex> dropped = {FrameIndex{1}, FrameIndex{4}};
  const LandmarkMap left = without_frames(map, dropped);
  EXPECT_EQ(left.frame_count(), 4U);
  EXPECT_EQ(left.frames().ids[1], map.frames().ids[2]);
  std::size_t expected = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    std::size_t others = 0;
    const auto frames = map.observing_frames(LandmarkIndex{i});
    for (const FrameIndex frame : frames) others += frame.value != 1 && frame.value != 4 ? 1 : 0;
    const bool kept = others >= 2 || others == frames.size();
    expected += kept ? 1 : 0;
    const auto found = left.find(map.landmarks().ids[i]);
    ASSERT_EQ(found.has_value(), kept) << i;
    if (kept) {
      EXPECT_EQ(left.observation_count(*found), others);
    }
  }
  EXPECT_EQ(left.landmark_count(), expected);
  EXPECT_LT(expected, map.landmark_count());
}

TEST(AreAlike, ByAngleAndDistance) {
  constexpr double kCosine = 0.94;
  constexpr double kRatio = 1.5;
  const Eigen::Vector3d here(0.0, 0.0, 2.0);
  const auto turned = [](double degrees_off, double distance) -> Eigen::Vector3d {
    return distance *
           Eigen::Vector3d(std::sin(radians(degrees_off)), 0.0, std::cos(radians(degrees_off)));
  };
  EXPECT_TRUE(are_alike(here, turned(19.0, 2.0), kCosine, kRatio));
  EXPECT_FALSE(are_alike(here, turned(21.0, 2.0), kCosine, kRatio));
  for (const auto& [a, b] :
       {std::pair(here, turned(0.0, 2.9)), std::pair(turned(0.0, 2.9), here)}) {
    EXPECT_TRUE(are_alike(a, b, kCosine, kRatio));
  }
  for (const auto& [a, b] :
       {std::pair(here, turned(0.0, 3.1)), std::pair(turned(0.0, 3.1), here)}) {
    EXPECT_FALSE(are_alike(a, b, kCosine, kRatio));
  }
  EXPECT_FALSE(are_alike(here, Eigen::Vector3d::Zero(), kCosine, kRatio));
}

TEST(NextFreeId, IsAboveAllIds) {
  EXPECT_EQ(next_free_id(std::span<const LandmarkId>()), LandmarkId{0});
  const std::vector<LandmarkId> ids = {LandmarkId{7}, LandmarkId{3}};
  EXPECT_EQ(next_free_id(std::span<const LandmarkId>(ids)), LandmarkId{8});
}

}  // namespace
}  // namespace cairn
