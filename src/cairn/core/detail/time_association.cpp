// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/time_association.hpp"

#include <algorithm>
#include <limits>
#include <queue>
#include <tuple>

namespace cairn::detail {
namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

// Both lists merged in ascending order of time, linked so that paired times can be removed.
struct Moment {
  double time_s;
  bool in_a;
  std::size_t index;  // in its list
  std::size_t before;
  std::size_t after;
};

std::vector<Moment> merged(std::span<const double> a, std::span<const double> b) {
  std::vector<Moment> moments;
  moments.reserve(a.size() + b.size());
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() || j < b.size()) {
    const bool from_a = j == b.size() || (i < a.size() && a[i] <= b[j]);
    const std::size_t place = moments.size();
    const std::size_t index = from_a ? i++ : j++;
    moments.push_back(
        {from_a ? a[index] : b[index], from_a, index, place == 0 ? kNone : place - 1, place + 1});
  }
  if (!moments.empty()) moments.back().after = kNone;
  return moments;
}

struct Candidate {
  double difference_s;
  std::size_t a;
  std::size_t b;
  std::size_t earlier;  // of the two, as a position among the moments
  std::size_t later;
};

// Order of a priority queue: the closest pair first; of equally close ones, the earliest.
struct ComesLater {
  bool operator()(const Candidate& x, const Candidate& y) const {
    return std::tie(x.difference_s, x.a, x.b) > std::tie(y.difference_s, y.a, y.b);
  }
};

}  // namespace

// The closest remaining pair always consists of neighbours in the merged list, because any time between the
// two would be closer to one of them. Therefore only neighbours are candidates; when a pair is removed, the
// times on both sides of it become neighbours.
IndexPairs associate_times(std::span<const double> a, std::span<const double> b,
                           double max_difference_s) {
  std::vector<Moment> moments = merged(a, b);
  std::priority_queue<Candidate, std::vector<Candidate>, ComesLater> candidates;
  const auto consider = [&](std::size_t earlier, std::size_t later) {
    if (earlier == kNone || later == kNone) return;
    const Moment& x = moments[earlier];
    const Moment& y = moments[later];
    const double difference = y.time_s - x.time_s;
    if (x.in_a == y.in_a || !(difference < max_difference_s)) return;
    candidates.push(
        {difference, x.in_a ? x.index : y.index, x.in_a ? y.index : x.index, earlier, later});
  };
  for (std::size_t i = 1; i < moments.size(); ++i) consider(i - 1, i);

  std::vector<bool> paired(moments.size(), false);
  IndexPairs pairs;
  while (!candidates.empty()) {
    const Candidate closest = candidates.top();
    candidates.pop();
    if (paired[closest.earlier] || paired[closest.later]) continue;
    paired[closest.earlier] = paired[closest.later] = true;
    pairs.emplace_back(closest.a, closest.b);
    const std::size_t before = moments[closest.earlier].before;
    const std::size_t after = moments[closest.later].after;
    if (before != kNone) moments[before].after = after;
    if (after != kNone) moments[after].before = before;
    consider(before, after);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace cairn::detail
