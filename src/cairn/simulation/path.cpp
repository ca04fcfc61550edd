// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/path.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/geometry/detail/pose_between.hpp"

namespace cairn {
namespace {

using Eigen::Vector3d;

double microseconds(double seconds) {
  return std::round(seconds * 1e6) / 1e6;
}

// A smooth wobble in three coordinates: a few sines of incommensurable frequencies.
class Wobble {
 public:
  // Standard deviation of each coordinate; frequencies in hertz.
  Wobble(double deviation, double lowest, double highest, Random& random) {
    for (int axis = 0; axis < 3; ++axis) {
      for (Sine& sine : sines_[static_cast<std::size_t>(axis)]) {
        sine.frequency = random.uniform(lowest, highest);
        sine.phase = random.uniform(0.0, 2.0 * std::numbers::pi);
        // Slow sway is wider than quick tremble.
        sine.amplitude = deviation * std::sqrt(2.0 / kSines) * std::sqrt(lowest / sine.frequency);
      }
    }
  }

  Vector3d at(double time) const {
    Vector3d sum = Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      for (const Sine& sine : sines_[static_cast<std::size_t>(axis)]) {
        sum[axis] +=
            sine.amplitude * std::sin(2.0 * std::numbers::pi * sine.frequency * time + sine.phase);
      }
    }
    return sum;
  }

 private:
  static constexpr int kSines = 5;
  struct Sine {
    double frequency = 1.0;
    double phase = 0.0;
    double amplitude = 0.0;
  };
  std::array<std::array<Sine, kSines>, 3> sines_;
};

using Route = std::function<Viewpoint(double time)>;

// Catmull-Rom spline between b and c.
Vector3d spline(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d,
                double t) {
  return 0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t +
                (3.0 * b - a - 3.0 * c + d) * t * t * t);
}

Vector3d jitter(double size, Random& random) {
  const double x = random.uniform(-size, size);
  const double y = random.uniform(-size, size);
  return {x, y, random.uniform(-size, size)};
}

// Through the viewpoints to the last one and back to the first, again and again.
Route sweep_route(const CameraStage& stage, Random& random) {
  std::vector<Viewpoint> stops = stage.sweep;
  for (Viewpoint& stop : stops) {
    stop.position += jitter(0.06, random);
    stop.target += jitter(0.1, random);
  }
  for (std::size_t i = stops.size() - 2; i > 0; --i) {
    Viewpoint back = stops[i];
    back.position += jitter(0.05, random);
    back.target += jitter(0.15, random);
    stops.push_back(back);
  }
  constexpr double kSpeed = 0.35;      // m/s
  constexpr double kTurnSpeed = 0.45;  // rad/s
  std::vector<double> starts = {0.0};
  for (std::size_t i = 0; i < stops.size(); ++i) {
    const Viewpoint& from = stops[i];
    const Viewpoint& to = stops[(i + 1) % stops.size()];
    const Vector3d a = (from.target - from.position).normalized();
    const Vector3d b = (to.target - to.position).normalized();
    const double turn = std::acos(std::clamp(a.dot(b), -1.0, 1.0));
    const double distance = (to.position - from.position).norm();
    starts.push_back(starts.back() + std::max({0.8, distance / kSpeed, turn / kTurnSpeed}));
  }
  const double phase = random.uniform(0.0, starts.back());
  return [stops, starts, phase](double time) {
    const double at = std::fmod(time + phase, starts.back());
    const auto next = std::upper_bound(starts.begin() + 1, starts.end() - 1, at);
    const auto i = static_cast<std::size_t>(next - starts.begin()) - 1;
    const double t = (at - starts[i]) / (starts[i + 1] - starts[i]);
    const std::size_t n = stops.size();
    const Viewpoint& a = stops[(i + n - 1) % n];
    const Viewpoint& b = stops[i];
    const Viewpoint& c = stops[(i + 1) % n];
    const Viewpoint& d = stops[(i + 2) % n];
    return Viewpoint{spline(a.position, b.position, c.position, d.position, t),
                     spline(a.target, b.target, c.target, d.target, t)};
  };
}

