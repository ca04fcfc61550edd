// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/bends/deformed.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "cairn/alignment/detail/bends/moved_in_map.hpp"
#include "cairn/alignment/detail/bends/pose_difference.hpp"
#include "cairn/alignment/search/descriptor_matches.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"
#include "cairn/registration/neighbors/kd_tree.hpp"

namespace cairn {
namespace {

constexpr std::size_t kStarts = 3;  // poses tried
constexpr std::size_t kFolds = 5;
constexpr std::size_t kLocalPoses = 200;
// Share of the smallest and of the largest values that count as outliers.
constexpr double kOutermost = 0.05;
constexpr double kMostRotation = 20.0 * std::numbers::pi / 180.0;
constexpr double kMostScaleRatio = 1.3;
constexpr double kMostStrain = 0.23;  // e.g. of stretches by 1.6 along one axis
constexpr int kPoseSteps = 20;

// Fold of a source landmark. The clouds are in random order.
std::size_t fold_of(std::size_t landmark) {
  return landmark % kFolds;
}

// The similarity with the least sum of distances from the pairs of points: reweighted least squares.
Similarity3 closest_similarity(std::span<const Eigen::Vector3d> from,
                               std::span<const Eigen::Vector3d> to) {
  std::vector<double> weights(from.size(), 1.0);
  Similarity3 pose;
  for (int step = 0; step < kPoseSteps; ++step) {
    const Rigid3 motion = closest_motion(from, to, weights);
    double sum = 0.0;
    Eigen::Vector3d here = Eigen::Vector3d::Zero();
    Eigen::Vector3d there = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < from.size(); ++i) {
      sum += weights[i];
      here += weights[i] * (motion.quaternion() * from[i]);
      there += weights[i] * to[i];
    }
    here /= sum;
    there /= sum;
    double product = 0.0;
    double square = 0.0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      const Eigen::Vector3d arm = motion.quaternion() * from[i] - here;
      product += weights[i] * arm.dot(to[i] - there);
      square += weights[i] * arm.squaredNorm();
    }
    if (!(product > 0.0)) return {1.0, motion};
    const double scale = product / square;
    pose = Similarity3(scale, Rigid3(motion.quaternion(), there - scale * here));
    double mean = 0.0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      weights[i] = (pose * from[i] - to[i]).norm();
      mean += weights[i] / static_cast<double>(from.size());
    }
    if (!(mean > 0.0)) return pose;
    constexpr double kLeast = 1e-3;  // distance that counts, over the mean
    for (double& weight : weights) weight = 1.0 / (weight + kLeast * mean);
  }
  return pose;
}

// The deformation around a match, as the matches around it show it. Its derivative would also state what no match
// shows: across a surface, the polynomial is determined by the prior alone.
struct LocalDeformation {
  Similarity3 target_from_source;
  double strain =
      0.0;  // distance from the similarity, over distance from the centre; root mean squares
};

class LocalDeformations {
 public:
  // @param pose, from  must outlive this
  LocalDeformations(const DeformedPose& pose, const std::vector<Eigen::Vector3d>& from)
      : pose_(pose), from_(from), tree_(from), near_(std::min(kNear, from.size())) {}

  LocalDeformation at(const Eigen::Vector3d& x_in_source) {
    tree_.nearest(x_in_source, near_);
    std::vector<Eigen::Vector3d> here;
    std::vector<Eigen::Vector3d> there;
    for (const Neighbor& neighbor : near_) {
      here.push_back(from_[neighbor.index]);
      there.push_back(pose_(here.back()));
    }
    LocalDeformation local{closest_similarity(here, there)};
    const Eigen::Vector3d centre = centroid(there);
    double off = 0.0;
    double extent = 0.0;
    for (std::size_t i = 0; i < here.size(); ++i) {
      off += (local.target_from_source * here[i] - there[i]).squaredNorm();
      extent += (there[i] - centre).squaredNorm();
    }
    if (extent > 0.0) local.strain = std::sqrt(off / extent);
    return local;
  }

 private:
  static constexpr std::size_t kNear = 24;

  const DeformedPose& pose_;
  const std::vector<Eigen::Vector3d>& from_;
  KdTree tree_;
  std::vector<Neighbor> near_;
};

