// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/hand_eye.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

constexpr int kUnknowns = 14;  // hand-eye 6, world 6, log scale, clock
constexpr int kLogScale = 12;
constexpr int kClock = 13;
constexpr std::size_t kFewestPoses = 30;
constexpr double kMaxGap = 0.1;  // over which the truth is interpolated, seconds

using Vector14 = Eigen::Matrix<double, kUnknowns, 1>;
using Matrix14 = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Residual = Eigen::Matrix<double, 6, 1>;
using Derivative = Eigen::Matrix<double, 6, kUnknowns>;

struct State {
  Rigid3 body_from_camera;
  Rigid3 truth_from_estimate;
  double log_scale = 0.0;
  double clock_offset_s = 0.0;

  State moved(const Vector14& step) const {
    return {body_from_camera.perturbed(step.segment<6>(0)),
            truth_from_estimate.perturbed(step.segment<6>(6)), log_scale + step[kLogScale],
            clock_offset_s + step[kClock]};
  }
};

struct Pair {
  Rigid3 world_from_camera;  // of the estimate
  Rigid3 world_from_body;    // of the truth
};

std::vector<Pair> pairs_at(const Trajectory& estimate, const Trajectory& truth,
                           double clock_offset_s, double max_gap_s) {
  std::vector<Pair> pairs;
  for (const TimedPose& pose : estimate.poses()) {
    const auto body = interpolated(truth, pose.timestamp_s + clock_offset_s, max_gap_s);
    if (body) pairs.push_back({pose.world_from_camera, *body});
  }
  return pairs;
}

// The shortest x with the least |rows·x - goal|.
Vector7d least_squares(const Eigen::Matrix<double, Eigen::Dynamic, 7>& rows,
                       const Eigen::VectorXd& goal) {
  constexpr double kOpen = 1e-12;
  const SymmetricEigen<7> normal = symmetric_eigen<7>(rows.transpose() * rows);
  Eigen::Matrix<double, 7, 1> along = normal.vectors.transpose() * (rows.transpose() * goal);
  for (int i = 0; i < 7; ++i) {
    along[i] = normal.values[i] > kOpen * normal.values[6] ? along[i] / normal.values[i] : 0.0;
  }
  return normal.vectors * along;
}

// Closed-form solution for given pairs, with the mean squared residual angle.
std::pair<State, double> start_from(const std::vector<Pair>& pairs, bool with_scale) {
  // Relative motions satisfy A·X = X·B, so the axis of A is that of B, rotated by X.
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const std::size_t apart : {std::size_t{1}, pairs.size() / 20, pairs.size() / 5}) {
    if (apart == 0) continue;
    for (std::size_t i = 0; i + apart < pairs.size(); ++i) {
      const auto turn = [&](const Rigid3& a, const Rigid3& b) {
        return rotation_log(a.quaternion().conjugate() * b.quaternion());
      };
      sum += turn(pairs[i].world_from_body, pairs[i + apart].world_from_body) *
             turn(pairs[i].world_from_camera, pairs[i + apart].world_from_camera).transpose();
    }
  }
  const Eigen::Matrix3d turn = nearest_rotation(singular_values(sum));
  Eigen::Matrix3d worlds = Eigen::Matrix3d::Zero();
  for (const Pair& pair : pairs) {
    worlds +=
        pair.world_from_body.rotation() * turn * pair.world_from_camera.rotation().transpose();
  }
  const Eigen::Matrix3d world = nearest_rotation(singular_values(worlds));
  double squared_angles = 0.0;
  // Body + R_body·t_hand = s·W·t_camera + t_world, linear in the two t and s.
  const auto rows = static_cast<Eigen::Index>(3 * pairs.size());
  Eigen::Matrix<double, Eigen::Dynamic, 7> design(rows, 7);
  Eigen::VectorXd goal(rows);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Matrix3d body = pairs[i].world_from_body.rotation();
    const Eigen::Vector3d camera = world * pairs[i].world_from_camera.translation();
    const auto row = static_cast<Eigen::Index>(3 * i);
    design.block<3, 3>(row, 0) = body;
    design.block<3, 3>(row, 3) = -Eigen::Matrix3d::Identity();
    design.block<3, 1>(row, 6) = with_scale ? Eigen::Vector3d(-camera) : Eigen::Vector3d::Zero();
    goal.segment<3>(row) =
        (with_scale ? Eigen::Vector3d::Zero() : camera) - pairs[i].world_from_body.translation();
    const Rigid3 off(
        Eigen::Matrix3d(world * pairs[i].world_from_camera.rotation() * (body * turn).transpose()),
        Eigen::Vector3d::Zero());
    squared_angles += off.angle() * off.angle();
  }
  const Vector7d solution = least_squares(design, goal);
  State state;
  state.body_from_camera = Rigid3(turn, solution.head<3>());
  state.truth_from_estimate = Rigid3(world, solution.segment<3>(3));
  if (with_scale) state.log_scale = std::log(std::max(1e-9, solution[6]));
  return {state, squared_angles / static_cast<double>(pairs.size())};
}

