// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "cairn/alignment/detail/search/nearest_field.hpp"
#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

using PointsF = std::vector<Eigen::Vector3f>;

// One round of the tournament: how many poses enter, and what is done with each.
struct Round {
  std::size_t entrants;
  double scale;  // geometric position between coarse (0) and fine (1) at its end
  int iterations;
  std::size_t points;
};

constexpr std::size_t kAnchors = 8;       // of each map; translations are all pairs of them
constexpr std::size_t kScoutPoints = 48;  // source points that score a translation
constexpr std::size_t kMostVoxels = 1 << 20;
constexpr float kVoxelsPerScale = 4.0F;
constexpr std::array<Round, 4> kRounds = {{
    {3072, 0.0, 5, 128},
    {768, 0.3, 6, 256},
    {256, 0.65, 6, 600},
    {128, 1.0, 10, 600},
}};

// Centroids of compact groups of equal size, by repeated halving at the median of the bounding box's longest
// edge.
PointsF anchors(PointsF points, std::size_t count) {
  if (points.empty()) return {};
  if (count == 1 || points.size() == 1) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const Eigen::Vector3f& point : points) sum += point;
    return {sum / static_cast<float>(points.size())};
  }
  Eigen::Vector3f low = points.front();
  Eigen::Vector3f high = points.front();
  for (const Eigen::Vector3f& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(
      points.begin(), middle, points.end(),
      [axis](const Eigen::Vector3f& a, const Eigen::Vector3f& b) { return a[axis] < b[axis]; });
  PointsF result = anchors(PointsF(points.begin(), middle), count / 2);
  const PointsF upper = anchors(PointsF(middle, points.end()), count / 2);
  result.insert(result.end(), upper.begin(), upper.end());
  return result;
}

// Contains all points except the farthest 1 % on each side, plus a margin, so that outliers do not enlarge
// the voxels.
Box robust_box(const PointsF& points, float margin) {
  Box box{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
  std::vector<float> values(points.size());
  const std::size_t rank = points.size() / 100;
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(points.begin(), points.end(), values.begin(),
                   [axis](const Eigen::Vector3f& point) { return point[axis]; });
    box.low[axis] = nth_lowest(values, rank) - margin;
    box.high[axis] = nth_lowest(values, values.size() - 1 - rank) + margin;
  }
  return box;
}

PointsF in_single_precision(std::span<const Eigen::Vector3d> points) {
  PointsF result;
  result.reserve(points.size());
  for (const Eigen::Vector3d& point : points) result.push_back(point.cast<float>());
  return result;
}

// Source points at a pose, one per row: their places relative to the pivot of a motion, the vectors from there to the
// target points that match, and the matches' trusts, 0 without a match.
struct Matched {
  explicit Matched(Eigen::Index count) : places(count, 3), residuals(count, 3), trusts(count) {}

  Eigen::MatrixX3f places;
  Eigen::MatrixX3f residuals;
  Eigen::ArrayXf trusts;
};

// The least-squares motion (δt, δφ) of the places about the pivot; a place x moves by δt + δφ × x. Slightly damped,
// so that undetermined directions do not move.
Vector6d small_motion(const Matched& matched, const Eigen::ArrayXf& weights, double weight) {
  constexpr double kSearchDamping = 1e-6;
  const Eigen::MatrixX3f weighted = matched.places.array().colwise() * weights;
  const Eigen::Vector3d first = weighted.colwise().sum().transpose().cast<double>();
  const Eigen::Matrix3d second =
      weighted.transpose().lazyProduct(matched.places).eval().cast<double>();
  const Eigen::Matrix3d torque =
      weighted.transpose().lazyProduct(matched.residuals).eval().cast<double>();
  const Eigen::Vector3d force =
      weights.matrix().transpose().lazyProduct(matched.residuals).transpose().eval().cast<double>();
  Eigen::Matrix<double, 6, 6> information;
  information.topLeftCorner<3, 3>() = weight * Eigen::Matrix3d::Identity();
  information.topRightCorner<3, 3>() = -skew(first);
  information.bottomLeftCorner<3, 3>() = skew(first);
  information.bottomRightCorner<3, 3>() = second.trace() * Eigen::Matrix3d::Identity() - second;
  information.diagonal().array() *= 1.0 + kSearchDamping;
  Vector6d gradient;
  gradient << force, torque(1, 2) - torque(2, 1), torque(2, 0) - torque(0, 2),
      torque(0, 1) - torque(1, 0);
  return solve_symmetric<6>(information, gradient);
}

