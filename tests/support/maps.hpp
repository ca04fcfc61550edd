// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <gmock/gmock.h>

#include "cairn/map/landmark_map.hpp"

namespace cairn::testing {

/// Tables of two cameras, three frames and four landmarks that use every optional column, each with
/// known and unknown entries. Ids are neither dense nor in order, one quaternion is off norm 1 as
/// in real files, one landmark has no observation, and texts hold what must be escaped.
inline MapTables full_tables() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  MapTables tables;
  tables.info = {
      LengthUnit::kFree,
      "desk",
      Eigen::Vector3d(0.0, 0.6, 0.8),
      "123e4567-e89b-12d3-a456-426614174000",
      std::vector<std::string>{"made by hand", " 100 % of it\n"},
      GeoReference{{47.37, 8.54, 408.0}, 2.5, {0.6, 0.0, 0.8000004, 0.0}, {1.0, -2.0, 0.1}},
      {{"nail 1", 47.3702, 8.5401, 409.25, {{"rgb/1.png", {12.5, -0.0}}, {" b%.png", {0.1, 3e5}}}},
       {"\n", -0.0, 180.0, std::nullopt, {}}}};
  tables.cameras = {
      {CameraId{5}, "PINHOLE", 640, 480, {517.3, 516.5, 318.6, 255.3}},
      {CameraId{2}, "OPENCV_FISHEYE", 320, 240, {190.0, 191.0, 160.0, 120.0, 0.01, -0.002, 0, 0}}};

  FrameTable& frames = tables.frames;
  frames.ids = {FrameId{7}, FrameId{18446744073709551615U}, FrameId{3}};
  frames.translations = {{0.0, -0.0, 0.0}, {0.1, 0.2, -0.3}, {1e-310, 4.5, 1.0 / 3.0}};
  frames.quaternions = {std::array{1.0, 0.0, 0.0, 0.0}, std::array{0.5, -0.5, 0.5, 0.5},
                        std::array{0.6, 0.0, 0.8000004, 0.0}};
  frames.cameras = {CameraIndex{1}, std::nullopt, CameraIndex{0}};
  frames.timestamps_s = {std::nullopt, 1305031453.374112, 0.0};
  frames.image_names = {"rgb/1.png", "", " 50%\tof\x7f\xc3\xa9 "};
  frames.gnss = {GnssFix{{47.3701, 8.54, 410.5}, 3.5}, std::nullopt,
                 GnssFix{{-0.0, -180.0, 1e-300}, std::nullopt}};

  LandmarkTable& landmarks = tables.landmarks;
  landmarks.ids = {LandmarkId{30}, LandmarkId{10}, LandmarkId{9223372036854775808U},
                   LandmarkId{20}};
  landmarks.positions = {{0.5, 0.0, 2.0}, {-1.0, 0.25, 3.0}, {1e8, -1e-300, 0.1}, {0, 0, 1}};
  Eigen::Matrix3d covariance;
  covariance << 2e-4, 1e-5, -3e-5, 1e-5, 1e-4, 0.0, -3e-5, 0.0, 9e-4;
  landmarks.covariances = {covariance, Eigen::Matrix3d::Constant(kNan), Eigen::Matrix3d::Zero(),
                           covariance * 0.1};
  landmarks.colors = {Color{200, 180, 40}, std::nullopt, Color{0, 0, 0}, Color{255, 255, 255}};
  landmarks.descriptors =
      DescriptorColumn{"ORB", 2, {1, 0, 1, 0}, {0x00, 0xff, 0, 0, 0x1a, 0xb2, 0, 0}};
  landmarks.columns = {{"confidence", {0.25, kNan, -0.0, 1.0}},
                       {"never_set", {kNan, kNan, kNan, kNan}}};

  ObservationTable& observations = tables.observations;
  observations.offsets = {0, 2, 3, 3, 5};
  observations.frames = {FrameIndex{0}, FrameIndex{2}, FrameIndex{1}, FrameIndex{2}, FrameIndex{1}};
  observations.pixels = {{447.925, 255.3}, {-0.5, 479.5}, {0.1, 0.2}, {1e-5, 1e5}, {-0.0, 3.0}};
  observations.keypoints = {12U, std::nullopt, 4294967295U, 0U, std::nullopt};
  observations.depths = {2.01, 1.99, std::nullopt, std::nullopt, std::nullopt};
  observations.octaves = {std::nullopt, 1, -2147483647 - 1, 0, std::nullopt};
  observations.sources = {PixelSource::kReference, PixelSource::kPatch, std::nullopt,
                          PixelSource::kCorner, std::nullopt};
  observations.sigmas_px = {0.05, 0.4, 1.5, std::nullopt, std::nullopt};
  return tables;
}

inline LandmarkMap full_map() {
  return LandmarkMap(full_tables());
}

/// As full_tables(), with what only version 3 of the text format holds: two further descriptors of the first landmark
/// and one of the third, covariances of the first and the third frame's poses, and a rig that took both.
inline MapTables several_tables() {
  MapTables tables = full_tables();
  tables.landmarks.descriptors->further_offsets = {0, 2, 2, 3, 3};
  tables.landmarks.descriptors->further = {0x01, 0xfe, 0x00, 0x00, 0x7f, 0x80};
  Matrix6d covariance = Matrix6d::Identity() * 0.01;
  covariance(0, 5) = covariance(5, 0) = 0.0025;
  covariance(1, 2) = covariance(2, 1) = -1.0 / 300.0;
  tables.frames.pose_covariances = {Matrix6d(Matrix6d::Zero()), std::nullopt, covariance};
  tables.rigs = {{RigId{18446744073709551615U},
                  {{CameraIndex{1}, {0.6, 0.0, 0.8000004, -0.0}, {0.25, 1.0 / 3.0, -0.0}},
                   {CameraIndex{0}, {1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}}}};
  tables.frames.instants = {InstantId{4294967295U}, std::nullopt, InstantId{4294967295U}};
  return tables;
}

inline LandmarkMap several_map() {
  return LandmarkMap(several_tables());
}

/// A map that version 1 of the text format holds whole: two frames, three landmarks, of which one
/// was observed twice, one once and one never.
inline MapTables plain_tables() {
  MapTables tables;
  tables.frames.ids = {FrameId{1}, FrameId{2}};
  tables.frames.translations = {{0.0, 0.0, 0.0}, {0.1, 0.0, 0.0}};
  tables.frames.quaternions = {std::array{1.0, 0.0, 0.0, 0.0}, std::array{1.0, 0.0, 0.0, 0.0}};
  tables.landmarks.ids = {LandmarkId{1}, LandmarkId{2}, LandmarkId{3}};
  tables.landmarks.positions = {{0.5, 0.0, 2.0}, {0.0, 0.0, 2.0}, {1.0, 1.0, 4.0}};
  tables.landmarks.covariances.assign(3, Eigen::Vector3d(1e-4, 1e-4, 9e-4).asDiagonal());
  tables.observations.offsets = {0, 2, 3, 3};
  tables.observations.frames = {FrameIndex{0}, FrameIndex{1}, FrameIndex{1}};
  tables.observations.pixels = {{447.925, 255.3}, {422.06, 255.3}, {292.735, 255.3}};
  return tables;
}

inline LandmarkMap plain_map() {
  return LandmarkMap(plain_tables());
}

namespace detail {

// Bit for bit, so that -0.0 differs from 0.0; only NaNs, which say "unknown", are all alike.
inline bool same(double a, double b) {
  if (std::isnan(a) && std::isnan(b)) return true;
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
inline bool same(const Pixel& a, const Pixel& b) {
  return same(a.u, b.u) && same(a.v, b.v);
}
template <int Rows, int Columns>
bool same(const Eigen::Matrix<double, Rows, Columns>& a,
          const Eigen::Matrix<double, Rows, Columns>& b) {
  if (Rows == 3 && Columns == 3 && std::isnan(a(0, 0)) && std::isnan(b(0, 0))) return true;
  for (int i = 0; i < a.size(); ++i) {
    if (!same(a.data()[i], b.data()[i])) return false;
  }
  return true;
}
template <class Value>
  requires std::equality_comparable<Value> && (!std::is_floating_point_v<Value>)
bool same(const Value& a, const Value& b) {
  return a == b;
}
inline bool same(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  for (std::size_t i = 0; i < 4; ++i) {
    if (!same(a[i], b[i])) return false;
  }
  return true;
}
inline bool same(const std::optional<double>& a, const std::optional<double>& b) {
  return a.has_value() == b.has_value() && (!a || same(*a, *b));
}
inline bool same(const std::optional<Eigen::Vector3d>& a, const std::optional<Eigen::Vector3d>& b) {
  return a.has_value() == b.has_value() && (!a || same(*a, *b));
}

inline bool same(const GeodeticPosition& a, const GeodeticPosition& b) {
  return same(a.latitude_deg, b.latitude_deg) && same(a.longitude_deg, b.longitude_deg) &&
         same(a.altitude_m, b.altitude_m);
}
inline bool same(const std::optional<GeoReference>& a, const std::optional<GeoReference>& b) {
  return a.has_value() == b.has_value() &&
         (!a || (same(a->origin, b->origin) && same(a->scale, b->scale) &&
                 same(a->quaternion, b->quaternion) && same(a->translation, b->translation)));
}
inline bool same(const std::optional<GnssFix>& a, const std::optional<GnssFix>& b) {
  return a.has_value() == b.has_value() &&
         (!a || (same(a->position, b->position) && same(a->accuracy_m, b->accuracy_m)));
}

}  // namespace detail

/// The first column, and the row of it, in which two maps differ in any bit; empty if in none.
inline std::string map_difference(const LandmarkMap& a, const LandmarkMap& b) {
  std::string difference;
  const auto one = [&](const std::string& name, const auto& x, const auto& y) {
    if (difference.empty() && !detail::same(x, y)) difference = name;
  };
  const auto column = [&](const std::string& name, const auto& x, const auto& y) {
    if (difference.empty() && x.size() != y.size()) {
      difference =
          name + ": " + std::to_string(x.size()) + " and " + std::to_string(y.size()) + " entries";
    }
    for (std::size_t i = 0; difference.empty() && i < x.size(); ++i) {
      one(name + " " + std::to_string(i), x[i], y[i]);
    }
  };
  one("length unit", a.info().length_unit, b.info().length_unit);
  one("world frame", a.info().world_frame, b.info().world_frame);
  one("gravity", a.info().gravity, b.info().gravity);
  one("georeference", a.info().georeference, b.info().georeference);
  one("uuid", a.info().uuid, b.info().uuid);
  column("provenance", a.info().provenance, b.info().provenance);
  column("control points", a.info().control_points, b.info().control_points);
  column("cameras", a.cameras(), b.cameras());
  column("rigs", a.rigs(), b.rigs());

  column("frame ids", a.frames().ids, b.frames().ids);
  column("translations", a.frames().translations, b.frames().translations);
  column("quaternions", a.frames().quaternions, b.frames().quaternions);
  column("frame cameras", a.frames().cameras, b.frames().cameras);
  column("timestamps", a.frames().timestamps_s, b.frames().timestamps_s);
  column("image names", a.frames().image_names, b.frames().image_names);
  column("GNSS positions", a.frames().gnss, b.frames().gnss);
  column("pose covariances", a.frames().pose_covariances, b.frames().pose_covariances);
  column("instants", a.frames().instants, b.frames().instants);

  column("landmark ids", a.landmarks().ids, b.landmarks().ids);
  column("positions", a.landmarks().positions, b.landmarks().positions);
  column("covariances", a.landmarks().covariances, b.landmarks().covariances);
  column("colors", a.landmarks().colors, b.landmarks().colors);
  const auto& da = a.landmarks().descriptors;
  const auto& db = b.landmarks().descriptors;
  one("whether there are descriptors", da.has_value(), db.has_value());
  if (da && db) {
    one("descriptor kind", da->kind, db->kind);
    one("descriptor size", da->bytes_each, db->bytes_each);
    column("known descriptors", da->known, db->known);
    column("descriptor bytes", da->bytes, db->bytes);
    column("offsets of further descriptors", da->further_offsets, db->further_offsets);
    column("further descriptors", da->further, db->further);
  }
  const auto& ca = a.landmarks().columns;
  const auto& cb = b.landmarks().columns;
  one("number of named columns", ca.size(), cb.size());
  for (std::size_t i = 0; difference.empty() && i < ca.size(); ++i) {
    one("name of column " + std::to_string(i), ca[i].name, cb[i].name);
    column("column " + ca[i].name, ca[i].values, cb[i].values);
  }

  column("offsets", a.observations().offsets, b.observations().offsets);
  column("observing frames", a.observations().frames, b.observations().frames);
  column("pixels", a.observations().pixels, b.observations().pixels);
  column("keypoints", a.observations().keypoints, b.observations().keypoints);
  column("depths", a.observations().depths, b.observations().depths);
  column("octaves", a.observations().octaves, b.observations().octaves);
  column("sources", a.observations().sources, b.observations().sources);
  column("sigmas", a.observations().sigmas_px, b.observations().sigmas_px);
  return difference;
}

/// Matches a map equal to `expected` in all columns, bit for bit.
MATCHER_P(EqualsMap, expected, "is the same map") {
  const std::string difference = map_difference(arg, expected);
  if (!difference.empty()) *result_listener << "which differs in " << difference;
  return difference.empty();
}

}  // namespace cairn::testing
