// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/by_parts.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include <Eigen/Cholesky>

#include "cairn/alignment/detail/bends/motion_field.hpp"
#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/detail/pose_between.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn {
namespace {

using namespace detail;

// Number of parts that must agree.
constexpr std::size_t kFewestParts = 2;
// Limit for two consecutive aligned parts.
constexpr double kStepRotation = 8.0 * std::numbers::pi / 180.0;
// Limit for any two aligned parts.
constexpr double kWholeRotation = 20.0 * std::numbers::pi / 180.0;
// Limit for consecutive parts, times the map's radius.
constexpr double kStepDistance = 0.15;
// Limit for consecutive parts, for the logarithm of the scale.
constexpr double kStepScale = 0.08;
// Largest deviation of an undecided part from the pose between its neighbours, as a share of these
// limits.
constexpr double kBetween = 0.5;
constexpr double kLeastProbability = 0.1;  // of such a pose
constexpr std::size_t kFitPoints = 200;    // landmarks of a part that a pose is fitted to
constexpr double kMostOfBend = 0.8;
constexpr double kOwnShare =
    0.2;  // least share of a part's matches that makes a part of the other map its partner

// The landmarks of a prepared map, each moved by the field, in their order.
LandmarkCloud straightened(const PreparedCloud& prepared, const MotionField& field) {
  LandmarkCloud cloud = prepared.landmarks();
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const Similarity3& move = field.landmarks[prepared.as_given(i)];
    cloud.positions[i] = move * (cloud.positions[i] + prepared.centre());
    if (cloud.covariances.empty()) continue;
    cloud.covariances[i] = move.scale() * move.scale() *
                           rotated_covariance(cloud.covariances[i], move.rigid().rotation());
  }
  for (LandmarkView& view : cloud.views) {
    view.centre = field.keyframes[view.frame.value] * (view.centre + prepared.centre());
  }
  return cloud;
}

double angle_between(const Similarity3& a, const Similarity3& b) {
  return a.rigid().quaternion().angularDistance(b.rigid().quaternion());
}

// Result of place() for a part.
struct Trial {
  PartPose pose;
  Similarity3 own;  // found, other_from_own
  bool decisive = false;
  // Covariance of target_from_source; without an estimated scale, the last row and column are zero.
  std::optional<Matrix7d> covariance = {};
  std::vector<Similarity3> candidates;  // other_from_own, with at least kLeastProbability
  std::vector<double> shares;           // shares of its matches in each part of the other map
};

// A map whose parts are placed in the other map.
struct Side {
  MapRole role = MapRole::kSource;
  const PreparedMap* map = nullptr;
  const PreparedMap* other = nullptr;
  std::vector<Trial> trials = {};
  std::vector<std::size_t> decisive = {};  // indices of trials
  bool consistent = false;

  Similarity3 own(const Similarity3& target_from_source) const {
    return role == MapRole::kSource ? target_from_source : target_from_source.inverse();
  }
  // Positions of some landmarks of a part, in the map's frame.
  std::vector<Eigen::Vector3d> points(std::size_t part) const {
    const PreparedCloud& cloud = map->parts()->prepared()[part].cloud.cloud();
    std::vector<Eigen::Vector3d> result;
    for (std::size_t i = 0; i < std::min(kFitPoints, cloud.size()); ++i) {
      result.emplace_back(cloud.landmarks().positions[i] + cloud.centre());
    }
    return result;
  }
};

