// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/random.hpp"

namespace cairn::detail {

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
  /// The bytes of its descriptors, one after another.
  std::span<const std::uint8_t> rows(std::size_t i) const {
    return {bytes_.data() + begins_[i] * bytes_each_, (begins_[i + 1] - begins_[i]) * bytes_each_};
  }
  std::size_t bytes_each() const { return bytes_each_; }
  /// Compared by bits; otherwise by bytes.
  bool binary() const { return binary_; }

 private:
  bool binary_;
  std::size_t bytes_each_;
  std::vector<std::uint32_t> landmarks_;
  std::vector<std::size_t> begins_ = {0};  // of each landmark's descriptors, and the end
  std::vector<std::uint8_t> bytes_;
};

/// Decides by descriptors which landmarks that a pose brings together are similar.
///
/// A landmark of the source resembles its partners, the candidates in the target, if its smallest
/// descriptor distance to them beats that to Likeness::kOthers times as many other landmarks of the target.
/// Two landmarks differ by the distance of their best pair of descriptors.
/// The others are a run of one random order, from a random start for each source landmark. For unrelated
/// landmarks the probability is at most 1 / (kOthers + 1) (ties count as dissimilar), for any descriptor
/// and without a threshold.
class LookComparison {
 public:
  /// @param sample number of first source landmarks to compare
  LookComparison(const LandmarkCloud& source, const LandmarkCloud& target, std::size_t sample,
                 Random random);

  /// Whether most landmarks of both have descriptors of one kind, and the target has enough of them for a
  /// comparison.
  bool possible() const { return descriptors_.has_value(); }

  /// Largest number of partners.
  static constexpr std::size_t kPartners = 8;

  /// std::nullopt if the descriptor of the source, or those of all partners, are unknown.
  /// @param targets the partners, nearest first
  std::optional<bool> alike(std::uint32_t source, std::span<const std::uint32_t> targets) const;

 private:
  // Landmarks are numbered among those with known descriptors.
  struct Both {
    Descriptors source;
    Descriptors target;
    std::vector<std::uint32_t> order = {};  // random permutation of the target's
    std::vector<std::uint32_t> place = {};  // per target landmark: its position in that order
    std::vector<std::uint32_t> first = {};  // per source landmark: place of its first other
    std::size_t partners = 0;               // number of partners for which there are enough others
    // Per source landmark: least difference to the others of one partner, of two partners, and so on.
    std::vector<std::uint32_t> least = {};

    std::uint32_t difference(std::size_t i, std::size_t j) const;
    // Least difference to the others of as many partners as `left_out` has, without these landmarks.
    std::uint32_t least_but(std::size_t i, std::span<const std::size_t> left_out) const;
  };
  std::optional<Both> descriptors_;
};

}  // namespace cairn::detail
