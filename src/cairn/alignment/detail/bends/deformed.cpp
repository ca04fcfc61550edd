// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/detail/bends/deformation.hpp"
#include "cairn/alignment/detail/bends/motion_field.hpp"
#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

namespace cairn {
namespace {

using namespace detail;

constexpr std::size_t kStarts = 3;  // poses tried
constexpr std::size_t kFolds = 5;
constexpr std::size_t kLocalPoses = 200;
// Share of the smallest and of the largest values that count as outliers.
constexpr double kOutermost = 0.05;
constexpr double kMostRotation = 20.0 * std::numbers::pi / 180.0;
constexpr double kMostScaleRatio = 1.3;
constexpr double kMostStrain = 0.23;  // e.g. of stretches by 1.6 along one axis

// Fold of a source landmark. The clouds are in random order.
std::size_t fold_of(std::size_t landmark) {
  return landmark % kFolds;
}

// The deformation around a match, fitted to the matches around it. The derivative of the polynomial is not used,
// because across a surface only the prior determines it.
struct LocalDeformation {
  Similarity3 target_from_source;
  double strain =
      0.0;  // distance from the similarity, over distance from the centre; root mean squares
};

class LocalDeformations {
 public:
  // @param pose, from  must outlive this
  LocalDeformations(const CrossFittedDeformation& pose, const std::vector<Eigen::Vector3d>& from)
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

  const CrossFittedDeformation& pose_;
  const std::vector<Eigen::Vector3d>& from_;
  BatchTree tree_;
  std::vector<Neighbor> near_;
};

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
  figures.rotation_rad = lower_quantile(std::move(turns), 1.0 - kOutermost);
  figures.scale_ratio =
      lower_quantile(scales, 1.0 - kOutermost) / lower_quantile(scales, kOutermost);
}

// The source's landmarks in the source's frame, each moved by the deformation fitted to the matches of the other
// folds.
LandmarkCloud deformed_by_folds(const PreparedCloud& source, const CrossFittedDeformation& pose) {
  const Eigen::Vector3d& centre = source.centre();
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

DeformablePair::DeformablePair(const PreparedMap& source, const PreparedMap& target)
    : source_(source),
      target_(target),
      matches_(std::make_shared<DescriptorMatches>(source.cloud().landmarks(),
                                                   target.cloud().landmarks())) {}

Eigen::Vector3d DeformablePair::source_place(std::size_t match) const {
  return matches_->source_places()[match] + source_.cloud().centre();
}

Eigen::Vector3d DeformablePair::target_place(std::size_t match) const {
  return matches_->target_places()[match] + target_.cloud().centre();
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
  for (const Eigen::Vector3d& position : source_.cloud().landmarks().positions) {
    region.emplace_back(start * (position + source_.cloud().centre()));
  }
  return fit_deformation(from, to, region);
}

std::optional<DeformedPose> DeformablePair::described(const DeformationFit& fit,
                                                      CrossFittedDeformation deformation) const {
  DeformedPose result;
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  std::vector<double> deformed;  // distances under the other folds' deformation
  for (const std::size_t i : fit.inliers) {
    from.push_back(source_place(i));
    to.push_back(target_place(i));
    const Deformation& other = deformation.of_folds[fold_of(matches_->all()[i].source)];
    deformed.push_back((other(deformation.start * from.back()) - to.back()).norm());
  }
  const Similarity3& whole = result.target_from_source = closest_similarity(from, to);
  std::vector<double> single;
  std::vector<Similarity3> local;
  std::vector<double> strains;
  LocalDeformations deformations(deformation, from);
  const std::size_t step = std::max<std::size_t>(1, from.size() / kLocalPoses);
  std::size_t folds = 0;
  double squares = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    single.push_back((whole * from[i] - to[i]).norm());
    squares += single.back() * single.back();
    if (i % step != 0) continue;
    if (deformation.deformation.folds(deformation.start * from[i])) ++folds;
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
                    lower_quantile(std::move(strains), 1.0 - kOutermost) <= kMostStrain;
  const double median = lower_quantile(std::move(single), 0.5);
  if (median > 0.0) result.residual = lower_quantile(std::move(deformed), 0.5) / median;
  result.deformation = std::make_shared<const CrossFittedDeformation>(std::move(deformation));
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
  CrossFittedDeformation deformation{start, best->deformation};
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    const std::optional<DeformationFit> fit = fitted(start, fold);
    if (!fit) return std::nullopt;
    deformation.of_folds.push_back(fit->deformation);
  }
  return described(*best, std::move(deformation));
}

Alignment DeformablePair::judge(const DeformedPose& pose, const AlignOptions& options,
                                const Execution& execution) const {
  AlignOptions placement = options;
  placement.search = PoseSearch::kNever;
  placement.trace = false;
  const PreparedMap source(deformed_by_folds(source_.cloud(), *pose.deformation), "source",
                           execution);
  Alignment placed =
      PreparedPair(source, target_, placement, execution).settle(pose.deformation->start);
  if (placed.verdict == Verdict::kAligned && !(is_decided(placed) && pose.is_small)) {
    placed.verdict = Verdict::kAmbiguous;
    placed.target_from_source.reset();
  }
  return placed;
}

}  // namespace cairn
