// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/descriptor_kernel.hpp"

#include <algorithm>
#include <bit>

// GCC takes the undefined lanes in its own AVX-512 headers for a mistake (its bug 105593).
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

// Vectors of a size known only at run time are not what this is written for.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#define HWY_WANT_AVX3_DL  // which counts bits in one instruction
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cairn/core/detail/descriptor_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef CAIRN_CORE_DESCRIPTOR_KERNEL_ONCE
#define CAIRN_CORE_DESCRIPTOR_KERNEL_ONCE
namespace cairn::detail::descriptor_kernel {

// Most lanes of 32 bits that any instruction set has; columns are padded to a multiple of it.
inline constexpr std::size_t kPadding = 16;

// Descriptors in columns: the k-th word of all of them side by side, so that each lane compares another.
// A word is four bytes (kHamming) or two, each widened to 16 bits (kSquaredBytes).
struct Columns {
  std::size_t count = 0;
  std::size_t padded = 0;
  std::size_t words = 0;
  std::vector<std::uint32_t> values;
  std::vector<std::uint32_t> owners;  // padded; empty: each descriptor has its own

  const std::uint32_t* word(std::size_t k) const { return values.data() + k * padded; }
};

}  // namespace cairn::detail::descriptor_kernel
#endif

// Compiled once for each instruction set.
HWY_BEFORE_NAMESPACE();
namespace cairn::detail::descriptor_kernel::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::CappedTag<std::uint32_t, kPadding>;
using Signed = hn::RebindToSigned<Words>;
using Word = hn::Vec<Words>;

#if HWY_TARGET == HWY_SCALAR

// There are no lanes to split.
Word bits_of(const std::uint32_t* query, const Columns& others, std::size_t j) {
  const Words d;
  Word sum = hn::Zero(d);
  for (std::size_t k = 0; k < others.words; ++k) {
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

HWY_INLINE Word bits_of(const std::uint32_t* query, const Columns& others, std::size_t j) {
  const Words d;
  Word sum = hn::Zero(d);
  for (std::size_t k = 0; k < others.words;) {
    auto counts = hn::Zero(Bytes());
    const std::size_t end = std::min(others.words, k + kMostInBytes);
    for (; k < end; ++k) {
      const Word bits = hn::Xor(hn::Set(d, query[k]), hn::LoadU(d, others.word(k) + j));
      counts = hn::Add(counts, hn::PopulationCount(hn::BitCast(Bytes(), bits)));
    }
    sum = hn::Add(sum, sum_of_bytes(hn::BitCast(d, counts)));
  }
  return sum;
}

#endif

struct Hamming {
  static Word difference(const std::uint32_t* query, const Columns& others, std::size_t j) {
    return bits_of(query, others, j);
  }
};

struct SquaredBytes {
  // Of the two numbers of 16 bits in a lane.
  static hn::Vec<Signed> sum_of_squares(Word a, Word b) {
    const Signed d;
#if HWY_ARCH_X86 && HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
    // Elsewhere this operation sums other pairs.
    const hn::RepartitionToNarrow<Signed> shorts;
    const auto difference = hn::Sub(hn::BitCast(shorts, a), hn::BitCast(shorts, b));
    auto unused = hn::Zero(d);
    return hn::ReorderWidenMulAccumulate(d, difference, difference, hn::Zero(d), unused);
#else
    const Word low = hn::Set(Words(), 0xffffU);
    const auto even = hn::Sub(hn::BitCast(d, hn::And(a, low)), hn::BitCast(d, hn::And(b, low)));
    const auto odd =
        hn::Sub(hn::BitCast(d, hn::ShiftRight<16>(a)), hn::BitCast(d, hn::ShiftRight<16>(b)));
    return hn::Add(hn::Mul(even, even), hn::Mul(odd, odd));
#endif
  }

  static Word difference(const std::uint32_t* query, const Columns& others, std::size_t j) {
    const Words d;
    auto sum = hn::Zero(Signed());
    for (std::size_t k = 0; k < others.words; ++k) {
      sum = hn::Add(sum, sum_of_squares(hn::Set(d, query[k]), hn::LoadU(d, others.word(k) + j)));
    }
    return hn::BitCast(d, sum);
  }
};

template <class Norm, bool kOwned>
void compare(const Columns& a, const Columns& b, NearestBothWays& result) {
  const Words d;
  const std::size_t lanes = hn::Lanes(d);
  std::vector<std::uint32_t> query(a.words);
  std::vector<std::uint32_t> column_first(b.padded, Nearest::kNone);
  std::vector<std::uint32_t> column_index(b.padded, Nearest::kNone);
  HWY_ALIGN std::uint32_t firsts[kPadding];
  HWY_ALIGN std::uint32_t seconds[kPadding];
  HWY_ALIGN std::uint32_t indices[kPadding];
  const auto owner_of = [&](std::uint32_t j) { return kOwned && j < b.count ? b.owners[j] : j; };
  const Word none = hn::Set(d, Nearest::kNone);
  const Word count = hn::Set(d, static_cast<std::uint32_t>(b.count));
  for (std::size_t i = 0; i < a.count; ++i) {
    for (std::size_t k = 0; k < a.words; ++k) query[k] = a.word(k)[i];
    const Word here = hn::Set(d, static_cast<std::uint32_t>(i));
    Word first = none;
    Word second = none;
    Word index = none;
    [[maybe_unused]] Word owner = none;
    for (std::size_t j = 0; j < b.padded; j += lanes) {
      const Word place = hn::Iota(d, static_cast<std::uint32_t>(j));
      const Word difference =
          hn::IfThenElse(hn::Lt(place, count), Norm::difference(query.data(), b, j), none);
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
      index = hn::IfThenElse(nearer, place, index);
      const Word known = hn::LoadU(d, column_first.data() + j);
      const auto better = hn::Lt(difference, known);
      hn::StoreU(hn::Min(difference, known), d, column_first.data() + j);
      hn::StoreU(hn::IfThenElse(better, here, hn::LoadU(d, column_index.data() + j)), d,
                 column_index.data() + j);
    }
    hn::Store(first, d, firsts);
    hn::Store(second, d, seconds);
    hn::Store(index, d, indices);
    Nearest& nearest = result.of_a[i];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (firsts[lane] < nearest.first ||
          (firsts[lane] == nearest.first && indices[lane] < nearest.index)) {
        nearest.first = firsts[lane];
        nearest.index = indices[lane];
      }
    }
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      // A lane whose nearest has another owner has nothing nearer of another owner than that.
      const bool is_other = kOwned ? owner_of(indices[lane]) != owner_of(nearest.index)
                                   : indices[lane] != nearest.index;
      nearest.second = std::min(nearest.second, is_other ? firsts[lane] : seconds[lane]);
    }
  }
  for (std::size_t j = 0; j < b.count; ++j) {
    result.of_b[j] = {column_index[j], column_first[j], Nearest::kNone};
  }
}

