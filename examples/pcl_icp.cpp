// SPDX-License-Identifier: BSD-3-Clause
// PCL's own ICP with Cairn's data association: one line more than without.
#include <iostream>
#include <vector>

#include <adapters/pcl/confidence_correspondence_estimation.hpp>
#include <cairn/confidence/metric.hpp>
#include <cairn/map/synthetic.hpp>
#include <pcl/point_types.h>
#include <pcl/registration/icp.h>

int main() {
  using Cloud = pcl::PointCloud<pcl::PointXYZ>;
  const cairn::LandmarkMap map = cairn::synthetic_map({.seed = 7, .landmarks = 1000});
  const std::vector<double> confidences = cairn::observations_metric().evaluate(map);
  Cloud::Ptr source(new Cloud);
  Cloud::Ptr target(new Cloud);
  for (const Eigen::Vector3d& x : map.landmarks().positions) {
    const pcl::PointXYZ p(static_cast<float>(x.x()), static_cast<float>(x.y()),
                          static_cast<float>(x.z()));
    target->push_back(p);
    source->push_back({p.x + 0.02F, p.y, p.z});
  }

  pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> icp;
  icp.setInputSource(source);
  icp.setInputTarget(target);
  icp.setMaximumIterations(150);
  icp.setCorrespondenceEstimation(
      pcl::make_shared<
          cairn::pcl_adapter::ConfidenceCorrespondenceEstimation<pcl::PointXYZ, pcl::PointXYZ>>(
          confidences, 3));
  Cloud aligned;
  icp.align(aligned);
  std::cout << "score " << icp.getFitnessScore() << "\n" << icp.getFinalTransformation() << "\n";
  return icp.hasConverged() ? 0 : 1;
}
