// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/descriptor_kernel.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

// GCC takes the undefined lanes in its own AVX-512 headers for a mistake (its bug 105593).
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

// Vectors of a size known only at run time are not what this is written for.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// Counts bits in one instruction. Highway 1.0 lets the compiler use AVX-VNNI with it, which processors with AVX-512 may
// lack (Ice Lake, Zen 4); Clang does.
#ifndef __clang__
#define HWY_WANT_AVX3_DL
#endif
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cairn/core/detail/descriptor_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef CAIRN_CORE_DESCRIPTOR_KERNEL_ONCE
#define CAIRN_CORE_DESCRIPTOR_KERNEL_ONCE
namespace cairn::detail::descriptor_kernel {

// Most lanes of 32 bits that any instruction set has.
inline constexpr std::size_t kMostLanes = 16;
// Columns are padded to a multiple of as many vectors as are compared at once.
inline constexpr std::size_t kPadding = 4 * kMostLanes;

// Descriptors as words of four bytes (kHamming) or of two bytes, each widened to 16 bits (kSquaredBytes).
struct Rows {
  std::size_t count = 0;
  std::size_t words = 0;
  std::vector<std::uint32_t> values;
  std::vector<std::uint32_t> squares;  // sum over the bytes of each; empty for kHamming
};

// Consecutive rows in columns: the k-th word of all of them side by side, so that each lane compares another.
struct Columns {
  std::size_t begin = 0;  // number of the first
  std::size_t count = 0;
  std::size_t padded = 0;
  std::size_t words = 0;
  std::vector<std::uint32_t> values;
  std::vector<std::uint32_t> squares;  // padded, as for Rows
  std::vector<std::uint32_t> owners;   // padded; empty: each descriptor has its own

  const std::uint32_t* word(std::size_t k) const { return values.data() + k * padded; }
};

}  // namespace cairn::detail::descriptor_kernel
#endif

// Compiled once for each instruction set.
HWY_BEFORE_NAMESPACE();
namespace cairn::detail::descriptor_kernel::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::CappedTag<std::uint32_t, kMostLanes>;
using Signed = hn::RebindToSigned<Words>;
using Word = hn::Vec<Words>;

#if HWY_TARGET == HWY_SCALAR

// There are no lanes to split.
Word bits_of(const std::uint32_t* query, const Columns& others, std::size_t words, std::size_t j) {
  const Words d;
  Word sum = hn::Zero(d);
  for (std::size_t k = 0; k < words; ++k) {
    const Word bits = hn::Xor(hn::Set(d, query[k]), hn::LoadU(d, others.word(k) + j));
    sum = hn::Add(sum, hn::PopulationCount(bits));
  }
  return sum;
}

#else

using Bytes = hn::RepartitionToNarrow<hn::RepartitionToNarrow<Words> >;

// Counts of bits by byte are added up in bytes, which hold those of so many words.
constexpr std::size_t kMostInBytes = 31;

Word sum_of_bytes(Word counts) {
  const Words d;
  const Word even = hn::Set(d, 0x00ff00ffU);
  const Word pairs = hn::Add(hn::And(counts, even), hn::And(hn::ShiftRight<8>(counts), even));
  return hn::Add(hn::And(pairs, hn::Set(d, 0xffffU)), hn::ShiftRight<16>(pairs));
}

HWY_INLINE Word bits_of(const std::uint32_t* query, const Columns& others, std::size_t words,
                        std::size_t j) {
  const Words d;
  Word sum = hn::Zero(d);
  for (std::size_t k = 0; k < words;) {
    auto counts = hn::Zero(Bytes());
    const std::size_t end = std::min(words, k + kMostInBytes);
    for (; k < end; ++k) {
      const Word bits = hn::Xor(hn::Set(d, query[k]), hn::LoadU(d, others.word(k) + j));
      counts = hn::Add(counts, hn::PopulationCount(hn::BitCast(Bytes(), bits)));
    }
    sum = hn::Add(sum, sum_of_bytes(hn::BitCast(d, counts)));
  }
  return sum;
}

#endif

// Differences of a row and as many vectors of others as are compared at once.
struct Hamming {
  static constexpr std::size_t kUsualWords = 8;  // of ORB
  using Differences = std::array<Word, 1>;

  static HWY_INLINE Differences of(const Rows& a, std::size_t i, const Columns& b,
                                   std::size_t words, std::size_t j) {
    return {bits_of(a.values.data() + i * words, b, words, j)};
  }
};

// By |a - b|² = |a|² + |b|² - 2 a·b, because products need one instruction less than squared differences.
struct SquaredBytes {
  static constexpr std::size_t kUsualWords = 64;  // of SIFT
  using Differences = std::array<Word, kPadding / kMostLanes>;

  // Of the two numbers of 16 bits in a lane.
  static HWY_INLINE hn::Vec<Signed> sum_of_products(Word a, Word b) {
    const Signed d;
#if HWY_ARCH_X86 && HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
    // Elsewhere this operation sums other pairs.
    const hn::RepartitionToNarrow<Signed> shorts;
    auto unused = hn::Zero(d);
    return hn::ReorderWidenMulAccumulate(d, hn::BitCast(shorts, a), hn::BitCast(shorts, b),
                                         hn::Zero(d), unused);
#else
    const Word low = hn::Set(Words(), 0xffffU);
    const auto even = hn::Mul(hn::BitCast(d, hn::And(a, low)), hn::BitCast(d, hn::And(b, low)));
    const auto odd =
        hn::Mul(hn::BitCast(d, hn::ShiftRight<16>(a)), hn::BitCast(d, hn::ShiftRight<16>(b)));
    return hn::Add(even, odd);
#endif
  }

  static HWY_INLINE Differences of(const Rows& a, std::size_t i, const Columns& b,
                                   std::size_t words, std::size_t j) {
    const Words d;
    const std::size_t lanes = hn::Lanes(d);
    const std::uint32_t* const query = a.values.data() + i * words;
    auto products_0 = hn::Zero(Signed());
    auto products_1 = products_0;
    auto products_2 = products_0;
    auto products_3 = products_0;
    for (std::size_t k = 0; k < words; ++k) {
      const Word word = hn::Set(d, query[k]);
      const std::uint32_t* const others = b.word(k) + j;
      products_0 = hn::Add(products_0, sum_of_products(word, hn::LoadU(d, others)));
      products_1 = hn::Add(products_1, sum_of_products(word, hn::LoadU(d, others + lanes)));
      products_2 = hn::Add(products_2, sum_of_products(word, hn::LoadU(d, others + 2 * lanes)));
      products_3 = hn::Add(products_3, sum_of_products(word, hn::LoadU(d, others + 3 * lanes)));
    }
    const Word own = hn::Set(d, a.squares[i]);
    const auto difference = [&](std::size_t vector, hn::Vec<Signed> products) HWY_ATTR {
      const Word squares = hn::Add(own, hn::LoadU(d, b.squares.data() + j + vector * lanes));
      return hn::Sub(squares, hn::ShiftLeft<1>(hn::BitCast(d, products)));
    };
    return {difference(0, products_0), difference(1, products_1), difference(2, products_2),
            difference(3, products_3)};
  }
};

// Merges into `nearest` the nearest of further rows, whose numbers are larger.
void merge(const Nearest& further, bool one_owner, Nearest& nearest) {
  const bool nearer = further.first < nearest.first;
  const Nearest& loser = nearer ? nearest : further;
  nearest.second =
      std::min({nearest.second, further.second, one_owner ? Nearest::kNone : loser.first});
  if (!nearer) return;
  nearest.first = further.first;
  nearest.index = further.index;
}

