// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/fusion/fuse_maps.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/column_motion.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/detail/fusion.hpp"
#include "cairn/merging/detail/join_splats.hpp"

namespace cairn {
namespace detail {
namespace {

constexpr std::string_view kStaleColumn = "reprojection_error";

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kSlice = 4096;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

WorldLandmarks in_world(const PlacedMap& placed, const Executor& executor) {
  const LandmarkMap& map = *placed.map;
  const LandmarkTable& landmarks = map.landmarks();
  const Matrix3d linear = placed.world_from_map.linear();
  WorldLandmarks world;
  world.positions.resize(map.landmark_count());
  world.covariances.assign(map.landmark_count(), Matrix3d::Zero());
  executor.for_blocks(map.landmark_count(), kSlice, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      world.positions[i] = placed.world_from_map * landmarks.positions[i];
      if (landmarks.covariances.empty() || !is_known(landmarks.covariances[i])) continue;
      world.covariances[i] = propagated_covariance(linear, landmarks.covariances[i]);
    }
  });
  return world;
}

// Covariance of a point of a map in the world, from the covariance of the map's pose.
Matrix3d covariance_by_pose(const PlacedMap& placed, const Matrix7d& of_pose,
                            const Vector3d& in_world) {
  const Eigen::Matrix<double, 3, 7> by_pose =
      point_by_pose(in_world - placed.world_from_map.translation());
  return by_pose * of_pose * by_pose.transpose();
}

Matrix3d symmetric(const Matrix3d& m) {
  return 0.5 * (m + m.transpose());
}

const Matrix7d& relative_covariance(const PlacedMap& placed) {
  return placed.relative_covariance ? *placed.relative_covariance : placed.covariance;
}

// The information-weighted mean of all of `measured`. Its covariance is that of a mixture: with probability 1 - wrong,
// all are one landmark; otherwise, any one of them is another landmark. If one of them is exact, it is the result.
Estimate combined(std::span<const Estimate> measured, double wrong) {
  const std::size_t count = measured.size();
  // Sums of information and of its products with the positions, before and from each measurement.
  struct Sum {
    Matrix3d information = Matrix3d::Zero();
    Vector3d moment = Vector3d::Zero();

    Estimate estimate(const Vector3d& origin) const {
      const Matrix3d covariance = information.inverse();
      return {origin + covariance * moment, covariance, Matrix3d::Zero(), Matrix3d::Zero()};
    }
  };
  // About one of them, since the mean lies among them, far from the world's origin.
  const Vector3d& origin = measured.front().position;
  std::vector<Sum> before(count + 1);
  std::vector<Sum> from(count + 1);
  std::vector<Sum> each(count);
  for (std::size_t k = 0; k < count; ++k) {
    const Matrix3d information = measured[k].covariance.inverse();
    if (!information.allFinite()) return measured[k];
    each[k] = {information, information * (measured[k].position - origin)};
    before[k + 1] = {before[k].information + each[k].information,
                     before[k].moment + each[k].moment};
  }
  for (std::size_t k = count; k-- > 0;) {
    from[k] = {from[k + 1].information + each[k].information, from[k + 1].moment + each[k].moment};
  }
  Estimate all = before[count].estimate(origin);
  Matrix3d more = Matrix3d::Zero();
  for (std::size_t k = 0; k < count; ++k) {
    const Matrix3d weight = all.covariance * each[k].information;
    all.compared += weight * measured[k].compared * weight.transpose();
    all.stated += weight * measured[k].stated * weight.transpose();
    if (wrong == 0.0) continue;
    const Sum others{before[k].information + from[k + 1].information,
                     before[k].moment + from[k + 1].moment};
    const Estimate without = others.estimate(origin);
    const Vector3d apart = without.position - all.position;
    more += without.covariance - all.covariance + apart * apart.transpose();
  }
  more *= wrong / static_cast<double>(count);
  all.covariance = symmetric(all.covariance + more);
  all.compared = symmetric(all.compared + more);
  all.stated = symmetric(all.stated + more);
  return all;
}

}  // namespace