Trial trial(const Side& side, const PreparedPart& part, AlignOptions options,
            const Execution& execution) {
  options.search = PoseSearch::kNever;
  options.trace = false;
  const bool of_source = side.role == MapRole::kSource;
  Alignment placed = PreparedPair(of_source ? part.cloud : *side.other,
                                  of_source ? *side.other : part.cloud, options, execution)
                         .place();
  Trial result;
  PartPose& pose = result.pose;
  pose.map = side.role;
  pose.first = part.part.first;
  pose.middle = part.part.middle;
  pose.last = part.part.last;
  pose.landmarks = part.part.landmarks.size();
  if (placed.candidates.empty() || !placed.registration.has_pose()) return result;
  pose.verdict = *placed.verdict;
  pose.probability = *placed.probability;
  pose.found = placed.registration.similarity();
  result.own = side.own(*pose.found);
  if (placed.registration.covariance_with_scale) {
    result.covariance = placed.registration.covariance_with_scale;
  } else if (placed.registration.covariance) {
    result.covariance = Matrix7d(Matrix7d::Zero());
    result.covariance->topLeftCorner<6, 6>() = *placed.registration.covariance;
  }
  result.decisive = placed.verdict == Verdict::kAligned && is_decided(placed);
  if (placed.probability >= kLeastProbability) result.candidates.push_back(result.own);
  for (std::size_t i = 1; i < placed.candidates.size(); ++i) {
    if (placed.candidates[i].probability < kLeastProbability) continue;
    result.candidates.push_back(side.own(placed.candidates[i].similarity()));
  }
  const std::span<const std::uint32_t> part_of = side.other->parts()->part_of();
  result.shares.resize(side.other->parts()->prepared().size());
  double all = 0.0;
  for (const Match& match : placed.registration.matches) {
    const std::uint32_t there = part_of[of_source ? match.target : match.source];
    if (there >= result.shares.size()) continue;
    ++result.shares[there];
    ++all;
  }
  for (double& share : result.shares) share /= std::max(all, 1.0);
  return result;
}

// Whether two poses, other_from_own, may be those of parts of one bent map.
class Agreement {
 public:
  explicit Agreement(const Side& side)
      : radius_(PoseDistance::of(side.map->cloud().landmarks().positions).radius) {
    for (std::size_t i = 0; i < side.trials.size(); ++i) {
      distances_.push_back(PoseDistance::of(side.points(i)));
    }
  }
  // @param share largest difference, as a share of the limits
  bool operator()(std::size_t part, const Similarity3& a, const Similarity3& b,
                  double share = 1.0) const {
    const double scale = std::sqrt(a.scale() * b.scale());
    return angle_between(a, b) <= share * kStepRotation &&
           std::abs(std::log(a.scale() / b.scale())) <= share * kStepScale &&
           distances_[part](a, b) <= share * kStepDistance * radius_ * scale;
  }
  double distance(std::size_t part, const Similarity3& a, const Similarity3& b) const {
    return distances_[part](a, b);
  }

 private:
  double radius_;
  std::vector<PoseDistance> distances_;
};

bool consistent(const Side& side, const Agreement& agree) {
  if (side.decisive.size() < kFewestParts) return false;
  for (std::size_t i = 0; i < side.decisive.size(); ++i) {
    const std::size_t a = side.decisive[i];
    for (std::size_t j = i + 1; j < side.decisive.size(); ++j) {
      const std::size_t b = side.decisive[j];
      const Similarity3& first = side.trials[a].own;
      const Similarity3& second = side.trials[b].own;
      if (angle_between(first, second) > kWholeRotation) return false;
      // Between two adjacent parts, both poses are nearly the same.
      if (j == i + 1 && !(agree(a, first, second) || agree(b, first, second))) return false;
    }
  }
  return true;
}

// Whether a separately aligned part of the other map contradicts all parts of this map.
bool contradicts(const Side& side, const Agreement& agree, const Side& other) {
  if (side.decisive.empty()) return false;
  return std::any_of(other.decisive.begin(), other.decisive.end(), [&](std::size_t there) {
    const Similarity3 pose = other.trials[there].own.inverse();
    return std::none_of(side.decisive.begin(), side.decisive.end(),
                        [&](std::size_t here) { return agree(here, side.trials[here].own, pose); });
  });
}

// Whether two parts match two different parts of the other map. Otherwise, a single object seen in many
// keyframes could align several parts.
bool independent(const Side& side) {
  for (const std::size_t a : side.decisive) {
    for (const std::size_t b : side.decisive) {
      const std::vector<double>& one = side.trials[a].shares;
      const std::vector<double>& other = side.trials[b].shares;
      for (std::size_t i = 0; a < b && i < one.size(); ++i) {
        for (std::size_t j = 0; j < other.size(); ++j) {
          if (i != j && one[i] >= kOwnShare && other[j] >= kOwnShare) return true;
        }
      }
    }
  }
  return false;
}

