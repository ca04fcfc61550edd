// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/adjustment/adjust.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <utility>

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <fmt/format.h>

#include "cairn/adjustment/detail/costs.hpp"
#include "cairn/adjustment/detail/frame_groups.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {

using namespace detail;  // what the least-squares problem is made of

namespace {

// 95 % quantiles of chi-squared distributions.
constexpr double kPixel95 = 5.991;  // two degrees of freedom
constexpr double kDepth95 = 3.841;

struct PixelMeasure {
  const Camera* camera;
  CameraProjection projection;
  Eigen::Vector2d pixel;
  double sigma_px;
  const Rigid3* camera_from_lead;  // null for the lead itself

  std::optional<SeenPoint> operator()(const Eigen::Vector3d& x_in_lead) const {
    return seen_from_body(camera_from_lead, x_in_lead, [&](const Eigen::Vector3d& x_in_camera) {
      return seen_pixel(projection, camera->parameters.data(), pixel, sigma_px, x_in_camera);
    });
  }
};

struct DepthMeasure {
  double depth;
  double sigma;
  const Rigid3* camera_from_lead;

  std::optional<SeenPoint> operator()(const Eigen::Vector3d& x_in_lead) const {
    return seen_from_body(camera_from_lead, x_in_lead, [&](const Eigen::Vector3d& x_in_camera) {
      return seen_depth(depth, sigma, x_in_camera);
    });
  }
};

class StopWhenAsked final : public ceres::IterationCallback {
 public:
  StopWhenAsked(const Execution& execution, int max_iterations)
      : execution_(execution), max_iterations_(max_iterations) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (execution_.progress) {
      execution_.progress(static_cast<double>(summary.iteration) / max_iterations_);
    }
    return execution_.stop.stop_requested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const Execution& execution_;
  int max_iterations_;
};

// Prior standard deviations of a calibration. Without a prior, parameters that the observations hardly
// determine (e.g. three radial ones of a narrow lens) would diverge together with others.
ceres::Vector calibration_deviations(const Camera& camera) {
  constexpr double kFocal = 0.02;       // of it
  constexpr double kCentre = 0.01;      // of the image's size
  constexpr double kDistortion = 0.05;  // each parameter
  const Eigen::Index focal_lengths = CameraProjection(camera).focal_lengths();
  ceres::Vector deviations =
      ceres::Vector::Constant(static_cast<Eigen::Index>(camera.parameters.size()), kDistortion);
  deviations.head(focal_lengths).setConstant(kFocal * camera.parameters.front());
  deviations.segment<2>(focal_lengths).setConstant(kCentre * std::max(camera.width, camera.height));
  return deviations;
}

struct Solved {
  MapTables tables;
  bool converged = false;
  int iterations = 0;
};

using Measurements = std::vector<std::vector<Measurement>>;

// One solution of the least-squares problem.
class Adjustment {
 public:
  // Cameras start with the map's parameters; the calibration is the prior.
  Adjustment(const LandmarkMap& map, std::span<const Camera> calibration,
             const Measurements& measurements, const AdjustOptions& options,
             const Execution& execution)
      : map_(map),
        calibration_(calibration),
        measurements_(measurements),
        options_(options),
        execution_(execution),
        rigid_(rigid_frames(map.rigs(), map.frames())),
        groups_(frame_groups(map, rigid_, measurements, options.min_observations)),
        projections_(map.cameras().begin(), map.cameras().end()),
        poses_(map.frame_count()),
        points_(map.landmarks().positions) {
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      poses_[i] = to_block(map.world_from_camera(FrameIndex{i}));
    }
    for (const Camera& camera : map.cameras()) {
      first_parameter_.push_back(parameters_.size());
      parameters_.insert(parameters_.end(), camera.parameters.begin(), camera.parameters.end());
    }
  }

  Solved run();

