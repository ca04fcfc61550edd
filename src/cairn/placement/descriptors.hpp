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

/// Whether descriptors of a kind are compared by bits (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH); others are
/// compared by bytes.
bool is_binary(std::string_view kind);

/// Whether both clouds have descriptors, of one kind and length.
bool have_like_descriptors(const LandmarkCloud& a, const LandmarkCloud& b);

/// The known descriptors of the first landmarks of a cloud, laid out for comparisons.
class Descriptors {
 public:
  /// @param cloud  has descriptors
  /// @param sample number of landmarks to use, from the first on
  Descriptors(const LandmarkCloud& cloud, std::size_t sample);

  std::size_t size() const { return landmarks_.size(); }
  /// Landmark of the i-th descriptor; ascending.
  std::uint32_t landmark(std::size_t i) const { return landmarks_[i]; }
  /// Index of a landmark's descriptor; std::nullopt if unknown.
  std::optional<std::size_t> of(std::uint32_t landmark) const;
  /// Its bytes, padded with zeros.
  std::span<const std::uint64_t> words(std::size_t i) const {
    return {values_.data() + i * words_, words_};
  }
  /// Compared by bits; otherwise by bytes.
  bool binary() const { return binary_; }

 private:
  bool binary_;
  std::size_t words_;
  std::vector<std::uint32_t> landmarks_;
  std::vector<std::uint64_t> values_;
};

/// Hamming distance of two binary descriptors.
inline std::uint32_t differing_bits(std::span<const std::uint64_t> a,
                                    std::span<const std::uint64_t> b) {
  return static_cast<std::uint32_t>(hamming_distance(a, b));
}

/// Sum of squared byte differences of two other descriptors.
std::uint32_t squared_difference(std::span<const std::uint64_t> a,
                                 std::span<const std::uint64_t> b);

}  // namespace cairn
