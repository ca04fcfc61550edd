// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/map_drift.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>

#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn::detail {
namespace {

// The part of a symmetric matrix with positive eigenvalues.
Matrix6d positive_part(const Matrix6d& matrix) {
  const SymmetricEigen<6> eigen = symmetric_eigen<6>(matrix);
  return eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose();
}

// The linear map that turns the covariance `from` into `to`; the identity if they are equal.
Matrix6d recolouring(const Matrix6d& from, const Matrix6d& to) {
  constexpr double kJitter = 1e-9;  // relative; a certain keyframe's covariance is singular
  constexpr double kLeast = 1e-30;
  const Matrix6d certain = (kJitter * from.diagonal().array() + kLeast).matrix().asDiagonal();
  const Eigen::LLT<Matrix6d> of_from(from + certain);
  const Matrix6d root_of_to = Eigen::LLT<Matrix6d>(to + certain).matrixL();
  return of_from.matrixL().solve<Eigen::OnTheRight>(root_of_to);
}

}  // namespace

Vector7d length_units(double length) {
  Vector7d unit = Vector7d::Constant(1.0 / length);
  unit.head<3>().setOnes();
  return unit;
}

MapDrift::MapDrift(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks) {
  const OptionalColumn<Matrix6d>& stated = map.frames().pose_covariances;
  if (!map.has_observations() || stated.empty() || landmarks.empty()) return;
  for (const LandmarkIndex landmark : landmarks) {
    centre_ += map.landmarks().positions[landmark.value];
  }
  centre_ /= static_cast<double>(landmarks.size());
  std::vector<std::pair<Matrix6d, std::uint32_t>> keyframes;
  for (std::uint32_t frame = 0; frame < map.frame_count(); ++frame) {
    const std::optional<Matrix6d> covariance = stated[frame];
    if (!covariance) continue;
    const Eigen::Vector3d arm = centre_ - map.frames().translations[frame];
    keyframes.emplace_back(covariance_at_point(*covariance, arm), frame);
  }
  std::stable_sort(keyframes.begin(), keyframes.end(), [](const auto& a, const auto& b) {
    return a.first.diagonal().template head<3>().sum() <
           b.first.diagonal().template head<3>().sum();
  });
  const auto count = static_cast<std::uint32_t>(keyframes.size());
  std::vector<std::uint32_t> rank(map.frame_count(), count);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [covariance, frame] : keyframes) {
    middle += map.frames().translations[frame] / count;
  }
  has_exact_keyframe_ = count > 0 && keyframes.front().first.isZero(0.0);
  Matrix6d walked = Matrix6d::Zero();
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto& [covariance, frame] = keyframes[i];
    Keyframe keyframe;
    keyframe.step = positive_part(covariance - walked);
    walked += keyframe.step;
    keyframe.from_walk = recolouring(walked, covariance);
    keyframe.motion_of_frame = Matrix6d::Identity() / count;
    keyframe.motion_of_frame.topRightCorner<3, 3>() =
        -skew(map.frames().translations[frame] - middle) / count;
    keyframes_.push_back(keyframe);
    rank[frame] = i;
  }
  for (const LandmarkIndex landmark : landmarks) {
    std::vector<std::uint32_t> observing;
    for (const FrameIndex frame : map.observing_frames(landmark)) {
      if (rank[frame.value] != count) observing.push_back(rank[frame.value]);
    }
    std::sort(observing.begin(), observing.end());
    keyframe_of_.push_back(observing.empty() ? count : observing[observing.size() / 2]);
  }
}

Matrix7d MapDrift::covariance(std::span<const Term> terms, const Similarity3& from_map,
                              const Eigen::Vector3d& origin, bool free_scale) const {
  constexpr double kDamping = 1e-9;
  const std::size_t count = keyframes_.size();
  const int freedoms = free_scale ? 7 : 6;
  const Eigen::Vector3d pivot = from_map * centre_;
  // The information that each keyframe's landmarks give; those without a keyframe come last and do not drift.
  std::vector<Matrix7d> information(count + 1, Matrix7d::Zero());
  for (const Term& term : terms) {
    const auto derivative = point_by_pose(term.place - pivot);
    information[keyframe_of_[term.landmark]] += term.weight * derivative.transpose() * derivative;
  }
  Matrix7d all = Matrix7d::Zero();
  for (const Matrix7d& part : information) all += part;
  if (!(all(0, 0) > 0.0)) return Matrix7d::Zero();
  const double length = std::sqrt(all.diagonal().segment<3>(3).sum() / (2.0 * all(0, 0)));
  const Vector7d unit = length_units(std::max(length, 1e-12));
  const Matrix7d scaled = unit.asDiagonal() * all * unit.asDiagonal();
  Eigen::MatrixXd used = scaled.topLeftCorner(freedoms, freedoms);
  used.diagonal().array() += kDamping * used.trace();
  const Eigen::LDLT<Eigen::MatrixXd> solver(used);

  Matrix6d turned = Matrix6d::Zero();
  turned.topLeftCorner<3, 3>() = from_map.linear();
  turned.bottomRightCorner<3, 3>() = from_map.rigid().rotation();
  Matrix7d covariance = Matrix7d::Zero();
  // How the pose, and the map's frame, follow a step of the walk: by this keyframe and all less certain ones.
  Eigen::MatrixXd of_pose = Eigen::MatrixXd::Zero(freedoms, 6);
  Matrix6d of_frame = Matrix6d::Zero();
  for (std::size_t i = count; i-- > 0;) {
    const Keyframe& keyframe = keyframes_[i];
    const Eigen::MatrixXd moved = (unit.asDiagonal() * information[i]).topLeftCorner(freedoms, 6);
    const Eigen::MatrixXd own = unit.head(freedoms).asDiagonal() * solver.solve(moved);
    of_pose += own * turned * keyframe.from_walk;
    of_frame += turned * keyframe.motion_of_frame * keyframe.from_walk;
    const bool is_error_of_views = i == 1 && has_exact_keyframe_;
    Eigen::MatrixXd response = of_pose;
    if (!is_error_of_views) response.topRows(6) -= of_frame;
    covariance.topLeftCorner(freedoms, freedoms) += response * keyframe.step * response.transpose();
  }
  covariance = covariance_at_point(covariance, origin - pivot);
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace cairn::detail
