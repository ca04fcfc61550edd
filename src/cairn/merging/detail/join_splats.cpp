// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/detail/join_splats.hpp"

#include <algorithm>
#include <array>
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
#include "cairn/core/statistics.hpp"
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
  const PlacedMap* placed = nullptr;
  std::vector<Vector3d> positions;
  std::vector<Matrix3d> covariances;
  std::vector<double> opacities;
  std::size_t rank = 0;  // in the order of largest_first()
  std::optional<BatchTree> tree;
  std::optional<MapSights> sights;  // of the model's images, if there are any
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

// A model that has images.
bool has_images(const PlacedMap& placed) {
  return placed.model != nullptr && placed.model->has_observations();
}

std::size_t models_among(std::span<const PlacedMap> maps) {
  return static_cast<std::size_t>(std::ranges::count_if(maps, has_images));
}

WorldSplats splats_in_world(const PlacedMap& placed, const Executor& executor) {
  const LandmarkTable& landmarks = placed.map->landmarks();
  WorldSplats world;
  world.placed = &placed;
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
  world.tree.emplace(world.positions);
  if (has_images(placed)) world.sights.emplace(*placed.model, placed.world_from_map);
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

// A splat and a like one of another map that comes before it.
struct Twin {
  std::uint32_t splat = 0;
  std::uint32_t other_map = 0;
  std::uint32_t other = 0;
  Vector3d color_change = Vector3d::Zero();  // from the other, of 255
};

// Whether splat i of a map comes before splat j of another map, so that j may be left out.
bool comes_before(const WorldSplats& map, std::uint32_t i, const WorldSplats& other,
                  std::uint32_t j) {
  return map.opacities[i] == other.opacities[j] ? map.rank < other.rank
                                                : map.opacities[i] > other.opacities[j];
}

// Keeps the twins whose colours differ as those of most twins do: captures differ in exposure.
void drop_other_colors(std::vector<Twin>& twins) {
  constexpr double kMostChange = 25.0;
  if (twins.empty()) return;
  Vector3d usual;
  for (int channel = 0; channel < 3; ++channel) {
    std::vector<double> changes;
    for (const Twin& twin : twins) changes.push_back(twin.color_change[channel]);
    usual[channel] = upper_median(changes);
  }
  std::erase_if(twins, [&](const Twin& twin) {
    return (twin.color_change - usual).cwiseAbs().maxCoeff() > kMostChange;
  });
}

// A map's splats compared with the nearest ones of another map.
struct Comparison {
  std::vector<Twin> twins;                 // by ascending splat
  std::vector<std::uint8_t> has_neighbor;  // by splat: whether one of the others overlaps it
};

Comparison compared(const WorldSplats& map, const WorldSplats& other, std::uint32_t other_map,
                    const Executor& executor) {
  constexpr std::size_t kNearest = 4;
  constexpr double kTwinOverlap = 0.8;       // of equal discs 1.3 standard deviations apart
  constexpr double kNeighborOverlap = 0.05;  // 4.9 standard deviations
  constexpr std::uint32_t kNoSplat = std::numeric_limits<std::uint32_t>::max();
  Comparison result;
  result.has_neighbor.assign(map.positions.size(), 0);
  std::vector<std::array<std::uint32_t, kNearest>> like(map.positions.size());
  for (auto& each : like) each.fill(kNoSplat);
  BatchTree::Batch batch = other.tree->batch(kNearest);
  batch.for_each(map.positions, executor, [&](std::size_t i, const auto& nearest) {
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      const std::uint32_t j = nearest.index(k);
      const double overlap = overlap_coefficient(other.positions[j] - map.positions[i],
                                                 map.covariances[i], other.covariances[j]);
      if (overlap > kNeighborOverlap) result.has_neighbor[i] = 1;
      if (overlap < kTwinOverlap) continue;
      if (comes_before(other, j, map, static_cast<std::uint32_t>(i))) like[i][k] = j;
    }
  });
  const auto color = [](const WorldSplats& of, std::uint32_t i) {
    const auto& colors = of.placed->map->landmarks().colors;
    const auto shown = colors.empty() ? std::nullopt : colors[i];
    return shown ? Vector3d(shown->red, shown->green, shown->blue) : Vector3d(0.0, 0.0, 0.0);
  };
  for (std::uint32_t i = 0; i < like.size(); ++i) {
    for (const std::uint32_t j : like[i]) {
      if (j == kNoSplat) continue;
      result.twins.push_back({i, other_map, j, color(map, i) - color(other, j)});
    }
  }
  drop_other_colors(result.twins);
  return result;
}

