// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/descriptor_agreement.hpp"

namespace cairn {

/// Two landmarks whose descriptors are each other's nearest.
struct DescriptorMatch {
  std::uint32_t source = 0;
  std::uint32_t target = 0;
  std::uint32_t difference = 0;  ///< bits, or squared differences of bytes
};

/// The landmarks of two clouds that are likely the same by their descriptors alone.
///
/// A match is mutual: each descriptor is the other's nearest. Binary descriptors (ORB, BRIEF, BRISK,
/// AKAZE, FREAK, LATCH) are compared by Hamming distance and differ in at most a quarter of their bits.
/// Others are compared byte by byte by the Euclidean norm; the distance is at most 0.85 times that to the
/// second nearest (Lowe 2004).
class DescriptorMatches {
 public:
  /// No matches if the clouds have no descriptors of one kind and length.
  /// @param pair in random order: of larger clouds only the first landmarks are compared
  explicit DescriptorMatches(const CentredPair& pair);

  /// Both clouds have descriptors of one kind, so that the absence of matches says something.
  bool possible() const { return possible_; }
  /// Smallest difference first.
  std::span<const DescriptorMatch> all() const { return matches_; }
  /// Positions of all(), in the same order.
  std::span<const Eigen::Vector3d> source_places() const { return source_places_; }
  std::span<const Eigen::Vector3d> target_places() const { return target_places_; }

  /// Enough to know how many agree by chance to a few per cent.
  static constexpr std::size_t kPartners = 512;

  /// How many matches a centred pose brings within the radius, and how many it would by chance.
  /// @param partners of other matches with which each is tried, for the latter
  DescriptorAgreement agreement(const Similarity3& pose, double radius,
                                std::size_t partners = kPartners) const;

 private:
  bool possible_ = false;
  std::vector<DescriptorMatch> matches_;
  std::vector<Eigen::Vector3d> source_places_;
  std::vector<Eigen::Vector3d> target_places_;
  double source_extent_ = 0.0;
  double target_extent_ = 0.0;
};

}  // namespace cairn
