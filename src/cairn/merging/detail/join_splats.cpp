// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/join_splats.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/map/column_motion.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/merging/detail/fusion.hpp"
#include "cairn/merging/detail/map_sights.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn::detail {
namespace {

// A map's splats in the world.
struct WorldSplats {
  std::vector<Vector3d> positions;
  std::vector<Matrix3d> covariances;
  std::vector<double> opacities;
  std::size_t rank = 0;  // in the order of largest_first()
};

// Makes a disc at least as thick as a share of its width, because its own thickness is less than the
// error of the surface.
Matrix3d thickened(const Matrix3d& covariance) {
  constexpr double kLeastShare = 0.3;
  SymmetricEigen<3> eigen = symmetric_eigen<3>(covariance);
  const double least = kLeastShare * kLeastShare * eigen.values[2];
  const Vector3d values = eigen.values.cwiseMax(least);
  return eigen.vectors * values.asDiagonal() * eigen.vectors.transpose();
}

WorldSplats splats_in_world(const PlacedMap& placed, const Executor& executor) {
  const LandmarkTable& landmarks = placed.map->landmarks();
  WorldSplats world;
  world.positions = moved_points(landmarks.positions, placed.world_from_map);
  world.opacities = splat_opacities(*splat_columns(landmarks.columns), landmarks);
  world.covariances.assign(landmarks.positions.size(), Matrix3d::Zero());
  constexpr std::size_t kSplatSlice = 4096;
  const Matrix3d linear = placed.world_from_map.linear();
  executor.for_blocks(
      landmarks.positions.size(), kSplatSlice, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          if (landmarks.covariances.empty() || !is_known(landmarks.covariances[i])) continue;
          world.covariances[i] = thickened(propagated_covariance(linear, landmarks.covariances[i]));
        }
      });
  return world;
}

// Overlap of two Gaussians, 0 to 1 (Bhattacharyya 1943); 0 if one has no extent.
double overlap_coefficient(const Vector3d& apart, const Matrix3d& a, const Matrix3d& b) {
  const Matrix3d mean = 0.5 * (a + b);
  const double product = a.determinant() * b.determinant();
  if (!(product > 0.0)) return 0.0;
  const double distance = apart.dot(mean.inverse() * apart) / 8.0 +
                          0.5 * std::log(mean.determinant() / std::sqrt(product));
  return std::exp(-distance);
}

enum class Fate : std::uint8_t { kKept, kDuplicate, kFloater };

// Calls visit(splat, neighbour in `other`, overlap) for the nearest splats of another map.
template <class Visit>
void for_near_splats(const WorldSplats& map, const WorldSplats& other, const BatchTree& of_other,
                     const Executor& executor, const Visit& visit) {
  constexpr std::size_t kNearest = 4;
  BatchTree::Batch batch = of_other.batch(kNearest);
  batch.for_each(map.positions, executor, [&](std::size_t i, const auto& nearest) {
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      const std::uint32_t j = nearest.index(k);
      visit(i, j,
            overlap_coefficient(other.positions[j] - map.positions[i], map.covariances[i],
                                other.covariances[j]));
    }
  });
}

// Marks the splats of a map that have a duplicate of higher opacity in another map.
void mark_duplicates(const WorldSplats& map, const WorldSplats& other, const BatchTree& of_other,
                     const Executor& executor, std::vector<Fate>& fates) {
  constexpr double kLeastOverlap = 0.8;  // of equal discs 1.3 standard deviations apart
  for_near_splats(map, other, of_other, executor,
                  [&](std::size_t i, std::uint32_t j, double overlap) {
                    const bool has_more = other.opacities[j] == map.opacities[i]
                                              ? other.rank < map.rank
                                              : other.opacities[j] > map.opacities[i];
                    if (has_more && overlap >= kLeastOverlap) fates[i] = Fate::kDuplicate;
                  });
}

// Views that see through a splat, against those that see something at it.
bool is_seen_through(const MapSights::Count& count) {
  constexpr std::size_t kLeastViews = 3;
  constexpr std::size_t kLeastRatio = 4;  // images agree by chance where they show much behind
  return count.through >= kLeastViews && count.through >= kLeastRatio * count.agrees;
}

// Marks the splats where another map has none, that the keyframes of its model look through, and
// that the keyframes of the map's own model do not confirm.
void mark_floaters(const WorldSplats& map, const std::optional<MapSights>& own,
                   const WorldSplats& other, const BatchTree& of_other,
                   const MapSights& sights_of_other, const Executor& executor,
                   std::vector<Fate>& fates) {
  constexpr double kMostOverlap = 0.05;  // of equal discs 4.9 standard deviations apart
  constexpr double kDeviations = 3.0;
  std::vector<std::uint8_t> has_neighbor(map.positions.size(), 0);
  for_near_splats(map, other, of_other, executor,
                  [&](std::size_t i, std::uint32_t, double overlap) {
                    if (overlap > kMostOverlap) has_neighbor[i] = 1;
                  });
  constexpr std::size_t kBlock = 256;
  const auto any_view = [](const Vector3d&) { return true; };
  executor.for_blocks(fates.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (has_neighbor[i] != 0 || fates[i] != Fate::kKept) continue;
      const double extent = kDeviations * std::sqrt(map.covariances[i].trace());
      if (!is_seen_through(sights_of_other.count(map.positions[i], extent, any_view))) continue;
      const auto seen = own ? own->count(map.positions[i], extent, any_view) : MapSights::Count();
      if (seen.agrees <= seen.through) fates[i] = Fate::kFloater;
    }
  });
}

