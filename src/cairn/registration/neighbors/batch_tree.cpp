// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/neighbors/batch_tree.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/registration/neighbors/batch_kernel.hpp"

namespace cairn {
namespace {

using batch_kernel::kFanOut;
using batch_kernel::Level;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kLeafSize = 8;  // at most

// Coordinates about the centre beyond this might overflow single precision when squared.
constexpr double kMostCoordinate = 1e18;

// What single precision can be off by. A coordinate is rounded by at most 2⁻²⁴ of itself, so that a
// distance between points within `extent` of the centre along each axis is off by √3·2⁻²⁴ times the
// sum of their extents; computing its square is off by less than 2⁻²¹ of itself, or, where numbers are
// too small for that to hold, by less than kTiny. All constants are rounded up generously.
constexpr double kRelative = 1.0 / (1 << 20);
constexpr double kTiny = 1e-37;
double coordinate_error(double extents) {
  return 1.75 / (1 << 24) * extents + 1e-40;
}

// How many times the last motion beyond the k-th neighbour a search looks.
constexpr double kFarther = 2.5;

// Relative error of what is computed in double precision, rounded up generously.
constexpr double kRounding = 1e-13;

double extent(const Eigen::Vector3d& offset) {
  return offset.cwiseAbs().maxCoeff();
}

// As NeighborSearch defines distances; spelt out, for Eigen is free to add in another order.
double squared_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double x = a.x() - b.x();
  const double y = a.y() - b.y();
  const double z = a.z() - b.z();
  return x * x + y * y + z * z;
}

bool before(const Neighbor& a, const Neighbor& b) {
  return a.squared_distance != b.squared_distance ? a.squared_distance < b.squared_distance
                                                  : a.index < b.index;
}

// The best so far, in order.
class Best {
 public:
  explicit Best(std::span<Neighbor> out) : out_(out) {}

  std::size_t size() const { return count_; }
  double worst() const {
    return count_ == out_.size() ? out_[count_ - 1].squared_distance : kInfinity;
  }
  void add(const Neighbor& neighbor) {
    const bool full = count_ == out_.size();
    if (full && !before(neighbor, out_[count_ - 1])) return;
    std::size_t i = full ? count_ - 1 : count_++;
    for (; i > 0 && before(neighbor, out_[i - 1]); --i) out_[i] = out_[i - 1];
    out_[i] = neighbor;
  }

 private:
  std::span<Neighbor> out_;
  std::size_t count_ = 0;
};

struct Item {
  std::array<float, 3> position;
  std::uint32_t index;
};

std::size_t widest_axis(std::span<const Item> items) {
  std::array<float, 3> low = items[0].position;
  std::array<float, 3> high = low;
  for (const Item& item : items) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], item.position[axis]);
      high[axis] = std::max(high[axis], item.position[axis]);
    }
  }
  std::size_t widest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (high[axis] - low[axis] > high[widest] - low[widest]) widest = axis;
  }
  return widest;
}

// Puts the `first` lowest of the items along their widest axis before the others.
void halve(std::span<Item> items, std::size_t first) {
  const std::size_t axis = widest_axis(items);
  std::nth_element(
      items.begin(), items.begin() + static_cast<std::ptrdiff_t>(first), items.end(),
      [axis](const Item& a, const Item& b) { return a.position[axis] < b.position[axis]; });
}

// Halves the items along their widest axis until there are `leaves` of them, a power of two.
void split(std::span<Item> items, std::span<const std::uint32_t> leaf_begin) {
  const std::size_t leaves = leaf_begin.size() - 1;
  if (leaves == 1) return;
  const std::size_t axis = widest_axis(items);
  const std::size_t half = leaf_begin[leaves / 2] - leaf_begin[0];
  std::nth_element(
      items.begin(), items.begin() + static_cast<std::ptrdiff_t>(half), items.end(),
      [axis](const Item& a, const Item& b) { return a.position[axis] < b.position[axis]; });
  split(items.first(half), leaf_begin.first(leaves / 2 + 1));
  split(items.subspan(half), leaf_begin.subspan(leaves / 2));
}

// The same until there are at most `most` in each part; all but the last of them full.
void split_evenly(std::span<Item> items, std::size_t most) {
  if (items.size() <= most) return;
  const std::size_t parts = (items.size() + most - 1) / most;
  const std::size_t half = (parts + 1) / 2 * most;
  halve(items, half);
  split_evenly(items.first(half), most);
  split_evenly(items.subspan(half), most);
}