Fusion::Fusion(std::span<const PlacedMap> maps, const FusionOptions& options,
               const Execution& execution)
    : maps_(maps),
      options_(options),
      execution_(execution),
      order_(largest_first(maps)),
      world_(maps.size()),
      variances_(maps.size()),
      original_(maps.size()),
      rank_(maps.size()),
      landmark_of_(maps.size()),
      has_prefix_(maps.size(), false) {
  result_.maps.resize(maps.size());
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::size_t m = order_[i];
    rank_[m] = i;
    const bool is_copy = i > 0 && !precedes(*maps[order_[i - 1]].map, *maps[m].map);
    original_[m] = is_copy ? original_[order_[i - 1]] : m;
  }
  std::size_t landmarks = 0;
  std::size_t frames = 0;
  for (const std::size_t m : order_) {
    const PlacedMap& placed = maps[m];
    landmarks += placed.map->landmark_count();
    frames += placed.map->frame_count();
    has_colors_ = has_colors_ || !placed.map->landmarks().colors.empty();
    const auto& descriptors = placed.map->landmarks().descriptors;
    if (!descriptors) continue;
    auto& kept = tables_.landmarks.descriptors;
    if (!kept) kept = DescriptorColumn{descriptors->kind, descriptors->bytes_each, {}, {}};
    const bool fits =
        kept->kind == descriptors->kind && kept->bytes_each == descriptors->bytes_each;
    has_further_ = has_further_ || (fits && descriptors->has_further());
    if (!fits && execution_.log) {
      execution_.log(
          fmt::format("{}: its descriptors ({}, {} bytes) are left out: a map has one kind",
                      placed.name, printable(descriptors->kind), descriptors->bytes_each));
    }
  }
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  reject_if(landmarks > kMost || frames > kMost, "maps",
            fmt::format("{} landmarks, {} frames", landmarks, frames),
            fmt::format("at most {} of each", kMost));
  if (has_colors_) tables_.landmarks.colors.reserve(landmarks);
}

FusionResult Fusion::run() {
  for (std::size_t m = 0; m < maps_.size(); ++m) add_frames(m);
  std::sort(identities_.begin(), identities_.end(), [&](const Identities& a, const Identities& b) {
    return std::pair(rank_[a.earlier], rank_[a.later]) <
           std::pair(rank_[b.earlier], rank_[b.later]);
  });
  drop_unused_cameras();
  std::size_t added = 0;
  for (const std::size_t m : order_) {
    if (execution_.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, "merge", "fusion was cancelled", "");
    }
    add(m);
    if (execution_.progress) {
      execution_.progress(static_cast<double>(++added) / static_cast<double>(maps_.size()));
    }
  }
  count_fused();
  set_positions();
  set_columns();
  set_observations();
  tell_images_apart();
  set_info();
  tables_.landmarks.ids.resize(last_member_.size());
  for (std::size_t i = 0; i < last_member_.size(); ++i) tables_.landmarks.ids[i] = LandmarkId{i};
  result_.map = LandmarkMap(std::move(tables_));
  return std::move(result_);
}

void Fusion::add(std::size_t m) {
  const LandmarkMap& map = *maps_[m].map;
  const WorldLandmarks& world = world_[m] = in_world(maps_[m], execution_.executor);
  AssociationResult association;
  if (original_[m] != m) {
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      association.pairs.push_back({landmark_of_[original_[m]][i], i, 1.0});
    }
  } else if (!positions_.empty()) {
    const auto looks = [](const std::optional<DescriptorColumn>& column) {
      return column ? &*column : nullptr;
    };
    std::vector<Matrix3d> covariances = world.covariances;
    for (std::size_t i = 0; i < covariances.size(); ++i) {
      covariances[i] +=
          covariance_by_pose(maps_[m], relative_covariance(maps_[m]), world.positions[i]);
    }
    association = associate({positions_, covariances_, looks(tables_.landmarks.descriptors)},
                            {world.positions, covariances, looks(map.landmarks().descriptors)},
                            options_.fusion_probability, execution_);
    association = with_identities(m, std::move(association));
  }
  result_.maps[m].landmarks = map.landmark_count();
  result_.maps[m].deviation = association.deviation;
  estimate_variances(m, association);
  landmark_of_[m].resize(map.landmark_count());
  auto next = association.pairs.begin();
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (next != association.pairs.end() && next->second == i) {
      const std::uint32_t landmark = landmark_of_[m][i] = next->first;
      members_.push_back(
          {static_cast<std::uint32_t>(m), i, next->probability,
           std::exchange(last_member_[landmark], static_cast<std::uint32_t>(members_.size()))});
      if (m < from_map_[landmark]) {
        from_map_[landmark] = static_cast<std::uint32_t>(m);
        from_landmark_[landmark] = i;
      }
      take_looks(m, i, landmark);
      ++parts_[landmark];
      ++next;
    } else {
      landmark_of_[m][i] = static_cast<std::uint32_t>(last_member_.size());
      append(m, i);
    }
  }
  for (const Association& pair : association.pairs) {
    const Estimate now = estimate(pair.first);
    positions_[pair.first] = now.position;
    covariances_[pair.first] = now.compared;
  }
  if (has_further_) set_further();
}

