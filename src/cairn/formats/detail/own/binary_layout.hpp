// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>

#include "cairn/map/landmark_map.hpp"

// The layout of Cairn's binary format (docs/formats.md).
namespace cairn::detail {

static_assert(std::endian::native == std::endian::little, "numbers are stored as they are");
static_assert(sizeof(FrameId) == 8 && sizeof(LandmarkId) == 8 && sizeof(FrameIndex) == 4 &&
                  sizeof(Pixel) == 16 && sizeof(Eigen::Vector3d) == 24 &&
                  sizeof(Eigen::Matrix3d) == 72 && sizeof(std::array<double, 4>) == 32,
              "columns are stored as they are");
static_assert(!Eigen::Matrix3d::IsRowMajor, "covariances are stored column by column");

inline constexpr std::uint32_t kBinaryVersion = 1;
inline constexpr std::uint64_t kVersionPlace = 8;
inline constexpr std::uint64_t kUnitPlace = 12;
inline constexpr std::uint64_t kSizePlace = 16;
inline constexpr std::uint64_t kFramesPlace = 24;
inline constexpr std::uint64_t kLandmarksPlace = 32;
inline constexpr std::uint64_t kObservationsPlace = 40;
inline constexpr std::uint64_t kSectionsPlace = 48;
inline constexpr std::uint64_t kHeaderSize = 56;
inline constexpr std::uint64_t kTableEntrySize = 24;
inline constexpr std::uint64_t kAlignment = 8;
inline constexpr std::uint64_t kChecksumSize = 16;

inline constexpr std::uint64_t kUnknownBits = 0x7ff8000000000000;  // of a double
inline constexpr double kUnknownNumber = std::bit_cast<double>(kUnknownBits);
inline constexpr std::int64_t kUnknownInteger = std::numeric_limits<std::int64_t>::min();

inline constexpr std::size_t kBinaryBlock = std::size_t{1} << 20;

inline constexpr std::size_t kUpperTriangle = 21;  // numbers of a symmetric matrix of six rows

/// The integers of an optional column.
template <class Value>
Value from_integer(std::int64_t integer) {
  if constexpr (requires { Value{}.value; }) {
    return Value{static_cast<decltype(Value{}.value)>(integer)};
  } else {
    return static_cast<Value>(integer);
  }
}
template <class Value>
std::int64_t to_integer(Value value) {
  if constexpr (requires { value.value; }) {
    return value.value;
  } else {
    return static_cast<std::int64_t>(value);
  }
}

// What a section has entries for.
enum class Per { kFile, kFrame, kLandmark, kOffset, kObservation };

struct Layout {
  std::string_view name;
  Per per;
  std::uint64_t bytes_each;  // 0: differs between entries, or is not known in advance
};

inline constexpr std::array<Layout, 36> kLayouts = {{
    {"world frame", Per::kFile, 0},
    {"gravity", Per::kFile, 24},
    {"uuid", Per::kFile, 0},
    {"provenance", Per::kFile, 0},
    {"cameras", Per::kFile, 0},
    {"frame ids", Per::kFrame, 8},
    {"translations", Per::kFrame, 24},
    {"quaternions", Per::kFrame, 32},
    {"frame cameras", Per::kFrame, 8},
    {"timestamps", Per::kFrame, 8},
    {"image names", Per::kFrame, 0},
    {"landmark ids", Per::kLandmark, 8},
    {"positions", Per::kLandmark, 24},
    {"covariances", Per::kLandmark, 72},
    {"colours", Per::kLandmark, 4},
    {"descriptor kind", Per::kFile, 0},
    {"known descriptors", Per::kLandmark, 1},
    {"descriptors", Per::kLandmark, 0},
    {"column names", Per::kFile, 0},
    {"column values", Per::kLandmark, 0},
    {"offsets", Per::kOffset, 8},
    {"observing frames", Per::kObservation, 4},
    {"pixels", Per::kObservation, 16},
    {"keypoints", Per::kObservation, 8},
    {"depths", Per::kObservation, 8},
    {"octaves", Per::kObservation, 8},
    {"sources", Per::kObservation, 8},
    {"sigmas", Per::kObservation, 8},
    {"georeference", Per::kFile, 88},
    {"GNSS positions", Per::kFrame, 32},
    {"further offsets", Per::kOffset, 8},
    {"further descriptors", Per::kFile, 0},
    {"control points", Per::kFile, 0},
    {"pose covariances", Per::kFrame, 8 * kUpperTriangle},
    {"rigs", Per::kFile, 0},
    {"instants", Per::kFrame, 8},
}};
static_assert(kLayouts.size() == static_cast<std::size_t>(MapColumn::kInstants));

constexpr std::size_t index_of(MapColumn column) {
  return static_cast<std::size_t>(column) - 1;
}

constexpr std::uint64_t aligned(std::uint64_t byte) {
  return (byte + kAlignment - 1) / kAlignment * kAlignment;
}

/// References to the parts of a map; to constant parts for a LandmarkMap.
template <class Info, class Cameras, class Rigs, class Frames, class Landmarks, class Observations>
struct MapParts {
  Info& info;
  Cameras& cameras;
  Rigs& rigs;
  Frames& frames;
  Landmarks& landmarks;
  Observations& observations;
};
// Clang deduces the parameters of an aggregate from version 17 on only.
template <class Info, class Cameras, class Rigs, class Frames, class Landmarks, class Observations>
MapParts(Info&, Cameras&, Rigs&, Frames&, Landmarks&, Observations&)
    -> MapParts<Info, Cameras, Rigs, Frames, Landmarks, Observations>;

inline constexpr auto code_geodetic = [](auto& io, auto& position) {
  io(position.latitude_deg, "latitude");
  io(position.longitude_deg, "longitude");
  io(position.altitude_m, "altitude");
};

template <class Codec, class Parts>
void code_info_and_cameras(Codec& codec, const Parts& map) {
  using enum MapColumn;
  const auto vector = [](auto& io, auto& x) {
    for (auto& component : x) io(component, "vector");
  };

  auto& info = map.info;
  codec.text(kWorldFrame, info.world_frame);
  codec.entry(kGravity, info.gravity, vector);
  codec.text(kUuid, info.uuid);
  codec.entries(kProvenance, info.provenance,
                [](auto& io, auto& step) { io.filled(step, "a text"); });
  codec.entry(kGeoReference, info.georeference, [&](auto& io, auto& georeference) {
    code_geodetic(io, georeference.origin);
    io(georeference.scale, "scale");
    vector(io, georeference.quaternion);
    vector(io, georeference.translation);
  });
  codec.entries(kControlPoints, info.control_points, [](auto& io, auto& point) {
    code_geodetic(io, point);
    io(point.name, "name");
    io.list(point.views, "number of images", [&](auto& view) {
      io(view.pixel.u, "u");
      io(view.pixel.v, "v");
      io(view.image_name, "image");
    });
  });
  codec.entries(kCameras, map.cameras, [](auto& io, auto& camera) {
    io(camera.id.value, "id");
    io(camera.width, "width");
    io(camera.height, "height");
    io(camera.model, "model");
    io(camera.parameters, "parameters");
  });
  codec.entries(kRigs, map.rigs, [&](auto& io, auto& rig) {
    io(rig.id.value, "id");
    io.list(rig.mounts, "number of cameras", [&](auto& mount) {
      io(mount.camera.value, "camera");
      vector(io, mount.quaternion);
      vector(io, mount.translation);
    });
  });
}

/// Passes the content of every section to a codec, which reads or writes it.
template <class Codec, class Parts>
void code_sections(Codec& codec, const Parts& map) {
  using enum MapColumn;
  constexpr std::int64_t kMost32 = std::numeric_limits<std::uint32_t>::max();
  const auto number = [](auto& io, auto& value) { io(value, "number"); };
  code_info_and_cameras(codec, map);

  auto& frames = map.frames;
  codec.rows(kFrameIds, frames.ids);
  codec.rows(kTranslations, frames.translations);
  codec.rows(kQuaternions, frames.quaternions);
  codec.integers(kFrameCameras, frames.cameras, 0, kMost32);
  codec.integers(kInstants, frames.instants, 0, kMost32);
  codec.template numbers<1>(kTimestamps, frames.timestamps_s, number);
  codec.names(kImageNames, frames.image_names);
  codec.template numbers<4>(kGnss, frames.gnss, [](auto& io, auto& fix) {
    code_geodetic(io, fix.position);
    io(fix.accuracy_m, "accuracy");
  });
  const auto upper_triangle = [](auto& io, auto& matrix) {
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) io.both(matrix(i, j), matrix(j, i));
    }
  };
  codec.template numbers<kUpperTriangle>(kPoseCovariances, frames.pose_covariances, upper_triangle);

  auto& landmarks = map.landmarks;
  codec.rows(kLandmarkIds, landmarks.ids);
  codec.rows(kPositions, landmarks.positions);
  codec.covariances(landmarks.covariances);
  codec.colors(landmarks.colors);
  codec.descriptors(landmarks.descriptors);
  codec.named_columns(landmarks.columns);

  auto& observations = map.observations;
  codec.offsets(observations.offsets);
  codec.rows(kObservingFrames, observations.frames);
  codec.rows(kPixels, observations.pixels);
  codec.integers(kKeypoints, observations.keypoints, 0, kMost32);
  codec.template numbers<1>(kDepths, observations.depths, number);
  codec.integers(kOctaves, observations.octaves, std::numeric_limits<std::int32_t>::min(),
                 std::numeric_limits<std::int32_t>::max());
  codec.integers(kPixelSources, observations.sources, 0,
                 static_cast<std::int64_t>(kPixelSourceCount) - 1);
  codec.template numbers<1>(kPixelSigmas, observations.sigmas_px, number);
}

}  // namespace cairn::detail