// @tparam kWords of a row; 0 if only known at run time
template <class Norm, bool kOwned, std::size_t kWords>
void compare(const Rows& a, const Columns& b, std::span<const std::uint32_t> owners,
             NearestBothWays& result) {
  const Words d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t words = kWords > 0 ? kWords : a.words;
  std::vector<std::uint32_t> column_first(b.padded, Nearest::kNone);
  std::vector<std::uint32_t> column_index(b.padded, Nearest::kNone);
  HWY_ALIGN std::uint32_t firsts[kMostLanes];
  HWY_ALIGN std::uint32_t seconds[kMostLanes];
  HWY_ALIGN std::uint32_t indices[kMostLanes];
  const auto same_owner = [&](std::uint32_t i, std::uint32_t j) {
    return kOwned && i < owners.size() && j < owners.size() ? owners[i] == owners[j] : i == j;
  };
  const Word none = hn::Set(d, Nearest::kNone);
  const Word count = hn::Set(d, static_cast<std::uint32_t>(b.count));
  const Word begin = hn::Set(d, static_cast<std::uint32_t>(b.begin));
  for (std::size_t i = 0; i < a.count; ++i) {
    const Word here = hn::Set(d, static_cast<std::uint32_t>(i));
    // What is no nearer than the second of the rows before changes nothing.
    Word first = hn::Set(d, result.of_a[i].second);
    Word second = first;
    Word index = none;
    [[maybe_unused]] Word owner = none;
    typename Norm::Differences differences;
    for (std::size_t j = 0; j < b.padded; j += lanes) {
      const std::size_t vector = j / lanes % differences.size();
      if (vector == 0) differences = Norm::of(a, i, b, words, j);
      Word difference = differences[vector];
      const Word place = hn::Iota(d, static_cast<std::uint32_t>(j));
      if (j + lanes > b.count) difference = hn::IfThenElse(hn::Lt(place, count), difference, none);
      const Word known = hn::LoadU(d, column_first.data() + j);
      if (hn::AllFalse(d, hn::Lt(difference, hn::Max(known, second)))) continue;
      const auto better = hn::Lt(difference, known);
      const auto nearer = hn::Lt(difference, first);
      const Word loser = hn::Max(first, difference);
      if constexpr (kOwned) {
        const Word here_owned = hn::LoadU(d, b.owners.data() + j);
        second = hn::IfThenElse(hn::Eq(owner, here_owned), second, hn::Min(second, loser));
        owner = hn::IfThenElse(nearer, here_owned, owner);
      } else {
        second = hn::Min(second, loser);
      }
      first = hn::Min(first, difference);
      index = hn::IfThenElse(nearer, hn::Add(place, begin), index);
      hn::StoreU(hn::Min(difference, known), d, column_first.data() + j);
      hn::StoreU(hn::IfThenElse(better, here, hn::LoadU(d, column_index.data() + j)), d,
                 column_index.data() + j);
    }
    hn::Store(first, d, firsts);
    hn::Store(second, d, seconds);
    hn::Store(index, d, indices);
    Nearest nearest;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (indices[lane] == Nearest::kNone) continue;
      if (firsts[lane] < nearest.first ||
          (firsts[lane] == nearest.first && indices[lane] < nearest.index)) {
        nearest.first = firsts[lane];
        nearest.index = indices[lane];
      }
    }
    if (nearest.index == Nearest::kNone) continue;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      // A lane whose nearest has another owner has nothing nearer of another owner than that.
      const bool is_other = !same_owner(indices[lane], nearest.index);
      nearest.second = std::min(nearest.second, is_other ? firsts[lane] : seconds[lane]);
    }
    merge(nearest, same_owner(nearest.index, result.of_a[i].index), result.of_a[i]);
  }
  for (std::size_t j = 0; j < b.count; ++j) {
    result.of_b[b.begin + j] = {column_index[j], column_first[j], Nearest::kNone};
  }
}