std::size_t models_among(std::span<const PlacedMap> maps) {
  return static_cast<std::size_t>(
      std::ranges::count_if(maps, [](const PlacedMap& one) { return one.model != nullptr; }));
}

// By map and splat.
std::vector<std::vector<Fate>> fates_of_splats(std::span<const PlacedMap> maps,
                                               const FusionOptions& options,
                                               const Executor& executor) {
  std::vector<std::vector<Fate>> fates;
  for (const PlacedMap& placed : maps) {
    fates.emplace_back(placed.map->landmark_count(), Fate::kKept);
  }
  if (!options.thin_splats && models_among(maps) == 0) return fates;
  std::vector<WorldSplats> worlds;
  std::vector<BatchTree> trees;
  std::vector<std::optional<MapSights>> sights(maps.size());
  for (std::size_t m = 0; m < maps.size(); ++m) {
    worlds.push_back(splats_in_world(maps[m], executor));
    trees.emplace_back(worlds.back().positions);
    if (maps[m].model != nullptr) sights[m].emplace(*maps[m].model, maps[m].world_from_map);
  }
  const std::vector<std::size_t> order = largest_first(maps);
  for (std::size_t i = 0; i < order.size(); ++i) worlds[order[i]].rank = i;
  for (std::size_t a = 0; a < maps.size(); ++a) {
    for (std::size_t b = 0; b < maps.size(); ++b) {
      if (a == b || worlds[b].positions.empty()) continue;
      if (options.thin_splats) mark_duplicates(worlds[a], worlds[b], trees[b], executor, fates[a]);
      if (!sights[b]) continue;
      mark_floaters(worlds[a], sights[a], worlds[b], trees[b], *sights[b], executor, fates[a]);
    }
  }
  return fates;
}

// A column of the joined splats, and its index in each map.
struct JoinedColumn {
  std::string name;
  double missing = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::optional<std::size_t>> of_map;
};

std::vector<JoinedColumn> joined_columns(std::span<const PlacedMap> maps) {
  std::vector<SplatColumns> layouts;
  for (const PlacedMap& placed : maps) {
    layouts.push_back(*splat_columns(placed.map->landmarks().columns));
  }
  const auto first = static_cast<std::size_t>(
      std::max_element(layouts.begin(), layouts.end(),
                       [](const auto& a, const auto& b) { return a.degree < b.degree; }) -
      layouts.begin());
  std::vector<JoinedColumn> joined;
  const auto add = [&](const PlacedMap& placed, const SplatColumns& layout) {
    const auto& columns = placed.map->landmarks().columns;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const bool is_harmonic =
          std::find(layout.harmonics.begin(), layout.harmonics.end(), i) != layout.harmonics.end();
      const bool is_there = std::any_of(joined.begin(), joined.end(), [&](const JoinedColumn& one) {
        return one.name == columns[i].name;
      });
      if (is_there || (is_harmonic && &layout != &layouts[first])) continue;
      JoinedColumn& column = joined.emplace_back();
      column.name = columns[i].name;
      const std::string plain = plain_column_name(columns[i].name);
      if (is_harmonic || plain == "nx" || plain == "ny" || plain == "nz") column.missing = 0.0;
    }
  };
  add(maps[first], layouts[first]);
  for (std::size_t m = 0; m < maps.size(); ++m) add(maps[m], layouts[m]);
  const std::size_t each = layouts[first].harmonics.size() / 3;  // of a channel
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const auto& columns = maps[m].map->landmarks().columns;
    for (JoinedColumn& column : joined) {
      const auto found = std::find_if(columns.begin(), columns.end(), [&](const NamedColumn& one) {
        return one.name == column.name;
      });
      column.of_map.push_back(found == columns.end() ? std::nullopt
                                                     : std::optional(static_cast<std::size_t>(
                                                           found - columns.begin())));
    }
    // Harmonics go by channel and not by name.
    const std::size_t theirs = layouts[m].harmonics.size() / 3;
    for (std::size_t i = 0; i < 3 * each; ++i) {
      joined[layouts[first].harmonics[i]].of_map[m] =
          i % each < theirs ? std::optional(layouts[m].harmonics[i / each * theirs + i % each])
                            : std::nullopt;
    }
  }
  return joined;
}

// In single precision if each map has the column so.
ColumnValues empty_column(std::span<const PlacedMap> maps, const JoinedColumn& column) {
  for (std::size_t m = 0; m < maps.size(); ++m) {
    if (!column.of_map[m]) continue;
    const NamedColumn& of_map = maps[m].map->landmarks().columns[*column.of_map[m]];
    if (!of_map.values.is_single()) return {};
  }
  return std::vector<float>();
}

