// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/detail/batch_kernel.hpp"

#include <bit>
#include <limits>

// Excludes vectors of a size known only at run time, because they cannot be stored in arrays.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cairn/registration/detail/batch_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// Compiled once for each instruction set.
HWY_BEFORE_NAMESPACE();
namespace cairn::batch_kernel::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kFanOut>;
using Indices = hn::RebindToUnsigned<Floats>;
using SignedIndices = hn::RebindToSigned<Floats>;
using Float = hn::Vec<Floats>;
using Index = hn::Vec<Indices>;
using FloatMask = hn::Mask<Floats>;

// An array of vectors. Unlike those of std::array and of an aggregate, its functions are compiled for this
// instruction set; others cannot construct vectors on each processor.
template <class Vector, std::size_t kCount>
struct Vectors {
  Vectors() {}  // NOLINT(modernize-use-equals-default)
  template <class... Others>
  Vectors(Vector first, Others... others)  // NOLINT(google-explicit-constructor)
      : values{first, others...} {}

  Vector& operator[](std::size_t i) { return values[i]; }
  const Vector& operator[](std::size_t i) const { return values[i]; }
  Vector* begin() { return values; }
  Vector* end() { return values + kCount; }

  Vector values[kCount];
};

using Place = Vectors<Float, 3>;

// A key is a squared distance whose last bits are replaced by the point's place in the leaves that the search
// has visited. All bits set: no point.
constexpr std::uint32_t kPointBits = 10;
constexpr std::uint32_t kPointMask = (1U << kPointBits) - 1;
constexpr std::uint32_t kMostLeaves = kPointMask / kLeafSize;
constexpr int kLeafBits = std::countr_zero(kLeafSize);

// A search extends beyond the k-th neighbour by this multiple of the last motion, so that its result remains
// valid after a similar motion.
constexpr float kFarther = 2.5F;

Float inflated(Float squared, float relative) {
  return hn::MulAdd(squared, hn::Set(Floats(), 1.0F + relative), hn::Set(Floats(), kTiny));
}

Float deflated(Float squared, float relative) {
  const Float less =
      hn::MulSub(squared, hn::Set(Floats(), 1.0F - relative), hn::Set(Floats(), kTiny));
  return hn::Max(less, hn::Zero(Floats()));
}

Float squared_distance(const Place& a, const Place& b) {
  const Float x = hn::Sub(a[0], b[0]);
  const Float y = hn::Sub(a[1], b[1]);
  const Float z = hn::Sub(a[2], b[2]);
  return hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)));
}

Place gather(const Tree& tree, Index places) {
  const auto indices = hn::BitCast(SignedIndices(), places);
  return Place(hn::GatherIndex(Floats(), tree.points[0].data(), indices),
               hn::GatherIndex(Floats(), tree.points[1].data(), indices),
               hn::GatherIndex(Floats(), tree.points[2].data(), indices));
}

// The candidates of a lane's query in order.
template <std::size_t kCapacity>
struct Candidates {
  Vectors<Index, kCapacity> place;
  Vectors<Float, kCapacity> squared;

  void measure(const Tree& tree, const Place& query) {
    FloatMask disorder = hn::FirstN(Floats(), 0);
    for (std::size_t j = 0; j < kCapacity; ++j) {
      squared[j] = squared_distance(gather(tree, place[j]), query);
      if (j > 0) disorder = hn::Or(disorder, hn::Lt(squared[j], squared[j - 1]));
    }
    if (!hn::AllFalse(Floats(), disorder)) sort();
  }

  // Lanes whose first k candidates are certainly the nearest, in order, if no other point is nearer than
  // `outside`.
  FloatMask certain(std::size_t k, Float outside, float rounding) const {
    const Floats d;
    const Float reach =
        hn::Add(hn::Sqrt(inflated(squared[k - 1], kRelative)), hn::Set(d, 2.0F * rounding));
    FloatMask result = hn::Lt(reach, outside);
    // Two distances certainly differ if their squares differ by more than four times the error of one.
    const Float gap = hn::MulAdd(hn::Sqrt(squared[k]), hn::Set(d, 8.0F * rounding),
                                 hn::Set(d, 4.0F * kTiny + 8.0F * rounding * rounding));
    for (std::size_t j = 0; j < k; ++j) {
      const Float apart =
          hn::Sub(hn::Mul(squared[j + 1], hn::Set(d, 1.0F - 4.0F * kRelative)), squared[j]);
      result = hn::And(result, hn::Gt(apart, gap));
    }
    return result;
  }

