// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/random.hpp"
#include "cairn/geometry/rigid3.hpp"

#include "random_pose.hpp"

namespace cairn::benchmarks {

/// A map as a peer takes it.
struct PeerCloud {
  std::vector<Eigen::Vector3d> positions;
  /// One a position: the way to a camera that saw it, of length 1, to which surfaces turn.
  std::vector<Eigen::Vector3d> towards_camera;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
};

struct PeerTask {
  PeerCloud source;  ///< the smaller map: some peers ask for a share of its points
  PeerCloud target;
  double spacing = 0.0;  ///< the larger of the maps' usual distances between neighbours
  unsigned seed = 0;
};

/// Another way to place maps.
struct Peer {
  std::string name;
  /// target_from_source; nothing if it gave up
  std::function<std::optional<Rigid3>(const PeerTask&)> place;
};

/// Starts for methods that need one: any rotation, centroid upon centroid.
inline std::vector<Rigid3> random_starts(const PeerTask& task, std::size_t count) {
  Random random(task.seed);
  std::vector<Rigid3> starts;
  for (std::size_t i = 0; i < count; ++i) {
    const Rigid3 turn = random_pose(random, 0.0);
    starts.emplace_back(turn.quaternion(), task.target.centroid - turn * task.source.centroid);
  }
  return starts;
}

/// What a peer's matrix says, which is a rotation in single precision only.
inline Rigid3 pose_of(const Eigen::Matrix4d& matrix) {
  return {Eigen::Quaterniond(Eigen::Matrix3d(matrix.topLeftCorner<3, 3>())),
          matrix.topRightCorner<3, 1>()};
}

/// Fast point feature histograms with RANSAC, and with fast global registration, as in Open3D's tutorials.
/// @param voxel of the grid that thins the maps and that all lengths are multiples of, in spacings
std::vector<Peer> open3d_peers(double voxel);

/// The same histograms with the prerejective RANSAC of PCL's tutorial.
Peer pcl_histogram_peer(double voxel);

/// PCL's NDT from many starts, with PCL's ICP after it.
Peer pcl_ndt_peer();

}  // namespace cairn::benchmarks
