// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/alignment/detail/search/proposals.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kQuadAround = 10;        // neighbours of a point that form quads with it
constexpr std::size_t kQuadPatch = 64;         // neighbours of a point that test a pose
constexpr std::size_t kMostCentres = 20'000;   // of the target's quads
constexpr std::size_t kMostQuads = 1'500'000;  // of the target
constexpr std::size_t kSourceQuads = 40'000;
// Of the longest side:
constexpr double kLeastSide = 0.2;
constexpr double kLeastQuadHeight = 0.15;  // of the third corner above the longest side
constexpr float kMostUnlike = 0.03F;       // difference of two shapes
constexpr double kSides = 64.0;            // cells of the index in a unit of a proportion
constexpr std::size_t kMostMatches = 20'000;
// Largest distance of equal points, in spacings of the patch: for the first pose, and for the pose corrected by its
// first points.
constexpr double kFirstQuadReach = 0.3;
constexpr double kQuadReach = 0.2;
constexpr std::size_t kQuadGlance = 12;
constexpr std::size_t kQuadGlanceHits = 6;
constexpr double kLeastEvidence = 6.0;
// Ratio of the radii of a patch and of the target's points, either way.
constexpr double kMostStretch = 6.0;
constexpr double kSameQuadPose = 0.5;  // fine scales: largest distance of equal poses

// The order of the corners depends only on proportions. The ends of the longest side come first, beginning with the end
// that is nearer to the other corners; then, of these, the corner that is nearer to this end.
struct Quad {
  std::array<std::uint32_t, 4> corners{};
  std::uint32_t centre = 0;
  float length = 0.0F;  // of its longest side
};

// Proportions of the other sides to the longest, and of the volume, which tells a quad from its mirror image.
using Shape = std::array<float, 6>;

// The points of a cloud, and the nearest neighbours of some of them.
class Surroundings {
 public:
  Surroundings(const PreparedCloud& cloud, std::size_t centres, const Executor& executor)
      : points(cloud.landmarks().positions),
        tree(cloud.tree()),
        size(std::min(kQuadPatch + 1, points.size())),
        count(std::min(centres, points.size())),
        near_(count * size),
        radius_(count) {
    auto batch = tree.batch(size);
    batch.for_each(std::span(points).first(count), executor,
                   [&](std::size_t i, const BatchTree::Batch::Nearest& nearest) {
                     for (std::size_t k = 0; k < size; ++k) near_[i * size + k] = nearest.index(k);
                     radius_[i] = std::sqrt(nearest.squared_distance(size - 1));
                   });
  }

  /// The point itself and its neighbours, nearest first.
  std::span<const std::uint32_t> near(std::size_t i) const {
    return std::span(near_).subspan(i * size, size);
  }
  /// Distance of the last neighbour.
  double radius(std::size_t i) const { return radius_[i]; }
  /// Spacing of the points around a point, if they lie on a surface.
  double spacing(std::size_t i) const {
    return radius_[i] * std::sqrt(std::numbers::pi / static_cast<double>(size - 1));
  }

  const std::vector<Vector3d>& points;
  const BatchTree& tree;
  const std::size_t size;
  const std::size_t count;

 private:
  std::vector<std::uint32_t> near_;
  std::vector<double> radius_;
};

// A point and its neighbours, with their distances.
class Neighbourhood {
 public:
  Neighbourhood(const std::vector<Vector3d>& points, std::span<const std::uint32_t> near)
      : near_(near) {
    for (std::size_t i = 0; i < near.size(); ++i) {
      places_[i] = points[near[i]];
      for (std::size_t j = 0; j < i; ++j) {
        distances_[i][j] = distances_[j][i] = (places_[i] - places_[j]).norm();
      }
    }
  }

  std::uint32_t index(std::size_t i) const { return near_[i]; }
  const Vector3d& place(std::size_t i) const { return places_[i]; }
  double distance(std::size_t i, std::size_t j) const { return distances_[i][j]; }

 private:
  static constexpr std::size_t kMost = kQuadAround + 1;

  std::span<const std::uint32_t> near_;
  std::array<Vector3d, kMost> places_;
  std::array<std::array<double, kMost>, kMost> distances_;
};