// Residual of the body's pose from the estimate versus the true one.
Residual residual_of(const State& state, const Rigid3& world_from_camera,
                     const Rigid3& world_from_body) {
  const Similarity3 worlds(std::exp(state.log_scale), state.truth_from_estimate);
  const Rigid3 camera_in_truth(worlds.rigid().quaternion() * world_from_camera.quaternion(),
                               worlds * world_from_camera.translation());
  const Rigid3 predicted = camera_in_truth * state.body_from_camera.inverse();
  return predicted.difference_to(world_from_body);
}

class Solver {
 public:
  Solver(const Trajectory& estimate, const Trajectory& truth, double max_clock_offset_s,
         bool with_scale)
      : estimate_(estimate),
        truth_(truth),
        max_clock_offset_s_(max_clock_offset_s),
        with_scale_(with_scale) {}

  HandEyeResult run() {
    HandEyeResult result;
    const auto too_few = [&](std::size_t poses) {
      result.reason = fmt::format(
          "{} poses of the estimate have a true pose at their time; {} are "
          "needed for the hand-eye offset",
          poses, kFewestPoses);
      return result;
    };
    const auto begin = start();
    if (!begin) return too_few(pairs_at(estimate_, truth_, 0.0, kMaxGap).size());
    State state = *begin;
    constexpr int kMostSteps = 50;
    for (int i = 0; i < kMostSteps; ++i) {
      linearise(state);
      if (residuals_.size() < kFewestPoses) return too_few(residuals_.size());
      const Vector14 move = step();
      if (!move.allFinite()) break;
      state = state.moved(move);
      constexpr double kSmall = 1e-9;
      if (move.norm() < kSmall) break;
    }
    linearise(state);
    if (residuals_.size() < kFewestPoses) return too_few(residuals_.size());

    const Matrix14 normal = normal_matrix();
    // Scaled by the diagonal, to test how well the motion separates the unknowns.
    const Vector14 root = normal.diagonal().cwiseSqrt();
    const Matrix14 scaled =
        root.cwiseInverse().asDiagonal() * normal * root.cwiseInverse().asDiagonal();
    constexpr double kLeast = 1e-5;  // eigenvalue
    const bool determined =
        scaled.allFinite() && solve_positive_definite<kUnknowns>(
                                  scaled - kLeast * Matrix14::Identity(), Vector14::Zero());
    if (!determined) {
      result.reason =
          "the motion does not determine the hand-eye offset: it needs turns about two axes or "
          "more";
      return result;
    }
    if (std::abs(state.clock_offset_s) > 1.5 * max_clock_offset_s_) {
      result.reason = fmt::format("the clocks differ by {:.3f} s, more than {:g} s",
                                  state.clock_offset_s, max_clock_offset_s_);
      return result;
    }
    const Matrix14 spread = covariance(normal);
    HandEye hand_eye;
    hand_eye.body_from_camera = state.body_from_camera;
    hand_eye.covariance = spread.topLeftCorner<6, 6>();
    hand_eye.clock_offset_s = state.clock_offset_s;
    hand_eye.clock_offset_deviation_s = std::sqrt(spread(kClock, kClock));
    hand_eye.truth_from_estimate =
        Similarity3(std::exp(state.log_scale), state.truth_from_estimate);
    hand_eye.poses = residuals_.size();
    result.hand_eye = hand_eye;
    return result;
  }

 private:
  std::optional<State> start() const {
    constexpr double kStep = 0.02;
    const int most = static_cast<int>(std::floor(max_clock_offset_s_ / kStep));
    std::optional<State> best;
    double least = std::numeric_limits<double>::max();
    for (int i = -most; i <= most; ++i) {
      const double offset = kStep * i;
      const auto pairs = pairs_at(estimate_, truth_, offset, kMaxGap);
      if (pairs.size() < kFewestPoses) continue;
      const auto [state, squared] = start_from(pairs, with_scale_);
      if (squared >= least) continue;
      least = squared;
      best = state;
      best->clock_offset_s = offset;
    }
    return best;
  }

