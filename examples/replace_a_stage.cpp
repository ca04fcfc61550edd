// SPDX-License-Identifier: BSD-3-Clause
// An ICP of one's own: the ready-made stages, with one replaced. Here the estimation moves only in
// the plane, as a robot on a floor does.
#include <iostream>

#include <cairn/map/synthetic.hpp>
#include <cairn/registration/convergence/pcl_criteria.hpp>
#include <cairn/registration/correspondence/confident_neighbor.hpp>
#include <cairn/registration/estimation/point_to_point.hpp>
#include <cairn/registration/neighbors/batch_tree.hpp>
#include <cairn/registration/point_set.hpp>
#include <cairn/registration/stages.hpp>

namespace {

// Any type with this call operator is a TransformEstimation.
struct PlanarEstimation {
  std::span<const Eigen::Vector3d> target;

  cairn::Rigid3 operator()(std::span<const Eigen::Vector3d> moved_source,
                           std::span<const cairn::Match> matches) const {
    std::vector<Eigen::Vector3d> from;
    std::vector<Eigen::Vector3d> to;
    for (const cairn::Match& match : matches) {
      from.push_back(moved_source[match.source]);
      to.push_back(target[match.target]);
      from.back().z() = to.back().z() = 0.0;
    }
    return cairn::closest_motion(from, to);
  }
};

}  // namespace

int main() {
  const cairn::LandmarkMap map = cairn::synthetic_map({.seed = 7, .landmarks = 1000});
  const cairn::PointSet target = cairn::point_set(map, cairn::observations_metric());
  const auto truth = cairn::Rigid3::from_roll_pitch_yaw({0.05, -0.04, 0.0}, 0.0, 0.0, 0.05);
  std::vector<Eigen::Vector3d> source;
  source.reserve(target.positions.size());
  for (const Eigen::Vector3d& x : target.positions) source.push_back(truth.inverse() * x);

  const cairn::BatchTree tree(target.positions);
  const cairn::ConfidentNeighborCorrespondence<cairn::BatchTree> find_matches(
      {tree, target.positions, target.confidences}, std::nullopt, {.k = 1});
  const cairn::IcpRun run =
      cairn::run_icp(source, cairn::Rigid3(), find_matches, PlanarEstimation{target.positions},
                     cairn::PclCriteria{.max_iterations = 100});
  const double error = truth.difference_to(run.target_from_source).norm();
  std::cout << run.iterations << " iterations, off by " << error << "\n";
  return error < 1e-6 ? 0 : 1;
}
