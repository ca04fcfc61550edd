// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/placement/centred_pair.hpp"

namespace cairn {

/// What the cameras of one map have to say of the landmarks of another: they saw through the air in
/// front of their own landmarks, and not through what those lie on.
struct SightCounts {
  std::size_t agree = 0;     ///< landmarks where a camera saw its own
  std::size_t in_front = 0;  ///< where it looked through: they cannot be there
  std::size_t behind = 0;    ///< where it could not see them, behind others

  std::size_t total() const { return agree + in_front + behind; }
  SightCounts& operator+=(const SightCounts& other);
};

/// Tests lines of sight at centred poses, both ways.
///
/// A view is kept as distances by direction, in cells of about one degree. A landmark of the other map
/// is compared with what the view saw in the same cell; most cells are empty, and say nothing.
class SightChecker {
 public:
  /// @param pair   views of either cloud; must outlive this
  /// @param sample the first landmarks of each cloud that are looked at
  SightChecker(const CentredPair& pair, std::size_t sample);

  /// Nothing but zeros if the clouds have no views.
  SightCounts operator()(const Similarity3& pose) const;

 private:
  // Least and greatest distance seen in each direction; 0 where nothing was.
  struct Seen {
    Eigen::Vector3d centre;
    std::vector<float> least;
    std::vector<float> greatest;
  };

  static std::vector<Seen> seen_by(const LandmarkCloud& cloud);
  static SightCounts count(const std::vector<Seen>& views,
                           std::span<const Eigen::Vector3d> landmarks);

  const CentredPair& pair_;
  std::size_t sample_;
  std::vector<Seen> source_views_;
  std::vector<Seen> target_views_;
};

}  // namespace cairn
