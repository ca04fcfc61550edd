// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/likeness.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn {

Likeness& Likeness::operator+=(const Likeness& other) {
  compared += other.compared;
  alike += other.alike;
  return *this;
}

Likeness Likeness::operator-(const Likeness& other) const {
  return {compared - other.compared, alike - other.alike};
}

double Likeness::evidence() const {
  constexpr double kChance = 1.0 / (LikenessTest::kOthers + 1);
  const auto all = static_cast<double>(compared);
  const auto like = static_cast<double>(alike);
  if (like <= kChance * all) return 0.0;
  const double unlike = all - like;
  // Where all are alike, 0·log 0 is 0.
  const double by_others = unlike > 0.0 ? unlike * std::log(unlike / (all * (1.0 - kChance))) : 0.0;
  return like * std::log(like / (all * kChance)) + by_others;
}

LikenessTest::LikenessTest(const CentredPair& pair, std::size_t sample) {
  if (!have_like_descriptors(pair.source(), pair.target())) return;
  const std::size_t source_size = std::min(sample, pair.source().size());
  const std::size_t target_size = pair.target().size();
  Both both{Descriptors(pair.source(), source_size), Descriptors(pair.target(), target_size), {}};
  if (2 * both.source.size() < source_size || 2 * both.target.size() < target_size ||
      both.target.size() <= kOthers) {
    return;
  }
  for (std::size_t i = 0; i < both.source.size(); ++i) {
    auto nearest = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t j = 0; j < kOthers; ++j) nearest = std::min(nearest, both.difference(i, j));
    both.nearest_other.push_back(nearest);
  }
  descriptors_ = std::move(both);
}

std::optional<bool> LikenessTest::alike(std::uint32_t source, std::uint32_t target) const {
  if (!descriptors_) return std::nullopt;
  const auto i = descriptors_->source.of(source);
  const auto j = descriptors_->target.of(target);
  if (!i || !j || *j < kOthers) return std::nullopt;
  return descriptors_->difference(*i, *j) < descriptors_->nearest_other[*i];
}

std::uint32_t LikenessTest::Both::difference(std::size_t i, std::size_t j) const {
  return source.binary() ? differing_bits(source.words(i), target.words(j))
                         : squared_difference(source.words(i), target.words(j));
}

}  // namespace cairn