// Usual descriptors have 256 bits, which are one vector or few.
std::uint32_t least_bits(std::span<const std::uint64_t> a, std::span<const std::uint64_t> b,
                         std::size_t words_each) {
  const hn::CappedTag<std::uint64_t, 4> d;
  const std::size_t lanes = hn::Lanes(d);
  std::uint64_t least = Nearest::kNone;
  for (std::size_t i = 0; i < a.size(); i += words_each) {
    for (std::size_t j = 0; j < b.size(); j += words_each) {
      auto counts = hn::Zero(d);
      std::size_t k = 0;
      for (; k + lanes <= words_each; k += lanes) {
        const auto bits = hn::Xor(hn::LoadU(d, &a[i + k]), hn::LoadU(d, &b[j + k]));
        counts = hn::Add(counts, hn::PopulationCount(bits));
      }
      std::uint64_t sum = hn::GetLane(hn::SumOfLanes(d, counts));
      for (; k < words_each; ++k) {
        sum += static_cast<std::uint64_t>(std::popcount(a[i + k] ^ b[j + k]));
      }
      least = std::min(least, sum);
    }
  }
  return static_cast<std::uint32_t>(least);
}

void compare_any(const Columns& a, const Columns& b, Norm norm, NearestBothWays& result) {
  const bool owned = !b.owners.empty();
  if (norm == Norm::kHamming) {
    return owned ? compare<Hamming, true>(a, b, result) : compare<Hamming, false>(a, b, result);
  }
  return owned ? compare<SquaredBytes, true>(a, b, result)
               : compare<SquaredBytes, false>(a, b, result);
}

}  // namespace
}  // namespace cairn::detail::descriptor_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace cairn::detail::descriptor_kernel {
namespace {

HWY_EXPORT(compare_any);
HWY_EXPORT(least_bits);

Columns columns_of(std::span<const std::uint8_t> rows, std::size_t bytes_each, Norm norm) {
  const std::size_t bytes_a_word = norm == Norm::kHamming ? 4 : 2;
  Columns columns;
  columns.count = rows.size() / bytes_each;
  columns.padded = (columns.count + kPadding - 1) / kPadding * kPadding;
  columns.words = (bytes_each + bytes_a_word - 1) / bytes_a_word;
  columns.values.assign(columns.words * columns.padded, 0);
  for (std::size_t i = 0; i < columns.count; ++i) {
    const std::uint8_t* const row = rows.data() + i * bytes_each;
    for (std::size_t byte = 0; byte < bytes_each; ++byte) {
      const std::size_t shift = byte % bytes_a_word * (32 / bytes_a_word);
      columns.values[byte / bytes_a_word * columns.padded + i] |=
          static_cast<std::uint32_t>(row[byte]) << shift;
    }
  }
  return columns;
}

}  // namespace

NearestBothWays nearest_both_ways(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                                  std::size_t bytes_each, Norm norm,
                                  std::span<const std::uint32_t> owners_of_b) {
  const Columns of_a = columns_of(a, bytes_each, norm);
  Columns of_b = columns_of(b, bytes_each, norm);
  if (!owners_of_b.empty()) {
    of_b.owners.assign(owners_of_b.begin(), owners_of_b.end());
    of_b.owners.resize(of_b.padded, Nearest::kNone);
  }
  NearestBothWays result;
  result.of_a.resize(of_a.count);
  result.of_b.resize(of_b.count);
  if (of_a.count > 0 && of_b.count > 0) {
    HWY_DYNAMIC_DISPATCH(compare_any)(of_a, of_b, norm, result);
  }
  return result;
}

std::uint32_t least_hamming(std::span<const std::uint64_t> a, std::span<const std::uint64_t> b,
                            std::size_t words_each) {
  return HWY_DYNAMIC_DISPATCH(least_bits)(a, b, words_each);
}

}  // namespace cairn::detail::descriptor_kernel

#endif  // HWY_ONCE
