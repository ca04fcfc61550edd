// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/neighbors/batch_kernel.hpp"

#include <limits>

// Vectors of a size known only at run time cannot be kept in arrays, as they are here.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cairn/registration/neighbors/batch_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// Compiled once for each instruction set.
HWY_BEFORE_NAMESPACE();
namespace cairn::batch_kernel::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kFanOut>;
using Indices = hn::RebindToUnsigned<Floats>;
using Float = hn::Vec<Floats>;
using Index = hn::Vec<Indices>;

// A node on the way.
struct Visit {
  float squared_distance;  // from the box of all queries
  std::uint32_t node;
  std::uint32_t level;
};

// Each level leaves at most all children but one behind; 32-bit indices have at most 8 levels.
constexpr std::size_t kMostVisits = 9 * kFanOut;

// A lane a query, all descending together.
template <std::size_t kCapacity>
class Packet {
 public:
  Packet(const Tree& tree, Queries& queries, std::size_t first) : tree_(tree) {
    const Floats d;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      query_[axis] = hn::Load(d, queries.position[axis].data() + first);
      low_[axis] = hn::GetLane(hn::MinOfLanes(d, query_[axis]));
      high_[axis] = hn::GetLane(hn::MaxOfLanes(d, query_[axis]));
    }
    const Float bound = hn::Load(d, queries.bound.data() + first);
    const Index none = hn::Set(Indices(), static_cast<std::uint32_t>(tree.points[0].size()));
    for (std::size_t j = 0; j < kCapacity; ++j) {
      distance_[j] = bound;
      index_[j] = none;
    }
    farthest_ = hn::GetLane(hn::MaxOfLanes(d, bound));
    bounded_ = farthest_ < std::numeric_limits<float>::infinity();
  }

  void search() {
    open(static_cast<std::uint32_t>(tree_.levels.size() - 1), 0);
    while (visit_count_ > 0) {
      const Visit visit = visits_[--visit_count_];
      if (visit.squared_distance >= farthest_) continue;
      if (visit.level == 0) {
        look_through(visit.node);
      } else {
        open(visit.level - 1, visit.node * static_cast<std::uint32_t>(kFanOut));
      }
    }
  }

  void store(Queries& queries, std::span<std::uint32_t> candidates, std::size_t first) const {
    hn::Store(distance_[kCapacity - 1], Floats(), queries.bound.data() + first);
    for (std::size_t j = 0; j < kCapacity; ++j) {
      hn::StoreU(index_[j], Indices(), candidates.data() + j * kMostQueries + first);
    }
  }

 private:
  // Squared distance between a box and another, or a point.
  static Float apart(const std::array<Float, 3>& low, const std::array<Float, 3>& high,
                     const std::array<Float, 3>& other_low,
                     const std::array<Float, 3>& other_high) {
    Float sum = hn::Zero(Floats());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Float gap = hn::Max(
          hn::Max(hn::Sub(low[axis], other_high[axis]), hn::Sub(other_low[axis], high[axis])),
          hn::Zero(Floats()));
      sum = hn::MulAdd(gap, gap, sum);
    }
    return sum;
  }

  // Remembers those of kFanOut nodes that are near enough, the nearest to be visited first.
  HWY_NOINLINE void open(std::uint32_t level, std::uint32_t first) {
    const Floats d;
    const Level& boxes = tree_.levels[level];
    alignas(64) std::array<float, kFanOut> squared;
    const std::array<Float, 3> low = {hn::Set(d, low_[0]), hn::Set(d, low_[1]),
                                      hn::Set(d, low_[2])};
    const std::array<Float, 3> high = {hn::Set(d, high_[0]), hn::Set(d, high_[1]),
                                       hn::Set(d, high_[2])};
    std::uint32_t near = 0;
    for (std::size_t i = 0; i < kFanOut; i += hn::Lanes(d)) {
      const auto load = [&](const std::array<std::vector<float>, 3>& from) {
        return std::array<Float, 3>{hn::LoadU(d, from[0].data() + first + i),
                                    hn::LoadU(d, from[1].data() + first + i),
                                    hn::LoadU(d, from[2].data() + first + i)};
      };
      const Float distance = apart(load(boxes.low), load(boxes.high), low, high);
      hn::Store(distance, d, squared.data() + i);
      std::array<std::uint8_t, 8> bits = {};
      hn::StoreMaskBits(d, hn::Lt(distance, hn::Set(d, farthest_)), bits.data());
      near |= static_cast<std::uint32_t>(bits[0] | bits[1] << 8) << i;
    }
    const std::size_t begin = visit_count_;
    for (; near != 0; near &= near - 1) {
      const auto i = static_cast<std::uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
      std::size_t place = visit_count_++;
      // With a good bound from the start the order matters little, and sorting is not cheap.
      for (; !bounded_ && place > begin && visits_[place - 1].squared_distance < squared[i];
           --place) {
        visits_[place] = visits_[place - 1];
      }
      visits_[place] = {squared[i], first + i, level};
    }
  }

  void look_through(std::uint32_t leaf) {
    const Floats d;
    const Level& boxes = tree_.levels[0];
    std::array<Float, 3> low;
    std::array<Float, 3> high;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = hn::Set(d, boxes.low[axis][leaf]);
      high[axis] = hn::Set(d, boxes.high[axis][leaf]);
    }
    const Float gap = apart(low, high, query_, query_);
    if (hn::AllFalse(d, hn::Lt(gap, distance_[kCapacity - 1]))) return;
    const std::uint32_t end = tree_.leaf_begin[leaf + 1];
    bool changed = false;
    for (std::uint32_t i = tree_.leaf_begin[leaf]; i < end; ++i) {
      const Float x = hn::Sub(query_[0], hn::Set(d, tree_.points[0][i]));
      const Float y = hn::Sub(query_[1], hn::Set(d, tree_.points[1][i]));
      const Float z = hn::Sub(query_[2], hn::Set(d, tree_.points[2][i]));
      const Float squared = hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)));
      if (hn::AllFalse(d, hn::Lt(squared, distance_[kCapacity - 1]))) continue;
      insert(squared, hn::Set(Indices(), i));
      changed = true;
    }
    if (changed) farthest_ = hn::GetLane(hn::MaxOfLanes(d, distance_[kCapacity - 1]));
  }

  void insert(Float squared, Index index) {
    const Indices du;
    for (std::size_t j = 0; j < kCapacity; ++j) {
      const auto nearer = hn::Lt(squared, distance_[j]);
      const auto nearer_index = hn::RebindMask(du, nearer);
      const Float displaced = hn::Max(squared, distance_[j]);
      const Index displaced_index = hn::IfThenElse(nearer_index, index_[j], index);
      distance_[j] = hn::Min(squared, distance_[j]);
      index_[j] = hn::IfThenElse(nearer_index, index, index_[j]);
      squared = displaced;
      index = displaced_index;
    }
  }

  const Tree& tree_;
  std::array<Float, 3> query_;
  std::array<Float, kCapacity> distance_;  // of the candidates, ascending
  std::array<Index, kCapacity> index_;
  std::array<float, 3> low_;  // box of all queries
  std::array<float, 3> high_;
  bool bounded_;    // from the start
  float farthest_;  // beyond this no query takes a point
  std::size_t visit_count_ = 0;
  std::array<Visit, kMostVisits> visits_;
};