// Marks splats of which a twin stays. Those that come first are decided first.
void mark_duplicates(const std::vector<WorldSplats>& worlds,
                     const std::vector<std::vector<Twin>>& twins,
                     std::vector<std::vector<Fate>>& fates) {
  std::vector<std::pair<std::uint32_t, const Twin*>> all;  // by map
  for (std::uint32_t m = 0; m < twins.size(); ++m) {
    for (const Twin& twin : twins[m]) all.emplace_back(m, &twin);
  }
  std::ranges::stable_sort(all, [&](const auto& a, const auto& b) {
    const double here = worlds[a.first].opacities[a.second->splat];
    const double there = worlds[b.first].opacities[b.second->splat];
    return here == there ? worlds[a.first].rank < worlds[b.first].rank : here > there;
  });
  for (const auto& [m, twin] : all) {
    if (fates[twin->other_map][twin->other] == Fate::kKept)
      fates[m][twin->splat] = Fate::kDuplicate;
  }
}

// Views that see through a splat, against those that see something at it.
bool is_seen_through(const MapSights::Count& count) {
  constexpr std::size_t kLeastViews = 3;
  constexpr std::size_t kLeastRatio = 4;  // images agree by chance where they show much behind
  return count.through >= kLeastViews && count.through >= kLeastRatio * count.agrees;
}

// Marks the splats where another map has none, that the keyframes of its model look through, and
// that the keyframes of the map's own model do not confirm.
void mark_floaters(const WorldSplats& map, const WorldSplats& other,
                   const std::vector<std::uint8_t>& has_neighbor, const Executor& executor,
                   std::vector<Fate>& fates) {
  constexpr double kDeviations = 3.0;
  constexpr std::size_t kSplatsAtOnce = 256;
  const auto any_view = [](const Vector3d&) { return true; };
  executor.for_blocks(fates.size(), kSplatsAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (has_neighbor[i] != 0 || fates[i] != Fate::kKept) continue;
      const double extent = kDeviations * std::sqrt(map.covariances[i].trace());
      if (!is_seen_through(other.sights->count(map.positions[i], extent, any_view))) continue;
      const auto seen =
          map.sights ? map.sights->count(map.positions[i], extent, any_view) : MapSights::Count();
      if (seen.agrees <= seen.through) fates[i] = Fate::kFloater;
    }
  });
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
  for (const PlacedMap& placed : maps) worlds.push_back(splats_in_world(placed, executor));
  const std::vector<std::size_t> order = largest_first(maps);
  for (std::size_t i = 0; i < order.size(); ++i) worlds[order[i]].rank = i;
  std::vector<std::vector<Twin>> twins(maps.size());
  struct MayFloat {
    std::size_t map;
    std::size_t other;
    std::vector<std::uint8_t> has_neighbor;
  };
  std::vector<MayFloat> may_float;
  for (std::size_t a = 0; a < maps.size(); ++a) {
    for (std::size_t b = 0; b < maps.size(); ++b) {
      if (a == b || worlds[b].positions.empty()) continue;
      Comparison found = compared(worlds[a], worlds[b], static_cast<std::uint32_t>(b), executor);
      twins[a].insert(twins[a].end(), found.twins.begin(), found.twins.end());
      if (worlds[b].sights) may_float.push_back({a, b, std::move(found.has_neighbor)});
    }
  }
  if (options.thin_splats) mark_duplicates(worlds, twins, fates);
  for (const auto& [map, other, has_neighbor] : may_float) {
    mark_floaters(worlds[map], worlds[other], has_neighbor, executor, fates[map]);
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
    if (!layout) {
      // Refuses splats in no known layout.
      const Similarity3 any_motion(2.0, Rigid3());
      ColumnMotion(column_names(placed.map->landmarks().columns), any_motion, placed.name);
    }
    reject_if(
        layout.has_value() != first.has_value(), placed.name,
        fmt::format("{}, but {} {}", layout ? "has Gaussian splats" : "has no Gaussian splats",
                    maps.front().name, layout ? "has none" : "has"),
        "splats alone, or maps alone");
    if (!layout) continue;
    reject_if(placed.map->frame_count() > 0, placed.name,
              "has keyframes beside its Gaussian splats", "splats alone");
    const std::string others =
        "its splats have other properties than those of " + maps.front().name;
    reject_if(layout->log_scales.size() != first->log_scales.size(), placed.name, others,
              "scale_2 in both or in neither");
    reject_if(layout->base_color.has_value() != first->base_color.has_value(), placed.name, others,
              "f_dc_0 in both or in neither");
  }
  return first.has_value();
}

FusionResult join_splats(std::span<const PlacedMap> maps, const FusionOptions& options,
                         const Executor& executor) {
  const std::size_t models = models_among(maps);
  refuse_if(options.drop_floaters && models == 0, "FusionOptions.drop_floaters",
            "no splat has a model with images", "models of the splats, whose images show floaters");
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
    if (models > (has_images(maps[m]) ? 1U : 0U)) {
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
