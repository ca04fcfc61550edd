// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>

namespace cairn {

/// Integer comparable only with its own kind, so that a frame cannot pass for a landmark.
template <class Tag, class Representation>
struct StrongId {
  Representation value{};

  friend constexpr auto operator<=>(StrongId, StrongId) = default;
};

// Ids identify entities across files and programs; their values are arbitrary.
using CameraId = StrongId<struct CameraIdTag, std::uint64_t>;
using FrameId = StrongId<struct FrameIdTag, std::uint64_t>;
using LandmarkId = StrongId<struct LandmarkIdTag, std::uint64_t>;
using RigId = StrongId<struct RigIdTag, std::uint64_t>;
using InstantId = StrongId<struct InstantIdTag, std::uint32_t>;

// Indices are positions in the columns of one LandmarkMap; they are dense.
using CameraIndex = StrongId<struct CameraIndexTag, std::uint32_t>;
using FrameIndex = StrongId<struct FrameIndexTag, std::uint32_t>;
using LandmarkIndex = StrongId<struct LandmarkIndexTag, std::uint32_t>;

}  // namespace cairn

/// @cond
template <class Tag, class Representation>
struct std::hash<cairn::StrongId<Tag, Representation>> {
  std::size_t operator()(cairn::StrongId<Tag, Representation> id) const noexcept {
    return std::hash<Representation>{}(id.value);
  }
};
/// @endcond
