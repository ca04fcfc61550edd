// SPDX-License-Identifier: BSD-3-Clause
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <omp.h>
#include <open3d/geometry/KDTreeSearchParam.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/pipelines/registration/CorrespondenceChecker.h>
#include <open3d/pipelines/registration/FastGlobalRegistration.h>
#include <open3d/pipelines/registration/Feature.h>
#include <open3d/pipelines/registration/Registration.h>
#include <open3d/utility/Random.h>

#include "placement_peers.hpp"

namespace cairn::benchmarks {
namespace {

namespace registration = open3d::pipelines::registration;
using open3d::geometry::KDTreeSearchParamHybrid;
using open3d::geometry::PointCloud;

// Thinned, with normals and histograms; the radii are multiples of the voxel as in the tutorials.
struct Described {
  Described(const PeerCloud& cloud, double voxel) {
    PointCloud all(cloud.positions);
    // EstimateNormals turns normals the way that they were before.
    all.normals_ = cloud.towards_camera;
    points = all.VoxelDownSample(voxel);
    points->EstimateNormals(KDTreeSearchParamHybrid(2.0 * voxel, 30));
    histograms =
        registration::ComputeFPFHFeature(*points, KDTreeSearchParamHybrid(5.0 * voxel, 100));
  }
  std::shared_ptr<PointCloud> points;
  std::shared_ptr<registration::Feature> histograms;
};

Rigid3 refined(const PeerTask& task, double voxel, const Eigen::Matrix4d& start) {
  return pose_of(registration::RegistrationICP(PointCloud(task.source.positions),
                                               PointCloud(task.target.positions), 1.5 * voxel,
                                               start)
                     .transformation_);
}

std::optional<Rigid3> by_ransac(const PeerTask& task, double voxel) {
  const Described source(task.source, voxel);
  const Described target(task.target, voxel);
  const double near = 1.5 * voxel;
  const registration::CorrespondenceCheckerBasedOnEdgeLength edges(0.9);
  const registration::CorrespondenceCheckerBasedOnDistance distances(near);
  const registration::RegistrationResult result =
      registration::RegistrationRANSACBasedOnFeatureMatching(
          *source.points, *target.points, *source.histograms, *target.histograms, true, near,
          registration::TransformationEstimationPointToPoint(false), 3, {edges, distances},
          registration::RANSACConvergenceCriteria(100'000, 0.999));
  if (result.correspondence_set_.empty()) return std::nullopt;
  return refined(task, voxel, result.transformation_);
}

std::optional<Rigid3> by_fast_global_registration(const PeerTask& task, double voxel) {
  const Described source(task.source, voxel);
  const Described target(task.target, voxel);
  registration::FastGlobalRegistrationOption options;
  options.maximum_correspondence_distance_ = 0.5 * voxel;
  const registration::RegistrationResult result =
      registration::FastGlobalRegistrationBasedOnFeatureMatching(
          *source.points, *target.points, *source.histograms, *target.histograms, options);
  if (result.correspondence_set_.empty()) return std::nullopt;
  return refined(task, voxel, result.transformation_);
}

using Place = std::optional<Rigid3>(const PeerTask&, double voxel);

// On one thread, as all.
Peer peer(const std::string& name, Place* place, double voxel) {
  return {name, [place, voxel](const PeerTask& task) {
            omp_set_num_threads(1);
            open3d::utility::random::Seed(static_cast<int>(task.seed));
            return place(task, voxel * task.spacing);
          }};
}

}  // namespace

std::vector<Peer> open3d_peers(double voxel) {
  return {peer("Open3D FPFH, RANSAC, ICP", by_ransac, voxel),
          peer("Open3D FPFH, FGR, ICP", by_fast_global_registration, voxel)};
}

}  // namespace cairn::benchmarks
