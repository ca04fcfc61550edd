// SPDX-License-Identifier: BSD-3-Clause
// Places parts of mapped sessions on each other, with truth: what the model of the verdict's probability
// is fitted to, and what it is tested with.
//   cairn_placement_sessions_benchmark FOLDER PAIRS PART [THREADS]
// FOLDER holds, for each session, PLACE-SEED-SESSION.cairn and PLACE-SEED-SESSION.gt, its ground truth
// (benchmarks/placement_sessions.sh makes them). PART: fit (places of odd seed) or test (of even seed).
// Every other pair is of two different places. One CSV row a candidate to stdout; that of rank -1 is the
// true pose, refined.
#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/io/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/placement/centred_pair.hpp"
#include "cairn/placement/place.hpp"
#include "cairn/placement/refine.hpp"
#include "cairn/placement/support.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/score/fitness.hpp"
#include "cairn/trajectory/tum.hpp"

#include "random_pose.hpp"

namespace {

using namespace cairn;
using benchmarks::random_pose;

constexpr double kCounterpart = 0.05;  // metres, within which landmarks count as overlapping
constexpr std::size_t kFewest = 150;   // landmarks of a part
constexpr double kMovedUpTo = 5.0;     // metres
// Pairs of one place take turns; the first have nothing in common.
constexpr std::array<std::array<double, 2>, 5> kOverlaps = {
    {{0.0, 0.01}, {0.1, 0.25}, {0.25, 0.4}, {0.4, 0.6}, {0.6, 1.01}}};

struct Session {
  std::string place;
  LandmarkMap map;
  std::map<double, Rigid3> truth;  // world_from_camera by time
};

// Of consecutive keyframes of a session, with where it is.
struct Part {
  LandmarkMap map;
  Rigid3 world_from_map;
};

std::vector<Session> read_sessions(const std::filesystem::path& folder, bool odd) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".cairn") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Session> sessions;
  for (std::filesystem::path file : files) {
    const std::string name = file.stem().string();
    const std::string place = name.substr(0, name.rfind('-'));
    const int seed = std::stoi(place.substr(place.rfind('-') + 1));
    if ((seed % 2 == 1) != odd) continue;
    Session session{place, read_map(file), {}};
    FileReader truth(file.replace_extension(".gt"));
    for (const TimedPose& pose : read_tum_trajectory(truth).poses()) {
      session.truth[pose.timestamp_s] = pose.world_from_camera;
    }
    sessions.push_back(std::move(session));
  }
  if (sessions.size() < 2) throw std::runtime_error("fewer than two sessions");
  return sessions;
}

// The mean of what the keyframes say: odometry drifts, and a part is to be judged by its own place.
std::optional<Rigid3> world_from_map(const LandmarkMap& map,
                                     const std::map<double, Rigid3>& truth) {
  Eigen::Vector4d turn = Eigen::Vector4d::Zero();
  Eigen::Vector3d there = Eigen::Vector3d::Zero();
  Eigen::Vector3d here = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const auto at = truth.find(map.frames().timestamps_s[i].value_or(-1.0));
    if (at == truth.end()) continue;
    const Rigid3 pose = map.world_from_camera(FrameIndex{i});
    Eigen::Vector4d q = (at->second.quaternion() * pose.quaternion().conjugate()).coeffs();
    turn += q.dot(turn) < 0.0 ? Eigen::Vector4d(-q) : q;
    there += at->second.translation();
    here += pose.translation();
    ++count;
  }
  if (count == 0.0) return std::nullopt;
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(turn).normalized();
  return Rigid3(rotation, there / count - rotation * (here / count));
}

// Of the keyframes between two shares of the session.
std::optional<Part> part_of(const Session& session, double begin, double end, Random& random) {
  const auto& ids = session.map.frames().ids;
  const auto count = static_cast<double>(ids.size());
  const double share = random.uniform(0.2, 1.0) * (end - begin);
  const auto first = static_cast<std::size_t>(random.uniform(begin, end - share) * count);
  const auto last = std::min(first + static_cast<std::size_t>(share * count), ids.size() - 1);
  LandmarkMap map = cut_frames(session.map, ids[first], FrameId{ids[last].value + 1});
  if (landmarks_observed(map, 2).size() < kFewest) return std::nullopt;
  const auto pose = world_from_map(map, session.truth);
  if (!pose) return std::nullopt;
  return Part{std::move(map), *pose};
}

double overlap(const LandmarkCloud& source, const LandmarkCloud& target, const Rigid3& truth) {
  const bool inverted = source.size() > target.size();
  const LandmarkCloud& less = inverted ? target : source;
  const LandmarkCloud& more = inverted ? source : target;
  return *share_within(nearest_squared_distances(less.positions, inverted ? truth.inverse() : truth,
                                                 BatchTree(more.positions), Executor()),
                       kCounterpart);
}

// -1 where the covariance is unknown.
double squared_mahalanobis(const AlignResult& result, const Rigid3& truth) {
  if (!result.covariance) return -1.0;
  return normalised_squared_error(result.target_from_source, *result.covariance, truth);
}

