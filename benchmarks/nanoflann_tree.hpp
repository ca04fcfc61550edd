// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <nanoflann.hpp>

#include "cairn/registration/stages.hpp"

namespace cairn::benchmarks {

inline constexpr std::size_t kLeafSize = 12;  // measured: 8 to 16 are alike, more is slower

/// The points in nanoflann's interface.
struct PointAccess {
  std::vector<Eigen::Vector3d> points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

/// Keeps the best by (distance, index). nanoflann's own result set breaks ties by the order of the search.
class OrderedResult {
 public:
  using DistanceType = double;

  explicit OrderedResult(std::span<Neighbor> out) : out_(out) {}

  std::size_t size() const { return count_; }
  bool full() const { return count_ == out_.size(); }
  static void sort() {}  // nanoflann 1.5 calls it; the neighbours are sorted at any time

  // The tree drops what is not nearer than this. The margin lets ties through to addPoint, also where
  // the tree's own lower bounds are rounded up.
  // NOLINTNEXTLINE(readability-identifier-naming): nanoflann's name
  double worstDist() const {
    if (!full()) return std::numeric_limits<double>::infinity();
    return out_[count_ - 1].squared_distance * (1.0 + 1e-12) + std::numeric_limits<double>::min();
  }

  // NOLINTNEXTLINE(readability-identifier-naming): nanoflann's name
  bool addPoint(double squared_distance, std::uint32_t index) {
    const auto before = [&](const Neighbor& other) {
      return squared_distance != other.squared_distance ? squared_distance < other.squared_distance
                                                        : index < other.index;
    };
    if (full() && !before(out_[count_ - 1])) return true;
    std::size_t i = full() ? count_ - 1 : count_++;
    for (; i > 0 && before(out_[i - 1]); --i) out_[i] = out_[i - 1];
    out_[i] = {index, squared_distance};
    return true;
  }

 private:
  std::span<Neighbor> out_;
  std::size_t count_ = 0;
};

/// A NeighborSearch by nanoflann's k-d tree: a peer of BatchTree.
class NanoflannTree {
 public:
  explicit NanoflannTree(std::span<const Eigen::Vector3d> points)
      : access_{{points.begin(), points.end()}}, tree_(3, access_, {kLeafSize}) {}

  std::size_t size() const { return access_.points.size(); }

  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const {
    if (size() == 0 || out.empty()) return 0;
    OrderedResult result(out);
    tree_.findNeighbors(result, query.data(), {});  // of a type that nanoflann 1.5 renamed
    return result.size();
  }

 private:
  PointAccess access_;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointAccess>,
                                      PointAccess, 3, std::uint32_t>
      tree_;
};

static_assert(NeighborSearch<NanoflannTree>);

}  // namespace cairn::benchmarks
