// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/prepared_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <unordered_set>
#include <utility>

#include "cairn/alignment/detail/evidence/contrast.hpp"
#include "cairn/alignment/detail/spatial_groups.hpp"
#include "cairn/core/detail/hash.hpp"
#include "cairn/core/random.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/central_part.hpp"
#include "cairn/geometry/detail/grid_steps.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

// Random numbers that depend on the landmarks. They make the samples of two maps independent, even if their landmarks
// have the same order.
Random random_of(const LandmarkCloud& cloud, std::uint64_t seed) {
  const std::string_view bytes(reinterpret_cast<const char*>(cloud.positions.data()),
                               cloud.size() * sizeof(Eigen::Vector3d));
  return Random(seed).fork(hash_of(bytes).low);
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

// Entry i becomes the former entry order[i].
template <class Value>
void reorder(std::vector<Value>& column, std::span<const std::uint32_t> order) {
  if (column.empty()) return;
  std::vector<Value> ordered;
  ordered.reserve(order.size());
  for (const std::uint32_t i : order) ordered.push_back(std::move(column[i]));
  column = std::move(ordered);
}

LandmarkCloud ordered(LandmarkCloud cloud, std::span<const std::uint32_t> order) {
  reorder(cloud.positions, order);
  reorder(cloud.covariances, order);
  reorder(cloud.weights, order);
  reorder(cloud.lightness, order);
  if (cloud.descriptors) cloud.descriptors = descriptor_rows(*cloud.descriptors, order);
  std::vector<std::uint32_t> place(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;
  for (LandmarkView& view : cloud.views) {
    for (std::uint32_t& landmark : view.landmarks) landmark = place[landmark];
  }
  return cloud;
}

CloudScales scales_of_sample(const LandmarkCloud& cloud, const CloudScales& all,
                             const Executor& executor) {
  if (cloud.size() <= PreparedCloud::kSample) return all;
  LandmarkCloud part;
  part.positions.assign(cloud.positions.begin(), cloud.positions.begin() + PreparedCloud::kSample);
  CloudScales scales = cloud_scales(part, BatchTree(part.positions), executor);
  scales.noise = all.noise;
  return scales;
}

LandmarkCloud moved(LandmarkCloud cloud, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& position : cloud.positions) position += by;
  for (LandmarkView& view : cloud.views) view.centre += by;
  return cloud;
}

// Limits of a step, in spacings. A smaller step needs no dithering. A larger step is that of shelves or storeys, not
// of the positions.
constexpr double kLeastStep = 0.1;
constexpr double kMostStep = 2.0;

// Rounded positions and voxel centres are known only to within a step; this spreads them evenly over the step.
// Otherwise, two grids would match to the last digit, whatever the maps show.
void dither(std::vector<Eigen::Vector3d>& positions, Random random, const Executor& executor) {
  Eigen::Vector3d steps = grid_steps(positions);
  if (steps.isZero(0.0)) return;
  std::vector<double> spacings = landmark_spacings(positions, BatchTree(positions), executor);
  const double spacing = upper_median(spacings);
  for (double& step : steps) {
    if (step < kLeastStep * spacing || step > kMostStep * spacing) step = 0.0;
  }
  if ((steps.array() > 0.0).count() < 2) return;
  for (Eigen::Vector3d& position : positions) {
    for (int axis = 0; axis < 3; ++axis) position[axis] += steps[axis] * random.uniform(-0.5, 0.5);
  }
}

// Whether neighbours on one side of a point have counterparts on its other side. Among landmarks, at most 6 % have one;
// on grids, in depth images and in scans, 19 to 70 %.
bool on_lattice(std::span<const Eigen::Vector3d> points, const BatchTree& tree,
                const Executor& executor) {
  constexpr std::size_t kTested = 1024;  // points
  constexpr std::size_t kNeighbours = 4;
  constexpr double kSame = 0.2;  // of the neighbour's distance
  constexpr double kLeastShare = 0.15;
  const auto tested = points.first(std::min(points.size(), kTested));
  std::vector<Eigen::Vector3d> opposite(kNeighbours * tested.size());
  std::vector<double> farthest(opposite.size(), 0.0);  // squared
  tree.batch(kNeighbours + 1)
      .for_each(tested, executor, [&](std::size_t i, const NearestList auto& nearest) {
        for (std::size_t j = 1; j < nearest.size(); ++j) {
          const std::size_t place = kNeighbours * i + j - 1;
          opposite[place] = 2.0 * tested[i] - points[nearest.index(j)];
          farthest[place] = kSame * kSame * nearest.squared_distance(j);
        }
      });
  std::vector<char> has_counterpart(opposite.size());
  tree.batch(1).for_each(opposite, executor, [&](std::size_t i, const NearestList auto& nearest) {
    has_counterpart[i] = nearest.squared_distance(0) < farthest[i] ? 1 : 0;
  });
  return static_cast<double>(std::ranges::count(has_counterpart, 1)) >
         kLeastShare * static_cast<double>(opposite.size());
}

// The first point in each occupied cell of a grid; empty if there are more than `most` cells.
std::vector<std::uint32_t> first_in_cells(std::span<const Eigen::Vector3d> points, double edge,
                                          std::size_t most) {
  std::unordered_set<std::uint64_t> occupied;
  std::vector<std::uint32_t> first;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Eigen::Array3d cell = (points[i].array() / edge).floor();
    const std::string_view bytes(reinterpret_cast<const char*>(cell.data()), sizeof(cell));
    if (!occupied.insert(hash_of(bytes).low).second) continue;
    if (first.size() == most) return {};
    first.push_back(i);
  }
  return first;
}