class Search {
 public:
  Search(std::span<const Eigen::Vector3d> source, std::span<const double> source_weights,
         std::span<const Eigen::Vector3d> target, std::span<const double> target_weights,
         const std::function<bool(const Rigid3&)>& accept, const KernelScales& kernel,
         std::size_t candidates, const Execution& execution)
      : source_(in_single_precision(source)),
        target_(in_single_precision(target)),
        source_weights_(source_weights),
        target_weights_(target_weights),
        accept_(accept),
        kernel_(kernel),
        candidates_(candidates),
        execution_(execution),
        distance_(PoseDistance::of(source)) {}

  std::vector<SearchCandidate> run(std::span<const Eigen::Quaterniond> rotations) const {
    double scale = kernel_.coarse;
    NearestField nearest = field(scale);
    std::vector<SearchCandidate> poses = scout(rotations, nearest);
    double done = 1.0;
    for (const Round& round : kRounds) {
      if (execution_.progress) execution_.progress(done++ / (kRounds.size() + 1.0));
      keep_best(poses, round.entrants);
      const double start = scale;
      scale = kernel_.coarse * std::pow(kernel_.fine / kernel_.coarse, round.scale);
      if (scale != start) nearest = field(scale);
      std::vector<SearchCandidate> refined = poses;
      refine(refined, start, scale, round, nearest);
      // Scores of different scales are not comparable.
      if (execution_.stop.stop_requested()) break;
      poses = std::move(refined);
      // Keeps one of the poses that approach the same optimum.
      poses = distinct(std::move(poses), 0.5 * scale);
    }
    std::erase_if(poses,
                  [&](const SearchCandidate& pose) { return !accept_(pose.target_from_source); });
    poses = distinct(std::move(poses), 0.35 * kernel_.fine);
    keep_best(poses, candidates_);
    return poses;
  }

 private:
  NearestField field(double scale) const {
    const auto sigma = static_cast<float>(scale);
    return {target_, robust_box(target_, sigma), sigma / kVoxelsPerScale, kMostVoxels};
  }

  // Each rotation with the best of its translations.
  std::vector<SearchCandidate> scout(std::span<const Eigen::Quaterniond> rotations,
                                     const NearestField& field) const {
    const PointsF from = anchors(source_, kAnchors);
    const PointsF to = anchors(target_, kAnchors);
    const std::size_t count = std::min(kScoutPoints, source_.size());
    const std::vector<float> most = most_from_each(count);
    constexpr double kNotTried = -1.0;
    std::vector<SearchCandidate> poses(rotations.size(), {Rigid3(), kNotTried});
    execution_.executor.for_blocks(rotations.size(), 64, [&](std::size_t begin, std::size_t end) {
      // The first block always runs, so that there are poses to continue with.
      if (begin > 0 && execution_.stop.stop_requested()) return;
      PointsF rotated(count);
      for (std::size_t i = begin; i < end; ++i) {
        const Eigen::Matrix3f rotation = rotations[i].toRotationMatrix().cast<float>();
        for (std::size_t j = 0; j < count; ++j) rotated[j] = rotation * source_[j];
        float best = -1.0F;
        Eigen::Vector3f best_translation = Eigen::Vector3f::Zero();
        for (const Eigen::Vector3f& a : from) {
          const Eigen::Vector3f moved = rotation * a;
          for (const Eigen::Vector3f& b : to) {
            const Eigen::Vector3f translation = b - moved;
            const float value = score(rotated, most, translation, field, best);
            if (value > best) {
              best = value;
              best_translation = translation;
            }
          }
        }
        poses[i] = {Rigid3(rotations[i], best_translation.cast<double>()), best};
      }
    });
    std::erase_if(poses, [](const SearchCandidate& pose) { return pose.score == kNotTried; });
    return poses;
  }