// Mean squared rotation of the parts of `other` that the bend of `side` does not explain.
double unexplained(const Side& side, const Side& other) {
  double sum = 0.0;
  double count = 0.0;
  for (const std::size_t there : other.decisive) {
    const Trial& trial = other.trials[there];
    Eigen::Vector4d mean = Eigen::Vector4d::Zero();
    for (const std::size_t here : side.decisive) {
      Eigen::Vector4d q = side.trials[here].own.inverse().rigid().quaternion().coeffs();
      if (q.dot(mean) < 0.0) q = -q;
      mean += trial.shares[here] * q;
    }
    if (mean.norm() < 0.2) continue;  // matched with undecided parts
    const Eigen::Quaterniond expected = Eigen::Quaterniond(mean).normalized();
    const double off = expected.angularDistance(trial.own.rigid().quaternion());
    sum += off * off;
    ++count;
  }
  return count > 0.0 ? sum / count : 0.0;
}

// Assigns a pose to every part of the map.
void spread_consensus(Side& side, const Agreement& agree) {
  std::vector<std::size_t> known = side.decisive;
  const auto predicted = [&](std::size_t part) {
    const auto after = std::upper_bound(known.begin(), known.end(), part);
    if (after == known.begin()) return side.trials[known.front()].own;
    if (after == known.end()) return side.trials[known.back()].own;
    const std::size_t next = *after;
    const std::size_t last = *std::prev(after);
    const double share = static_cast<double>(part - last) / static_cast<double>(next - last);
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    const std::vector<Eigen::Vector3d> points = side.points(part);
    for (const Eigen::Vector3d& point : points) middle += point;
    middle /= static_cast<double>(std::max<std::size_t>(points.size(), 1));
    return pose_between(side.trials[last].own, side.trials[next].own, share, middle);
  };
  for (const std::size_t part : side.decisive) side.trials[part].pose.agrees = true;
  std::vector<Similarity3> poses;
  for (std::size_t i = 0; i < side.trials.size(); ++i) {
    Trial& trial = side.trials[i];
    if (trial.pose.agrees) continue;
    const Similarity3 expected = predicted(i);
    const auto near =
        std::find_if(trial.candidates.begin(), trial.candidates.end(),
                     [&](const Similarity3& pose) { return agree(i, pose, expected, kBetween); });
    if (near == trial.candidates.end()) continue;
    trial.own = *near;
    trial.pose.agrees = true;
  }
  known.clear();
  for (std::size_t i = 0; i < side.trials.size(); ++i) {
    if (side.trials[i].pose.agrees) known.push_back(i);
  }
  for (std::size_t i = 0; i < side.trials.size(); ++i) {
    Trial& trial = side.trials[i];
    if (!trial.pose.agrees) trial.own = predicted(i);
    trial.pose.target_from_source = side.own(trial.own);
  }
}

// Smooths the rotations along the parts by a polynomial. Its degree, up to 3, has the best Bayesian
// information criterion (Schwarz 1978), so that noise does not count as a bend.
std::vector<Eigen::Vector3d> smoothed(const std::vector<Eigen::Vector3d>& values,
                                      const std::vector<double>& at,
                                      const std::vector<double>& weights) {
  const auto count = static_cast<Eigen::Index>(values.size());
  std::vector<Eigen::Vector3d> best(values.size(), Eigen::Vector3d::Zero());
  double least = std::numeric_limits<double>::infinity();
  const double middle = 0.5 * (at.front() + at.back());
  const double half = std::max(0.5 * (at.back() - at.front()), 1e-9);
  for (Eigen::Index degree = 0; degree <= std::min<Eigen::Index>(3, count - 2); ++degree) {
    Eigen::MatrixXd powers(count, degree + 1);
    Eigen::MatrixXd rows(count, 3);
    Eigen::VectorXd weight(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto index = static_cast<std::size_t>(i);
      for (Eigen::Index d = 0; d <= degree; ++d) {
        powers(i, d) = std::pow((at[index] - middle) / half, static_cast<double>(d));
      }
      rows.row(i) = values[index].transpose();
      weight[i] = weights[index];
    }
    const Eigen::MatrixXd normal = powers.transpose() * weight.asDiagonal() * powers;
    const Eigen::MatrixXd fit =
        powers * normal.ldlt().solve(powers.transpose() * weight.asDiagonal() * rows);
    const Eigen::VectorXd squares = (rows - fit).rowwise().squaredNorm();
    const auto numbers = static_cast<double>(3 * count);
    constexpr double kLeast = 1e-8;  // rad²: below the accuracy of any part
    const double mean = squares.dot(weight) / weight.sum() / 3.0 + kLeast;
    const double criterion =
        numbers * std::log(mean) + static_cast<double>(3 * (degree + 1)) * std::log(numbers);
    if (criterion >= least) continue;
    least = criterion;
    for (Eigen::Index i = 0; i < count; ++i) {
      best[static_cast<std::size_t>(i)] = fit.row(i).transpose();
    }
  }
  return best;
}

