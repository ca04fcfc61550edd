// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/descriptors.hpp"

namespace cairn {

/// What descriptors have to say of landmarks that a pose brings together.
struct Likeness {
  std::size_t compared = 0;  ///< pairs of landmarks with descriptors
  std::size_t alike = 0;     ///< those that look alike: see LikenessTest

  Likeness& operator+=(const Likeness& other);
  Likeness operator-(const Likeness& other) const;

  /// By how much likelier this is if some pairs are one landmark, seen twice, than by chance: logarithm
  /// of the ratio for the likeliest share of them, at least 0.
  double evidence() const;
};

/// Tells by their descriptors which landmarks that a pose brings together look alike.
///
/// Two do if the source's descriptor is closer to the target's than to any of kOthers of the target's that
/// are drawn at random. Where a pose is wrong, that is so of one pair in kOthers + 1, whatever the
/// descriptor: so no threshold is asked for.
class LikenessTest {
 public:
  static constexpr std::size_t kOthers = 63;

  /// @param pair   in random order: the first are drawn
  /// @param sample the first of the source that are asked for
  LikenessTest(const CentredPair& pair, std::size_t sample);

  /// Most landmarks of both have descriptors, of one kind: alike() has something to say.
  bool possible() const { return descriptors_.has_value(); }

  /// Nothing where a descriptor is unknown, or is one of those that all are compared with.
  std::optional<bool> alike(std::uint32_t source, std::uint32_t target) const;

 private:
  struct Both {
    Descriptors source;
    Descriptors target;
    std::vector<std::uint32_t> nearest_other;  // how unlike, for each of the source

    std::uint32_t difference(std::size_t i, std::size_t j) const;
  };
  std::optional<Both> descriptors_;
};

}  // namespace cairn
