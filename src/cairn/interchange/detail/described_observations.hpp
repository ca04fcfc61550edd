// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// How the difference of two descriptors is measured.
enum class DescriptorNorm {
  kHamming,  ///< bits that differ
  kSquared,  ///< sum of squared differences of bytes
};

/// The descriptor with the least sum of differences to the others, the first of several: its place.
/// Looks at no more than the first 64.
/// @param descriptors not empty, all of one size
std::size_t medoid(std::span<const std::span<const std::uint8_t>> descriptors, DescriptorNorm norm);

/// Observations in the order of the keyframes that made them, each with what its keypoint holds, on their way
/// into the order of landmarks.
class DescribedObservations {
 public:
  struct Entry {
    std::uint64_t landmark_id = 0;
    FrameIndex frame;
    Pixel pixel;
    std::optional<std::uint32_t> keypoint = {};
    std::optional<double> depth = {};
    std::optional<std::int32_t> octave = {};
  };

  /// @param bytes_each of a descriptor; 0: there are none
  explicit DescribedObservations(std::size_t bytes_each) : bytes_each_(bytes_each) {}

  /// @param descriptor of bytes_each bytes, or empty where unknown
  void add(const Entry& entry, std::span<const std::uint8_t> descriptor);
  std::vector<Entry>& entries() { return entries_; }

  /// Fills the observations, those of a landmark in the order of the frames, and the landmarks' descriptors:
  /// the medoid of those of a landmark.
  /// @param tables whose landmarks have their ids, ascending
  /// @return how many observations were left out, because their landmark is none of the map's
  std::size_t fill(MapTables& tables, const std::string& kind, DescriptorNorm norm) &&;

 private:
  std::size_t bytes_each_;
  std::vector<Entry> entries_;
  std::vector<std::uint8_t> known_;  // one an entry
  std::vector<std::uint8_t> bytes_;  // bytes_each_ an entry
};

}  // namespace cairn::detail
