// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/neighbors/batch_tree.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/registration/detail/batch_kernel.hpp"

namespace cairn {
namespace {

using batch_kernel::kFanOut;
using batch_kernel::kLeafSize;
using batch_kernel::Level;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Largest coordinate relative to the centre; larger ones approach the value for padding points.
constexpr double kMostCoordinate = 1e16;

// Largest error of a distance in single precision. The relative rounding error of a coordinate is at most
// 2⁻²⁴, so the distance of two points is off by at most √3·2⁻²⁴ times the sum of their extents along an axis
// from the centre; rounded up generously.
double coordinate_error(double extents) {
  return 1.75 / (1 << 24) * extents + 1e-38;
}

// Relative error of computations in double precision, rounded up generously.
constexpr double kRounding = 1e-13;

double extent(const Eigen::Vector3d& offset) {
  return offset.cwiseAbs().maxCoeff();
}

bool before(const Neighbor& a, const Neighbor& b) {
  return a.squared_distance != b.squared_distance ? a.squared_distance < b.squared_distance
                                                  : a.index < b.index;
}

// The nearest points so far, in order.
class Best {
 public:
  // @param farthest known upper bound of the squared distance
  explicit Best(std::span<Neighbor> out, double farthest = kInfinity)
      : out_(out), farthest_(farthest) {}

