// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/look_comparison.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/placement/likeness.hpp"

namespace cairn {
namespace {

constexpr std::size_t kOthers = Likeness::kOthers;

}  // namespace

LookComparison::LookComparison(const CentredPair& pair, std::size_t sample, Random random) {
  if (!have_like_descriptors(pair.source(), pair.target())) return;
  const std::size_t source_size = std::min(sample, pair.source().size());
  const std::size_t target_size = pair.target().size();
  Both both{Descriptors(pair.source(), source_size), Descriptors(pair.target(), target_size)};
  const std::size_t known = both.target.size();
  if (2 * both.source.size() < source_size || 2 * known < target_size || known <= kOthers) return;
  both.order.resize(known);
  std::iota(both.order.begin(), both.order.end(), 0U);
  for (std::size_t i = known; i > 1; --i) {
    std::swap(both.order[i - 1], both.order[random.index(i)]);
  }
  both.place.resize(known);
  for (std::uint32_t i = 0; i < known; ++i) both.place[both.order[i]] = i;
  for (std::size_t i = 0; i < both.source.size(); ++i) {
    both.first.push_back(static_cast<std::uint32_t>(random.index(known)));
    both.least.push_back(both.least_difference(i, kOthers));
  }
  descriptors_ = std::move(both);
}

std::optional<bool> LookComparison::alike(std::uint32_t source, std::uint32_t target) const {
  if (!descriptors_) return std::nullopt;
  const Both& both = *descriptors_;
  const auto i = both.source.of(source);
  const auto j = both.target.of(target);
  if (!i || !j) return std::nullopt;
  const std::size_t known = both.target.size();
  const std::size_t among = (both.place[*j] + known - both.first[*i]) % known;
  const std::uint32_t least = among < kOthers ? both.least_difference(*i, among) : both.least[*i];
  return both.difference(*i, *j) < least;
}

std::uint32_t LookComparison::Both::difference(std::size_t i, std::size_t j) const {
  return source.binary() ? differing_bits(source.words(i), target.words(j))
                         : squared_difference(source.words(i), target.words(j));
}

std::uint32_t LookComparison::Both::least_difference(std::size_t i, std::size_t left_out) const {
  auto result = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t other = 0; other <= kOthers; ++other) {
    if (other == left_out) continue;
    result = std::min(result, difference(i, order[(first[i] + other) % order.size()]));
  }
  return result;
}

}  // namespace cairn
