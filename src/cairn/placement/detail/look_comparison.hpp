// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/descriptors.hpp"

namespace cairn {

/// Tells by their descriptors which landmarks that a pose brings together look alike.
///
/// One of the source and its partners, those of the target that it may be, do if its descriptor is closer
/// to one of theirs than to Likeness::kOthers times as many others of the target: a run of one random order
/// of these, from a random place for each of the source. Where a pose is wrong, and what it brings together
/// is no more of one kind than any two landmarks are, that is so at most once in kOthers + 1 (ties are
/// unlike), whatever the descriptor: no threshold is asked for.
class LookComparison {
 public:
  /// @param sample the first of the source that are asked for
  LookComparison(const CentredPair& pair, std::size_t sample, Random random);

  /// Most landmarks of both have descriptors, of one kind, and the target enough of them: alike() has
  /// something to say.
  bool possible() const { return descriptors_.has_value(); }

  /// Most partners that are looked at.
  static constexpr std::size_t kPartners = 8;

  /// Nothing where the source's descriptor is unknown, or those of all partners.
  /// @param targets the partners, nearest first
  std::optional<bool> alike(std::uint32_t source, std::span<const std::uint32_t> targets) const;

 private:
  // By number among the known descriptors.
  struct Both {
    Descriptors source;
    Descriptors target;
    std::vector<std::uint32_t> order = {};  // of the target's, at random
    std::vector<std::uint32_t> place = {};  // in that order, of each of the target's
    std::vector<std::uint32_t> first = {};  // place of the first other, of each of the source's
    std::size_t partners = 0;               // for how many there are others enough
    // Least difference to the others of one partner, of two and so on; of each of the source's.
    std::vector<std::uint32_t> least = {};

    std::uint32_t difference(std::size_t i, std::size_t j) const;
    // Least difference to the others of as many partners as are left out, none of which is among them.
    std::uint32_t least_but(std::size_t i, std::span<const std::size_t> left_out) const;
  };
  std::optional<Both> descriptors_;
};

}  // namespace cairn
