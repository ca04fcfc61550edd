// SPDX-License-Identifier: BSD-3-Clause
// Cairn and other ways to place maps from no initial pose, on the same pairs, each on one thread. See its
// usage; one CSV row for each pair and method to stdout, a table to stderr. Not timed, in favour of the
// peers: how they learn the spacing of the landmarks and where the cameras were.
#include "placement_peers.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/detail/cloud_scales.hpp"
#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/registration/icp.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"

#include "placement_pairs.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;
using namespace cairn::benchmarks;

struct Tally {
  std::size_t right = 0;
  std::size_t wrong = 0;
  std::size_t unanswered = 0;
  std::vector<double> seconds;
};

// Of landmarks that no view has, the nearest camera's direction is as good a guess as any.
PeerCloud peer_cloud(const LandmarkCloud& cloud) {
  PeerCloud result{cloud.positions, {}, centroid(cloud.positions)};
  std::vector<Eigen::Vector3d> cameras(
      cloud.size(), Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (const LandmarkView& view : cloud.views) {
    for (const std::uint32_t landmark : view.landmarks) cameras[landmark] = view.centre;
  }
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d& position = cloud.positions[i];
    Eigen::Vector3d camera = cameras[i];
    if (!camera.allFinite()) {
      const auto nearest = std::min_element(cloud.views.begin(), cloud.views.end(),
                                            [&](const LandmarkView& a, const LandmarkView& b) {
                                              return (a.centre - position).squaredNorm() <
                                                     (b.centre - position).squaredNorm();
                                            });
      camera = nearest == cloud.views.end() ? result.centroid : nearest->centre;
    }
    result.towards_camera.push_back((camera - position).normalized());
  }
  return result;
}

double spacing_of(const LandmarkCloud& cloud) {
  return detail::cloud_scales(cloud, BatchTree(cloud.positions), Executor()).spacing;
}

PeerTask task_of(const LandmarkCloud& less, const LandmarkCloud& more, std::uint64_t seed) {
  return {peer_cloud(less), peer_cloud(more), std::max(spacing_of(less), spacing_of(more)),
          static_cast<unsigned>(seed)};
}

constexpr std::size_t kIcpStarts = 200;
constexpr int kIcpIterations = 50;

// The paper's base ICP from many starts, each of so few iterations that many can be had; the least score
// wins.
std::optional<Rigid3> by_icp(const PeerTask& task) {
  const PointSet source{.positions = task.source.positions, .confidences = {}};
  const PointSet target{.positions = task.target.positions, .confidences = {}};
  IcpOptions options;
  options.k = 1;
  options.max_iterations = kIcpIterations;
  std::optional<Rigid3> best;
  double least = std::numeric_limits<double>::infinity();
  for (const Rigid3& start : random_starts(task, kIcpStarts)) {
    options.initial = start;
    const RegistrationResult result = icp(source, target, options);
    if (result.score && *result.score < least) {
      least = *result.score;
      best = result.target_from_source;
    }
  }
  return best;
}

// The peers' tutorials say of the voxel no more than that it should suit the points: each of these does
// for some pairs.
constexpr double kVoxels[] = {0.5, 1.0, 2.0};

std::vector<Peer> all_peers() {
  std::vector<Peer> peers = {{"ICP, 200 starts", by_icp}};
  [[maybe_unused]] const auto add = [&](Peer peer, double voxel) {
    peer.name += fmt::format(", voxel {:g}", voxel);
    peers.push_back(std::move(peer));
  };
  for ([[maybe_unused]] const double voxel : kVoxels) {
#ifdef CAIRN_HAS_OPEN3D
    for (Peer& peer : open3d_peers(voxel)) add(std::move(peer), voxel);
#endif
#ifdef CAIRN_HAS_PCL
    add(pcl_histogram_peer(voxel), voxel);
#endif
  }
#ifdef CAIRN_HAS_PCL
  peers.push_back(pcl_ndt_peer());
#endif
  return peers;
}

// A peer that throws has no answer.
std::optional<Rigid3> answer_of(const Peer& peer, const PeerTask& task) {
  try {
    return peer.place(task);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", peer.name.c_str(), error.what());
    return std::nullopt;
  }
}

class Comparison {
 public:
  void run(const PlacementPair& pair) {
    if (pair.truth_by_cairn || pair.any_scale) {
      throw Error(ErrorKind::kMisuse, pair.group,
                  pair.any_scale ? "scales are not what the peers estimate"
                                 : "Cairn's own answer is no truth to judge others by",
                  "maps with a TRUTH, sessions, simulated or strangers");
    }
    if (tallies_.empty()) {
      std::puts("group,trial,method,answer,rotation_deg,translation_m,wall_s");
    }
    const Alignment result = place(pair.source, pair.target, {}, {.seed = pair.trial});
    const bool accepted = result.verdict == Verdict::kAligned;
    const bool failed = result.registration.status == RegistrationStatus::kFailed;
    const std::optional<Rigid3> found =
        failed ? std::nullopt : std::optional(result.registration.target_from_source);
    tell(pair, "Cairn, aligned or not", found, result.duration_s);
    tell(pair, "Cairn, aligned", accepted ? found : std::nullopt, result.duration_s);

    const bool inverted = pair.source.size() > pair.target.size();
    const PeerTask task = inverted ? task_of(pair.target, pair.source, pair.trial)
                                   : task_of(pair.source, pair.target, pair.trial);
    for (const Peer& peer : peers_) {
      const auto start = std::chrono::steady_clock::now();
      std::optional<Rigid3> pose = answer_of(peer, task);
      const double seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (pose && inverted) pose = pose->inverse();
      tell(pair, peer.name, pose, seconds);
    }
  }

  void summary() {
    for (auto& [key, tally] : tallies_) {
      std::sort(tally.seconds.begin(), tally.seconds.end());
      std::fprintf(stderr, "%-34s %-46s right %3zu, wrong %3zu, no answer %3zu, median %.3f s\n",
                   key.first.c_str(), key.second.c_str(), tally.right, tally.wrong,
                   tally.unanswered, tally.seconds[tally.seconds.size() / 2]);
    }
  }

 private:
  void tell(const PlacementPair& pair, const std::string& method, const std::optional<Rigid3>& pose,
            double seconds) {
    Tally& tally = tallies_[{pair.group, method}];
    tally.seconds.push_back(seconds);
    const char* answer = "none";
    std::string errors = ",";
    if (!pose) {
      ++tally.unanswered;
    } else if (!pair.truth) {
      answer = "wrong";
      ++tally.wrong;
    } else {
      const PoseError error = pose_error(*pose, *pair.truth, pair.source.positions);
      const bool right = degrees(error.rotation_rad) <= pair.most_deg &&
                         error.translation <= pair.most_translation;
      answer = right ? "right" : "wrong";
      ++(right ? tally.right : tally.wrong);
      errors = fmt::format("{:.3f},{:.4f}", degrees(error.rotation_rad), error.translation);
    }
    fmt::print("\"{}\",{},\"{}\",{},{},{:.3f}\n", pair.group, pair.trial, method, answer, errors,
               seconds);
    std::fflush(stdout);
  }

  std::vector<Peer> peers_ = all_peers();
  std::map<std::pair<std::string, std::string>, Tally> tallies_;
};

}  // namespace

int main(int argc, char** argv) {
  const std::string usage = std::string("PAIRS, which is one of\n") + kPairsUsage;
  return study_main(argc, argv, 1, usage.c_str(), [](const std::vector<std::string>& words) {
    Comparison comparison;
    for_each_pair(words, [&](const PlacementPair& pair) { comparison.run(pair); });
    comparison.summary();
  });
}