 private:
  void sort() {
    for (std::size_t i = 1; i < kCapacity; ++i) {
      for (std::size_t j = i; j > 0; --j) {
        const FloatMask swap = hn::Lt(squared[j], squared[j - 1]);
        const auto swap_place = hn::RebindMask(Indices(), swap);
        const Float nearer = hn::Min(squared[j], squared[j - 1]);
        squared[j] = hn::Max(squared[j], squared[j - 1]);
        squared[j - 1] = nearer;
        const Index first = hn::IfThenElse(swap_place, place[j], place[j - 1]);
        place[j] = hn::IfThenElse(swap_place, place[j - 1], place[j]);
        place[j - 1] = first;
      }
    }
  }
};

// Squared distance between a box and another, or a point.
Float apart(const Place& low, const Place& high, const Place& other_low, const Place& other_high) {
  Float sum = hn::Zero(Floats());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Float gap =
        hn::Max(hn::Max(hn::Sub(low[axis], other_high[axis]), hn::Sub(other_low[axis], high[axis])),
                hn::Zero(Floats()));
    sum = hn::MulAdd(gap, gap, sum);
  }
  return sum;
}

// A node to be visited.
struct Visit {
  float squared_distance;  // from the box of all queries
  std::uint32_t node;
  std::uint32_t level;
};

// The nodes still to be visited, for queries that descend together.
class Trail {
 public:
  Trail(const Tree& tree, const Place& query, Float bound) : tree_(tree) {
    const Floats d;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low_[axis] = hn::GetLane(hn::MinOfLanes(d, query[axis]));
      high_[axis] = hn::GetLane(hn::MaxOfLanes(d, query[axis]));
    }
    limit(bound);
    bounded_ = farthest_ < kFarAway;
    open(static_cast<std::uint32_t>(tree.levels.size() - 1), 0);
  }

  // Whether an earlier search gives a bound from the start.
  bool bounded() const { return bounded_; }

  // Skips nodes beyond all queries' bounds.
  void limit(Float bound) { farthest_ = hn::GetLane(hn::MaxOfLanes(Floats(), bound)); }

  // The next leaf; of all nodes with a common parent the nearest first, unless bounded.
  bool next(std::uint32_t& leaf) {
    while (count_ > 0) {
      const Visit& visit = visits_[--count_];
      if (visit.squared_distance >= farthest_) continue;
      if (visit.level == 0) {
        leaf = visit.node;
        return true;
      }
      open(visit.level - 1, visit.node * static_cast<std::uint32_t>(kFanOut));
    }
    return false;
  }

 private:
  // Each level leaves at most all children but one behind; 32-bit indices have at most 8 levels.
  static constexpr std::size_t kMostVisits = 9 * kFanOut;

  // Adds those of kFanOut nodes that are near enough.
  HWY_NOINLINE void open(std::uint32_t level, std::uint32_t first) {
    const Floats d;
    const Level& boxes = tree_.levels[level];
    alignas(64) std::array<float, kFanOut> squared;
    const Place low = {hn::Set(d, low_[0]), hn::Set(d, low_[1]), hn::Set(d, low_[2])};
    const Place high = {hn::Set(d, high_[0]), hn::Set(d, high_[1]), hn::Set(d, high_[2])};
    std::uint32_t near = 0;
    for (std::size_t i = 0; i < kFanOut; i += hn::Lanes(d)) {
      const auto load = [&](const std::array<std::vector<float>, 3>& from) {
        return Place{hn::LoadU(d, from[0].data() + first + i),
                     hn::LoadU(d, from[1].data() + first + i),
                     hn::LoadU(d, from[2].data() + first + i)};
      };
      const Float distance = apart(load(boxes.low), load(boxes.high), low, high);
      hn::Store(distance, d, squared.data() + i);
      std::array<std::uint8_t, 8> bits = {};
      hn::StoreMaskBits(d, hn::Lt(distance, hn::Set(d, farthest_)), bits.data());
      near |= static_cast<std::uint32_t>(bits[0] | bits[1] << 8) << i;
    }
    const std::size_t begin = count_;
    for (; near != 0; near &= near - 1) {
      const auto i = static_cast<std::uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
      std::size_t place = count_++;
      // With a good bound from the start, the order matters less than the cost of sorting.
      for (; !bounded_ && place > begin && visits_[place - 1].squared_distance < squared[i];
           --place) {
        visits_[place] = visits_[place - 1];
      }
      visits_[place] = {squared[i], first + i, level};
    }
  }

  const Tree& tree_;
  std::array<float, 3> low_;  // box of all queries
  std::array<float, 3> high_;
  float farthest_;
  bool bounded_ = true;
  std::size_t count_ = 0;
  std::array<Visit, kMostVisits> visits_;
};