// The same for the finest grid that has at most `most` occupied cells; its edge is within 1 % of the finest.
std::vector<std::uint32_t> evenly_spread(std::span<const Eigen::Vector3d> points, double extent,
                                         std::size_t most) {
  constexpr double kFinestEdge = 1e-3;  // of the extent
  constexpr int kRounds = 10;           // of bisection, from three decades
  double fine = kFinestEdge * extent;
  double coarse = extent;
  std::vector<std::uint32_t> rows;
  for (int round = 0; round < kRounds; ++round) {
    const double edge = std::sqrt(fine * coarse);
    std::vector<std::uint32_t> found = first_in_cells(points, edge, most);
    (found.empty() ? fine : coarse) = edge;
    if (!found.empty()) rows = std::move(found);
  }
  return rows;
}

std::span<const Eigen::Vector3d> first_of(std::span<const Eigen::Vector3d> points) {
  return points.first(std::min(points.size(), PreparedCloud::kSample));
}

Similarity3 translation(const Eigen::Vector3d& by) {
  return Rigid3(Eigen::Quaterniond::Identity(), by);
}

}  // namespace

PreparedCloud::More::More(const LandmarkCloud& landmarks, const BatchTree& tree,
                          const Executor& executor)
    : spacings(landmark_spacings(landmarks.positions, tree, executor)),
      scales(cloud_scales(landmarks, tree, executor)),
      sample_scales(scales_of_sample(landmarks, scales, executor)),
      groups(spatial_groups(first_of(landmarks.positions), kGroups)),
      views(landmarks) {
  if (!landmarks.descriptors) {
    contrasts = contrast_ranks(landmarks.lightness, landmarks.positions, tree, executor);
  }
}

PreparedCloud PreparedCloud::plain(LandmarkCloud cloud) {
  PreparedCloud result;
  result.centre_ = central_part(cloud.positions).centre;
  result.landmarks_ =
      std::make_shared<const LandmarkCloud>(moved(std::move(cloud), -result.centre_));
  result.extent_ = cloud_extent(result.landmarks());
  result.order_ = std::make_shared<const std::vector<std::uint32_t>>();
  result.tree_ = std::make_shared<const BatchTree>(result.landmarks().positions);
  return result;
}