Level boxes_of(std::size_t count, const auto& grow_by) {
  const std::size_t padded = (count + kFanOut - 1) / kFanOut * kFanOut;
  Level result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.low[axis].assign(padded, std::numeric_limits<float>::infinity());
    result.high[axis].assign(padded, -std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < count; ++i) {
      grow_by(axis, i, [&](float low, float high) {
        result.low[axis][i] = std::min(result.low[axis][i], low);
        result.high[axis][i] = std::max(result.high[axis][i], high);
      });
    }
  }
  return result;
}

// As a tree of these points would have them, so that consecutive ones fill small boxes.
std::vector<std::uint32_t> spatial_order(std::span<const Eigen::Vector3d> points) {
  std::vector<Item> items(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto x = static_cast<float>(points[i][static_cast<Eigen::Index>(axis)]);
      items[i].position[axis] = std::isfinite(x) ? x : 0.0F;  // or sorting would go astray
    }
    items[i].index = static_cast<std::uint32_t>(i);
  }
  const std::size_t packets = (points.size() + kFanOut - 1) / kFanOut;
  if (packets > 1) split_evenly(items, kFanOut);
  std::vector<std::uint32_t> order(points.size());
  std::transform(items.begin(), items.end(), order.begin(),
                 [](const Item& item) { return item.index; });
  return order;
}

}  // namespace

struct BatchTree::Nodes {
  explicit Nodes(std::span<const Eigen::Vector3d> all) {
    Eigen::Vector3d low = Eigen::Vector3d::Constant(kInfinity);
    Eigen::Vector3d high = -low;
    for (const Eigen::Vector3d& point : all) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
    }
    if (!all.empty()) centre = low + 0.5 * (high - low);
    std::vector<Item> items(all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Eigen::Vector3d offset = all[i] - centre;
      // Not std::max, which would lose what is not a number.
      if (!(extent(offset) <= most)) most = extent(offset);
      items[i] = {{static_cast<float>(offset.x()), static_cast<float>(offset.y()),
                   static_cast<float>(offset.z())},
                  static_cast<std::uint32_t>(i)};
    }
    searchable = most <= kMostCoordinate;
    if (!searchable || all.empty()) {
      points.assign(all.begin(), all.end());
      index.resize(all.size());
      std::iota(index.begin(), index.end(), 0U);
      return;
    }

    const std::size_t leaves = std::bit_ceil((all.size() + kLeafSize - 1) / kLeafSize);
    for (std::size_t i = 0; i <= leaves; ++i) {
      tree.leaf_begin.push_back(static_cast<std::uint32_t>(all.size() * i / leaves));
    }
    split(items, tree.leaf_begin);
    points.reserve(all.size() + 1);
    index.reserve(all.size() + 1);
    for (auto& coordinates : tree.points) coordinates.reserve(all.size());
    for (const Item& item : items) {
      points.push_back(all[item.index]);
      index.push_back(item.index);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        tree.points[axis].push_back(item.position[axis]);
      }
    }
    // What lanes without a candidate hold.
    points.push_back(Eigen::Vector3d::Constant(kInfinity));
    index.push_back(std::numeric_limits<std::uint32_t>::max());

    tree.levels.push_back(boxes_of(leaves, [&](std::size_t axis, std::size_t leaf, auto grow) {
      for (std::size_t i = tree.leaf_begin[leaf]; i < tree.leaf_begin[leaf + 1]; ++i) {
        grow(tree.points[axis][i], tree.points[axis][i]);
      }
    }));
    for (std::size_t count = leaves; count > kFanOut;) {
      count = (count + kFanOut - 1) / kFanOut;
      const Level& below = tree.levels.back();
      Level level = boxes_of(count, [&](std::size_t axis, std::size_t node, auto grow) {
        for (std::size_t i = node * kFanOut; i < (node + 1) * kFanOut; ++i) {
          grow(below.low[axis][i], below.high[axis][i]);
        }
      });
      tree.levels.push_back(std::move(level));
    }
  }

  std::size_t size() const { return searchable ? tree.points[0].size() : points.size(); }

  // In double precision alone.
  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const {
    if (out.empty() || size() == 0) return 0;
    Best best(out);
    const Eigen::Vector3d offset = query - centre;
    if (searchable && extent(offset) <= kMostCoordinate) {
      // The boxes hold rounded points.
      const double slack = coordinate_error(most) + kRounding * (most + extent(offset));
      visit(tree.levels.size() - 1, 0, Query{query, offset, slack}, best);
    } else {
      for (std::size_t i = 0; i < size(); ++i) {
        best.add({index[i], squared_distance(points[i], query)});
      }
    }
    return best.size();
  }

  struct Query {
    Eigen::Vector3d place;
    Eigen::Vector3d offset;  // from the centre
    double slack;            // boxes may be this much nearer
  };

  void visit(std::size_t level, std::size_t first, const Query& query, Best& best) const {
    const Level& boxes = tree.levels[level];
    std::array<std::pair<double, std::size_t>, kFanOut> near;
    std::size_t count = 0;
    for (std::size_t i = first; i < first + kFanOut; ++i) {
      if (boxes.low[0][i] > boxes.high[0][i]) break;  // only fills up the level
      double squared = 0.0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double at = query.offset[static_cast<Eigen::Index>(axis)];
        const double gap =
            std::max({boxes.low[axis][i] - at, at - boxes.high[axis][i], query.slack}) -
            query.slack;
        squared += gap * gap;
      }
      squared *= 1.0 - kRounding;
      if (squared > best.worst()) continue;
      std::size_t place = count++;
      for (; place > 0 && near[place - 1].first > squared; --place) near[place] = near[place - 1];
      near[place] = {squared, i};
    }
    for (std::size_t j = 0; j < count && near[j].first <= best.worst(); ++j) {
      const std::size_t node = near[j].second;
      if (level > 0) {
        visit(level - 1, node * kFanOut, query, best);
        continue;
      }
      for (std::size_t i = tree.leaf_begin[node]; i < tree.leaf_begin[node + 1]; ++i) {
        best.add({index[i], squared_distance(points[i], query.place)});
      }
    }
  }

  batch_kernel::Tree tree;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double most = 0.0;  // farthest from the centre along any axis
  bool searchable = true;
  std::vector<Eigen::Vector3d> points;  // in the order of the leaves, and one at infinity
  std::vector<std::uint32_t> index;     // of these in the set
};