// The quad of four of the points and its shape; false if it does not determine a similarity well.
bool describe(const Neighbourhood& around, std::array<std::size_t, 4> corners, Quad& quad,
              Shape& shape) {
  const auto distance = [&](std::size_t i, std::size_t j) {
    return around.distance(corners[i], corners[j]);
  };
  const auto exchange = [&](std::size_t i, std::size_t j) { std::swap(corners[i], corners[j]); };
  double longest = 0.0;
  std::pair<std::size_t, std::size_t> ends;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = i + 1; j < 4; ++j) {
      if (const double side = distance(i, j); side > longest) {
        longest = side;
        ends = {i, j};
      }
    }
  }
  if (!(longest > 0.0)) return false;
  exchange(0, ends.first);
  exchange(1, ends.second == 0 ? ends.first : ends.second);
  double ac = distance(0, 2);
  double ad = distance(0, 3);
  double bc = distance(1, 2);
  double bd = distance(1, 3);
  if (ac + ad > bc + bd) {
    exchange(0, 1);
    std::swap(ac, bc);
    std::swap(ad, bd);
  }
  if (ac > ad) {
    exchange(2, 3);
    std::swap(ac, ad);
    std::swap(bc, bd);
  }
  const double cd = distance(2, 3);
  if (std::min(ac, cd) < kLeastSide * longest) return false;
  const Vector3d& origin = around.place(corners[0]);
  const Vector3d normal =
      (around.place(corners[1]) - origin).cross(around.place(corners[2]) - origin);
  if (normal.norm() < kLeastQuadHeight * longest * longest) return false;
  const double volume =
      normal.dot(around.place(corners[3]) - origin) / (longest * longest * longest);
  constexpr double kVolume = 2.0;  // makes its error about that of a side
  for (std::size_t i = 0; i < 4; ++i) quad.corners[i] = around.index(corners[i]);
  quad.length = static_cast<float>(longest);
  const auto share = [&](double side) { return static_cast<float>(side / longest); };
  shape = {share(ac), share(bd), share(ad),
           share(bc), share(cd), static_cast<float>(kVolume * volume)};
  return true;
}

// Calls visit(quad, shape) for the quads of a point and three of its neighbours.
template <class Visit>
void for_quads(const Surroundings& cloud, std::size_t centre, const Visit& visit) {
  const auto near = cloud.near(centre).first(std::min(cloud.size, kQuadAround + 1));
  const Neighbourhood around(cloud.points, near);
  Quad quad;
  quad.centre = static_cast<std::uint32_t>(centre);
  Shape shape;
  for (std::size_t i = 1; i < near.size(); ++i) {
    for (std::size_t j = i + 1; j < near.size(); ++j) {
      for (std::size_t k = j + 1; k < near.size(); ++k) {
        if (describe(around, {0, i, j, k}, quad, shape)) visit(quad, shape);
      }
    }
  }
}

// The quads of the target, by three of their proportions.
class QuadIndex {
 public:
  QuadIndex(const Surroundings& target, const Executor& executor) {
    constexpr std::size_t kBlock = 256;
    const std::size_t blocks = (target.count + kBlock - 1) / kBlock;
    std::vector<std::vector<std::pair<Quad, Shape>>> parts(blocks);
    executor.for_blocks(target.count, kBlock, [&](std::size_t begin, std::size_t end) {
      auto& part = parts[begin / kBlock];
      for (std::size_t i = begin; i < end; ++i) {
        for_quads(target, i,
                  [&](const Quad& quad, const Shape& shape) { part.emplace_back(quad, shape); });
      }
    });
    // Of too many, those of the first centres.
    std::size_t total = 0;
    for (auto& part : parts) {
      part.resize(std::min(part.size(), kMostQuads - total));
      total += part.size();
    }
    begins_.assign(kCells * kCells * kCells + 1, 0);
    for (const auto& part : parts) {
      for (const auto& [quad, shape] : part) ++begins_[cell_of(shape) + 1];
    }
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    quads_.resize(total);
    for (auto& proportions : shapes_) proportions.resize(total + kTogether);
    std::vector<std::uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (const auto& part : parts) {
      for (const auto& [quad, shape] : part) {
        const std::uint32_t slot = next[cell_of(shape)]++;
        quads_[slot] = quad;
        for (std::size_t k = 0; k < shape.size(); ++k) shapes_[k][slot] = shape[k];
      }
    }
  }

  static std::size_t cell_of(const Shape& shape) { return index_of(cells_of(shape)); }