template <class IsKept>
void append_splats(const PlacedMap& placed, std::size_t number,
                   std::span<const JoinedColumn> joined, const std::vector<Fate>& fates,
                   const IsKept& is_kept, LandmarkTable& all) {
  const LandmarkTable& landmarks = placed.map->landmarks();
  const ColumnMotion motion(column_names(landmarks.columns), placed.world_from_map, placed.name);
  std::vector<double> row(landmarks.columns.size());
  for (std::size_t i = 0; i < landmarks.positions.size(); ++i) {
    if (!is_kept(fates[i])) continue;
    for (std::size_t k = 0; k < row.size(); ++k) row[k] = landmarks.columns[k].values[i];
    motion.move(row);
    for (std::size_t k = 0; k < joined.size(); ++k) {
      const auto& from = joined[k].of_map[number];
      all.columns[k].values.push_back(from ? row[*from] : joined[k].missing);
    }
    all.ids.push_back(LandmarkId{all.ids.size()});
    all.positions.push_back(placed.is_in_world() ? landmarks.positions[i]
                                                 : placed.world_from_map * landmarks.positions[i]);
    all.colors.push_back(landmarks.colors.empty() ? std::nullopt : landmarks.colors[i]);
  }
}

}  // namespace

bool are_splats(std::span<const PlacedMap> maps) {
  const auto layout_of = [](const PlacedMap& placed) {
    return splat_columns(placed.map->landmarks().columns);
  };
  const auto first = layout_of(maps.front());
  for (const PlacedMap& placed : maps) {
    const auto layout = layout_of(placed);
    reject_if(
        layout.has_value() != first.has_value(), placed.name,
        fmt::format("{}, but {} {}", layout ? "has Gaussian splats" : "has no Gaussian splats",
                    maps.front().name, layout ? "has none" : "has"),
        "splats alone, or maps alone");
    if (!layout) {
      // Refuses splats in no known layout.
      const Similarity3 any_motion(2.0, Rigid3());
      ColumnMotion(column_names(placed.map->landmarks().columns), any_motion, placed.name);
      continue;
    }
    reject_if(placed.map->frame_count() > 0, placed.name,
              "has keyframes beside its Gaussian splats", "splats alone");
    reject_if(layout->log_scales.size() != first->log_scales.size() ||
                  layout->base_color.has_value() != first->base_color.has_value(),
              placed.name, "its splats have other properties than those of " + maps.front().name,
              "scale_2 and f_dc_0 in both or in neither");
  }
  return first.has_value();
}

FusionResult join_splats(std::span<const PlacedMap> maps, const FusionOptions& options,
                         const Executor& executor) {
  const std::size_t models = models_among(maps);
  refuse_if(options.drop_floaters && models == 0, "FusionOptions.drop_floaters",
            "no splat has a model", "a model, whose images show floaters");
  const std::vector<std::vector<Fate>> fates = fates_of_splats(maps, options, executor);
  const auto is_kept = [&](Fate fate) {
    return fate == Fate::kKept || (fate == Fate::kFloater && !options.drop_floaters);
  };
  const std::vector<JoinedColumn> joined = joined_columns(maps);
  FusionResult result;
  result.frames.resize(maps.size());
  MapTables tables;
  tables.info = info_of_world(maps);
  LandmarkTable& all = tables.landmarks;
  std::size_t kept = 0;
  for (const auto& of_map : fates) {
    kept += static_cast<std::size_t>(std::ranges::count_if(of_map, is_kept));
  }
  all.positions.reserve(kept);
  all.ids.reserve(kept);
  for (const JoinedColumn& column : joined) {
    all.columns.push_back({column.name, empty_column(maps, column)});
  }
  for (NamedColumn& column : all.columns) column.values.reserve(kept);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    append_splats(maps[m], m, joined, fates[m], is_kept, all);
    const auto number_of = [&](Fate fate) {
      return static_cast<std::size_t>(std::ranges::count(fates[m], fate));
    };
    MapFusion& fusion = result.maps.emplace_back();
    fusion.landmarks = maps[m].map->landmark_count();
    fusion.fused = number_of(Fate::kDuplicate);
    if (models > (maps[m].model != nullptr ? 1U : 0U)) {
      fusion.floaters = number_of(Fate::kFloater);
    }
    for (const std::string& line : maps[m].map->info().provenance) {
      tables.info.provenance.push_back(fmt::format("{}: {}", maps[m].name, line));
    }
    std::string origin =
        fmt::format("map {} of a merge: {}, {} splats, of which {} are left out as duplicates", m,
                    maps[m].name, fusion.landmarks, fusion.fused);
    if (options.drop_floaters) {
      origin += fmt::format(" and {} as floaters", fusion.floaters.value_or(0));
    }
    tables.info.provenance.push_back(std::move(origin));
    if (maps[m].disposable != nullptr) *maps[m].disposable = LandmarkMap();
  }
  set_splat_looks(*splat_columns(all.columns), all);
  result.map = LandmarkMap(std::move(tables));
  return result;
}

}  // namespace cairn::detail
