// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::testing {

inline constexpr std::size_t kDescriptorBytes = 32;

/// A place's descriptors, of which a map sees some, each with some bits flipped.
inline std::vector<std::uint8_t> place(std::uint64_t seed, std::size_t landmarks) {
  Random random(seed);
  std::vector<std::uint8_t> bytes(landmarks * kDescriptorBytes);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.index(256));
  return bytes;
}

/// Landmarks [begin, end) of a place.
/// @param flipped share of the bits
inline LandmarkMap seen(const std::vector<std::uint8_t>& place, std::size_t begin, std::size_t end,
                        double flipped, std::uint64_t seed, const std::string& kind = "ORB") {
  Random random(seed);
  MapTables tables;
  DescriptorColumn column{kind, kDescriptorBytes, {}, {}};
  for (std::size_t i = begin; i < end; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(random.normal(), random.normal(), random.normal());
    column.known.push_back(1);
    for (std::size_t k = 0; k < kDescriptorBytes; ++k) {
      std::uint8_t byte = place[i * kDescriptorBytes + k];
      for (int bit = 0; bit < 8; ++bit) {
        if (random.chance(flipped)) byte = static_cast<std::uint8_t>(byte ^ (1 << bit));
      }
      column.bytes.push_back(byte);
    }
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn::testing