struct Pair {
  std::string target_place;
  LandmarkCloud source;
  LandmarkCloud target;
  Rigid3 truth;  // target_from_source
  double overlap = 0.0;
};

// Parts of a session and of one of the others, both moved anyhow; of one place, with an overlap in the
// range if that can be had.
std::optional<Pair> draw_pair(const Session& one, const std::vector<const Session*>& others,
                              const std::array<double, 2>& overlaps, Random& random) {
  constexpr int kAttempts = 40;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Session& other = *others[random.index(others.size())];
    // Parts of one session have no keyframe in common.
    const double cut = &one == &other ? random.uniform(0.3, 0.7) : 1.0;
    const auto a = part_of(one, 0.0, cut, random);
    const auto b = part_of(other, &one == &other ? cut : 0.0, 1.0, random);
    if (!a || !b) continue;
    const Rigid3 moved_source = random_pose(random, kMovedUpTo);
    const Rigid3 moved_target = random_pose(random, kMovedUpTo);
    Pair pair{
        other.place, landmark_cloud(transformed(a->map, moved_source)),
        landmark_cloud(transformed(b->map, moved_target)),
        moved_target * b->world_from_map.inverse() * a->world_from_map * moved_source.inverse()};
    if (one.place != other.place) return pair;
    pair.overlap = overlap(pair.source, pair.target, pair.truth);
    if (pair.overlap >= overlaps[0] && pair.overlap < overlaps[1]) return pair;
  }
  return std::nullopt;
}

// What the true pose would be as a candidate: tells a failing search from maps that do not say more.
PlacementCandidate true_candidate(const Pair& pair, double radius) {
  RefineOptions refinement;
  refinement.initial = pair.truth;
  refinement.fine = 2.0 * radius;
  refinement.coarse = 4.0 * radius;
  const CentredPair centred(pair.source, pair.target);
  const Rigid3 pose =
      centred.centred(refine(pair.source, pair.target, refinement).target_from_source).rigid();
  const BatchTree source_tree(centred.source().positions);
  const BatchTree target_tree(centred.target().positions);
  const Support support = SupportCounter(centred, source_tree, target_tree, pair.source.size(),
                                         Executor())(pose, radius);
  PlacementCandidate candidate;
  candidate.target_from_source = centred.uncentred(pose).rigid();
  candidate.support = support.share;
  candidate.close_support = support.close_share;
  candidate.evidence = support.evidence;
  candidate.spread_evidence = support.spread_evidence;
  return candidate;
}

void run(const std::vector<Session>& sessions, std::uint64_t pairs, bool odd,
         const Executor& executor) {
  std::puts(
      "pair,source,target,same,overlap,source_landmarks,target_landmarks,verdict,wall_s,rank,"
      "support,"
      "close_support,evidence,spread_evidence,contradicted,probability,rotation_deg,translation_m,"
      "mahalanobis");
  for (std::uint64_t pair = 0; pair < pairs; ++pair) {
    Random random = Random(pair).fork(odd ? 1 : 2);
    const Session& one = sessions[random.index(sessions.size())];
    const bool same = pair % 2 == 0;
    std::vector<const Session*> others;
    for (const Session& session : sessions) {
      if ((session.place == one.place) == same) others.push_back(&session);
    }
    const auto drawn = draw_pair(one, others, kOverlaps[pair / 2 % kOverlaps.size()], random);
    if (!drawn) continue;
    const auto& [place, source, target, truth, shared] = *drawn;
    PlaceOptions options;
    options.seed = pair;
    options.executor = executor;
    const PlacementResult result = cairn::place(source, target, options);
    std::vector<PlacementCandidate> candidates = result.candidates;
    if (same) candidates.push_back(true_candidate(*drawn, result.radius));
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const PlacementCandidate& candidate = candidates[i];
      const PoseError error =
          same ? pose_error(candidate.target_from_source, truth, source.positions)
               : PoseError{std::numbers::pi, 100.0};
      std::printf(
          "%llu,%s,%s,%d,%.4f,%zu,%zu,%s,%.3f,%d,%.5f,%.5f,%.3f,%.3f,%.5f,%.6f,%.3f,%.4f,%.3f\n",
          static_cast<unsigned long long>(pair), one.place.c_str(), place.c_str(), same ? 1 : 0,
          shared, source.size(), target.size(), std::string(to_string(result.verdict)).c_str(),
          result.duration_s, i < result.candidates.size() ? static_cast<int>(i) : -1,
          candidate.support, candidate.close_support, candidate.evidence, candidate.spread_evidence,
          candidate.contradicted.value_or(-1.0), candidate.probability, degrees(error.rotation_rad),
          error.translation, i == 0 && same ? squared_mahalanobis(result.alignment, truth) : -1.0);
    }
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 3 || (words[2] != "fit" && words[2] != "test")) {
    std::fputs("usage: cairn_placement_sessions_benchmark FOLDER PAIRS fit|test [THREADS]\n",
               stderr);
    return 2;
  }
  try {
    const bool odd = words[2] == "fit";
    run(read_sessions(words[0], odd), std::stoull(words[1]), odd,
        Executor(words.size() > 3 ? static_cast<unsigned>(std::stoul(words[3])) : 0));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
