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

/// The known descriptors of the first landmarks of a cloud, laid out for comparisons. The distance of two
/// landmarks is that of their best pair of descriptors.
class Descriptors {
 public:
  /// @param cloud  cloud with descriptors
  /// @param sample number of first landmarks to use
  Descriptors(const LandmarkCloud& cloud, std::size_t sample);

  /// Number of landmarks with descriptors.
  std::size_t size() const { return landmarks_.size(); }
  /// Index in the cloud of the i-th landmark with descriptors; ascending.
  std::uint32_t landmark(std::size_t i) const { return landmarks_[i]; }
  /// Position of a landmark among the landmarks with descriptors; std::nullopt if its descriptors are
  /// unknown.
  std::optional<std::size_t> of(std::uint32_t landmark) const;
  /// Bytes of the descriptors of the i-th landmark with descriptors, one descriptor after another.
  std::span<const std::uint8_t> rows(std::size_t i) const {
    return {bytes_.data() + begins_[i] * bytes_each_, (begins_[i + 1] - begins_[i]) * bytes_each_};
  }
  std::size_t bytes_each() const { return bytes_each_; }
  /// Whether descriptors are compared by bits; otherwise by bytes.
  bool binary() const { return binary_; }

 private:
  bool binary_;
  std::size_t bytes_each_;
  std::vector<std::uint32_t> landmarks_;
  std::vector<std::size_t> begins_ = {0};  // first descriptor of each landmark, and the end
  std::vector<std::uint8_t> bytes_;
};

/// Difference of the best pair of descriptors of landmark i in `a` and landmark j in `b`, numbered among the landmarks
/// with descriptors: by bits, or the squared difference of bytes.
std::uint32_t least_difference(const Descriptors& a, std::size_t i, const Descriptors& b,
                               std::size_t j);

/// Decides by descriptors whether landmarks that a pose brings together are similar.
///
/// The partners of a source landmark are the candidates for its match in the target. The source landmark is
/// similar to its partners if its smallest descriptor distance to a partner is less than its smallest
/// descriptor distance to the others. The others are Likeness::kOthers times as many target landmarks that
/// are not partners. The distance of two landmarks is that of their best pair of descriptors. The others
/// are consecutive in one random order of the target landmarks, from a random start for each source
/// landmark. Unrelated landmarks are similar with a probability of at most 1 / (kOthers + 1) (ties count as
/// dissimilar), for any descriptor and without a threshold.
class LookComparison {
 public:
  /// @param sample number of first source landmarks to compare
  LookComparison(const LandmarkCloud& source, const LandmarkCloud& target, std::size_t sample,
                 Random random);

  /// Whether most landmarks of both clouds have descriptors of one kind, and the target has enough of them
  /// for a comparison.
  bool possible() const { return descriptors_.has_value(); }

  /// Largest number of partners.
  static constexpr std::size_t kPartners = 8;

  /// Whether a source landmark is similar to its partners; std::nullopt if the descriptors of the source
  /// landmark, or those of all partners, are unknown.
  /// @param targets the partners, nearest first
  std::optional<bool> alike(std::uint32_t source, std::span<const std::uint32_t> targets) const;

 private:
  // Landmarks are numbered among the landmarks with known descriptors.
  struct Both {
    Descriptors source;
    Descriptors target;
    std::vector<std::uint32_t> order = {};  // random permutation of the target landmarks
    std::vector<std::uint32_t> place = {};  // per target landmark: its position in `order`
    std::vector<std::uint32_t> first = {};  // per source landmark: position of its first other
    std::size_t partners = 0;               // number of partners for which there are enough others
    // Per source landmark: least difference to its first kOthers others (for one partner), to its first
    // 2·kOthers others (for two partners), and so on.
    std::vector<std::uint32_t> least = {};

    std::uint32_t difference(std::size_t i, std::size_t j) const;
    // Least difference of source landmark i to kOthers times as many others as `left_out` has entries; the
    // others are not in `left_out`.
    std::uint32_t least_but(std::size_t i, std::span<const std::size_t> left_out) const;
  };
  std::optional<Both> descriptors_;
};

}  // namespace cairn::detail
