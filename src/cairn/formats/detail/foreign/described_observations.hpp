// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/map/distinct_descriptors.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Index of the descriptor with the smallest sum of differences to the others (the first, if several tie).
/// Considers only the first 64.
/// @param descriptors not empty, all of one size
std::size_t medoid(std::span<const std::span<const std::uint8_t>> descriptors, DescriptorNorm norm);

/// Appends a row to a column: of the descriptors of one landmark's observations the medoid(), which
/// represents it, and those of the most distinct views; unknown if there is none.
void append_distinct(DescriptorColumn& column,
                     std::span<const std::span<const std::uint8_t>> descriptors,
                     DescriptorNorm norm);

/// For descriptors that a small file may refer to many times, or that have room for every landmark.
/// @param name the file or folder
/// @throws Error (input) if so many bytes of descriptors exceed memory_budget() of the file's bytes
void require_descriptor_budget(std::uint64_t descriptor_bytes, std::uint64_t file_bytes,
                               const std::string& name);

/// Collects observations keyframe by keyframe, with their keypoints' data, and orders them by landmark.
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

  /// @param bytes_each size of a descriptor; 0: no descriptors
  explicit DescribedObservations(std::size_t bytes_each) : bytes_each_(bytes_each) {}

  /// @param descriptor bytes_each bytes; empty if unknown
  void add(const Entry& entry, std::span<const std::uint8_t> descriptor);
  std::vector<Entry>& entries() { return entries_; }
  /// Bytes of the descriptors added so far.
  std::uint64_t descriptor_bytes() const { return bytes_.size(); }
  /// Largest number of bytes of descriptors while fill() gives them to so many landmarks.
  std::uint64_t descriptor_bytes_to_fill(std::size_t landmarks) const {
    return 2 * descriptor_bytes() + landmarks * bytes_each_;
  }

  /// Fills the observations, those of each landmark in the order of frames, and the landmarks' descriptors
  /// by append_distinct().
  /// @param tables contain the landmarks' ids, ascending
  /// @return number of observations left out because the map does not have their landmark
  std::size_t fill(MapTables& tables, const std::string& kind, DescriptorNorm norm) &&;

 private:
  std::size_t bytes_each_;
  std::vector<Entry> entries_;
  std::vector<std::size_t> ends_;  // in bytes_, of each entry's descriptor; empty if its size is 0
  std::vector<std::uint8_t> bytes_;  // of the known descriptors, in the order of entries
};

}  // namespace cairn::detail