// Result of a search; each lane is a query.
template <std::size_t kCapacity>
struct Found {
  Vectors<Float, kCapacity> keys;  // ascending
  std::array<std::uint32_t, kMostLeaves + 1> leaves;

  // In the order of their keys.
  Candidates<kCapacity> candidates() const {
    const Indices d;
    Candidates<kCapacity> result;
    for (std::size_t j = 0; j < kCapacity; ++j) {
      const Index point = hn::And(hn::BitCast(d, keys[j]), hn::Set(d, kPointMask));
      const auto number = hn::BitCast(SignedIndices(), hn::ShiftRight<kLeafBits>(point));
      const Index leaf = hn::GatherIndex(d, leaves.data(), number);
      result.place[j] =
          hn::Or(hn::ShiftLeft<kLeafBits>(leaf), hn::And(point, hn::Set(d, kLeafSize - 1)));
    }
    return result;
  }

  // All other points are at least this far away.
  Float outside(float rounding) const {
    const Index bits = hn::BitCast(Indices(), keys[kCapacity - 1]);
    const Float least = hn::BitCast(Floats(), hn::And(bits, hn::Set(Indices(), ~kPointMask)));
    return hn::Sub(hn::Sqrt(deflated(least, kRelative)), hn::Set(Floats(), rounding));
  }
};

// Searches for all lanes together.
// @param bound only points whose squared distance is below count
// @return false if there were too many leaves to visit
template <std::size_t kCapacity>
bool descend(const Tree& tree, const Place& query, Float bound, Found<kCapacity>& found) {
  const Floats d;
  const Indices du;
  const Index distance_bits = hn::Set(du, ~kPointMask);
  Vectors<Float, kCapacity> keys;
  for (Float& key : keys) {
    key = hn::BitCast(d, hn::Or(hn::BitCast(du, bound), hn::Set(du, kPointMask)));
  }
  Trail trail(tree, query, bound);
  std::uint32_t leaf_count = 0;
  const Level& boxes = tree.levels[0];
  for (std::uint32_t leaf; trail.next(leaf);) {
    const Place low = {hn::Set(d, boxes.low[0][leaf]), hn::Set(d, boxes.low[1][leaf]),
                       hn::Set(d, boxes.low[2][leaf])};
    const Place high = {hn::Set(d, boxes.high[0][leaf]), hn::Set(d, boxes.high[1][leaf]),
                        hn::Set(d, boxes.high[2][leaf])};
    const Float gap = apart(low, high, query, query);
    if (hn::AllFalse(d, hn::Lt(gap, keys[kCapacity - 1]))) continue;
    if (leaf_count == kMostLeaves) return false;
    const std::array<const float*, 3> points = {tree.points[0].data() + leaf * kLeafSize,
                                                tree.points[1].data() + leaf * kLeafSize,
                                                tree.points[2].data() + leaf * kLeafSize};
    const Index first_name = hn::Set(du, leaf_count * static_cast<std::uint32_t>(kLeafSize));
    for (std::uint32_t i = 0; i < kLeafSize; ++i) {
      const Place point = {hn::Set(d, points[0][i]), hn::Set(d, points[1][i]),
                           hn::Set(d, points[2][i])};
      const Index bits = hn::BitCast(du, squared_distance(query, point));
      const Index name = hn::Add(first_name, hn::Set(du, i));
      Float key = hn::BitCast(d, hn::OrAnd(name, bits, distance_bits));
      for (std::size_t j = 0; j + 1 < kCapacity; ++j) {
        const Float displaced = hn::Max(key, keys[j]);
        keys[j] = hn::Min(key, keys[j]);
        key = displaced;
      }
      keys[kCapacity - 1] = hn::Min(key, keys[kCapacity - 1]);
    }
    found.leaves[leaf_count++] = leaf;
    // With a good bound from the start, this rarely pays off.
    if (!trail.bounded() || leaf_count % 4 == 0) trail.limit(keys[kCapacity - 1]);
  }
  found.keys = keys;
  // A key without a point refers to the leaf without points.
  found.leaves[kMostLeaves] = static_cast<std::uint32_t>(tree.points[0].size() / kLeafSize - 1);
  return true;
}