// Replaces the associations of landmarks that keypoints of common images identify by these identities. A few identities
// are wrong, where a track jumps to another point; they are dropped.
AssociationResult Fusion::with_identities(std::size_t m, AssociationResult association) const {
  constexpr double kTimesMedian = 4.0;           // largest distance
  constexpr double kRounding = 1e-6;             // of the poses of one map's copies
  constexpr std::size_t kFewest = 12;            // for an estimate of the deviation
  constexpr double kMedianOfChiSquared = 2.366;  // with three degrees of freedom
  std::map<std::uint32_t, Association> by_second;
  std::set<std::uint32_t> firsts;
  std::vector<double> distances;
  const auto distance = [&](std::uint32_t first, std::uint32_t second) {
    return (positions_[first] - world_[m].positions[second]).norm();
  };
  for (const Identities& one : identities_) {
    if (one.earlier != m && one.later != m) continue;
    const std::size_t other = one.earlier == m ? one.later : one.earlier;
    if (landmark_of_[other].empty()) continue;  // added later
    for (const auto& [of_earlier, of_later] : one.landmarks) {
      const std::uint32_t second = (one.earlier == m ? of_earlier : of_later).value;
      const std::uint32_t first =
          landmark_of_[other][(one.earlier == m ? of_later : of_earlier).value];
      if (by_second.contains(second) || !firsts.insert(first).second) continue;
      by_second.emplace(second, Association{first, second, 1.0});
      distances.push_back(distance(first, second));
    }
  }
  if (by_second.empty()) return association;
  const double median = upper_median(distances);
  std::erase_if(by_second, [&](const auto& pair) {
    return distance(pair.second.first, pair.second.second) > kTimesMedian * median + kRounding;
  });
  if (by_second.size() >= kFewest) {
    association.deviation =
        std::max(association.deviation, median / std::sqrt(kMedianOfChiSquared));
  }
  firsts.clear();
  for (const auto& [second, pair] : by_second) firsts.insert(pair.first);
  for (const Association& pair : association.pairs) {
    if (!firsts.contains(pair.first)) by_second.emplace(pair.second, pair);
  }
  association.pairs.clear();
  for (const auto& [second, pair] : by_second) association.pairs.push_back(pair);
  return association;
}

// Whether most of the landmarks that a map shares with earlier maps come from the same observations. Such landmarks
// have the same errors, so their distances cannot show the variance.
bool Fusion::repeats_another(std::size_t m, const AssociationResult& association) {
  std::size_t repeated = 0;
  for (const Association& pair : association.pairs) {
    const std::uint32_t last = last_member_[pair.first];
    repeated += share_of_own(static_cast<std::uint32_t>(m), pair.second, last) == 0.0 ? 1 : 0;
  }
  if (2 * repeated <= association.pairs.size()) return false;
  original_[m] = original_[members_[last_member_[association.pairs.front().first]].map];
  return true;
}

// Share of a landmark's observations that are in none of the frames in which `earlier` and the members before it
// observe the same landmark; 1 if the landmark has no observations.
double Fusion::share_of_own(std::uint32_t map, std::uint32_t landmark,
                            std::uint32_t earlier) const {
  const auto frames_of = [&](std::uint32_t m, std::uint32_t i) {
    return maps_[m].map->observing_frames(LandmarkIndex{i});
  };
  const auto frames = frames_of(map, landmark);
  if (frames.empty()) return 1.0;
  std::size_t own = 0;
  for (const FrameIndex frame : frames) {
    const FrameIndex fused = result_.frames[map][frame.value];
    bool known = false;
    for (std::uint32_t at = is_shared_[fused.value] ? earlier : Member::kNoMember;
         at != Member::kNoMember && !known; at = members_[at].previous) {
      const Member& member = members_[at];
      const auto others = frames_of(member.map, member.landmark);
      known = std::any_of(others.begin(), others.end(), [&](FrameIndex other) {
        return result_.frames[member.map][other.value] == fused;
      });
    }
    own += known ? 0 : 1;
  }
  return static_cast<double>(own) / static_cast<double>(frames.size());
}