PreparedCloud::PreparedCloud(LandmarkCloud cloud, std::uint64_t seed, const Executor& executor,
                             std::string_view name) {
  cloud.validate(name);
  const bool has_placeholders = has_placeholder_covariances(cloud);
  if (has_placeholders) cloud.covariances.clear();
  const Random random = random_of(cloud, seed);
  auto order = random_order(cloud, random);
  dither(cloud.positions, random.fork(1), executor);
  *this = plain(ordered(std::move(cloud), order));
  ignores_covariances_ = has_placeholders;
  order_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(order));
  more_ = std::make_shared<const More>(landmarks(), tree(), executor);
  is_lattice_ = !landmarks().descriptors && on_lattice(landmarks().positions, tree(), executor);
}

std::span<const Eigen::Vector3d> PreparedCloud::sample() const {
  return first_of(landmarks().positions);
}

std::vector<std::uint32_t> PreparedCloud::close_by(std::size_t first) const {
  std::vector<std::uint32_t> result;
  result.reserve(std::min(first, size()));
  std::copy_if(tree().order().begin(), tree().order().end(), std::back_inserter(result),
               [first](std::uint32_t i) { return i < first; });
  return result;
}

PreparedCloud PreparedCloud::scaled_plainly(double scale) const {
  if (scale == 1.0) return *this;
  PreparedCloud result = *this;
  result.centre_ *= scale;
  result.extent_ *= scale;
  result.landmarks_ = std::make_shared<const LandmarkCloud>(cairn::scaled(landmarks(), scale));
  result.tree_ = std::make_shared<const BatchTree>(result.landmarks().positions);
  result.more_.reset();
  return result;
}

PreparedCloud PreparedCloud::scaled(double scale, const Executor& executor) const {
  if (scale == 1.0) return *this;
  PreparedCloud result = scaled_plainly(scale);
  result.more_ = std::make_shared<const More>(result.landmarks(), result.tree(), executor);
  return result;
}

PreparedCloud PreparedCloud::even(const Executor& executor) const {
  const std::vector<std::uint32_t> rows = evenly_spread(landmarks().positions, extent(), kSample);
  LandmarkCloud cloud;
  std::vector<std::uint32_t> order;
  for (const std::uint32_t row : rows) {
    cloud.positions.push_back(landmarks().positions[row]);
    if (!landmarks().covariances.empty()) cloud.covariances.push_back(landmarks().covariances[row]);
    if (!landmarks().weights.empty()) cloud.weights.push_back(landmarks().weights[row]);
    if (!landmarks().lightness.empty()) cloud.lightness.push_back(landmarks().lightness[row]);
    order.push_back(as_given(row));
  }
  PreparedCloud result = plain(std::move(cloud));
  result.centre_ += centre_;
  result.ignores_covariances_ = ignores_covariances_;
  result.is_lattice_ = is_lattice_;
  result.order_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(order));
  result.more_ = std::make_shared<const More>(result.landmarks(), result.tree(), executor);
  return result;
}

PreparedCloud PreparedCloud::mirrored() const {
  const Eigen::DiagonalMatrix<double, 3> mirror(-1.0, 1.0, 1.0);
  LandmarkCloud cloud = landmarks();
  cloud.views.clear();
  cloud.descriptors.reset();
  cloud.lightness.clear();
  for (Eigen::Vector3d& position : cloud.positions) position = mirror * position;
  for (Eigen::Matrix3d& covariance : cloud.covariances) covariance = mirror * covariance * mirror;
  PreparedCloud result = *this;
  result.landmarks_ = std::make_shared<const LandmarkCloud>(std::move(cloud));
  result.tree_ = std::make_shared<const BatchTree>(result.landmarks().positions);
  const auto more = std::make_shared<More>(*more_);
  more->views = SeenViews(result.landmarks());
  result.more_ = more;
  return result;
}

Similarity3 centred_pose(const PreparedCloud& source, const PreparedCloud& target,
                         const Similarity3& target_from_source) {
  return translation(-target.centre()) * target_from_source * translation(source.centre());
}

Similarity3 uncentred_pose(const PreparedCloud& source, const PreparedCloud& target,
                           const Similarity3& centred) {
  return translation(target.centre()) * centred * translation(-source.centre());
}

}  // namespace cairn::detail