 private:
  void add_blocks(ceres::Problem& problem, ceres::ParameterBlockOrdering& ordering);
  void add_landmark(ceres::Problem& problem, std::uint32_t landmark, ceres::LossFunction* pixel,
                    ceres::LossFunction* depth);
  void hold_scale(const FrameGroup& group);
  void carry_along(std::uint32_t landmark);
  Rigid3 pose_of(std::uint32_t frame) const {
    const Rigid3 lead = to_pose(poses_[rigid_.lead[frame]].data());
    return rigid_.leads(frame) ? lead : lead * rigid_.camera_from_lead[frame].inverse();
  }
  double* parameters_of(std::size_t camera) {
    return parameters_.data() + first_parameter_[camera];
  }
  std::vector<Camera> cameras() const;
  MapTables tables() const;

  const LandmarkMap& map_;
  std::span<const Camera> calibration_;
  const Measurements& measurements_;
  const AdjustOptions& options_;
  const Execution& execution_;
  RigidFrames rigid_;
  std::vector<FrameGroup> groups_;
  std::vector<CameraProjection> projections_;  // of the map's cameras
  // Contiguous arrays, because Ceres orders the blocks of a group by address, which must be deterministic.
  std::vector<PoseBlock> poses_;  // by frame; those that do not lead are unused
  std::vector<Eigen::Vector3d> points_;
  std::vector<double> parameters_;  // of all cameras
  std::vector<std::size_t> first_parameter_;
};

// The map's cameras with the present parameters.
std::vector<Camera> Adjustment::cameras() const {
  std::vector<Camera> cameras(map_.cameras().begin(), map_.cameras().end());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto first = parameters_.begin() + static_cast<std::ptrdiff_t>(first_parameter_[i]);
    std::copy_n(first, cameras[i].parameters.size(), cameras[i].parameters.begin());
  }
  return cameras;
}

void Adjustment::add_blocks(ceres::Problem& problem, ceres::ParameterBlockOrdering& ordering) {
  for (const FrameGroup& group : groups_) {
    for (const std::uint32_t frame : group.frames) {
      if (!rigid_.leads(frame)) continue;
      problem.AddParameterBlock(poses_[frame].data(), 7, new PoseManifold());
      ordering.AddElementToGroup(poses_[frame].data(), 1);
    }
    problem.SetParameterBlockConstant(poses_[group.frames.front()].data());
  }
  if (!options_.refine_intrinsics) return;
  std::vector<bool> is_used(calibration_.size(), false);
  for (const FrameGroup& group : groups_) {
    for (const std::uint32_t frame : group.frames) {
      is_used[map_.frames().cameras[frame]->value] = true;
    }
  }
  for (std::size_t i = 0; i < calibration_.size(); ++i) {
    if (!is_used[i]) continue;
    const std::vector<double>& expected = calibration_[i].parameters;
    problem.AddParameterBlock(parameters_of(i), static_cast<int>(expected.size()));
    ordering.AddElementToGroup(parameters_of(i), 2);  // after the poses, wherever these lie
    if (projections_[i].focal_lengths() == 0) {       // the size of a panorama is no unknown
      problem.SetParameterBlockConstant(parameters_of(i));
      continue;
    }
    const ceres::Matrix weights =
        calibration_deviations(calibration_[i]).cwiseInverse().asDiagonal();
    problem.AddResidualBlock(
        new ceres::NormalPrior(
            weights, Eigen::Map<const ceres::Vector>(expected.data(),
                                                     static_cast<Eigen::Index>(expected.size()))),
        nullptr, parameters_of(i));
  }
}

void Adjustment::add_landmark(ceres::Problem& problem, std::uint32_t landmark,
                              ceres::LossFunction* pixel, ceres::LossFunction* depth) {
  for (const Measurement& one : measurements_[landmark]) {
    const std::uint32_t frame = one.frame.value;
    double* const pose = poses_[rigid_.lead[frame]].data();
    const Rigid3* const mount = rigid_.leads(frame) ? nullptr : &rigid_.camera_from_lead[frame];
    double* const point = points_[landmark].data();
    const CameraIndex index = *map_.frames().cameras[frame];
    const Camera& camera = map_.cameras()[index.value];
    if (options_.refine_intrinsics) {
      problem.AddResidualBlock(new CalibrationCost(camera, one.pixel, one.sigma_px, mount), pixel,
                               pose, point, parameters_of(index.value));
    } else {
      problem.AddResidualBlock(
          new PointCost<PixelMeasure>(
              PixelMeasure{&camera, projections_[index.value], one.pixel, one.sigma_px, mount}),
          pixel, pose, point);
    }
    if (!one.depth) continue;
    problem.AddResidualBlock(
        new PointCost<DepthMeasure>(DepthMeasure{*one.depth, one.sigma_depth, mount}), depth, pose,
        point);
  }
}