Route orbit_route(const CameraStage& stage, Random& random) {
  constexpr double kSpeed = 0.35;  // m/s
  const double radius = stage.orbit_radius_m * random.uniform(0.98, 1.04);
  const double phase = random.uniform(0.0, 2.0 * std::numbers::pi);
  const double turn = (random.chance(0.5) ? 1.0 : -1.0) * kSpeed / radius;
  const double rise = random.uniform(0.0, 2.0 * std::numbers::pi);
  const Vector3d target = stage.orbit_target + jitter(0.08, random);
  return [=, centre = stage.orbit_target, height = stage.orbit_height_m](double time) {
    const double angle = phase + turn * time;
    const double z = height + 0.08 * std::sin(0.7 * time + rise);
    return Viewpoint{
        {centre.x() + radius * std::cos(angle), centre.y() + radius * std::sin(angle), z}, target};
  };
}

// A closed round with its corners rounded off, by distance gone.
class Round {
 public:
  explicit Round(std::vector<Vector3d> corners) : corners_(std::move(corners)) {
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      starts_.push_back(starts_.back() +
                        (corners_[(i + 1) % corners_.size()] - corners_[i]).norm());
    }
  }

  double length() const { return starts_.back(); }

  // The mean over a stretch of the way: never outside the round's convex hull.
  Vector3d at(double distance) const {
    constexpr double kReach = 0.45;  // metres to either side
    constexpr int kSamples = 30;
    Vector3d sum = Vector3d::Zero();
    for (int i = 0; i < kSamples; ++i) {
      sum += on_line(distance + kReach * ((i + 0.5) / (0.5 * kSamples) - 1.0));
    }
    return sum / kSamples;
  }

 private:
  Vector3d on_line(double distance) const {
    double at = std::fmod(distance, length());
    if (at < 0.0) at += length();
    const auto next = std::upper_bound(starts_.begin() + 1, starts_.end() - 1, at);
    const auto i = static_cast<std::size_t>(next - starts_.begin()) - 1;
    const double share = (at - starts_[i]) / (starts_[i + 1] - starts_[i]);
    return corners_[i] + share * (corners_[(i + 1) % corners_.size()] - corners_[i]);
  }

  std::vector<Vector3d> corners_;
  std::vector<double> starts_ = {0.0};
};

Route walk_route(const CameraStage& stage, Random& random) {
  std::vector<Vector3d> corners = stage.walk;
  for (Vector3d& corner : corners) {
    corner += Vector3d(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), 0.0);
  }
  const Round round(std::move(corners));
  const double speed = random.uniform(0.75, 0.95);  // m/s
  const double start = random.uniform(0.0, round.length());
  const double glance = random.uniform(0.0, 2.0 * std::numbers::pi);
  return [=](double time) {
    const double distance = start + speed * time;
    const Vector3d position = round.at(distance);
    const Vector3d ahead = round.at(distance + 0.8) - round.at(distance - 0.4);
    // Glances to either side every ten seconds or so; the gait's rise and fall and sway.
    const double yaw = std::atan2(ahead.y(), ahead.x()) +
                       0.55 * std::sin(2.0 * std::numbers::pi * 0.11 * time + glance);
    const double step = 2.0 * std::numbers::pi * 1.8 * time;
    const Vector3d side(-std::sin(yaw), std::cos(yaw), 0.0);
    const Vector3d moved =
        position + Vector3d(0, 0, 0.015 * std::sin(step)) + 0.012 * std::sin(0.5 * step) * side;
    const double down = 0.2 + 0.08 * std::sin(2.0 * std::numbers::pi * 0.17 * time + 2.0 * glance);
    return Viewpoint{moved, moved + Vector3d(std::cos(yaw), std::sin(yaw), -std::tan(down))};
  };
}

bool keeps_clear(const Scene& scene, const std::vector<TimedPose>& poses, double clearance_m) {
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Vector3d& here = poses[i].world_from_camera.translation();
    const Vector3d& next = poses[std::min(i + 1, poses.size() - 1)].world_from_camera.translation();
    if (scene.distance(here) < clearance_m) return false;
    if (scene.distance(0.5 * (here + next)) < clearance_m) return false;
  }
  return true;
}

}  // namespace

PathKind path_kind(std::string_view name) {
  if (name == "sweep") return PathKind::kSweep;
  if (name == "orbit") return PathKind::kOrbit;
  if (name == "walk") return PathKind::kWalk;
  throw Error(ErrorKind::kMisuse, "path", printable(name) + " is none", "sweep, orbit or walk");
}