BatchTree::BatchTree(std::span<const Eigen::Vector3d> points)
    : nodes_(std::make_unique<const Nodes>(points)) {}
BatchTree::~BatchTree() = default;
BatchTree::BatchTree(BatchTree&&) noexcept = default;
BatchTree& BatchTree::operator=(BatchTree&&) noexcept = default;

std::size_t BatchTree::size() const {
  return nodes_->size();
}

std::size_t BatchTree::nearest(const Eigen::Vector3d& query, std::span<Neighbor> out) const {
  return nodes_->nearest(query, out);
}

BatchTree::Batch BatchTree::batch(std::size_t k) const {
  return {*nodes_, k};
}

BatchTree::Batch::Batch(const Nodes& nodes, std::size_t k)
    : nodes_(&nodes), count_(std::min(k, nodes.size())), capacity_(0) {
  if (!nodes.searchable) return;
  for (const std::size_t capacity : batch_kernel::kCapacities) {
    // One more than k tells how far the others are.
    if (capacity <= count_) continue;
    capacity_ = capacity;
    return;
  }
}

void BatchTree::Batch::prepare(std::span<const Eigen::Vector3d> queries) {
  if (order_.size() == queries.size()) return;
  order_ = spatial_order(queries);
  known_.assign(queries.size(), {});
  candidates_.assign(queries.size() * capacity_, 0);
}

template <std::size_t kCapacity>
BatchTree::Batch::Ranked BatchTree::Batch::rank(std::size_t slot, const Eigen::Vector3d& query,
                                                double outside, Neighbor* found) {
  std::uint32_t* const candidates = candidates_.data() + slot * kCapacity;
  const Eigen::Vector3d* const points = nodes_->points.data();
  const std::uint32_t* const index = nodes_->index.data();
  std::array<double, kCapacity> squared;
  bool ordered = true;
  for (std::size_t j = 0; j < kCapacity; ++j) {
    squared[j] = squared_distance(points[candidates[j]], query);
  }
  for (std::size_t j = 1; j < kCapacity; ++j) ordered &= squared[j - 1] < squared[j];
  // Candidates are kept in order, which changes little.
  for (std::size_t j = 1; !ordered && j < kCapacity; ++j) {
    const std::uint32_t candidate = candidates[j];
    const double distance = squared[j];
    const auto comes_before = [&](std::size_t other) {
      return distance != squared[other] ? distance < squared[other]
                                        : index[candidate] < index[candidates[other]];
    };
    std::size_t place = j;
    for (; place > 0 && comes_before(place - 1); --place) {
      squared[place] = squared[place - 1];
      candidates[place] = candidates[place - 1];
    }
    squared[place] = distance;
    candidates[place] = candidate;
  }
  const double kth = squared[count_ - 1];
  const bool exact = outside > 0.0 && kth < outside * outside * (1.0 - kRounding);
  if (exact) {
    for (std::size_t j = 0; j < count_; ++j) found[j] = {index[candidates[j]], squared[j]};
  }
  return {exact, kth, squared[kCapacity - 1]};
}