MapBend bend_of(const Side& side, const Similarity3& whole, const Agreement& agree) {
  MapBend bend;
  bend.map = side.role;
  std::vector<std::size_t> parts;
  std::vector<Eigen::Vector3d> turns;
  std::vector<double> at;
  std::vector<double> weights;
  for (std::size_t i = 0; i < side.trials.size(); ++i) {
    if (!side.trials[i].pose.agrees) continue;
    parts.push_back(i);
    at.push_back(static_cast<double>(i));
    turns.push_back(rotation_log(whole.rigid().quaternion().conjugate() *
                                 side.trials[i].own.rigid().quaternion()));
    weights.push_back(side.trials[i].decisive ? 1.0 : 0.25);
    bend.displacement = std::max(bend.displacement,
                                 agree.distance(i, side.trials[i].own, whole) *
                                     (side.role == MapRole::kSource ? 1.0 : 1.0 / whole.scale()));
  }
  bend.first = side.trials[parts.front()].pose.middle;
  bend.last = side.trials[parts.back()].pose.middle;
  const std::vector<Eigen::Vector3d> curve = smoothed(turns, at, weights);
  const auto angle = [&](std::size_t a, std::size_t b) {
    return rotation_exp(curve[a]).angularDistance(rotation_exp(curve[b]));
  };
  for (std::size_t i = 0; i < curve.size(); ++i) {
    for (std::size_t j = i + 1; j < curve.size(); ++j) {
      bend.rotation_rad = std::max(bend.rotation_rad, angle(i, j));
    }
  }
  // The shortest stretch with most of the bend.
  std::size_t shortest = curve.size();
  for (std::size_t i = 0; i < curve.size(); ++i) {
    for (std::size_t j = i + 1; j < curve.size(); ++j) {
      if (angle(i, j) < kMostOfBend * bend.rotation_rad || j - i >= shortest) continue;
      shortest = j - i;
      bend.first = side.trials[parts[i]].pose.middle;
      bend.last = side.trials[parts[j]].pose.middle;
    }
  }
  return bend;
}

// The single pose, other_from_own, that best fits the landmarks as placed by their parts.
Similarity3 single_pose(const Side& side, bool free_scale) {
  std::vector<Eigen::Vector3d> here;
  std::vector<Eigen::Vector3d> there;
  for (std::size_t i = 0; i < side.trials.size(); ++i) {
    for (const Eigen::Vector3d& point : side.points(i)) {
      here.push_back(point);
      there.emplace_back(side.trials[i].own * point);
    }
  }
  return Similarity3::from_matrix(least_squares_similarity(here, there, free_scale));
}

// Covariance of the single pose, with the scale: the mean covariance within the parts, and the scatter
// of the parts' poses about the single pose.
std::optional<Matrix7d> spread_of(const Side& side, const Similarity3& whole) {
  Matrix7d sum = Matrix7d::Zero();
  double count = 0.0;
  double known = 0.0;
  Matrix7d within = Matrix7d::Zero();
  for (const Trial& trial : side.trials) {
    if (!trial.pose.agrees) continue;
    const Vector7d off = pose_difference(whole, *trial.pose.target_from_source);
    sum += off * off.transpose();
    ++count;
    if (!trial.covariance || !trial.decisive) continue;
    // That of the part's own pose, carried to the whole's.
    within += covariance_at_point(*trial.covariance,
                                  whole.translation() - trial.pose.found->translation());
    ++known;
  }
  if (known == 0.0) return std::nullopt;
  const Matrix7d covariance = sum / count + within / known;
  return Matrix7d(0.5 * (covariance + covariance.transpose()));
}