// Scales the group so that the frame that fixes its scale has its earlier distance.
void Adjustment::hold_scale(const FrameGroup& group) {
  if (!group.scale_frame) return;
  const auto centre = [&](std::uint32_t frame) {
    return Eigen::Map<Eigen::Vector3d>(poses_[frame].data() + 4);
  };
  const auto& before = map_.frames().translations;
  const std::uint32_t first = group.frames.front();
  const Eigen::Vector3d origin = centre(first);
  const double now = (centre(*group.scale_frame) - origin).norm();
  const double scale = (before[*group.scale_frame] - before[first]).norm() / now;
  if (!(scale > 0.0) || !std::isfinite(scale)) return;
  for (const std::uint32_t frame : group.frames) {
    if (frame != first) centre(frame) = origin + scale * (centre(frame) - origin);
  }
  for (const std::uint32_t landmark : group.landmarks) {
    points_[landmark] = origin + scale * (points_[landmark] - origin);
  }
}

void Adjustment::carry_along(std::uint32_t landmark) {
  const FrameIndex frame = measurements_[landmark].front().frame;
  const Rigid3 moved = pose_of(frame.value) * map_.world_from_camera(frame).inverse();
  points_[landmark] = moved * map_.landmarks().positions[landmark];
}

Solved Adjustment::run() {
  Solved solved;
  ceres::HuberLoss pixel_loss(std::sqrt(kPixel95));
  ceres::HuberLoss depth_loss(std::sqrt(kDepth95));
  ceres::Problem::Options how;
  how.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  how.disable_all_safety_checks = true;
  ceres::Problem problem(how);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  add_blocks(problem, *ordering);
  std::size_t moving = 0;
  for (std::uint32_t l = 0; l < measurements_.size(); ++l) {
    if (measurements_[l].size() < options_.min_observations) continue;
    problem.AddParameterBlock(points_[l].data(), 3);
    ordering->AddElementToGroup(points_[l].data(), 0);
    add_landmark(problem, l, &pixel_loss, &depth_loss);
    ++moving;
  }
  if (moving == 0) {
    solved.tables = tables();
    solved.converged = true;
    return solved;
  }
  constexpr std::size_t kFewFrames = 40;
  ceres::Solver::Options solve;
  solve.linear_solver_type =
      map_.frame_count() > kFewFrames ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
  solve.linear_solver_ordering = ordering;
  solve.max_num_iterations = options_.max_iterations;
  solve.num_threads = 1;  // sums in a fixed order
  solve.logging_type = ceres::SILENT;
  // No residual holds the scale of a group without depths, only the damping does, which is inverse to this. With the
  // default the normal equations become singular to rounding, and Ceres prints that.
  solve.max_trust_region_radius = 1e8;
  StopWhenAsked stop(execution_, options_.max_iterations);
  solve.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(solve, &problem, &summary);
  if (execution_.stop.stop_requested()) {
    throw Error(ErrorKind::kCancelled, "adjustment", "was cancelled", "");
  }
  solved.iterations = summary.num_successful_steps + summary.num_unsuccessful_steps;
  solved.converged = summary.termination_type == ceres::CONVERGENCE;
  for (const Camera& camera : cameras()) {
    if (!camera_defect(camera).empty()) solved.converged = false;
  }
  if (!summary.IsSolutionUsable() || (!solved.converged && options_.refine_intrinsics &&
                                      summary.termination_type == ceres::CONVERGENCE)) {
    LandmarkMap same = map_;
    solved.tables = std::move(same).tables();
    return solved;
  }
  for (std::uint32_t l = 0; l < measurements_.size(); ++l) {
    const bool moved = measurements_[l].size() >= options_.min_observations;
    // A landmark that the observations do not determine has an arbitrary position.
    if (measurements_[l].empty() || (moved && are_coordinates(points_[l]))) continue;
    carry_along(l);
  }
  for (const FrameGroup& group : groups_) hold_scale(group);
  solved.tables = tables();
  return solved;
}