  // The quad most alike; null if none is alike. Sets the squared difference of the shapes.
  const Quad* nearest(const Shape& shape, float& difference) const {
    const Quad* best = nullptr;
    difference = kMostUnlike * kMostUnlike;
    const std::array<std::size_t, 3> cell = cells_of(shape);
    // The cells that neighbours in two proportions and within kMostUnlike of the third are in.
    constexpr std::size_t kThirdReach = 2;
    const auto below = [&](std::size_t axis, std::size_t reach) {
      return cell[axis] - std::min(cell[axis], reach);
    };
    const auto above = [&](std::size_t axis, std::size_t reach) {
      return std::min(cell[axis] + reach, kCells - 1);
    };
    for (std::size_t x = below(0, 1); x <= above(0, 1); ++x) {
      for (std::size_t y = below(1, 1); y <= above(1, 1); ++y) {
        const std::size_t begin = begins_[index_of({x, y, below(2, kThirdReach)})];
        const std::size_t end = begins_[index_of({x, y, above(2, kThirdReach)}) + 1];
        for (std::size_t i = begin; i < end; i += kTogether) {
          const std::array<float, kTogether> differences = differences_from(shape, i);
          for (std::size_t j = 0; j < std::min(kTogether, end - i); ++j) {
            if (differences[j] >= difference) continue;
            difference = differences[j];
            best = &quads_[i + j];
          }
        }
      }
    }
    return best;
  }

 private:
  static constexpr std::size_t kCells = static_cast<std::size_t>(kSides) + 1;
  static constexpr std::size_t kTogether = 8;  // shapes that vector instructions compare

  // Squared differences of consecutive shapes.
  std::array<float, kTogether> differences_from(const Shape& shape, std::size_t begin) const {
    std::array<float, kTogether> sums{};
    for (std::size_t k = 0; k < shape.size(); ++k) {
      const float* const proportions = shapes_[k].data() + begin;
      for (std::size_t j = 0; j < kTogether; ++j) {
        const float apart = proportions[j] - shape[k];
        sums[j] += apart * apart;
      }
    }
    return sums;
  }

  static std::array<std::size_t, 3> cells_of(const Shape& shape) {
    const auto cell = [](float share) {
      return std::min(static_cast<std::size_t>(static_cast<double>(share) * kSides), kCells - 1);
    };
    return {cell(shape[0]), cell(shape[1]), cell(shape[2])};
  }
  static std::size_t index_of(const std::array<std::size_t, 3>& cell) {
    return (cell[0] * kCells + cell[1]) * kCells + cell[2];
  }
  std::vector<std::uint32_t> begins_;  // of each cell
  std::vector<Quad> quads_;
  std::array<std::vector<float>, std::tuple_size_v<Shape>> shapes_;  // by proportion
};

struct QuadMatch {
  Quad source;
  const Quad* target = nullptr;
  float difference = 0.0F;
};

class QuadFinder {
 public:
  QuadFinder(const PreparedCloud& source, const PreparedCloud& target, const ScaleRange& scales,
             double fine, const Execution& execution)
      : scales_(scales),
        fine_(fine),
        execution_(execution),
        source_(source, PreparedCloud::kSample, execution.executor),
        target_(target, kMostCentres, execution.executor),
        index_(target_, execution.executor) {}