  // Entry i: the most that the points from i on can add to a score.
  std::vector<float> most_from_each(std::size_t count) const {
    const double most = target_weights_.empty()
                            ? 1.0
                            : *std::max_element(target_weights_.begin(), target_weights_.end());
    std::vector<float> result(count + 1, 0.0F);
    for (std::size_t i = count; i > 0; --i) {
      const double own = source_weights_.empty() ? 1.0 : source_weights_[i - 1];
      result[i - 1] = result[i] + static_cast<float>(own * most);
    }
    return result;
  }

  // The score of a translation, or less if it is not better than the best.
  float score(const PointsF& rotated, std::span<const float> most,
              const Eigen::Vector3f& translation, const NearestField& field, float best) const {
    constexpr std::size_t kBlock = 8;
    constexpr float kRounding = 1e-4F;
    const auto per_square = static_cast<float>(1.0 / (kernel_.coarse * kernel_.coarse));
    const auto count = static_cast<float>(rotated.size());
    const float enough = (1.0F - kRounding) * best * count;
    float sum = 0.0F;
    for (std::size_t i = 0; i < rotated.size(); ++i) {
      if (i % kBlock == 0 && sum + most[i] < enough) break;
      const Eigen::Vector3f moved = rotated[i] + translation;
      const std::uint32_t nearest = field.nearest(moved);
      if (nearest == NearestField::kNone) continue;
      sum += weight(i, nearest) / (1.0F + per_square * (target_[nearest] - moved).squaredNorm());
    }
    return sum / count;
  }

  float weight(std::size_t source, std::size_t target) const {
    double result = 1.0;
    if (!source_weights_.empty()) result *= source_weights_[source];
    if (!target_weights_.empty()) result *= target_weights_[target];
    return static_cast<float>(result);
  }

  void refine(std::vector<SearchCandidate>& poses, double start, double end, const Round& round,
              const NearestField& field) const {
    const std::size_t count = std::min(round.points, source_.size());
    execution_.executor.for_blocks(poses.size(), 16, [&](std::size_t begin, std::size_t stop) {
      for (std::size_t i = begin; i < stop; ++i) {
        if (execution_.stop.stop_requested()) return;
        for (int k = 1; k <= round.iterations; ++k) {
          const double share = static_cast<double>(k) / round.iterations;
          step(poses[i], start * std::pow(end / start, share), count, field);
        }
      }
    });
  }

  // One step of least squares; the score is that before it.
  void step(SearchCandidate& pose, double scale, std::size_t count,
            const NearestField& field) const {
    const Eigen::Matrix3f rotation = pose.target_from_source.rotation().cast<float>();
    const Eigen::Vector3f translation = pose.target_from_source.translation().cast<float>();
    const Eigen::Vector3f pivot = (pose.target_from_source * distance_.centroid).cast<float>();
    Matched matched(static_cast<Eigen::Index>(count));
    for (std::size_t i = 0; i < count; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const Eigen::Vector3f moved = rotation * source_[i] + translation;
      const std::uint32_t nearest = field.nearest(moved);
      const bool none = nearest == NearestField::kNone;
      matched.places.row(row) = moved - pivot;
      matched.residuals.row(row) =
          none ? Eigen::Vector3f::Zero() : Eigen::Vector3f(target_[nearest] - moved);
      matched.trusts[row] = none ? 0.0F : weight(i, nearest);
    }
    const auto per_square = static_cast<float>(1.0 / (scale * scale));
    const Eigen::ArrayXf kernel =
        (1.0F + per_square * matched.residuals.rowwise().squaredNorm().array()).inverse();
    const Eigen::ArrayXf trusted = matched.trusts * kernel;
    pose.score = trusted.sum() / static_cast<float>(count);
    const Eigen::ArrayXf weights = trusted * kernel;
    const auto weight = static_cast<double>(weights.sum());
    if (!(weight > 0.0)) return;
    const Vector6d delta = small_motion(matched, weights, weight);
    const Rigid3 turned(rotation_exp(delta.tail<3>()) * pose.target_from_source.quaternion(),
                        Eigen::Vector3d::Zero());
    const Eigen::Vector3d moved_centroid =
        pose.target_from_source * distance_.centroid + delta.head<3>();
    pose.target_from_source =
        Rigid3(turned.quaternion(), moved_centroid - turned * distance_.centroid);
  }