void BatchTree::Batch::answer(std::span<const Eigen::Vector3d> queries, std::size_t begin,
                              std::size_t end, std::span<Neighbor> found) {
  switch (capacity_) {
    case 4:
      return answer_with<4>(queries, begin, end, found);
    case 6:
      return answer_with<6>(queries, begin, end, found);
    case 8:
      return answer_with<8>(queries, begin, end, found);
    case 12:
      return answer_with<12>(queries, begin, end, found);
    case 16:
      return answer_with<16>(queries, begin, end, found);
    case 24:
      return answer_with<24>(queries, begin, end, found);
    default:
      for (std::size_t slot = begin; slot < end; ++slot) {
        nodes_->nearest(queries[order_[slot]], found.subspan((slot - begin) * count_, count_));
      }
  }
}

template <std::size_t kCapacity>
void BatchTree::Batch::answer_with(std::span<const Eigen::Vector3d> queries, std::size_t begin,
                                   std::size_t end, std::span<Neighbor> found) {
  static_assert(kBlock <= batch_kernel::kMostQueries);
  batch_kernel::Queries search;
  std::array<std::size_t, kBlock> slots;  // of what has to be searched
  for (std::size_t slot = begin; slot < end; ++slot) {
    const Eigen::Vector3d& query = queries[order_[slot]];
    Neighbor* const out = found.data() + (slot - begin) * count_;
    const Eigen::Vector3d offset = query - nodes_->centre;
    if (!(extent(offset) <= kMostCoordinate)) {
      nodes_->nearest(query, {out, count_});
      continue;
    }
    Known& known = known_[slot];
    double bound = kInfinity;
    if (known.outside >= 0.0) {
      const double motion = (query - known.place).norm() * (1.0 + kRounding);
      const Ranked ranked =
          rank<kCapacity>(slot, query, (known.outside - motion) * (1.0 - kRounding), out);
      if (ranked.exact) continue;
      // Whatever the k nearest are, the k-th is no farther than these. Beyond that, only as far as
      // lets the answer outlast another motion like this one.
      const double reach =
          std::min(std::sqrt(ranked.kth) + kFarther * motion, std::sqrt(ranked.last)) *
              (1.0 + kRounding) +
          coordinate_error(nodes_->most + extent(offset));
      bound = reach * reach * (1.0 + kRelative) + kTiny;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      search.position[axis][search.count] =
          static_cast<float>(offset[static_cast<Eigen::Index>(axis)]);
    }
    constexpr double kMost = std::numeric_limits<float>::max();
    search.bound[search.count] =
        bound <= kMost ? static_cast<float>(bound) : std::numeric_limits<float>::infinity();
    slots[search.count++] = slot;
  }
  if (search.count == 0) return;

  std::array<std::uint32_t, kCapacity * batch_kernel::kMostQueries> candidates;
  batch_kernel::search(nodes_->tree, kCapacity, search, candidates);
  for (std::size_t i = 0; i < search.count; ++i) {
    const std::size_t slot = slots[i];
    const Eigen::Vector3d& query = queries[order_[slot]];
    for (std::size_t j = 0; j < kCapacity; ++j) {
      candidates_[slot * kCapacity + j] = candidates[j * batch_kernel::kMostQueries + i];
    }
    const double error = coordinate_error(nodes_->most + extent(query - nodes_->centre));
    const double squared = search.bound[i];
    const double outside = std::sqrt(std::max(0.0, squared * (1.0 - kRelative) - kTiny)) - error;
    known_[slot] = {query, std::max(0.0, outside) * (1.0 - kRounding)};
    Neighbor* const out = found.data() + (slot - begin) * count_;
    if (!rank<kCapacity>(slot, query, known_[slot].outside, out).exact)
      nodes_->nearest(query, {out, count_});
  }
}

}  // namespace cairn
