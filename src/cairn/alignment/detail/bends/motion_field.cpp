// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/detail/bends/motion_field.hpp"

#include <algorithm>
#include <utility>

#include "cairn/core/statistics.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/detail/pose_between.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"

namespace cairn {
namespace detail {
namespace {

constexpr int kPoseSteps = 20;

// The motion at a position along the map, interpolated between the poses of the parts.
// @param poses poses of the parts, in order
// @param along position along the map, in parts; NaN: unknown
Similarity3 motion_at(std::span<const Similarity3> poses, double along,
                      const Eigen::Vector3d& centre) {
  const double last = static_cast<double>(poses.size() - 1);
  const double place = std::isfinite(along) ? std::clamp(along - 0.5, 0.0, last) : 0.5 * last;
  const auto i = std::min(static_cast<std::size_t>(place), poses.size() - 2);
  return pose_between(poses[i], poses[i + 1], place - static_cast<double>(i), centre);
}

}  // namespace

MotionField straightening(const PartsAlignment& parts, const AlongParts& along) {
  const MapRole role = parts.bend->map;
  const auto own = [&](const Similarity3& pose) {
    return role == MapRole::kSource ? pose : pose.inverse();
  };
  const Similarity3 own_from_whole = own(*parts.target_from_source).inverse();
  std::vector<Similarity3> poses;
  for (const PartPose& part : parts.parts) {
    if (part.map == role) poses.push_back(own_from_whole * own(*part.target_from_source));
  }
  const auto motions = [&](const std::vector<double>& places) {
    std::vector<Similarity3> result;
    result.reserve(places.size());
    for (const double place : places) result.push_back(motion_at(poses, place, along.centre));
    return result;
  };
  return {motions(along.keyframes), motions(along.landmarks)};
}

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

LandmarkMap moved(const LandmarkMap& map, const MotionField& field) {
  MapTables tables = LandmarkMap(map).tables();
  std::vector<double> scales;
  for (std::size_t i = 0; i < field.keyframes.size(); ++i) {
    const Similarity3& motion = field.keyframes[i];
    scales.push_back(motion.scale());
    auto& q = tables.frames.quaternions[i];
    const Eigen::Quaterniond turned =
        motion.rigid().quaternion() * Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    q = {turned.w(), turned.x(), turned.y(), turned.z()};
    tables.frames.translations[i] = motion * tables.frames.translations[i];
  }
  for (std::size_t i = 0; i < field.landmarks.size(); ++i) {
    const Similarity3& motion = field.landmarks[i];
    tables.landmarks.positions[i] = motion * tables.landmarks.positions[i];
    if (!map.has_covariances()) continue;
    tables.landmarks.covariances[i] =
        motion.scale() * motion.scale() *
        rotated_covariance(tables.landmarks.covariances[i], motion.rigid().rotation());
  }
  for (Rig& rig : tables.rigs) {
    for (Rig::Mount& mount : rig.mounts) {
      mount.translation *= scales.empty() ? 1.0 : upper_median(scales);
    }
  }
  hold_rigs(tables);
  return LandmarkMap(std::move(tables));
}

}  // namespace detail

using namespace detail;

std::vector<FrameIndex> keyframes_in_order(const LandmarkMap& map) {
  std::vector<FrameIndex> order;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) order.push_back(FrameIndex{i});
  const FrameTable& frames = map.frames();
  const auto is_known = [](const std::optional<double>& time) { return time.has_value(); };
  const auto& times = frames.timestamps_s;
  const bool by_time = !times.empty() && std::all_of(times.begin(), times.end(), is_known);
  std::stable_sort(order.begin(), order.end(), [&](FrameIndex a, FrameIndex b) {
    if (by_time) return *frames.timestamps_s[a.value] < *frames.timestamps_s[b.value];
    return frames.ids[a.value] < frames.ids[b.value];
  });
  return order;
}

LandmarkMap straightened(const LandmarkMap& map, const PartsAlignment& parts) {
  std::vector<FrameId> middles;
  for (const PartPose& part : parts.parts) {
    if (part.map == parts.bend->map) middles.push_back(part.middle);
  }
  return moved(map, straightening(parts, along_parts(map, middles)));
}

LandmarkMap straightened(const LandmarkMap& source, const DeformedPose& pose) {
  const Similarity3 back = pose.target_from_source.inverse();
  std::vector<CameraMotion> motions(source.frame_count(), CameraMotion(*pose.deformation, back));
  MotionField field;
  for (std::uint32_t i = 0; i < source.landmark_count(); ++i) {
    const Eigen::Vector3d& position = source.landmarks().positions[i];
    for (const FrameIndex frame : source.observing_frames(LandmarkIndex{i})) {
      motions[frame.value].add(position);
    }
    field.landmarks.push_back(back * pose.deformation->near(position));
  }
  for (std::size_t i = 0; i < motions.size(); ++i) {
    field.keyframes.push_back(motions[i].at(source.frames().translations[i]));
  }
  return moved(source, field);
}

}  // namespace cairn
