// SPDX-License-Identifier: BSD-3-Clause
// Poses of many maps from links of which some are wrong: time, and which links are kept. Robots drive about one
// floor; maps less than a metre apart are linked, with errors as stated.
//   cairn_pose_graphs_benchmark random|consistent|update SHARE MAPS...
// Wrong links are SHARE of all (random), or of those between robots (consistent: all wrong links between two
// robots agree on one false offset). With `update`, wrong links are random, the last map is new, and the poses of the
// others are known.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

namespace {

using namespace cairn;

constexpr std::size_t kRobots = 5;
constexpr double kShift = 0.01;  // deviations of a link's error: metres, radians
constexpr double kTurn = 0.005;
constexpr double kRadius = 1.0;   // of a map, and of how far linked maps are apart
constexpr double kSpacing = 0.5;  // of maps on the floor

struct World {
  World(std::size_t maps, std::uint64_t seed)
      : random(seed), side(kSpacing * std::sqrt(static_cast<double>(maps))) {
    for (std::size_t i = 0; i < maps; ++i) {
      robot.push_back(i * kRobots / maps);
      const bool starts = i == 0 || robot[i] != robot[i - 1];
      truth.push_back(starts ? anywhere() : next(truth.back()));
      graph.nodes.push_back({NodeId{i}, {}, std::string(1, static_cast<char>('a' + robot[i])), {}});
    }
    extents.assign(maps, {Eigen::Vector3d::Zero(), kRadius});
  }

  Rigid3 anywhere() {
    return Rigid3::from_roll_pitch_yaw({random.uniform(0.0, side), random.uniform(0.0, side), 0.0},
                                       0.0, 0.0, random.uniform(-3.14, 3.14));
  }
  // A step ahead, or away from the wall.
  Rigid3 next(const Rigid3& pose) {
    for (;;) {
      const Rigid3 ahead =
          pose * Rigid3::from_roll_pitch_yaw({0.0, 0.0, 0.0}, 0.0, 0.0, random.normal() * 0.5) *
          Rigid3::from_roll_pitch_yaw({kSpacing, 0.0, 0.0}, 0.0, 0.0, 0.0);
      const Eigen::Vector3d& at = ahead.translation();
      if (at.x() > 0.0 && at.x() < side && at.y() > 0.0 && at.y() < side) return ahead;
      const Rigid3 turned =
          pose *
          Rigid3::from_roll_pitch_yaw({0.0, 0.0, 0.0}, 0.0, 0.0, random.uniform(-3.14, 3.14)) *
          Rigid3::from_roll_pitch_yaw({kSpacing, 0.0, 0.0}, 0.0, 0.0, 0.0);
      const Eigen::Vector3d& there = turned.translation();
      if (there.x() > 0.0 && there.x() < side && there.y() > 0.0 && there.y() < side) return turned;
    }
  }
  void link(std::size_t target, std::size_t source, const Rigid3& target_from_source, bool right) {
    Vector6d error;
    for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? kShift : kTurn) * random.normal();
    Vector6d variances;
    variances << Eigen::Vector3d::Constant(kShift * kShift),
        Eigen::Vector3d::Constant(kTurn * kTurn);
    graph.links.push_back({.target = NodeId{target},
                           .source = NodeId{source},
                           .probability = 0.999,
                           .target_from_source = Similarity3(target_from_source.perturbed(error)),
                           .covariance = Matrix6d(variances.asDiagonal())});
    is_right.push_back(right);
  }
  // Links of maps that are near each other in these poses.
  template <class Wanted>
  void link_near(const std::vector<Rigid3>& poses, bool right, const Wanted& wanted) {
    for (std::size_t source = 0; source < poses.size(); ++source) {
      for (std::size_t target = 0; target < source; ++target) {
        const double apart = (poses[source].translation() - poses[target].translation()).norm();
        if (apart > kRadius || !wanted(target, source)) continue;
        link(target, source, poses[target].inverse() * poses[source], right);
      }
    }
  }

  Random random;
  double side;
  std::vector<Rigid3> truth;
  std::vector<std::size_t> robot;
  PoseGraph graph;
  std::vector<bool> is_right;
  std::vector<NodeExtent> extents;
};

World random_links(std::size_t maps, double share, std::uint64_t seed) {
  World world(maps, seed);
  world.link_near(world.truth, true, [](std::size_t, std::size_t) { return true; });
  const auto wrong = static_cast<std::size_t>(share / (1.0 - share) *
                                              static_cast<double>(world.graph.links.size()));
  for (std::size_t i = 0; i < wrong; ++i) {
    const std::size_t a = world.random.index(maps);
    const std::size_t b = (a + 1 + world.random.index(maps - 1)) % maps;
    const Rigid3 near = Rigid3::from_roll_pitch_yaw(
        {world.random.uniform(-1.0, 1.0), world.random.uniform(-1.0, 1.0), 0.0}, 0.0, 0.0,
        world.random.uniform(-3.14, 3.14));
    world.link(a, b, near, false);
  }
  return world;
}

