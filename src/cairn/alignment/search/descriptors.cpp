// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/search/descriptors.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <string_view>

namespace cairn {

bool is_binary(std::string_view kind) {
  constexpr std::array<std::string_view, 6> kBinary = {"ORB",   "BRIEF", "BRISK",
                                                       "AKAZE", "FREAK", "LATCH"};
  return std::find(kBinary.begin(), kBinary.end(), kind) != kBinary.end();
}

bool have_like_descriptors(const LandmarkCloud& a, const LandmarkCloud& b) {
  return a.descriptors && b.descriptors && a.descriptors->kind == b.descriptors->kind &&
         a.descriptors->bytes_each == b.descriptors->bytes_each;
}

Descriptors::Descriptors(const LandmarkCloud& cloud, std::size_t sample)
    : binary_(is_binary(cloud.descriptors->kind)), words_((cloud.descriptors->bytes_each + 7) / 8) {
  const DescriptorColumn& column = *cloud.descriptors;
  for (std::uint32_t i = 0; i < std::min(sample, cloud.size()); ++i) {
    if (column.known[i] == 0) continue;
    landmarks_.push_back(i);
    for (std::size_t k = 0; k < column.count(i); ++k) {
      values_.resize(values_.size() + words_, 0);
      std::memcpy(&values_[values_.size() - words_], column.descriptor(i, k).data(),
                  column.bytes_each);
    }
    begins_.push_back(begins_.back() + column.count(i));
  }
}

std::optional<std::size_t> Descriptors::of(std::uint32_t landmark) const {
  const auto found = std::lower_bound(landmarks_.begin(), landmarks_.end(), landmark);
  if (found == landmarks_.end() || *found != landmark) return std::nullopt;
  return static_cast<std::size_t>(found - landmarks_.begin());
}

std::uint32_t squared_difference(std::span<const std::uint64_t> a,
                                 std::span<const std::uint64_t> b) {
  const auto* const p = reinterpret_cast<const std::uint8_t*>(a.data());
  const auto* const q = reinterpret_cast<const std::uint8_t*>(b.data());
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < 8 * a.size(); ++i) {
    const int difference = int{p[i]} - int{q[i]};
    sum += static_cast<std::uint32_t>(difference * difference);
  }
  return sum;
}

std::uint32_t least_difference(const Descriptors& a, std::size_t i, const Descriptors& b,
                               std::size_t j) {
  const std::size_t each = a.words_each();
  const auto of_a = a.words(i);
  const auto of_b = b.words(j);
  auto least = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t p = 0; p < of_a.size(); p += each) {
    for (std::size_t q = 0; q < of_b.size(); q += each) {
      const auto x = of_a.subspan(p, each);
      const auto y = of_b.subspan(q, each);
      least = std::min(least, a.binary() ? differing_bits(x, y) : squared_difference(x, y));
    }
  }
  return least;
}

}  // namespace cairn
