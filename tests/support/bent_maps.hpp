// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"

/// Maps with descriptors, and maps that are bent or deformed.
namespace cairn::testing {

using Look = std::array<std::uint8_t, 32>;

inline Look random_look(Random& random) {
  Look look;
  for (std::uint8_t& byte : look) byte = static_cast<std::uint8_t>(random.index(256));
  return look;
}

// As another session sees it.
inline Look again(Look look, Random& random) {
  for (int i = 0; i < 12; ++i) {
    look[random.index(look.size())] ^= static_cast<std::uint8_t>(1U << random.index(8));
  }
  return look;
}

inline LandmarkMap with_looks(const LandmarkMap& map, const std::vector<Look>& looks) {
  MapTables tables = LandmarkMap(map).tables();
  DescriptorColumn column{"ORB", 32, {}, {}};
  for (const Look& look : looks) {
    column.known.push_back(1);
    column.bytes.insert(column.bytes.end(), look.begin(), look.end());
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

// Two sessions of one desk whose common landmarks look alike.
inline SyntheticPair described_pair(std::uint64_t seed) {
  SyntheticPair pair = synthetic_pair({.seed = seed, .landmarks = 3600, .frames = 60});
  Random random(seed);
  std::vector<Look> of_source;
  std::vector<Look> of_target;
  for (std::size_t i = 0; i < pair.source.landmark_count(); ++i) {
    of_source.push_back(random_look(random));
  }
  for (std::size_t i = 0; i < pair.target.landmark_count(); ++i) {
    of_target.push_back(random_look(random));
  }
  for (const auto& [source, target] : pair.shared) {
    of_target[target.value] = again(of_source[source.value], random);
  }
  pair.source = with_looks(pair.source, of_source);
  pair.target = with_looks(pair.target, of_target);
  return pair;
}

// Turned more and more from the first keyframe to the last, about the middle of the map.
inline LandmarkMap bent(const LandmarkMap& map, double degrees_bent) {
  MapTables tables = LandmarkMap(map).tables();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : tables.landmarks.positions) centre += position;
  centre /= static_cast<double>(tables.landmarks.positions.size());
  const auto turn = [&](std::uint32_t frame) {
    const double share =
        static_cast<double>(frame) / static_cast<double>(tables.frames.ids.size() - 1);
    return rotation_exp(radians(degrees_bent) * share * Eigen::Vector3d(0.6, 0.0, 0.8));
  };
  for (std::uint32_t i = 0; i < tables.landmarks.positions.size(); ++i) {
    const auto seen = map.observing_frames(LandmarkIndex{i});
    const auto rotation = turn(seen[(seen.size() - 1) / 2].value);
    Eigen::Vector3d& position = tables.landmarks.positions[i];
    position = centre + rotation * (position - centre);
  }
  for (std::uint32_t i = 0; i < tables.frames.ids.size(); ++i) {
    Eigen::Vector3d& position = tables.frames.translations[i];
    position = centre + turn(i) * (position - centre);
    auto& q = tables.frames.quaternions[i];
    const Eigen::Quaterniond turned = turn(i) * Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    q = {turned.w(), turned.x(), turned.y(), turned.z()};
  }
  return LandmarkMap(std::move(tables));
}

// A place that is deformed along x: lengths grow and directions turn steadily.
class Stretch {
 public:
  // Growth of lengths along x, across a map's radius.
  static constexpr double kGrowth = 0.3;

  // @param factor of the deformation
  explicit Stretch(const LandmarkMap& map, double factor = 1.0) : factor_(factor) {
    const auto count = static_cast<double>(map.landmark_count());
    for (const Eigen::Vector3d& position : map.landmarks().positions) middle_ += position / count;
    for (const Eigen::Vector3d& position : map.landmarks().positions) {
      radius_ += (position - middle_).squaredNorm() / count;
    }
    radius_ = std::sqrt(radius_);
  }

  double radius() const { return radius_; }
  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const {
    const double along = factor_ * (x - middle_).x() / radius_;
    return middle_ + (1.0 + 0.5 * kGrowth * along) *
                         (rotation_exp(0.1 * along * Eigen::Vector3d::UnitZ()) * (x - middle_));
  }
  // The local scale.
  double scale(const Eigen::Vector3d& x) const {
    const double growth = factor_ * kGrowth * (x - middle_).x() / radius_;
    return std::cbrt((1.0 + growth) * (1.0 + 0.5 * growth) * (1.0 + 0.5 * growth));
  }

 private:
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double radius_ = 0.0;
  double factor_;
};

inline LandmarkMap deformed_by(const Stretch& stretch, const LandmarkMap& map) {
  MapTables tables = LandmarkMap(map).tables();
  for (Eigen::Vector3d& position : tables.landmarks.positions) position = stretch(position);
  for (Eigen::Vector3d& centre : tables.frames.translations) centre = stretch(centre);
  tables.info.length_unit = LengthUnit::kFree;
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn::testing