void conclude(Side& side, const Agreement& agree, bool free_scale, PartsAlignment& result) {
  spread_consensus(side, agree);
  const Similarity3 whole = single_pose(side, free_scale);
  result.consensus = true;
  result.target_from_source = side.own(whole);
  result.bend = bend_of(side, whole, agree);
  if (const auto covariance = spread_of(side, *result.target_from_source)) {
    result.covariance = Matrix6d(covariance->topLeftCorner<6, 6>());
    if (free_scale) result.covariance_with_scale = covariance;
  }
  for (const std::size_t part : side.decisive) {
    result.probability = std::max(result.probability, side.trials[part].pose.probability);
  }
}

}  // namespace

PartsAlignment place_by_parts(const PreparedMap& source, const PreparedMap& target,
                              const AlignOptions& options, const Execution& execution) {
  PartsAlignment result;
  const bool described =
      source.cloud().landmarks().descriptors && target.cloud().landmarks().descriptors;
  if (!described) return result;
  std::vector<Side> sides = {{MapRole::kSource, &source, &target},
                             {MapRole::kTarget, &target, &source}};
  if (source.parts()->prepared().empty() || target.parts()->prepared().empty()) return result;
  // The parts run in parallel, each on one thread.
  const Execution of_part{.stop = execution.stop, .seed = execution.seed};
  for (Side& side : sides) {
    const auto parts = side.map->parts()->prepared();
    side.trials.resize(parts.size());
    execution.executor.for_blocks(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (execution.stop.stop_requested()) return;
        side.trials[i] = trial(side, parts[i], options, of_part);
      }
    });
    if (execution.stop.stop_requested()) return {};
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (side.trials[i].decisive) side.decisive.push_back(i);
    }
  }
  const std::vector<Agreement> agreements = {Agreement(sides[0]), Agreement(sides[1])};
  for (std::size_t i = 0; i < 2; ++i) {
    sides[i].consistent = consistent(sides[i], agreements[i]);
    result.aligned += sides[i].decisive.size();
  }
  std::optional<std::size_t> chosen;
  bool disagree = false;
  bool one_agrees = false;
  for (std::size_t i = 0; i < 2; ++i) {
    const bool contradicted = contradicts(sides[i], agreements[i], sides[1 - i]);
    disagree = disagree || contradicted ||
               (sides[i].decisive.size() >= kFewestParts && !sides[i].consistent);
    if (!sides[i].consistent || contradicted) continue;
    one_agrees = true;
    if (!independent(sides[i])) continue;
    // If both maps qualify, chooses the one whose bend explains the poses of the other's parts.
    if (!chosen || unexplained(sides[i], sides[1 - i]) < unexplained(sides[*chosen], sides[i])) {
      chosen = i;
    }
  }
  result.contradictory = disagree && !one_agrees;
  if (chosen) conclude(sides[*chosen], agreements[*chosen], options.scale.has_value(), result);
  for (Side& side : sides) {
    for (Trial& trial : side.trials) result.parts.push_back(std::move(trial.pose));
  }
  return result;
}

namespace detail {

bool is_aligned_straightened(const PartsAlignment& parts, const PreparedMap& source,
                             const PreparedMap& target, const AlignOptions& options,
                             const Execution& execution) {
  const MapRole role = parts.bend->map;
  const bool of_source = role == MapRole::kSource;
  const PreparedMap& map = of_source ? source : target;
  const PreparedMap straight(straightened(map.cloud(), straightening(parts, map.parts()->along())),
                             to_string(role), execution);
  AlignOptions placement = options;
  placement.search = PoseSearch::kNever;
  placement.trace = false;
  const Alignment placed = PreparedPair(of_source ? straight : source,
                                        of_source ? target : straight, placement, execution)
                               .settle(*parts.target_from_source);
  return placed.verdict == Verdict::kAligned && is_decided(placed);
}

}  // namespace detail

}  // namespace cairn