template <std::size_t kCapacity>
void search_with(const Tree& tree, Queries& queries, std::span<std::uint32_t> candidates) {
  const std::size_t lanes = hn::Lanes(Floats());
  // Lanes without a query repeat the last one, and take nothing.
  for (std::size_t i = queries.count; i % lanes != 0; ++i) {
    for (auto& position : queries.position) position[i] = position[queries.count - 1];
    queries.bound[i] = -1.0F;
  }
  for (std::size_t first = 0; first < queries.count; first += lanes) {
    Packet<kCapacity> packet(tree, queries, first);
    packet.search();
    packet.store(queries, candidates, first);
  }
}

void search_any(const Tree& tree, std::size_t capacity, Queries& queries,
                std::span<std::uint32_t> candidates) {
  switch (capacity) {
    case 4:
      return search_with<4>(tree, queries, candidates);
    case 6:
      return search_with<6>(tree, queries, candidates);
    case 8:
      return search_with<8>(tree, queries, candidates);
    case 12:
      return search_with<12>(tree, queries, candidates);
    case 16:
      return search_with<16>(tree, queries, candidates);
    default:
      return search_with<24>(tree, queries, candidates);
  }
}

}  // namespace
}  // namespace cairn::batch_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace cairn::batch_kernel {

HWY_EXPORT(search_any);

void search(const Tree& tree, std::size_t capacity, Queries& queries,
            std::span<std::uint32_t> candidates) {
  HWY_DYNAMIC_DISPATCH(search_any)(tree, capacity, queries, candidates);
}

}  // namespace cairn::batch_kernel

#endif  // HWY_ONCE