// Queries that need a search, gathered in adjacent lanes.
struct Doubtful {
  std::size_t count = 0;
  alignas(64) std::array<std::array<float, kBlock + kFanOut>, 3> position;
  alignas(64) std::array<float, kBlock + kFanOut> bound;
  alignas(64) std::array<std::uint32_t, kBlock + kFanOut> slot;
};

// Orders the candidates of all queries and collects the queries whose result is uncertain.
template <std::size_t kCapacity>
HWY_NOINLINE void rank(const Tree& tree, std::size_t k, Queries& queries, const Known& known,
                       Doubtful& doubtful) {
  const Floats d;
  const Indices du;
  const std::size_t lanes = hn::Lanes(d);
  const Float most = hn::Set(d, std::numeric_limits<float>::max());
  for (std::size_t i = 0; i < queries.count; i += lanes) {
    Place query;
    Place place;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      query[axis] = hn::Load(d, queries.position[axis].data() + i);
      place[axis] = hn::LoadU(d, known.place[axis] + i);
    }
    const Float outside = hn::LoadU(d, known.outside + i);
    const FloatMask is_known = hn::Ge(outside, hn::Zero(d));
    FloatMask certain = hn::FirstN(d, 0);
    Float bound = most;
    if (!hn::AllFalse(d, is_known)) {
      Candidates<kCapacity> candidates;
      for (std::size_t j = 0; j < kCapacity; ++j) {
        candidates.place[j] = hn::LoadU(du, known.candidates + j * kBlock + i);
      }
      candidates.measure(tree, query);
      for (std::size_t j = 0; j < kCapacity; ++j) {
        hn::StoreU(candidates.place[j], du, known.candidates + j * kBlock + i);
      }
      const Float motion = hn::Add(hn::Sqrt(inflated(squared_distance(query, place), kRelative)),
                                   hn::Set(d, 2.0F * queries.rounding));
      certain =
          hn::And(is_known, candidates.certain(k, hn::Sub(outside, motion), queries.rounding));
      // Upper bound of the k-th neighbour's distance.
      const Float reach =
          hn::Min(hn::MulAdd(motion, hn::Set(d, kFarther), hn::Sqrt(candidates.squared[k - 1])),
                  hn::Sqrt(candidates.squared[kCapacity - 1]));
      const Float safe = hn::Add(reach, hn::Set(d, 2.0F * queries.rounding));
      const Float squared = inflated(hn::Mul(safe, safe), 4.0F * kRelative);
      bound = hn::IfThenElse(is_known, hn::Min(squared, most), most);
    }
    const FloatMask exists = hn::FirstN(d, queries.count - i);
    const FloatMask doubt = hn::AndNot(certain, exists);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      hn::CompressBlendedStore(query[axis], doubt, d,
                               doubtful.position[axis].data() + doubtful.count);
    }
    hn::CompressBlendedStore(bound, doubt, d, doubtful.bound.data() + doubtful.count);
    doubtful.count += hn::CompressBlendedStore(hn::Iota(du, static_cast<std::uint32_t>(i)),
                                               hn::RebindMask(du, doubt), du,
                                               doubtful.slot.data() + doubtful.count);
    alignas(64) std::array<std::uint32_t, kFanOut> flags;
    hn::Store(hn::IfThenElseZero(hn::RebindMask(du, certain), hn::Set(du, 1U)), du, flags.data());
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      queries.certain[i + lane] = static_cast<std::uint8_t>(flags[lane]);
    }
  }
}