// Sums over whole vectors of bytes; the bytes behind these remain.
struct HammingOfBytes {
#if HWY_TARGET != HWY_SCALAR
  static constexpr std::size_t kStep = 8 * hn::MaxLanes(hn::CappedTag<std::uint64_t, 4>());
  static HWY_INLINE std::uint32_t sum(const std::uint8_t* a, const std::uint8_t* b,
                                      std::size_t end) {
    const hn::CappedTag<std::uint64_t, 4> d;
    const hn::Repartition<std::uint8_t, decltype(d)> bytes;
    auto counts = hn::Zero(d);
    for (std::size_t k = 0; k < end; k += kStep) {
      const auto bits = hn::Xor(hn::LoadU(bytes, a + k), hn::LoadU(bytes, b + k));
      counts = hn::Add(counts, hn::PopulationCount(hn::BitCast(d, bits)));
    }
    return static_cast<std::uint32_t>(hn::GetLane(hn::SumOfLanes(d, counts)));
  }
#endif
  static std::uint32_t of(std::uint8_t a, std::uint8_t b) {
    return static_cast<std::uint32_t>(std::popcount(static_cast<std::uint8_t>(a ^ b)));
  }
};

struct SquaresOfBytes {
#if HWY_TARGET != HWY_SCALAR
  static constexpr std::size_t kStep = hn::MaxLanes(hn::CappedTag<std::int16_t, 16>());
  static HWY_INLINE std::uint32_t sum(const std::uint8_t* a, const std::uint8_t* b,
                                      std::size_t end) {
    const hn::CappedTag<std::int16_t, 16> d;
    const hn::Rebind<std::uint8_t, decltype(d)> bytes;
    const hn::RepartitionToWide<decltype(d)> wide;
    auto low = hn::Zero(wide);
    auto high = hn::Zero(wide);
    for (std::size_t k = 0; k < end; k += kStep) {
      const auto difference = hn::Sub(hn::PromoteTo(d, hn::LoadU(bytes, a + k)),
                                      hn::PromoteTo(d, hn::LoadU(bytes, b + k)));
      low = hn::ReorderWidenMulAccumulate(wide, difference, difference, low, high);
    }
    return static_cast<std::uint32_t>(hn::GetLane(hn::SumOfLanes(wide, hn::Add(low, high))));
  }
#endif
  static std::uint32_t of(std::uint8_t a, std::uint8_t b) {
    const int difference = int{a} - int{b};
    return static_cast<std::uint32_t>(difference * difference);
  }
};

template <class Norm>
NearestPair nearest_of_pairs(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                             std::size_t bytes_each) {
#if HWY_TARGET == HWY_SCALAR
  const std::size_t whole = 0;
#else
  const std::size_t whole = bytes_each / Norm::kStep * Norm::kStep;
#endif
  NearestPair nearest;
  for (std::size_t i = 0; i < a.size(); i += bytes_each) {
    for (std::size_t j = 0; j < b.size(); j += bytes_each) {
      std::uint32_t sum = 0;
#if HWY_TARGET != HWY_SCALAR
      sum = Norm::sum(&a[i], &b[j], whole);
#endif
      for (std::size_t k = whole; k < bytes_each; ++k) sum += Norm::of(a[i + k], b[j + k]);
      if (sum < nearest.distance) nearest = {i / bytes_each, j / bytes_each, sum};
    }
  }
  return nearest;
}

NearestPair nearest_pair_of(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                            std::size_t bytes_each, Norm norm) {
  return norm == Norm::kHamming ? nearest_of_pairs<HammingOfBytes>(a, b, bytes_each)
                                : nearest_of_pairs<SquaresOfBytes>(a, b, bytes_each);
}

template <class Norm>
void compare_words(const Rows& a, const Columns& b, std::span<const std::uint32_t> owners,
                   NearestBothWays& result) {
  const bool usual = a.words == Norm::kUsualWords;
  if (owners.empty()) {
    return usual ? compare<Norm, false, Norm::kUsualWords>(a, b, owners, result)
                 : compare<Norm, false, 0>(a, b, owners, result);
  }
  return usual ? compare<Norm, true, Norm::kUsualWords>(a, b, owners, result)
               : compare<Norm, true, 0>(a, b, owners, result);
}

