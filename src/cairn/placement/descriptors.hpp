// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/core/hamming.hpp"
#include "cairn/placement/landmark_cloud.hpp"

namespace cairn {

/// Whether descriptors of a kind are compared bit by bit (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH); others
/// are compared byte by byte.
bool is_binary(std::string_view kind);

/// Whether descriptors of both clouds can be compared: both have some, of one kind and length.
bool have_like_descriptors(const LandmarkCloud& a, const LandmarkCloud& b);

/// The known descriptors among the first landmarks of a cloud, for comparing.
class Descriptors {
 public:
  /// @param cloud  has descriptors
  /// @param sample its first landmarks that are looked at
  Descriptors(const LandmarkCloud& cloud, std::size_t sample);

  std::size_t size() const { return landmarks_.size(); }
  /// Which landmark the i-th belongs to; ascending.
  std::uint32_t landmark(std::size_t i) const { return landmarks_[i]; }
  /// Which is that of a landmark, if it is known.
  std::optional<std::size_t> of(std::uint32_t landmark) const;
  /// Its bytes, zeros after them.
  std::span<const std::uint64_t> words(std::size_t i) const {
    return {values_.data() + i * words_, words_};
  }
  /// Compared bit by bit; otherwise byte by byte.
  bool binary() const { return binary_; }

 private:
  bool binary_;
  std::size_t words_;
  std::vector<std::uint32_t> landmarks_;
  std::vector<std::uint64_t> values_;
};

/// How unlike two binary descriptors are: bits that differ.
inline std::uint32_t differing_bits(std::span<const std::uint64_t> a,
                                    std::span<const std::uint64_t> b) {
  return static_cast<std::uint32_t>(hamming_distance(a, b));
}

/// How unlike two others are: squared differences of their bytes, summed.
std::uint32_t squared_difference(std::span<const std::uint64_t> a,
                                 std::span<const std::uint64_t> b);

}  // namespace cairn
