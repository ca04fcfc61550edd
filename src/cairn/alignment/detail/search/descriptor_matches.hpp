// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::detail {

/// Whether both clouds have descriptors of one kind and length.
bool have_like_descriptors(const LandmarkCloud& a, const LandmarkCloud& b);

/// Two landmarks with mutually nearest descriptors.
struct DescriptorMatch {
  std::uint32_t source = 0;
  std::uint32_t target = 0;
  std::uint32_t difference = 0;  ///< number of bits, or sum of squared byte differences
};

/// Landmarks of two clouds that are probably the same by their descriptors alone.
///
/// Matches are mutual nearest neighbours by descriptor. The distance of two landmarks is that of their best pair of
/// descriptors. Binary descriptors (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH) are compared by Hamming distance; those of
/// a match differ in at most a quarter of their bits. Other descriptors are compared by the Euclidean distance of their
/// bytes. This distance must be at most 0.85 times that of the nearest landmark elsewhere, i.e. farther away than 1 %
/// of the map's extent (ratio test, Lowe 2004).
class DescriptorMatches {
 public:
  /// If the clouds have no descriptors of one kind and length, `identities` are the only matches.
  /// @param source, target clouds in random order; only the first landmarks of large clouds are compared
  /// @param identities pairs of landmarks that are known to be the same, each landmark in one pair. They are the first
  ///        matches, and their landmarks have no other match.
  DescriptorMatches(const LandmarkCloud& source, const LandmarkCloud& target,
                    std::span<const DescriptorMatch> identities = {});

  /// Whether the clouds are small enough for all their landmarks to be compared.
  static bool compares_all(const LandmarkCloud& source, const LandmarkCloud& target);

  /// Whether both clouds have descriptors of one kind, or there are identities. Missing matches are then evidence.
  bool possible() const { return possible_; }
  /// Whether the source landmark belongs to an identity.
  bool is_identity(std::uint32_t source) const { return is_identity_[source] != 0; }
  /// All matches: the identities, then the others by ascending difference.
  std::span<const DescriptorMatch> all() const { return matches_; }
  /// Positions of the landmarks of all(), in the same order.
  std::span<const Eigen::Vector3d> source_places() const { return source_places_; }
  std::span<const Eigen::Vector3d> target_places() const { return target_places_; }

  /// Number of random partners per match, enough to estimate the number of chance agreements to a few percent.
  static constexpr std::size_t kPartners = 512;

  /// Number of matches that a centred pose brings within the radius, and the number expected by chance.
  /// @param partners number of random partners per match, to estimate the number expected by chance
  DescriptorAgreement agreement(const Similarity3& pose, double radius,
                                std::size_t partners = kPartners) const;

 private:
  void add_alike(const LandmarkCloud& source, const LandmarkCloud& target);

  bool possible_ = false;
  std::size_t identities_ = 0;     // their number; they are the first matches
  std::vector<char> is_identity_;  // by source landmark
  std::vector<DescriptorMatch> matches_;
  std::vector<Eigen::Vector3d> source_places_;
  std::vector<Eigen::Vector3d> target_places_;
  double source_extent_ = 0.0;
  double target_extent_ = 0.0;
};

}  // namespace cairn::detail