  std::vector<QuadPose> run() const {
    const std::vector<QuadMatch> alike = matches();
    constexpr std::size_t kBlock = 64;
    std::vector<std::vector<QuadPose>> parts((alike.size() + kBlock - 1) / kBlock);
    execution_.executor.for_blocks(alike.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      if (execution_.stop.stop_requested()) return;
      for (std::size_t i = begin; i < end; ++i) test(alike[i], parts[begin / kBlock]);
    });
    std::vector<QuadPose> found;
    for (const auto& part : parts) found.insert(found.end(), part.begin(), part.end());
    std::stable_sort(found.begin(), found.end(),
                     [](const QuadPose& a, const QuadPose& b) { return a.evidence > b.evidence; });
    const PoseDistance distance = PoseDistance::of(source_.points);
    return first_distinct(found, kMostQuadPoses, [&](const QuadPose& a, const QuadPose& b) {
      return distance(a.target_from_source, b.target_from_source) < kSameQuadPose * fine_;
    });
  }

 private:
  // The most similar pairs of quads, most similar first.
  std::vector<QuadMatch> matches() const {
    std::vector<std::pair<Quad, Shape>> wanted;
    for (std::size_t i = 0; i < source_.count && wanted.size() < kSourceQuads; ++i) {
      for_quads(source_, i,
                [&](const Quad& quad, const Shape& shape) { wanted.emplace_back(quad, shape); });
    }
    // Quads of one cell after another, whose surroundings are then in the cache.
    std::vector<std::uint32_t> order(wanted.size());
    std::iota(order.begin(), order.end(), 0U);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return QuadIndex::cell_of(wanted[a].second) < QuadIndex::cell_of(wanted[b].second);
    });
    std::vector<QuadMatch> all(wanted.size());
    execution_.executor.for_blocks(wanted.size(), 512, [&](std::size_t begin, std::size_t end) {
      if (execution_.stop.stop_requested()) return;
      for (const std::uint32_t i : std::span(order).subspan(begin, end - begin)) {
        all[i].source = wanted[i].first;
        all[i].target = index_.nearest(wanted[i].second, all[i].difference);
      }
    });
    std::erase_if(all, [&](const QuadMatch& match) {
      if (match.target == nullptr) return true;
      const double scale = static_cast<double>(match.target->length / match.source.length);
      return scale < scales_.least || scale > scales_.most;
    });
    std::stable_sort(all.begin(), all.end(), [](const QuadMatch& a, const QuadMatch& b) {
      return a.difference < b.difference;
    });
    if (all.size() > kMostMatches) all.resize(kMostMatches);
    return all;
  }

  // std::nullopt if the scale is out of range, as of points that coincide.
  std::optional<Similarity3> pose_of(std::span<const Vector3d> from,
                                     std::span<const Vector3d> to) const {
    const Eigen::Matrix4d matrix = least_squares_similarity(from, to, true);
    const double scale = std::cbrt(matrix.topLeftCorner<3, 3>().determinant());
    if (!(scale >= scales_.least && scale <= scales_.most)) return std::nullopt;
    return Similarity3::from_matrix(matrix);
  }

  struct Hits {
    std::vector<Vector3d> from;
    std::vector<Vector3d> to;
  };

  // Points of a patch that a pose brings near a target point.
  Hits hits(std::span<const std::uint32_t> patch, const Similarity3& pose, double reach) const {
    Hits result;
    std::array<Neighbor, 1> nearest;
    for (const std::uint32_t i : patch) {
      const Vector3d& point = source_.points[i];
      if (target_.tree.nearest(pose * point, nearest, reach * reach) == 0) continue;
      result.from.push_back(point);
      result.to.push_back(target_.points[nearest[0].index]);
    }
    return result;
  }

  void test(const QuadMatch& match, std::vector<QuadPose>& found) const {
    std::array<Vector3d, 4> from;
    std::array<Vector3d, 4> to;
    for (std::size_t i = 0; i < 4; ++i) {
      from[i] = source_.points[match.source.corners[i]];
      to[i] = target_.points[match.target->corners[i]];
    }
    const auto rough = pose_of(from, to);
    if (!rough) return;
    const std::size_t centre = match.source.centre;
    const double stretch =
        rough->scale() * source_.radius(centre) / target_.radius(match.target->centre);
    if (stretch > kMostStretch || stretch < 1.0 / kMostStretch) return;
    std::vector<std::uint32_t> patch;
    for (const std::uint32_t i : source_.near(centre)) {
      const auto& corners = match.source.corners;
      if (std::find(corners.begin(), corners.end(), i) == corners.end()) patch.push_back(i);
    }
    const double spacing = rough->scale() * source_.spacing(centre);
    Hits some = hits(std::span(patch).first(kQuadGlance), *rough, kFirstQuadReach * spacing);
    if (some.from.size() < kQuadGlanceHits) return;
    some.from.insert(some.from.end(), from.begin(), from.end());
    some.to.insert(some.to.end(), to.begin(), to.end());
    const auto better = pose_of(some.from, some.to);
    if (!better) return;
    Hits all = hits(patch, *better, kQuadReach * spacing);
    if (all.from.size() < kQuadGlanceHits) return;
    const auto best = pose_of(all.from, all.to);
    if (!best) return;
    all = hits(patch, *best, kQuadReach * spacing);
    // Share of points that are near a target point by chance if the surfaces coincide.
    const double areas = std::pow(kQuadReach * spacing / target_.spacing(match.target->centre), 2);
    const double chance = 1.0 - std::exp(-std::numbers::pi * areas);
    const double evidence = hit_evidence(all.from.size(), patch.size(), chance);
    if (evidence >= kLeastEvidence) found.push_back({*best, evidence});
  }

  const ScaleRange& scales_;
  double fine_;
  const Execution& execution_;
  Surroundings source_;
  Surroundings target_;
  QuadIndex index_;
};

}  // namespace

std::vector<QuadPose> quad_poses(const PreparedCloud& source, const PreparedCloud& target,
                                 const ScaleRange& scales, double fine,
                                 const Execution& execution) {
  const bool too_few = std::min(source.size(), target.size()) <= kQuadGlance + 4;
  if (too_few || execution.stop.stop_requested()) return {};
  return QuadFinder(source, target, scales, fine, execution).run();
}

}  // namespace cairn::detail
