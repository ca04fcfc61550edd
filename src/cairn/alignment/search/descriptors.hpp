// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/alignment/landmark_cloud.hpp"
#include "cairn/core/hamming.hpp"

namespace cairn {

/// Whether descriptors of a kind are compared by bits (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH); others are
/// compared by bytes.
bool is_binary(std::string_view kind);

/// Whether both clouds have descriptors, of one kind and length.
bool have_like_descriptors(const LandmarkCloud& a, const LandmarkCloud& b);

/// The known descriptors of the first landmarks of a cloud, laid out for comparisons. Two landmarks are
/// compared by their best pair of descriptors.
class Descriptors {
 public:
  /// @param cloud  has descriptors
  /// @param sample number of landmarks to use, from the first on
  Descriptors(const LandmarkCloud& cloud, std::size_t sample);

  /// Number of landmarks with descriptors.
  std::size_t size() const { return landmarks_.size(); }
  /// The i-th landmark with descriptors; ascending.
  std::uint32_t landmark(std::size_t i) const { return landmarks_[i]; }
  /// The place of a landmark among these; std::nullopt if its descriptors are unknown.
  std::optional<std::size_t> of(std::uint32_t landmark) const;
  /// The bytes of its descriptors, one after another, each padded with zeros to whole words.
  std::span<const std::uint64_t> words(std::size_t i) const {
    return {values_.data() + begins_[i] * words_, (begins_[i + 1] - begins_[i]) * words_};
  }
  /// Words of one descriptor.
  std::size_t words_each() const { return words_; }
  /// Compared by bits; otherwise by bytes.
  bool binary() const { return binary_; }

 private:
  bool binary_;
  std::size_t words_;
  std::vector<std::uint32_t> landmarks_;
  std::vector<std::size_t> begins_ = {0};  // of each landmark's descriptors, and the end
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

/// Difference of the best pair of two landmarks' descriptors, by bits or else by bytes.
/// @param a of one sample @param i a landmark of it; b and j alike
std::uint32_t least_difference(const Descriptors& a, std::size_t i, const Descriptors& b,
                               std::size_t j);

}  // namespace cairn
