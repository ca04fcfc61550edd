// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/point_set.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "cairn/core/statistics.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {
namespace {

// Keeps the rows whose measure is at most 5 times the median. @return the number of others
std::size_t drop_outliers(std::vector<std::uint32_t>& rows, std::vector<double> measures) {
  if (rows.empty()) return 0;
  constexpr double kTimesMedian = 5.0;
  const double most = kTimesMedian * upper_median(std::vector<double>(measures));
  std::vector<std::uint32_t> kept;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (measures[i] <= most) kept.push_back(rows[i]);
  }
  const std::size_t dropped = rows.size() - kept.size();
  rows = std::move(kept);
  return dropped;
}

template <class Measure>
std::vector<double> measured(const std::vector<std::uint32_t>& rows, const Measure& measure) {
  std::vector<double> values;
  values.reserve(rows.size());
  for (const std::uint32_t row : rows) values.push_back(measure(row));
  return values;
}

// Compares each of the rows with its neighbours among them. @return by landmark of the map
struct Neighbourhoods {
  std::vector<double> distances;  // to the 6th
  std::vector<double> contrasts;  // of colour to the mean of the neighbours; 0 if unknown
};

Neighbourhoods compared_with_neighbours(const LandmarkTable& landmarks,
                                        const std::vector<std::uint32_t>& rows) {
  constexpr std::size_t kRank = 6;
  const std::size_t count = landmarks.positions.size();
  Neighbourhoods result{std::vector<double>(count, 0.0), std::vector<double>(count, 0.0)};
  if (rows.size() <= kRank) return result;
  std::vector<Eigen::Vector3d> points;
  for (const std::uint32_t row : rows) points.push_back(landmarks.positions[row]);
  const auto color_of = [&](std::size_t i) {
    const Color color = landmarks.colors.values()[rows[i]];
    return Eigen::Vector3d(color.red, color.green, color.blue);
  };
  const BatchTree tree(points);
  BatchTree::Batch batch = tree.batch(kRank + 1);  // the point itself is the first
  batch.for_each(points, Executor(1), [&](std::size_t i, const auto& nearest) {
    result.distances[rows[i]] = std::sqrt(nearest.squared_distance(nearest.size() - 1));
    if (landmarks.colors.empty()) return;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t k = 1; k < nearest.size(); ++k) {
      mean += color_of(nearest.index(k)) / static_cast<double>(kRank);
    }
    result.contrasts[rows[i]] = (color_of(i) - mean).norm();
  });
  return result;
}

// Keeps those of highest contrast, in their order. @return the number of others
std::size_t drop_plain(std::vector<std::uint32_t>& rows, const std::vector<double>& contrasts) {
  if (rows.size() <= kMostSplatLandmarks) return 0;
  const std::size_t dropped = rows.size() - kMostSplatLandmarks;
  const auto end = rows.begin() + static_cast<std::ptrdiff_t>(kMostSplatLandmarks);
  std::nth_element(rows.begin(), end, rows.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(-contrasts[a], a) < std::pair(-contrasts[b], b);
  });
  rows.erase(end, rows.end());
  std::sort(rows.begin(), rows.end());
  return dropped;
}

}  // namespace

std::optional<SplatSelection> selected_splats(const LandmarkMap& map) {
  const LandmarkTable& landmarks = map.landmarks();
  const auto columns = splat_columns(landmarks.columns);
  if (!columns || landmarks.covariances.empty()) return std::nullopt;
  constexpr double kLeastOpacity = 0.5;
  SplatSelection selection;
  const std::vector<double> opacities = splat_opacities(*columns, landmarks);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (opacities[i] >= kLeastOpacity && map.covariance(LandmarkIndex{i})) rows.push_back(i);
  }
  selection.transparent = map.landmark_count() - rows.size();
  const auto& positions = landmarks.positions;
  const auto longest_axis = [&](std::uint32_t row) {
    double longest = -std::numeric_limits<double>::infinity();
    for (const std::size_t scale : columns->log_scales) {
      longest = std::max(longest, landmarks.columns[scale].values[row]);
    }
    return std::exp(longest);
  };
  selection.large = drop_outliers(rows, measured(rows, longest_axis));
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (Eigen::Index axis = 0; axis < 3 && !rows.empty(); ++axis) {
    centre[axis] =
        upper_median(measured(rows, [&](std::uint32_t row) { return positions[row][axis]; }));
  }
  const auto from_centre = [&](std::uint32_t row) { return (positions[row] - centre).norm(); };
  selection.distant = drop_outliers(rows, measured(rows, from_centre));
  const Neighbourhoods neighbours = compared_with_neighbours(landmarks, rows);
  selection.isolated = drop_outliers(
      rows, measured(rows, [&](std::uint32_t row) { return neighbours.distances[row]; }));
  selection.plain = drop_plain(rows, neighbours.contrasts);
  for (const std::uint32_t row : rows) selection.kept.push_back(LandmarkIndex{row});
  return selection;
}

std::vector<LandmarkIndex> landmarks_to_align(const LandmarkMap& map,
                                              const PointSetOptions& options) {
  auto splats = selected_splats(map);
  std::vector<LandmarkIndex> kept =
      splats ? std::move(splats->kept) : landmarks_observed(map, options.min_observations);
  const auto& ids = map.landmarks().ids;
  std::sort(kept.begin(), kept.end(),
            [&](LandmarkIndex a, LandmarkIndex b) { return ids[a.value] < ids[b.value]; });
  return kept;
}

PointSet point_set(const LandmarkMap& map, const std::optional<Metric>& metric,
                   const PointSetOptions& options) {
  const std::vector<LandmarkIndex> kept = landmarks_to_align(map, options);
  PointSet points;
  points.positions.reserve(kept.size());
  for (const LandmarkIndex landmark : kept) {
    points.positions.push_back(map.landmarks().positions[landmark.value]);
  }
  if (metric) {
    const std::vector<double> all = metric->evaluate(map);
    points.confidences.reserve(kept.size());
    for (const LandmarkIndex landmark : kept) points.confidences.push_back(all[landmark.value]);
  }
  return points;
}

}  // namespace cairn
