// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/neighbors/kd_tree.hpp"

#include <algorithm>
#include <limits>
#include <vector>

#include <nanoflann.hpp>

namespace cairn {
namespace {

constexpr std::size_t kLeafSize = 12;  // measured: 8 to 16 are alike, more is slower

// The points in nanoflann's interface.
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

// Keeps the best by (distance, index). nanoflann's own result set breaks ties by the order of the search.
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

}  // namespace

struct KdTree::Index {
  using Tree =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointAccess>,
                                          PointAccess, 3, std::uint32_t>;

  explicit Index(std::span<const Eigen::Vector3d> points)
      : access{{points.begin(), points.end()}}, tree(3, access, {kLeafSize}) {}

  PointAccess access;
  Tree tree;
};

KdTree::KdTree(std::span<const Eigen::Vector3d> points) : index_(std::make_unique<Index>(points)) {}
KdTree::~KdTree() = default;
KdTree::KdTree(KdTree&&) noexcept = default;
KdTree& KdTree::operator=(KdTree&&) noexcept = default;

std::size_t KdTree::size() const {
  return index_->access.points.size();
}

std::size_t KdTree::nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const {
  if (size() == 0 || out.empty()) return 0;
  OrderedResult result(out);
  index_->tree.findNeighbors(result, query.data(), {});  // of a type that nanoflann 1.5 renamed
  return result.size();
}

}  // namespace cairn