double quantile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Largest rotation between two of the poses, and largest ratio of their scales, without the outermost.
void measure(const std::vector<Similarity3>& local, MapDeformation& figures) {
  std::vector<double> turns = {0.0};
  std::vector<double> scales;
  for (std::size_t i = 0; i < local.size(); ++i) {
    scales.push_back(local[i].scale());
    for (std::size_t j = 0; j < i; ++j) {
      turns.push_back(local[i].rigid().quaternion().angularDistance(local[j].rigid().quaternion()));
    }
  }
  figures.rotation_rad = quantile(std::move(turns), 1.0 - kOutermost);
  figures.scale_ratio = quantile(scales, 1.0 - kOutermost) / quantile(scales, kOutermost);
}

// How a camera moves with the landmarks that it saw, as these are deformed; with few, as the place where it is.
class CameraMotion {
 public:
  /// @param pose of the source; the motion is in its frame
  CameraMotion(const DeformedPose& pose, const Similarity3& back) : pose_(pose), back_(back) {}

  void add(const Eigen::Vector3d& landmark) {
    if (from_.size() == kMostSeen) return;
    from_.push_back(landmark);
    to_.emplace_back(back_ * pose_(landmark));
  }
  Similarity3 at(const Eigen::Vector3d& centre) const {
    if (from_.size() < kFewestSeen) return back_ * pose_.near(centre);
    return closest_similarity(from_, to_);
  }

 private:
  static constexpr std::size_t kFewestSeen = 8;
  static constexpr std::size_t kMostSeen = 200;

  const DeformedPose& pose_;
  const Similarity3& back_;
  std::vector<Eigen::Vector3d> from_;
  std::vector<Eigen::Vector3d> to_;
};

// The source's landmarks, each moved as the other folds' matches show, in the source's frame.
LandmarkCloud deformed_by_folds(const PreparedCloud& source, const DeformedPose& pose) {
  const Eigen::Vector3d& centre = source.centred()->centre;
  const Similarity3 back = pose.start.inverse();
  const Eigen::Matrix3d turn = pose.start.rigid().rotation();
  LandmarkCloud cloud = source.landmarks();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Deformation& deformation = pose.of_folds[fold_of(i)];
    const Eigen::Vector3d there = pose.start * (cloud.positions[i] + centre);
    cloud.positions[i] = back * deformation(there);
    if (cloud.covariances.empty()) continue;
    const Eigen::Matrix3d derivative = turn.transpose() * deformation.derivative(there) * turn;
    cloud.covariances[i] = derivative * cloud.covariances[i] * derivative.transpose();
  }
  for (LandmarkView& view : cloud.views) {
    CameraMotion motion(pose, back);
    for (const std::uint32_t i : view.landmarks) {
      motion.add(source.landmarks().positions[i] + centre);
    }
    view.centre = motion.at(view.centre + centre) * (view.centre + centre);
  }
  return cloud;
}

}  // namespace

DeformablePair::DeformablePair(const PreparedCloud& source, const PreparedCloud& target)
    : source_(&source),
      target_(&target),
      matches_(
          std::make_shared<DescriptorMatches>(CentredPair(source.centred(), target.centred()))) {}

Eigen::Vector3d DeformablePair::source_place(std::size_t match) const {
  return matches_->source_places()[match] + source_->centred()->centre;
}

Eigen::Vector3d DeformablePair::target_place(std::size_t match) const {
  return matches_->target_places()[match] + target_->centred()->centre;
}

// @param without fold whose matches take no part
std::optional<DeformationFit> DeformablePair::fitted(const Similarity3& start,
                                                     std::optional<std::size_t> without) const {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  for (std::size_t i = 0; i < matches_->all().size(); ++i) {
    if (without && fold_of(matches_->all()[i].source) == *without) continue;
    from.push_back(start * source_place(i));
    to.push_back(target_place(i));
  }
  std::vector<Eigen::Vector3d> region;
  for (const Eigen::Vector3d& position : source_->landmarks().positions) {
    region.emplace_back(start * (position + source_->centred()->centre));
  }
  return fit_deformation(from, to, region);
}