World consistent_links(std::size_t maps, double share, std::uint64_t seed) {
  World world(maps, seed);
  // Every robot's maps as a whole, somewhere else.
  std::vector<Rigid3> moved;
  std::vector<Rigid3> offsets;
  for (std::size_t i = 0; i < kRobots; ++i) offsets.push_back(world.anywhere());
  for (std::size_t i = 0; i < maps; ++i) moved.push_back(offsets[world.robot[i]] * world.truth[i]);
  const auto between = [&](std::size_t target, std::size_t source) {
    return world.robot[target] != world.robot[source];
  };
  const auto count = [&](const std::vector<Rigid3>& poses) {
    double number = 0.0;
    for (std::size_t source = 0; source < maps; ++source) {
      for (std::size_t target = 0; target < source; ++target) {
        const double apart = (poses[source].translation() - poses[target].translation()).norm();
        number += apart <= kRadius && between(target, source) ? 1.0 : 0.0;
      }
    }
    return number;
  };
  // So many of those that there are of the one kind that the shares are as asked for.
  const double right = count(world.truth);
  const double wrong = count(moved);
  const double keep_right = std::min(1.0, wrong * (1.0 - share) / (share * right));
  const double keep_wrong = std::min(1.0, right * share / ((1.0 - share) * wrong));
  world.link_near(world.truth, true, [&](std::size_t target, std::size_t source) {
    return !between(target, source) || world.random.chance(keep_right);
  });
  world.link_near(moved, false, [&](std::size_t target, std::size_t source) {
    return between(target, source) && world.random.chance(keep_wrong);
  });
  return world;
}

// Of all maps but the last, with an entry for each.
OptimisedPoses without_last(const World& world) {
  PoseGraph less = world.graph;
  const NodeId last = less.nodes.back().id;
  std::erase_if(less.links,
                [&](const Link& link) { return link.target == last || link.source == last; });
  less.nodes.pop_back();
  OptimisedPoses poses = optimise_poses(less, std::span(world.extents).first(less.nodes.size()));
  poses.world_from_node.emplace_back();
  poses.covariances.emplace_back(Matrix7d::Zero());
  std::vector<bool> agrees;
  std::size_t next = 0;
  for (const Link& link : world.graph.links)
    agrees.push_back(link.target != last && link.source != last && poses.agrees[next++]);
  poses.agrees = std::move(agrees);
  return poses;
}

void run(const World& world, bool update) {
  OptimisedPoses before;
  if (update) before = without_last(world);
  const auto begin = std::chrono::steady_clock::now();
  const OptimisedPoses poses = update ? update_poses(world.graph, world.extents, before)
                                      : optimise_poses(world.graph, world.extents);
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  std::size_t right = 0;
  std::size_t right_kept = 0;
  std::size_t wrong_kept = 0;
  for (std::size_t i = 0; i < world.is_right.size(); ++i) {
    right += world.is_right[i] ? 1 : 0;
    right_kept += world.is_right[i] && poses.agrees[i] ? 1 : 0;
    wrong_kept += !world.is_right[i] && poses.agrees[i] ? 1 : 0;
  }
  std::size_t placed = 0;
  std::size_t first = 0;
  while (first < world.truth.size() && !poses.world_from_node[first]) ++first;
  double sum = 0.0;
  for (std::size_t i = 0; i < world.truth.size(); ++i) {
    if (!poses.world_from_node[i]) continue;
    ++placed;
    const Rigid3 truth = world.truth[first].inverse() * world.truth[i];
    sum += (poses.world_from_node[i]->translation() - truth.translation()).squaredNorm();
  }
  std::printf("%7zu %7zu %6zu %7zu %8.4f %6zu %9.4f %8.2f\n", world.truth.size(),
              world.graph.links.size(), world.is_right.size() - right, placed,
              static_cast<double>(right_kept) / static_cast<double>(right), wrong_kept,
              std::sqrt(sum / static_cast<double>(placed)), time.count());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "Usage: %s random|consistent|update SHARE MAPS...\n", argv[0]);
    return 2;
  }
  const std::string kind = argv[1];
  const double share = std::atof(argv[2]);
  std::printf(
      "   maps   links  wrong  placed    right  wrong  rmse (m) time (s)\n"
      "                              kept      kept\n");
  for (int i = 3; i < argc; ++i) {
    const auto maps = static_cast<std::size_t>(std::atol(argv[i]));
    run(kind == "consistent" ? consistent_links(maps, share, 1) : random_links(maps, share, 1),
        kind == "update");
  }
  return 0;
}
