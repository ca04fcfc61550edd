// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/descriptors.hpp"

namespace cairn {

/// Tells by their descriptors which landmarks that a pose brings together look alike.
///
/// Two do if the source's descriptor is closer to its partner's than to Likeness::kOthers others of the
/// target: a run of one random order of these, from a random place for each of the source. Where a pose is
/// wrong, and what it brings together is no more of one kind than any two landmarks are, that is so of at
/// most one pair in kOthers + 1 (ties are unlike), whatever the descriptor: no threshold is asked for.
class LookComparison {
 public:
  /// @param sample the first of the source that are asked for
  LookComparison(const CentredPair& pair, std::size_t sample, Random random);

  /// Most landmarks of both have descriptors, of one kind, and the target enough of them: alike() has
  /// something to say.
  bool possible() const { return descriptors_.has_value(); }

  /// Nothing where a descriptor is unknown.
  std::optional<bool> alike(std::uint32_t source, std::uint32_t target) const;

 private:
  // By number among the known descriptors.
  struct Both {
    Descriptors source;
    Descriptors target;
    std::vector<std::uint32_t> order = {};  // of the target's, at random
    std::vector<std::uint32_t> place = {};  // in that order, of each of the target's
    std::vector<std::uint32_t> first = {};  // place of the first other, of each of the source's
    std::vector<std::uint32_t> least = {};  // difference to any other, of each of the source's

    std::uint32_t difference(std::size_t i, std::size_t j) const;
    // To the others of i; where one of them is to be left out, there is one more.
    // @param left_out its number among them, or kOthers
    std::uint32_t least_difference(std::size_t i, std::size_t left_out) const;
  };
  std::optional<Both> descriptors_;
};

}  // namespace cairn