  static void keep_best(std::vector<SearchCandidate>& poses, std::size_t count) {
    std::stable_sort(
        poses.begin(), poses.end(),
        [](const SearchCandidate& a, const SearchCandidate& b) { return a.score > b.score; });
    poses.resize(std::min(poses.size(), count));
  }

  std::vector<SearchCandidate> distinct(std::vector<SearchCandidate> poses, double radius) const {
    keep_best(poses, poses.size());
    std::vector<SearchCandidate> kept;
    std::vector<Eigen::Vector3d> centroids;  // moved by the poses that are kept
    for (const SearchCandidate& pose : poses) {
      const Eigen::Vector3d centroid = pose.target_from_source * distance_.centroid;
      const auto is_known = [&](std::size_t i) {
        // The centroids' distance is a part of the poses'.
        return (centroids[i] - centroid).squaredNorm() < radius * radius &&
               distance_(pose.target_from_source, kept[i].target_from_source) < radius;
      };
      std::size_t i = 0;
      while (i < kept.size() && !is_known(i)) ++i;
      if (i < kept.size()) continue;
      kept.push_back(pose);
      centroids.push_back(centroid);
    }
    return kept;
  }

  PointsF source_;
  PointsF target_;
  std::span<const double> source_weights_;
  std::span<const double> target_weights_;
  const std::function<bool(const Rigid3&)>& accept_;
  const KernelScales& kernel_;
  std::size_t candidates_;
  const Execution& execution_;
  PoseDistance distance_;
};

}  // namespace

std::vector<Eigen::Quaterniond> all_rotations(std::size_t count) {
  // The paper's constants: the root of 2 and the positive solution of x⁴ = x + 4.
  constexpr double kPhi = std::numbers::sqrt2;
  constexpr double kPsi = 1.533751168755204288118041;
  std::vector<Eigen::Quaterniond> rotations;
  rotations.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = static_cast<double>(i) + 0.5;
    const double t = s / static_cast<double>(count);
    const double inner = std::sqrt(t);
    const double outer = std::sqrt(1.0 - t);
    const double alpha = 2.0 * std::numbers::pi * s / kPhi;
    const double beta = 2.0 * std::numbers::pi * s / kPsi;
    rotations.emplace_back(outer * std::cos(beta), inner * std::sin(alpha), inner * std::cos(alpha),
                           outer * std::sin(beta));
  }
  return rotations;
}

std::vector<Eigen::Quaterniond> rotations_about(const Eigen::Vector3d& from,
                                                const Eigen::Vector3d& to, std::size_t count) {
  const Eigen::Quaterniond upright = rotation_between(from, to);
  std::vector<Eigen::Quaterniond> rotations;
  rotations.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double angle =
        2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count);
    rotations.push_back(Eigen::AngleAxisd(angle, to.normalized()) * upright);
  }
  return rotations;
}

std::vector<SearchCandidate> search_poses(
    std::span<const Eigen::Vector3d> source, std::span<const double> source_weights,
    std::span<const Eigen::Vector3d> target, std::span<const double> target_weights,
    std::span<const Eigen::Quaterniond> rotations, const std::function<bool(const Rigid3&)>& accept,
    const KernelScales& kernel, std::size_t candidates, const Execution& execution) {
  if (source.empty() || target.empty()) return {};
  return Search(source, source_weights, target, target_weights, accept, kernel, candidates,
                execution)
      .run(rotations);
}

}  // namespace cairn::detail