constexpr OptionField kPathFields[] = {
    {"frames", option_at<&PathOptions::frames>, within(1, 1e6)},
    {"rate_hz", option_at<&PathOptions::rate_hz>, within(0.1, 1000), "--rate", "Frames per second"},
    {"pace", option_at<&PathOptions::pace>, within(0.01, 5)},
    {"shake", option_at<&PathOptions::shake>, within(0, 5)},
    {"clearance_m", option_at<&PathOptions::clearance_m>, within(0, 1)},
};
constinit const OptionTable PathOptions::table = {"PathOptions", kPathFields};

void PathOptions::validate() const {
  check_options(*this);
}

Rigid3 looking_at(const Vector3d& position, const Vector3d& target) {
  const Vector3d forward = (target - position).normalized();
  const Vector3d level = forward.cross(Vector3d::UnitZ());
  // Straight up or down, any level axis will do.
  const Vector3d right = level.norm() > 1e-9 ? level.normalized() : Vector3d::UnitX();
  Eigen::Matrix3d rotation;
  rotation << right, forward.cross(right), forward;
  return {Eigen::Quaterniond(rotation), position};
}

Trajectory make_path(const Environment& environment, const PathOptions& options) {
  options.validate();
  constexpr int kAttempts = 40;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    Random random = Random(options.seed)
                        .fork(static_cast<std::uint64_t>(options.kind))
                        .fork(static_cast<std::uint64_t>(attempt));
    const CameraStage& stage = environment.stage;
    const Route route = options.kind == PathKind::kSweep   ? sweep_route(stage, random)
                        : options.kind == PathKind::kOrbit ? orbit_route(stage, random)
                                                           : walk_route(stage, random);
    const Wobble sway(0.008 * options.shake, 0.3, 3.0, random);
    const Wobble tremble(0.012 * options.shake, 0.3, 4.0, random);
    std::vector<TimedPose> poses;
    poses.reserve(options.frames);
    for (std::size_t i = 0; i < options.frames; ++i) {
      const double time = static_cast<double>(i) / options.rate_hz;
      const Viewpoint view = route(time * options.pace);
      Rigid3 pose = looking_at(view.position, view.target);
      pose = Rigid3(pose.quaternion() * rotation_exp(tremble.at(time)),
                    pose.translation() + sway.at(time));
      poses.push_back({microseconds(time), pose});
    }
    if (keeps_clear(environment.scene, poses, options.clearance_m)) {
      return Trajectory(std::move(poses));
    }
  }
  throw Error(
      ErrorKind::kMisuse, "PathOptions.clearance_m",
      fmt::format("no path found that stays {} m away from everything", options.clearance_m),
      "less");
}

Rigid3 pose_at(const Trajectory& trajectory, double timestamp_s) {
  const auto poses = trajectory.poses();
  const auto next =
      std::lower_bound(poses.begin(), poses.end(), timestamp_s,
                       [](const TimedPose& pose, double time) { return pose.timestamp_s < time; });
  if (next == poses.begin()) return poses.front().world_from_camera;
  if (next == poses.end()) return poses.back().world_from_camera;
  if (next->timestamp_s == timestamp_s) return next->world_from_camera;
  const auto before = next - 1;
  const double share =
      (timestamp_s - before->timestamp_s) / (next->timestamp_s - before->timestamp_s);
  return pose_between(before->world_from_camera, next->world_from_camera, share);
}

Trajectory resampled(const Trajectory& trajectory, double rate_hz, std::size_t frames) {
  if (trajectory.empty()) throw Error(ErrorKind::kMisuse, "resampled", "no poses", "at least one");
  refuse_if(!(rate_hz > 0.0), "resampled", fmt::format("a rate of {} Hz", rate_hz),
            "a positive one");
  const double start = microseconds(trajectory.poses().front().timestamp_s);
  const double end = trajectory.poses().back().timestamp_s;
  std::vector<TimedPose> poses;
  for (std::size_t i = 0; frames == 0 || i < frames; ++i) {
    const double time = microseconds(start + static_cast<double>(i) / rate_hz);
    if (time > end && i > 0) break;
    poses.push_back({time, pose_at(trajectory, time)});
  }
  return Trajectory(std::move(poses));
}

}  // namespace cairn
