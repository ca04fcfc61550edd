// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/prepared_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string_view>
#include <utility>

#include "cairn/alignment/detail/search/spatial_groups.hpp"
#include "cairn/core/hash.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

// Makes the samples of two maps independent, even if their landmarks have the same order.
Random random_of(const LandmarkCloud& cloud, std::uint64_t seed) {
  Hasher hasher;
  hasher.update({reinterpret_cast<const char*>(cloud.positions.data()),
                 cloud.size() * sizeof(Eigen::Vector3d)});
  return Random(seed).fork(hasher.digest().low);
}

// Weighted random order: landmarks of larger weight are probably earlier (Efraimidis and Spirakis 2006).
std::vector<std::uint32_t> random_order(const LandmarkCloud& cloud, Random random) {
  std::vector<std::pair<double, std::uint32_t>> keys(cloud.size());
  for (std::uint32_t i = 0; i < keys.size(); ++i) {
    keys[i] = {std::log1p(-random.uniform()) / std::max(cloud.weight(i), 1e-9), i};
  }
  std::sort(keys.begin(), keys.end(), std::greater<>());
  std::vector<std::uint32_t> order;
  order.reserve(keys.size());
  for (const auto& [key, i] : keys) order.push_back(i);
  return order;
}

// Permutes in place, cycle by cycle, so that entry i becomes the former entry order[i]. `save(i)` saves entry
// i, `move(to, from)` moves one, `restore(i)` sets entry i to the saved one.
template <class Save, class Move, class Restore>
void reorder(std::span<const std::uint32_t> order, const Save& save, const Move& move,
             const Restore& restore) {
  std::vector<bool> is_done(order.size(), false);
  for (std::size_t start = 0; start < order.size(); ++start) {
    if (is_done[start]) continue;
    save(start);
    std::size_t at = start;
    for (; order[at] != start; at = order[at]) {
      move(at, order[at]);
      is_done[at] = true;
    }
    restore(at);
    is_done[at] = true;
  }
}

template <class Value>
void reorder(std::vector<Value>& column, std::span<const std::uint32_t> order) {
  if (column.empty()) return;
  Value kept;
  reorder(
      order, [&](std::size_t i) { kept = std::move(column[i]); },
      [&](std::size_t to, std::size_t from) { column[to] = std::move(column[from]); },
      [&](std::size_t i) { column[i] = std::move(kept); });
}

void reorder(DescriptorColumn& column, std::span<const std::uint32_t> order) {
  if (column.has_further()) {
    column = descriptor_rows(column, order);  // rows vary in size
    return;
  }
  reorder(column.known, order);
  std::vector<std::uint8_t> kept(column.bytes_each);
  const auto row = [&](std::size_t i) { return column.bytes.data() + i * column.bytes_each; };
  reorder(
      order, [&](std::size_t i) { std::copy_n(row(i), kept.size(), kept.data()); },
      [&](std::size_t to, std::size_t from) { std::copy_n(row(from), kept.size(), row(to)); },
      [&](std::size_t i) { std::copy_n(kept.data(), kept.size(), row(i)); });
}

LandmarkCloud ordered(LandmarkCloud cloud, std::span<const std::uint32_t> order) {
  reorder(cloud.positions, order);
  reorder(cloud.covariances, order);
  reorder(cloud.weights, order);
  if (cloud.descriptors) reorder(*cloud.descriptors, order);
  std::vector<std::uint32_t> place(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;
  for (LandmarkView& view : cloud.views) {
    for (std::uint32_t& landmark : view.landmarks) landmark = place[landmark];
  }
  return cloud;
}

std::span<const Eigen::Vector3d> sample_of(const LandmarkCloud& cloud) {
  return std::span(cloud.positions).first(std::min(cloud.size(), PreparedCloud::kSample));
}

CloudScales scales_of_sample(const LandmarkCloud& cloud, const CloudScales& all,
                             const Executor& executor) {
  if (cloud.size() <= PreparedCloud::kSample) return all;
  LandmarkCloud part;
  part.positions.assign(sample_of(cloud).begin(), sample_of(cloud).end());
  CloudScales scales = cloud_scales(part, BatchTree(part.positions), executor);
  scales.noise = all.noise;
  return scales;
}

}  // namespace

PreparedCloud::Parts::Parts(const LandmarkCloud& landmarks, const Executor& executor)
    : tree(landmarks.positions),
      spacings(landmark_spacings(landmarks.positions, tree, executor)),
      scales(cloud_scales(landmarks, tree, executor)),
      sample_scales(scales_of_sample(landmarks, scales, executor)),
      groups(spatial_groups(sample_of(landmarks), kGroups)),
      views(landmarks) {}

PreparedCloud::PreparedCloud(LandmarkCloud cloud, std::uint64_t seed, const Executor& executor,
                             std::string_view name) {
  cloud.validate(name);
  if (has_placeholder_covariances(cloud)) {
    cloud.covariances.clear();
    ignores_covariances_ = true;
  }
  auto order = random_order(cloud, random_of(cloud, seed));
  centred_ = std::make_shared<const CentredCloud>(ordered(std::move(cloud), order));
  order_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(order));
  parts_ = std::make_shared<const Parts>(centred_->landmarks, executor);
}

PreparedCloud PreparedCloud::scaled(double scale, const Executor& executor) const {
  if (scale == 1.0) return *this;
  PreparedCloud result;
  result.centred_ = cairn::scaled(*centred_, scale);
  result.order_ = order_;
  result.ignores_covariances_ = ignores_covariances_;
  result.parts_ = std::make_shared<const Parts>(result.centred_->landmarks, executor);
  return result;
}

}  // namespace cairn