  void linearise(const State& state) {
    residuals_.clear();
    derivatives_.clear();
    const double gap = kMaxGap;
    for (const TimedPose& pose : estimate_.poses()) {
      const double time = pose.timestamp_s + state.clock_offset_s;
      constexpr double kHalf = 0.01;  // s, of the difference that gives the body's velocity
      const auto body = interpolated(truth_, time, gap);
      const auto before = interpolated(truth_, time - kHalf, gap);
      const auto after = interpolated(truth_, time + kHalf, gap);
      if (!body || !before || !after) continue;
      Derivative derivative = Derivative::Zero();
      for (int k = 0; k < kUnknowns; ++k) {
        if (!is_free(k)) continue;
        if (k == kClock) {
          derivative.col(k) = (residual_of(state, pose.world_from_camera, *after) -
                               residual_of(state, pose.world_from_camera, *before)) /
                              (2.0 * kHalf);
          continue;
        }
        constexpr double kStep = 1e-5;
        const auto moved = [&](double step) {
          return residual_of(state.moved(step * Vector14::Unit(k)), pose.world_from_camera, *body);
        };
        derivative.col(k) = (moved(kStep) - moved(-kStep)) / (2.0 * kStep);
      }
      residuals_.push_back(residual_of(state, pose.world_from_camera, *body));
      derivatives_.push_back(derivative);
    }
    if (residuals_.size() < kFewestPoses) return;
    std::vector<double> lengths;
    std::vector<double> angles;
    for (const Residual& residual : residuals_) {
      lengths.push_back(residual.head<3>().norm());
      angles.push_back(residual.tail<3>().norm());
    }
    constexpr double kMedianOfThree = 1.5382;  // of the length of three normal numbers
    constexpr double kExact = 1e-9;
    const double sigma_length =
        std::max(kExact, upper_median(std::vector(lengths)) / kMedianOfThree);
    const double sigma_angle = std::max(kExact, upper_median(std::vector(angles)) / kMedianOfThree);
    const auto weight = [](double deviations) {
      constexpr double kUsual = 2.8;  // 95 % of the lengths of three normal numbers
      return deviations <= kUsual ? 1.0 : std::sqrt(kUsual / deviations);
    };
    for (std::size_t i = 0; i < residuals_.size(); ++i) {
      const double length = weight(lengths[i] / sigma_length) / sigma_length;
      const double angle = weight(angles[i] / sigma_angle) / sigma_angle;
      residuals_[i].head<3>() *= length;
      residuals_[i].tail<3>() *= angle;
      derivatives_[i].topRows<3>() *= length;
      derivatives_[i].bottomRows<3>() *= angle;
    }
  }

  Vector14 step() const {
    Vector14 gradient = Vector14::Zero();
    for (std::size_t i = 0; i < residuals_.size(); ++i) {
      gradient += derivatives_[i].transpose() * residuals_[i];
    }
    return -solve_symmetric<kUnknowns>(normal_matrix(), gradient);
  }

  Matrix14 normal_matrix() const {
    Matrix14 normal = Matrix14::Zero();
    for (const Derivative& derivative : derivatives_) normal += derivative.transpose() * derivative;
    for (int k = 0; k < kUnknowns; ++k) {
      if (!is_free(k)) normal(k, k) = 1.0;
    }
    return normal;
  }

  // Errors of consecutive poses are correlated. Therefore, parts of the sequence count as independent, but not
  // the poses within them.
  Matrix14 covariance(const Matrix14& normal) const {
    constexpr std::size_t kParts = 15;
    Matrix14 result = Matrix14::Zero();
    for (std::size_t part = 0; part < kParts; ++part) {
      Vector14 gradient = Vector14::Zero();
      const std::size_t end = (part + 1) * residuals_.size() / kParts;
      for (std::size_t i = part * residuals_.size() / kParts; i < end; ++i) {
        gradient += derivatives_[i].transpose() * residuals_[i];
      }
      const Vector14 by_part = solve_symmetric<kUnknowns>(normal, gradient);
      result += by_part * by_part.transpose();
    }
    return static_cast<double>(kParts) / static_cast<double>(kParts - 1) * result;
  }

  // Unknowns that are not estimated have no derivative.
  bool is_free(int unknown) const {
    return unknown == kLogScale ? with_scale_
           : unknown == kClock  ? max_clock_offset_s_ > 0.0
                                : true;
  }

  const Trajectory& estimate_;
  const Trajectory& truth_;
  double max_clock_offset_s_;
  bool with_scale_;
  // One per pose: whitened and weighted.
  std::vector<Residual> residuals_;
  std::vector<Derivative> derivatives_;
};

}  // namespace

HandEyeResult estimate_hand_eye(const Trajectory& estimate, const Trajectory& truth,
                                double max_clock_offset_s, bool with_scale) {
  detail::require(max_clock_offset_s >= 0.0 && max_clock_offset_s <= 10.0, "max_clock_offset_s",
                  max_clock_offset_s, "0 to 10 seconds");
  return Solver(estimate, truth, max_clock_offset_s, with_scale).run();
}

Trajectory corrected_truth(const Trajectory& truth, const HandEye& hand_eye) {
  std::vector<TimedPose> poses;
  poses.reserve(truth.size());
  for (const TimedPose& pose : truth.poses()) {
    poses.push_back({pose.timestamp_s - hand_eye.clock_offset_s,
                     pose.world_from_camera * hand_eye.body_from_camera});
  }
  return Trajectory(std::move(poses));
}

}  // namespace cairn
