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

// What a section has entries for.
enum class Per { kFile, kFrame, kLandmark, kOffset, kObservation };

struct Layout {
  std::string_view name;
  Per per;
  std::uint64_t bytes_each;  // 0: different for entries, or not known in advance
};

inline constexpr std::array<Layout, 34> kLayouts = {{
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
}};
static_assert(kLayouts.size() == static_cast<std::size_t>(MapColumn::kPoseCovariances));

constexpr std::size_t index_of(MapColumn column) {
  return static_cast<std::size_t>(column) - 1;
}

constexpr std::uint64_t aligned(std::uint64_t byte) {
  return (byte + kAlignment - 1) / kAlignment * kAlignment;
}

}  // namespace cairn::detail
