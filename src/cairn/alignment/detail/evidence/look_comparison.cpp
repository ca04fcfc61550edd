// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/evidence/look_comparison.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "cairn/alignment/detail/search/descriptor_matches.hpp"
#include "cairn/core/detail/descriptor_kernel.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kOthers = Likeness::kOthers;

}  // namespace

std::uint32_t least_difference(const Descriptors& a, std::size_t i, const Descriptors& b,
                               std::size_t j) {
  const auto norm =
      a.binary() ? descriptor_kernel::Norm::kHamming : descriptor_kernel::Norm::kSquaredBytes;
  return descriptor_kernel::nearest_pair(a.rows(i), b.rows(j), a.bytes_each(), norm).distance;
}

Descriptors::Descriptors(const LandmarkCloud& cloud, std::size_t sample)
    : binary_(is_binary(cloud.descriptors->kind)), bytes_each_(cloud.descriptors->bytes_each) {
  const DescriptorColumn& column = *cloud.descriptors;
  for (std::uint32_t i = 0; i < std::min(sample, cloud.size()); ++i) {
    if (column.known[i] == 0) continue;
    landmarks_.push_back(i);
    for (std::size_t k = 0; k < column.count(i); ++k) {
      const auto row = column.descriptor(i, k);
      bytes_.insert(bytes_.end(), row.begin(), row.end());
    }
    begins_.push_back(begins_.back() + column.count(i));
  }
}

std::optional<std::size_t> Descriptors::of(std::uint32_t landmark) const {
  const auto found = std::lower_bound(landmarks_.begin(), landmarks_.end(), landmark);
  if (found == landmarks_.end() || *found != landmark) return std::nullopt;
  return static_cast<std::size_t>(found - landmarks_.begin());
}

LookComparison::LookComparison(const LandmarkCloud& source, const LandmarkCloud& target,
                               std::size_t sample, Random random) {
  if (!have_like_descriptors(source, target)) return;
  const std::size_t source_size = std::min(sample, source.size());
  const std::size_t target_size = target.size();
  Both both{Descriptors(source, source_size), Descriptors(target, target_size)};
  const std::size_t known = both.target.size();
  both.partners = std::min(kPartners, known / (kOthers + 1));
  if (2 * both.source.size() < source_size || 2 * known < target_size || both.partners == 0) return;
  both.order.resize(known);
  std::iota(both.order.begin(), both.order.end(), 0U);
  for (std::size_t i = known; i > 1; --i) std::swap(both.order[i - 1], both.order[random.index(i)]);
  both.place.resize(known);
  for (std::uint32_t i = 0; i < known; ++i) both.place[both.order[i]] = i;
  for (std::size_t i = 0; i < both.source.size(); ++i) {
    both.first.push_back(static_cast<std::uint32_t>(random.index(known)));
    auto least = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t other = 0; other < both.partners * kOthers; ++other) {
      least = std::min(least, both.difference(i, both.order[(both.first[i] + other) % known]));
      if ((other + 1) % kOthers == 0) both.least.push_back(least);
    }
  }
  descriptors_ = std::move(both);
}

std::optional<bool> LookComparison::alike(std::uint32_t source,
                                          std::span<const std::uint32_t> targets) const {
  if (!descriptors_) return std::nullopt;
  const Both& both = *descriptors_;
  const auto i = both.source.of(source);
  if (!i) return std::nullopt;
  std::array<std::size_t, kPartners> partners;
  std::size_t count = 0;
  for (const std::uint32_t target : targets) {
    if (count == both.partners) break;
    if (const auto j = both.target.of(target)) partners[count++] = *j;
  }
  if (count == 0) return std::nullopt;
  const std::size_t known = both.target.size();
  auto difference = std::numeric_limits<std::uint32_t>::max();
  bool among = false;
  for (std::size_t p = 0; p < count; ++p) {
    difference = std::min(difference, both.difference(*i, partners[p]));
    among = among || (both.place[partners[p]] + known - both.first[*i]) % known < count * kOthers;
  }
  const std::uint32_t least = among ? both.least_but(*i, std::span(partners).first(count))
                                    : both.least[*i * both.partners + count - 1];
  return difference < least;
}

std::uint32_t LookComparison::Both::difference(std::size_t i, std::size_t j) const {
  return least_difference(source, i, target, j);
}

std::uint32_t LookComparison::Both::least_but(std::size_t i,
                                              std::span<const std::size_t> left_out) const {
  auto result = std::numeric_limits<std::uint32_t>::max();
  std::size_t count = left_out.size() * kOthers;
  for (std::size_t other = 0; count > 0; ++other) {
    const std::uint32_t j = order[(first[i] + other) % order.size()];
    if (std::find(left_out.begin(), left_out.end(), j) != left_out.end()) continue;
    result = std::min(result, difference(i, j));
    --count;
  }
  return result;
}

}  // namespace cairn::detail