// The association estimates by how much the landmarks of a map are farther from those of earlier maps than the
// covariances explain. The covariances of earlier maps with a known variance already include it. Earlier maps with an
// unknown variance are assumed to be as good as this map.
void Fusion::estimate_variances(std::size_t m, const AssociationResult& association) {
  if (association.pairs.empty() || original_[m] != m || repeats_another(m, association)) return;
  std::vector<bool> unknown(maps_.size());
  std::size_t of_unknown = 0;
  for (const Association& pair : association.pairs) {
    const Member& member = members_[last_member_[pair.first]];
    const std::size_t earlier = original_[member.map];
    if (variances_[earlier]) continue;
    unknown[earlier] = true;
    ++of_unknown;
  }
  const double share =
      static_cast<double>(of_unknown) / static_cast<double>(association.pairs.size());
  const double variance = association.deviation * association.deviation / (1.0 + share);
  variances_[m] = variance;
  for (std::size_t k = 0; k < maps_.size(); ++k) {
    if (!unknown[k]) continue;
    variances_[k] = variance;
    result_.maps[k].deviation = association.deviation;
    for (const std::uint32_t landmark : landmark_of_[k]) {
      covariances_[landmark].diagonal().array() += variance;
    }
  }
}

Estimate Fusion::estimate(std::uint32_t landmark) const {
  std::vector<Estimate> measured;
  double wrong = 0.0;
  for (std::uint32_t at = last_member_[landmark]; at != Member::kNoMember;
       at = members_[at].previous) {
    const Member& member = members_[at];
    // A copy, which is added right after its original, is no further evidence.
    if (member.previous != Member::kNoMember &&
        original_[members_[member.previous].map] == original_[member.map]) {
      continue;
    }
    const double own = share_of_own(member.map, member.landmark, member.previous);
    if (own == 0.0) continue;
    const WorldLandmarks& world = world_[member.map];
    Matrix3d covariance = world.covariances[member.landmark] / own;
    covariance.diagonal().array() += variances_[original_[member.map]].value_or(0.0) / own;
    const Vector3d& position = world.positions[member.landmark];
    const PlacedMap& placed = maps_[member.map];
    measured.push_back(
        {position, covariance,
         covariance + covariance_by_pose(placed, relative_covariance(placed), position),
         covariance + covariance_by_pose(placed, placed.covariance, position)});
    wrong += 1.0 - member.probability;
  }
  if (measured.size() == 1) return measured.front();
  // In the order in which the maps were added.
  std::reverse(measured.begin(), measured.end());
  return combined(measured, wrong);
}

void Fusion::count_fused() {
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    for (const std::uint32_t landmark : landmark_of_[m]) {
      result_.maps[m].fused += parts_[landmark] > 1 ? 1 : 0;
    }
  }
}

// Landmarks of only one map keep their position and covariance; the uncertainty of the map's pose is added.
void Fusion::set_positions() {
  LandmarkTable& landmarks = tables_.landmarks;
  const std::size_t count = last_member_.size();
  landmarks.positions = std::move(positions_);
  landmarks.covariances.resize(count);
  std::vector<std::uint8_t> known(count, 1);  // whether all of its landmarks have a covariance
  execution_.executor.for_blocks(count, kSlice, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto landmark = static_cast<std::uint32_t>(i);
      // Gives the position, if all are of one map.
      const Member* first = &members_[last_member_[i]];
      const std::size_t original = original_[first->map];
      bool of_one_map = true;
      for (std::uint32_t at = last_member_[i]; at != Member::kNoMember; at = first->previous) {
        first = &members_[at];
        if (!has_covariance(first->map, first->landmark)) known[i] = 0;
        of_one_map = of_one_map && original_[first->map] == original;
      }
      if (!of_one_map) {
        const Estimate fused = estimate(landmark);
        landmarks.positions[i] = fused.position;
        landmarks.covariances[i] = fused.stated;
      } else {
        landmarks.covariances[i] =
            symmetric(world_[first->map].covariances[first->landmark] +
                      covariance_by_pose(maps_[first->map], maps_[first->map].covariance,
                                         landmarks.positions[i]));
      }
      if (known[i] == 0) landmarks.covariances[i].setConstant(kNan);
    }
  });
  if (std::find(known.begin(), known.end(), std::uint8_t{1}) == known.end()) {
    landmarks.covariances.clear();
  }
}