std::optional<DeformedPose> DeformablePair::described(const Similarity3& start,
                                                      const DeformationFit& fit,
                                                      std::vector<Deformation> of_folds) const {
  DeformedPose result;
  result.start = start;
  result.deformation = fit.deformation;
  result.of_folds = std::move(of_folds);
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  std::vector<double> deformed;  // distances under the other folds' deformation
  for (const std::size_t i : fit.inliers) {
    from.push_back(source_place(i));
    to.push_back(target_place(i));
    const Deformation& other = result.of_folds[fold_of(matches_->all()[i].source)];
    deformed.push_back((other(start * from.back()) - to.back()).norm());
  }
  const Similarity3& whole = result.target_from_source = closest_similarity(from, to);
  std::vector<double> single;
  std::vector<Similarity3> local;
  std::vector<double> strains;
  LocalDeformations deformations(result, from);
  const std::size_t step = std::max<std::size_t>(1, from.size() / kLocalPoses);
  std::size_t folds = 0;
  double squares = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    single.push_back((whole * from[i] - to[i]).norm());
    squares += single.back() * single.back();
    if (i % step != 0) continue;
    if (result.deformation.folds(start * from[i])) ++folds;
    const LocalDeformation here = deformations.at(from[i]);
    local.push_back(here.target_from_source);
    strains.push_back(here.strain);
    const Vector7d off = pose_difference(whole, local.back());
    result.spread += off * off.transpose();
  }
  result.spread /= static_cast<double>(local.size());
  if (static_cast<double>(folds) > kOutermost * static_cast<double>(local.size())) {
    return std::nullopt;
  }
  result.figures.matches = from.size();
  result.figures.displacement = std::sqrt(squares / static_cast<double>(from.size()));
  measure(local, result.figures);
  result.is_small = result.figures.rotation_rad <= kMostRotation &&
                    result.figures.scale_ratio <= kMostScaleRatio &&
                    quantile(std::move(strains), 1.0 - kOutermost) <= kMostStrain;
  const double median = quantile(std::move(single), 0.5);
  if (median > 0.0) result.residual = quantile(std::move(deformed), 0.5) / median;
  return result;
}

std::optional<DeformedPose> DeformablePair::fit(std::span<const Similarity3> starts) const {
  std::optional<DeformationFit> best;
  Similarity3 start;
  for (const Similarity3& pose : starts.first(std::min(kStarts, starts.size()))) {
    std::optional<DeformationFit> fit = fitted(pose);
    if (!fit || (best && fit->inliers.size() <= best->inliers.size())) continue;
    best = std::move(fit);
    start = pose;
  }
  if (!best || best->inliers.empty()) return std::nullopt;
  std::vector<Deformation> of_folds;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    const std::optional<DeformationFit> fit = fitted(start, fold);
    if (!fit) return std::nullopt;
    of_folds.push_back(fit->deformation);
  }
  return described(start, *best, std::move(of_folds));
}

PlacementResult DeformablePair::judge(const DeformedPose& pose, const PlaceOptions& options) const {
  PlaceOptions placement = options;
  placement.search = PoseSearch::kNever;
  placement.trace = false;
  const PreparedCloud source(deformed_by_folds(*source_, pose), options.seed,
                             options.execution.executor, "source");
  PlacementResult placed = PreparedPair(source, *target_, placement).settle(pose.start);
  const bool decisive = !placed.candidates.empty() && placed.candidates.front().support.agreement &&
                        placed.candidates.front().support.agreement->spread >= kDecisiveAgreement;
  if (placed.verdict == Verdict::kAligned && !(decisive && pose.is_small)) {
    placed.verdict = Verdict::kAmbiguous;
  }
  return placed;
}

LandmarkMap deformed(const LandmarkMap& source, const DeformedPose& pose) {
  const Similarity3 back = pose.target_from_source.inverse();
  MapTables tables = LandmarkMap(source).tables();
  std::vector<CameraMotion> motions(source.frame_count(), CameraMotion(pose, back));
  for (std::uint32_t i = 0; i < source.landmark_count(); ++i) {
    for (const FrameIndex frame : source.observing_frames(LandmarkIndex{i})) {
      motions[frame.value].add(source.landmarks().positions[i]);
    }
  }
  for (std::size_t i = 0; i < motions.size(); ++i) {
    move_keyframe(tables.frames, i, motions[i].at(tables.frames.translations[i]));
  }
  for (std::size_t i = 0; i < tables.landmarks.positions.size(); ++i) {
    move_landmark(tables.landmarks, source.has_covariances(), i,
                  back * pose.near(tables.landmarks.positions[i]));
  }
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn
