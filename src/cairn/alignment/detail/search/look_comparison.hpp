// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/alignment/refinement/centred_pair.hpp"
#include "cairn/alignment/search/descriptors.hpp"
#include "cairn/core/random.hpp"

namespace cairn {

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
  LookComparison(const CentredPair& pair, std::size_t sample, Random random);

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

}  // namespace cairn