void Fusion::append(std::size_t m, std::uint32_t i) {
  const auto landmark = static_cast<std::uint32_t>(last_member_.size());
  LandmarkTable& landmarks = tables_.landmarks;
  last_member_.push_back(static_cast<std::uint32_t>(members_.size()));
  members_.push_back({.map = static_cast<std::uint32_t>(m), .landmark = i});
  const Estimate now = estimate(landmark);
  positions_.push_back(now.position);
  covariances_.push_back(now.compared);
  from_map_.push_back(static_cast<std::uint32_t>(m));
  from_landmark_.push_back(i);
  parts_.push_back(1);
  if (has_colors_) landmarks.colors.emplace_back();
  if (landmarks.descriptors) {
    landmarks.descriptors->known.push_back(0);
    landmarks.descriptors->bytes.resize(landmarks.descriptors->bytes.size() +
                                        landmarks.descriptors->bytes_each);
    best_observed_.push_back(0);
    if (has_further_) descriptors_.emplace_back();
  }
  take_looks(m, i, landmark);
}

// Takes the first known colour, and the descriptor of the member with the most observations. If a map has several
// descriptors of a landmark, also keeps the most distinct ones of all members.
void Fusion::take_looks(std::size_t m, std::uint32_t i, std::uint32_t landmark) {
  const LandmarkMap& map = *maps_[m].map;
  LandmarkTable& landmarks = tables_.landmarks;
  if (!map.landmarks().colors.empty() && !landmarks.colors[landmark]) {
    landmarks.colors[landmark] = map.landmarks().colors[i];
  }
  const auto& theirs = map.landmarks().descriptors;
  if (!theirs || theirs->known[i] == 0) return;
  DescriptorColumn& ours = *landmarks.descriptors;
  if (theirs->kind != ours.kind || theirs->bytes_each != ours.bytes_each) return;
  const auto observed = static_cast<std::uint32_t>(map.observation_count(LandmarkIndex{i}));
  if (ours.known[landmark] == 0 || observed > best_observed_[landmark]) {
    ours.known[landmark] = 1;
    best_observed_[landmark] = observed;
    const auto from = theirs->descriptor(i, 0);
    std::copy(from.begin(), from.end(),
              ours.bytes.begin() + static_cast<std::ptrdiff_t>(landmark * ours.bytes_each));
  }
  if (has_further_) take_further(*theirs, i, landmark);
}

void Fusion::take_further(const DescriptorColumn& theirs, std::uint32_t i, std::uint32_t landmark) {
  std::vector<std::uint8_t>& all = descriptors_[landmark];
  const bool is_first = all.empty();
  for (std::size_t k = 0; k < theirs.count(i); ++k) {
    const auto bytes = theirs.descriptor(i, k);
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  if (is_first) return;
  const DescriptorColumn& ours = *tables_.landmarks.descriptors;
  std::vector<std::span<const std::uint8_t>> rows = {
      std::span(ours.bytes).subspan(landmark * ours.bytes_each, ours.bytes_each)};
  for (std::size_t at = 0; at < all.size(); at += ours.bytes_each) {
    rows.push_back(std::span(all).subspan(at, ours.bytes_each));
  }
  const DescriptorNorm norm = descriptor_norm(ours.kind);
  std::vector<std::uint8_t> kept;
  for (const std::size_t row : distinct_descriptors(rows, 0, kDistinctViews, norm)) {
    kept.insert(kept.end(), rows[row].begin(), rows[row].end());
  }
  all = std::move(kept);
}

// Sets the further descriptors of all landmarks so far. The first descriptor of each is its representative.
void Fusion::set_further() {
  DescriptorColumn& ours = *tables_.landmarks.descriptors;
  ours.further_offsets.assign(1, 0);
  ours.further.clear();
  for (const std::vector<std::uint8_t>& all : descriptors_) {
    if (!all.empty()) {
      ours.further.insert(ours.further.end(),
                          all.begin() + static_cast<std::ptrdiff_t>(ours.bytes_each), all.end());
    }
    ours.further_offsets.push_back(ours.further.size() / ours.bytes_each);
  }
}

void Fusion::set_columns() {
  const std::size_t count = last_member_.size();
  std::vector<NamedColumn>& columns = tables_.landmarks.columns;
  std::vector<double> from_map(count);
  std::vector<double> from_landmark(count);
  std::vector<double> parts(count);
  constexpr std::uint64_t kExact = std::uint64_t{1} << 53;
  for (std::size_t i = 0; i < count; ++i) {
    from_map[i] = from_map_[i];
    const std::uint64_t id = maps_[from_map_[i]].map->landmarks().ids[from_landmark_[i]].value;
    from_landmark[i] = id <= kExact ? static_cast<double>(id) : kNan;
    parts[i] = parts_[i];
  }
  columns.push_back({kFromMapColumn, std::move(from_map)});
  columns.push_back({kFromLandmarkColumn, std::move(from_landmark)});
  columns.push_back({kFusedColumn, std::move(parts)});
  for (const std::size_t m : order_) {
    std::vector<NamedColumn> moved = maps_[m].map->landmarks().columns;
    move_columns(moved, maps_[m].world_from_map, maps_[m].name);
    for (const NamedColumn& theirs : moved) {
      // Not copied, because the landmarks have moved; it can be computed from the observations.
      if (theirs.name == kStaleColumn) continue;
      const std::string& name = theirs.name;
      if (name == kFromMapColumn || name == kFromLandmarkColumn || name == kFusedColumn) continue;
      auto found = std::find_if(columns.begin(), columns.end(),
                                [&](const NamedColumn& column) { return column.name == name; });
      if (found == columns.end()) {
        columns.push_back({name, std::vector<double>(count, kNan)});
        found = columns.end() - 1;
      }
      for (std::uint32_t i = 0; i < theirs.values.size(); ++i) {
        const std::uint32_t landmark = landmark_of_[m][i];
        if (std::isnan(found->values[landmark])) found->values.set(landmark, theirs.values[i]);
      }
    }
  }
}

}  // namespace detail

std::vector<std::size_t> largest_first(std::span<const PlacedMap> maps) {
  std::vector<std::size_t> order(maps.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return precedes(*maps[a].map, *maps[b].map);
  });
  return order;
}

bool PlacedMap::is_in_world() const {
  return world_from_map.matrix() == Matrix4d::Identity();
}

constexpr OptionField kFusionFields[] = {
    {"fusion_probability", option_at<&FusionOptions::fusion_probability>, within(0.5, 1)},
    {"straighten",
     option_at<&FusionOptions::straighten>,
     {},
     "--straighten,!--no-straighten",
     "Straighten maps that others show to be bent. Default: on"},
    {"thin_splats",
     option_at<&FusionOptions::thin_splats>,
     {},
     "--thin-splats,!--no-thin-splats",
     "Gaussian splats: leave out the duplicates of lower opacity where maps overlap. Default: on"},
    {"drop_floaters", option_at<&FusionOptions::drop_floaters>},
    {"adjust",
     option_at<&FusionOptions::adjust>,
     {},
     "--adjust,!--no-adjust",
     "Bundle-adjust the merged map: minimise the reprojection errors over all keyframes and "
     "landmarks"},
    {"refine_intrinsics",
     option_at<&FusionOptions::adjustment, &AdjustOptions::refine_intrinsics>,
     {},
     "--refine-intrinsics",
     "With --adjust: also adjust the cameras' parameters"},
    {"matching_rounds", option_at<&FusionOptions::matching_rounds>, within(0, 10)},
};
constinit const OptionTable FusionOptions::table = {"FusionOptions", kFusionFields};

void FusionOptions::validate() const {
  check_options(*this);
  adjustment.validate();
}

FusionResult fuse_maps(std::span<const PlacedMap> maps, const FusionOptions& options,
                       const Execution& execution) {
  options.validate();
  if (maps.empty()) throw Error(ErrorKind::kMisuse, "maps", "none", "at least one map");
  if (detail::are_splats(maps)) return detail::join_splats(maps, options, execution.executor);
  refuse_if(options.drop_floaters, "FusionOptions.drop_floaters", "the maps are no Gaussian splats",
            "Gaussian splats");
  return detail::Fusion(maps, options, execution).run();
}

}  // namespace cairn
