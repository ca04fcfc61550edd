// SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <optional>

#include <Eigen/Core>
#include <pcl/features/fpfh.h>
#include <pcl/features/normal_3d.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/registration/icp.h>
#include <pcl/registration/ndt.h>
#include <pcl/registration/sample_consensus_prerejective.h>

#include "placement_peers.hpp"

namespace cairn::benchmarks {
namespace {

using Points = pcl::PointCloud<pcl::PointXYZ>;
using Oriented = pcl::PointCloud<pcl::PointNormal>;
using Histograms = pcl::PointCloud<pcl::FPFHSignature33>;

constexpr std::size_t kNdtStarts = 32;

// @param unit which lengths are told in
Points::Ptr points_of(const PeerCloud& cloud, double unit = 1.0) {
  Points::Ptr points(new Points);
  for (const Eigen::Vector3d& position : cloud.positions) {
    const Eigen::Vector3f at = (position / unit).cast<float>();
    points->push_back({at.x(), at.y(), at.z()});
  }
  return points;
}

// Thinned, with normals and histograms.
struct Described {
  Described(const PeerCloud& cloud, double voxel)
      : points(new Oriented), histograms(new Histograms) {
    Oriented::Ptr all(new Oriented);
    for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
      pcl::PointNormal point;
      point.getVector3fMap() = cloud.positions[i].cast<float>();
      point.getNormalVector3fMap() = cloud.towards_camera[i].cast<float>();
      all->push_back(point);
    }
    pcl::VoxelGrid<pcl::PointNormal> grid;
    const auto leaf = static_cast<float>(voxel);
    grid.setLeafSize(leaf, leaf, leaf);
    grid.setInputCloud(all);
    grid.filter(*points);

    pcl::PointCloud<pcl::Normal> normals;
    pcl::NormalEstimation<pcl::PointNormal, pcl::Normal> estimation;
    estimation.setInputCloud(points);
    estimation.setRadiusSearch(2.0 * voxel);
    estimation.compute(normals);
    Oriented::Ptr oriented(new Oriented);
    for (std::size_t i = 0; i < points->size(); ++i) {
      Eigen::Vector3f normal = normals[i].getNormalVector3fMap();
      if (!normal.allFinite()) continue;  // too few neighbours
      pcl::PointNormal point = (*points)[i];
      if (normal.dot(point.getNormalVector3fMap()) < 0.0F) normal = -normal;
      point.getNormalVector3fMap() = normal;
      oriented->push_back(point);
    }
    points = oriented;

    pcl::FPFHEstimation<pcl::PointNormal, pcl::PointNormal, pcl::FPFHSignature33> description;
    description.setInputCloud(points);
    description.setInputNormals(points);
    description.setRadiusSearch(5.0 * voxel);
    description.compute(*histograms);
  }
  Oriented::Ptr points;
  Histograms::Ptr histograms;
};

Rigid3 refined(const PeerTask& task, double voxel, const Eigen::Matrix4f& start) {
  pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> icp;
  icp.setInputSource(points_of(task.source));
  icp.setInputTarget(points_of(task.target));
  icp.setMaxCorrespondenceDistance(1.5 * voxel);
  icp.setMaximumIterations(30);
  Points unused;
  icp.align(unused, start);
  return pose_of(icp.getFinalTransformation().cast<double>());
}

std::optional<Rigid3> by_ransac(const PeerTask& task, double voxel) {
  std::srand(task.seed);  // which PCL draws from
  const Described source(task.source, voxel);
  const Described target(task.target, voxel);
  // Among so many most alike one is drawn; PCL reads beyond the end of fewer.
  constexpr int kMostAlike = 5;
  if (source.points->size() < kMostAlike || target.points->size() < kMostAlike) return std::nullopt;
  pcl::SampleConsensusPrerejective<pcl::PointNormal, pcl::PointNormal, pcl::FPFHSignature33> ransac;
  ransac.setInputSource(source.points);
  ransac.setSourceFeatures(source.histograms);
  ransac.setInputTarget(target.points);
  ransac.setTargetFeatures(target.histograms);
  ransac.setMaximumIterations(50'000);
  ransac.setNumberOfSamples(3);
  ransac.setCorrespondenceRandomness(kMostAlike);
  ransac.setSimilarityThreshold(0.9F);
  ransac.setMaxCorrespondenceDistance(static_cast<float>(2.5 * voxel));
  ransac.setInlierFraction(0.25F);
  Oriented moved;
  ransac.align(moved);
  if (!ransac.hasConverged()) return std::nullopt;
  return refined(task, voxel, ransac.getFinalTransformation());
}

// Cells hold about a dozen landmarks of a surface. They are the unit of length, because NDT ends by the
// square of a step, in whatever unit.
std::optional<Rigid3> by_ndt(const PeerTask& task) {
  const double cell = 4.0 * task.spacing;
  pcl::NormalDistributionsTransform<pcl::PointXYZ, pcl::PointXYZ> ndt;
  ndt.setResolution(1.0F);
  ndt.setStepSize(0.1);
  ndt.setTransformationEpsilon(1e-6);
  ndt.setMaximumIterations(100);
  ndt.setInputSource(points_of(task.source, cell));
  ndt.setInputTarget(points_of(task.target, cell));
  std::optional<Eigen::Matrix4f> best;
  double likelihood = -std::numeric_limits<double>::infinity();
  for (const Rigid3& start : random_starts(task, kNdtStarts)) {
    Points unused;
    const Rigid3 in_cells(start.quaternion(), start.translation() / cell);
    ndt.align(unused, in_cells.matrix().cast<float>());
    if (ndt.hasConverged() && ndt.getTransformationLikelihood() > likelihood) {
      likelihood = ndt.getTransformationLikelihood();
      best = ndt.getFinalTransformation();
      best->topRightCorner<3, 1>() *= static_cast<float>(cell);
    }
  }
  if (!best) return std::nullopt;
  return refined(task, task.spacing, *best);
}

}  // namespace

Peer pcl_histogram_peer(double voxel) {
  return {"PCL FPFH, prerejective RANSAC, ICP",
          [voxel](const PeerTask& task) { return by_ransac(task, voxel * task.spacing); }};
}

Peer pcl_ndt_peer() {
  return {"PCL NDT, 32 starts, ICP", by_ndt};
}

}  // namespace cairn::benchmarks