void compare_any(const Rows& a, const Columns& b, std::span<const std::uint32_t> owners, Norm norm,
                 NearestBothWays& result) {
  if (norm == Norm::kHamming) return compare_words<Hamming>(a, b, owners, result);
  return compare_words<SquaredBytes>(a, b, owners, result);
}

}  // namespace
}  // namespace cairn::detail::descriptor_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace cairn::detail::descriptor_kernel {
namespace {

HWY_EXPORT(compare_any);
HWY_EXPORT(nearest_pair_of);

// Bytes of columns that the first-level cache holds beside their results.
constexpr std::size_t kColumnBytes = 16384;

Rows rows_of(std::span<const std::uint8_t> bytes, std::size_t bytes_each, Norm norm) {
  const std::size_t bytes_a_word = norm == Norm::kHamming ? 4 : 2;
  Rows rows;
  rows.count = bytes.size() / bytes_each;
  rows.words = (bytes_each + bytes_a_word - 1) / bytes_a_word;
  rows.values.assign(rows.words * rows.count, 0);
  for (std::size_t i = 0; i < rows.count; ++i) {
    const std::uint8_t* const row = bytes.data() + i * bytes_each;
    std::uint32_t* const words = rows.values.data() + i * rows.words;
    if (norm == Norm::kHamming) {
      std::memcpy(words, row, bytes_each);
      continue;
    }
    std::uint32_t sum = 0;
    for (std::size_t byte = 0; byte < bytes_each; ++byte) {
      const std::uint32_t value = row[byte];
      words[byte / 2] |= value << (byte % 2 * 16);
      sum += value * value;
    }
    rows.squares.push_back(sum);
  }
  return rows;
}

Columns columns_of(const Rows& rows, std::size_t begin) {
  Columns columns;
  columns.begin = begin;
  columns.count = rows.count;
  columns.padded = (rows.count + kPadding - 1) / kPadding * kPadding;
  columns.words = rows.words;
  columns.values.assign(columns.words * columns.padded, 0);
  for (std::size_t i = 0; i < rows.count; ++i) {
    for (std::size_t k = 0; k < rows.words; ++k) {
      columns.values[k * columns.padded + i] = rows.values[i * rows.words + k];
    }
  }
  columns.squares = rows.squares;
  columns.squares.resize(columns.padded, 0);
  return columns;
}

}  // namespace

NearestBothWays nearest_both_ways(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                                  std::size_t bytes_each, Norm norm,
                                  std::span<const std::uint32_t> owners_of_b) {
  const Rows of_a = rows_of(a, bytes_each, norm);
  const std::size_t count_of_b = b.size() / bytes_each;
  NearestBothWays result;
  result.of_a.resize(of_a.count);
  result.of_b.resize(count_of_b);
  if (of_a.count == 0) return result;
  const std::size_t at_a_time =
      std::max(kColumnBytes / (of_a.words * sizeof(std::uint32_t)) / kPadding, std::size_t{1}) *
      kPadding;
  for (std::size_t begin = 0; begin < count_of_b; begin += at_a_time) {
    const std::size_t count = std::min(at_a_time, count_of_b - begin);
    const auto bytes = b.subspan(begin * bytes_each, count * bytes_each);
    Columns of_b = columns_of(rows_of(bytes, bytes_each, norm), begin);
    if (!owners_of_b.empty()) {
      const auto owners = owners_of_b.subspan(begin, count);
      of_b.owners.assign(owners.begin(), owners.end());
      of_b.owners.resize(of_b.padded, Nearest::kNone);
    }
    HWY_DYNAMIC_DISPATCH(compare_any)(of_a, of_b, owners_of_b, norm, result);
  }
  return result;
}

NearestPair nearest_pair(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                         std::size_t bytes_each, Norm norm) {
  return HWY_DYNAMIC_DISPATCH(nearest_pair_of)(a, b, bytes_each, norm);
}

}  // namespace cairn::detail::descriptor_kernel

#endif  // HWY_ONCE