MapTables Adjustment::tables() const {
  LandmarkMap copy = map_;
  MapTables tables = std::move(copy).tables();
  tables.info.uuid.reset();
  tables.cameras = cameras();
  for (const FrameGroup& group : groups_) {
    for (const std::uint32_t frame : group.frames) {
      if (frame == group.frames.front()) continue;  // as read, to the last digit
      const Rigid3 pose = pose_of(frame);
      const Eigen::Quaterniond q = pose.quaternion();
      tables.frames.translations[frame] = pose.translation();
      tables.frames.quaternions[frame] = {q.w(), q.x(), q.y(), q.z()};
    }
  }
  tables.landmarks.positions = points_;
  return tables;
}

double rms_px(const LandmarkMap& map, const Measurements& measurements,
              std::size_t min_observations) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t l = 0; l < measurements.size(); ++l) {
    if (measurements[l].size() < min_observations) continue;
    for (const Measurement& one : measurements[l]) {
      const auto squared = squared_residuals(map, one, map.landmarks().positions[l]);
      if (!squared) continue;
      sum += squared->pixel * one.sigma_px * one.sigma_px;
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

LandmarkMap with_rigs_held(LandmarkMap map) {
  MapTables tables = std::move(map).tables();
  hold_rigs(tables);
  return LandmarkMap(std::move(tables));
}

LandmarkMap without_covariances(LandmarkMap map) {
  MapTables tables = std::move(map).tables();
  tables.landmarks.covariances.clear();
  tables.frames.pose_covariances.clear();
  return LandmarkMap(std::move(tables));
}

}  // namespace

void AdjustOptions::validate() const {
  if (noise) noise->validate();
  refuse_if(max_iterations < 1, "AdjustOptions.max_iterations", fmt::format("{}", max_iterations),
            "at least 1");
  refuse_if(min_observations < 1, "AdjustOptions.min_observations",
            fmt::format("{}", min_observations), "at least 1");
}

AdjustResult adjust(const LandmarkMap& map, const AdjustOptions& options,
                    const Execution& execution) {
  options.validate();
  AdjustResult result;
  result.map = with_rigs_held(map);
  result.noise = options.noise ? *options.noise : estimated_noise(result.map);
  // The noise is known after a first adjustment only.
  const int rounds = options.noise ? 1 : 2;
  for (int round = 0; round < rounds; ++round) {
    if (round > 0) result.noise = estimated_noise(result.map, result.noise);
    const Measurements measurements = measurements_of(result.map, result.noise);
    if (round == 0) {
      for (const auto& landmark : measurements) {
        if (landmark.size() >= options.min_observations) result.observations += landmark.size();
      }
      result.unusable = map.observation_count() - result.observations;
      result.initial_rms_px = rms_px(result.map, measurements, options.min_observations);
    }
    Solved solved = Adjustment(result.map, map.cameras(), measurements, options, execution).run();
    result.map = LandmarkMap(std::move(solved.tables));
    result.converged = solved.converged;
    result.iterations += solved.iterations;
    result.final_rms_px = rms_px(result.map, measurements, options.min_observations);
  }
  if (options.covariances) {
    CovarianceOptions how;
    how.noise = result.noise;
    try {
      EstimatedCovariances estimated =
          estimate_covariances(result.map, how, execution.without_progress());
      result.map = std::move(estimated.map);
      result.covariance_references = std::move(estimated.references);
    } catch (const Error& error) {
      // The map itself was accepted above; an adjustment that took hours is worth more than its covariances.
      if (error.kind() != ErrorKind::kInput) throw;
      result.why_no_covariances = error.what();
    }
  }
  if (result.covariance_references.empty()) result.map = without_covariances(std::move(result.map));
  return result;
}

}  // namespace cairn