template <std::size_t kCapacity>
void search(const Tree& tree, std::size_t k, Doubtful& doubtful, Queries& queries, Known& known) {
  const Floats d;
  const Indices du;
  const std::size_t lanes = hn::Lanes(d);
  // Lanes without a query repeat the last one; their results are ignored.
  for (std::size_t i = doubtful.count; i % lanes != 0; ++i) {
    for (auto& position : doubtful.position) position[i] = position[doubtful.count - 1];
    doubtful.bound[i] = -1.0F;
  }
  for (std::size_t first = 0; first < doubtful.count; first += lanes) {
    const Place query = {hn::Load(d, doubtful.position[0].data() + first),
                         hn::Load(d, doubtful.position[1].data() + first),
                         hn::Load(d, doubtful.position[2].data() + first)};
    const std::size_t last = std::min(first + lanes, doubtful.count);
    Found<kCapacity> found;
    if (!descend(tree, query, hn::Load(d, doubtful.bound.data() + first), found)) {
      for (std::size_t i = first; i < last; ++i) known.outside[doubtful.slot[i]] = -1.0F;
      continue;
    }
    Candidates<kCapacity> candidates = found.candidates();
    candidates.measure(tree, query);
    const Float outside = found.outside(queries.rounding);
    const FloatMask certain = candidates.certain(k, outside, queries.rounding);
    alignas(64) std::array<float, kFanOut> outside_of;
    alignas(64) std::array<std::uint32_t, kFanOut> certain_of;
    alignas(64) std::array<std::array<std::uint32_t, kFanOut>, kCapacity> places;
    hn::Store(hn::Max(outside, hn::Zero(d)), d, outside_of.data());
    hn::Store(hn::IfThenElseZero(hn::RebindMask(du, certain), hn::Set(du, 1U)), du,
              certain_of.data());
    for (std::size_t j = 0; j < kCapacity; ++j)
      hn::Store(candidates.place[j], du, places[j].data());
    for (std::size_t i = first; i < last; ++i) {
      const std::size_t slot = doubtful.slot[i];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        known.place[axis][slot] = doubtful.position[axis][i];
      }
      known.outside[slot] = outside_of[i - first];
      queries.certain[slot] = static_cast<std::uint8_t>(certain_of[i - first]);
      for (std::size_t j = 0; j < kCapacity; ++j) {
        known.candidates[j * kBlock + slot] = places[j][i - first];
      }
    }
  }
}

template <std::size_t kCapacity>
void update_with(const Tree& tree, std::size_t k, Queries& queries, Known& known) {
  Doubtful doubtful;
  rank<kCapacity>(tree, k, queries, known, doubtful);
  if (doubtful.count > 0) search<kCapacity>(tree, k, doubtful, queries, known);
}

void update_any(const Tree& tree, std::size_t capacity, std::size_t k, Queries& queries,
                Known& known) {
  switch (capacity) {
    case 2:
      return update_with<2>(tree, k, queries, known);
    case 4:
      return update_with<4>(tree, k, queries, known);
    case 6:
      return update_with<6>(tree, k, queries, known);
    case 8:
      return update_with<8>(tree, k, queries, known);
    case 12:
      return update_with<12>(tree, k, queries, known);
    case 16:
      return update_with<16>(tree, k, queries, known);
    default:
      return update_with<24>(tree, k, queries, known);
  }
}

}  // namespace
}  // namespace cairn::batch_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace cairn::batch_kernel {

HWY_EXPORT(update_any);

void update(const Tree& tree, std::size_t capacity, std::size_t k, Queries& queries, Known& known) {
  HWY_DYNAMIC_DISPATCH(update_any)(tree, capacity, k, queries, known);
}

}  // namespace cairn::batch_kernel

#endif  // HWY_ONCE