  std::size_t size() const { return count_; }
  double worst() const {
    return count_ == out_.size() ? out_[count_ - 1].squared_distance : farthest_;
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
  double farthest_;
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

// Divides the items into compact parts of `most` items; only the last may have fewer. Any 2ⁿ parts that start
// at a multiple of 2ⁿ are also close to each other.
void part(std::span<Item> items, std::size_t most) {
  const std::size_t parts = (items.size() + most - 1) / most;
  if (parts <= 1) return;
  const std::size_t first = std::bit_ceil(parts) / 2 * most;
  halve(items, first);
  part(items.first(first), most);
  part(items.subspan(first), most);
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

// Order of the points in a tree, in which consecutive points have small bounding boxes.
std::vector<std::uint32_t> spatial_order(std::span<const Eigen::Vector3d> points) {
  std::vector<Item> items(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto x = static_cast<float>(points[i][static_cast<Eigen::Index>(axis)]);
      items[i].position[axis] = std::isfinite(x) ? x : 0.0F;  // NaN would break the sorting
    }
    items[i].index = static_cast<std::uint32_t>(i);
  }
  part(items, kFanOut);
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
      // Unlike std::max, keeps NaN.
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

    part(items, kLeafSize);
    const std::size_t leaves = (all.size() + kLeafSize - 1) / kLeafSize;
    for (auto& coordinates : tree.points) {
      coordinates.assign((leaves + 1) * kLeafSize, batch_kernel::kFarAway);
    }
    points.reserve(all.size());
    index.reserve(all.size());
    for (std::size_t i = 0; i < items.size(); ++i) {
      points.push_back(all[items[i].index]);
      index.push_back(items[i].index);
      for (std::size_t axis = 0; axis < 3; ++axis) tree.points[axis][i] = items[i].position[axis];
    }

    tree.levels.push_back(boxes_of(leaves, [&](std::size_t axis, std::size_t leaf, auto grow) {
      for (std::size_t i = leaf * kLeafSize; i < std::min((leaf + 1) * kLeafSize, size()); ++i) {
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

  std::size_t size() const { return points.size(); }

  // In double precision only.
  std::size_t nearest(const Eigen::Vector3d& query, std::span<Neighbor> out,
                      double farthest = kInfinity) const {
    if (out.empty() || size() == 0) return 0;
    Best best(out, farthest);
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
      if (boxes.low[0][i] > boxes.high[0][i]) break;  // padding of the level
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
      for (std::size_t i = node * kLeafSize; i < std::min((node + 1) * kLeafSize, size()); ++i) {
        best.add({index[i], squared_distance(points[i], query.place)});
      }
    }
  }

  batch_kernel::Tree tree;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double most = 0.0;  // farthest from the centre along any axis
  bool searchable = true;
  std::vector<Eigen::Vector3d> points;  // in the order of the leaves
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

std::size_t BatchTree::nearest(const Eigen::Vector3d& query, std::span<Neighbor> out,
                               double squared_limit) const {
  std::size_t found = nodes_->nearest(query, out, squared_limit);
  while (found > 0 && out[found - 1].squared_distance > squared_limit) --found;
  return found;
}

std::span<const std::uint32_t> BatchTree::order() const {
  return nodes_->index;
}

BatchTree::Batch BatchTree::batch(std::size_t k, std::vector<std::uint32_t> order) const {
  return {*nodes_, k, std::move(order)};
}

BatchTree::Batch::Batch(const Nodes& nodes, std::size_t k, std::vector<std::uint32_t> order)
    : nodes_(&nodes),
      points_(nodes.points.data()),
      index_(nodes.index.data()),
      count_(std::min(k, nodes.size())),
      order_(std::move(order)) {
  if (!nodes.searchable || count_ == 0) return;
  for (const std::size_t capacity : batch_kernel::kCapacities) {
    // One more than k, to bound the distance of the others.
    if (capacity <= count_) continue;
    capacity_ = capacity;
    return;
  }
}

void BatchTree::Batch::prepare(std::span<const Eigen::Vector3d> queries) {
  const std::size_t slots = (queries.size() + kBlock - 1) / kBlock * kBlock;
  const bool is_ordered = order_.size() == queries.size();
  if (is_ordered && outside_.size() == slots) return;
  if (!is_ordered) order_ = spatial_order(queries);
  for (auto& coordinates : place_) coordinates.assign(slots, 0.0F);
  outside_.assign(slots, -1.0F);
  candidates_.assign(slots * capacity_, 0);
}

BatchTree::Batch::Answers BatchTree::Batch::answer(std::span<const Eigen::Vector3d> queries,
                                                   std::size_t begin, std::size_t end) {
  static_assert(kBlock == batch_kernel::kBlock);
  Answers answers;
  batch_kernel::Queries block;
  block.count = end - begin;
  double most = 0.0;
  bool searchable = capacity_ > 0;
  for (std::size_t i = 0; searchable && i < block.count; ++i) {
    const Eigen::Vector3d offset = queries[order_[begin + i]] - nodes_->centre;
    block.position[0][i] = static_cast<float>(offset.x());
    block.position[1][i] = static_cast<float>(offset.y());
    block.position[2][i] = static_cast<float>(offset.z());
    most = std::max(most, extent(offset));
    searchable = extent(offset) <= kMostCoordinate;  // which no NaN is
  }
  if (searchable) {
    for (auto& position : block.position) {
      std::fill(position.begin() + static_cast<std::ptrdiff_t>(block.count), position.end(),
                position[block.count - 1]);
    }
    block.rounding = std::nextafter(static_cast<float>(coordinate_error(nodes_->most + most)),
                                    std::numeric_limits<float>::max());
    batch_kernel::Known known{
        {place_[0].data() + begin, place_[1].data() + begin, place_[2].data() + begin},
        outside_.data() + begin,
        candidates_.data() + begin * capacity_};
    batch_kernel::update(nodes_->tree, capacity_, count_, block, known);
    answers.certain = block.certain;
  } else {
    answers.certain.fill(0);
  }

  for (std::size_t slot = begin; slot < end; ++slot) {
    if (answers.certain[slot - begin] != 0) continue;
    answers.settled.resize(answers.settled.size() + count_);
    const std::span<Neighbor> found = std::span(answers.settled).last(count_);
    const Eigen::Vector3d& query = queries[order_[slot]];
    if (searchable) {
      settle(query, slot, found);
    } else {
      nodes_->nearest(query, found);
    }
  }
  return answers;
}

void BatchTree::Batch::settle(const Eigen::Vector3d& query, std::size_t slot,
                              std::span<Neighbor> found) const {
  Best best(found);
  const std::uint32_t* const candidates = candidates_of(slot);
  for (std::size_t j = 0; j < capacity_; ++j) {
    const std::uint32_t candidate = candidates[j * kBlock];
    if (candidate >= nodes_->size()) continue;  // padding of a leaf
    best.add({index_[candidate], squared_distance(points_[candidate], query)});
  }
  const Eigen::Vector3d offset = query - nodes_->centre;
  const Eigen::Vector3d place(place_[0][slot], place_[1][slot], place_[2][slot]);
  const double outside = outside_[slot] - (offset - place).norm() * (1.0 + kRounding) -
                         coordinate_error(extent(place));
  if (outside > 0.0 && best.worst() < outside * outside * (1.0 - kRounding)) return;
  nodes_->nearest(query, found, outside_[slot] >= 0.0F ? best.worst() : kInfinity);
}

}  // namespace cairn
