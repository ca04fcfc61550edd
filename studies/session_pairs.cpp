// SPDX-License-Identifier: BSD-3-Clause
#include "session_pairs.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/random.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/score/fitness.hpp"

#include "random_pose.hpp"

namespace cairn::benchmarks {
namespace {

constexpr double kCounterpart = 0.05;  // metres, within which landmarks count as overlapping
constexpr std::size_t kFewest = 150;   // landmarks of a part
constexpr double kMovedUpTo = 5.0;     // metres
// Pairs of one place take turns; the first have nothing in common.
constexpr std::array<std::array<double, 2>, 5> kOverlaps = {
    {{0.0, 0.01}, {0.1, 0.25}, {0.25, 0.4}, {0.4, 0.6}, {0.6, 1.001}}};

// Of consecutive keyframes of a session, with where it is.
struct Part {
  LandmarkMap map;
  Rigid3 world_from_map;
};

SessionPart part_of_seed(int seed) {
  if (seed % 2 == 0) return SessionPart::kTest;
  return seed % 4 == 1 ? SessionPart::kFit : SessionPart::kChoose;
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

// Parts of a session and of one of the others, both moved anyhow; of one place, with an overlap in the
// range if that can be had.
std::optional<SessionPair> draw_pair(const Session& one, const std::vector<const Session*>& others,
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
    SessionPair pair;
    pair.source_place = one.place;
    pair.target_place = other.place;
    pair.source = landmark_cloud(transformed(a->map, moved_source));
    pair.target = landmark_cloud(transformed(b->map, moved_target));
    pair.truth =
        moved_target * b->world_from_map.inverse() * a->world_from_map * moved_source.inverse();
    if (one.place != other.place) return pair;
    pair.overlap_range = overlaps;
    pair.overlap = overlap(pair.source, pair.target, pair.truth);
    if (pair.overlap >= overlaps[0] && pair.overlap < overlaps[1]) return pair;
  }
  return std::nullopt;
}

}  // namespace

std::vector<Session> read_sessions(const std::filesystem::path& folder,
                                   std::optional<SessionPart> part) {
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
    if (part && part_of_seed(seed) != *part) continue;
    // Still being made.
    if (!exists(std::filesystem::path(file).replace_extension(".gt"))) continue;
    Session session{place, read_map(file), {}};
    FileReader truth(file.replace_extension(".gt"));
    const Trajectory trajectory = read_trajectory(truth);
    for (const TimedPose& pose : trajectory.poses()) {
      session.truth[pose.timestamp_s] = pose.world_from_camera;
    }
    sessions.push_back(std::move(session));
  }
  if (sessions.size() < 2) throw std::runtime_error("fewer than two sessions");
  return sessions;
}

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

double overlap(const LandmarkCloud& source, const LandmarkCloud& target, const Rigid3& truth) {
  const bool inverted = source.size() > target.size();
  const LandmarkCloud& less = inverted ? target : source;
  const LandmarkCloud& more = inverted ? source : target;
  return *share_within(nearest_squared_distances(less.positions, inverted ? truth.inverse() : truth,
                                                 BatchTree(more.positions), Executor()),
                       kCounterpart);
}

std::uint64_t whole_number(std::string_view word) {
  std::uint64_t number = 0;
  const char* const end = word.data() + word.size();
  const auto [last, error] = std::from_chars(word.data(), end, number);
  if (error != std::errc() || last != end) {
    throw Error(ErrorKind::kMisuse, "pairs", "\"" + std::string(word) + "\" is not their number",
                "a whole number");
  }
  return number;
}

PairNumbers pair_numbers(const std::string& word) {
  const std::size_t dash = word.find('-');
  const bool range = dash != std::string::npos;
  const PairNumbers numbers = {range ? whole_number(std::string_view(word).substr(0, dash)) : 0,
                               whole_number(std::string_view(word).substr(range ? dash + 1 : 0))};
  if (numbers.end <= numbers.first) {
    throw Error(ErrorKind::kMisuse, "pairs", "\"" + word + "\" names no pairs",
                "a number, or FIRST-END with END, which is not among them, the larger");
  }
  return numbers;
}

SessionPart session_part(std::string_view name) {
  if (name == "fit") return SessionPart::kFit;
  if (name == "choose") return SessionPart::kChoose;
  if (name == "test") return SessionPart::kTest;
  throw Error(ErrorKind::kMisuse, "part", "\"" + std::string(name) + "\" is none",
              "fit, choose or test");
}

void for_each_session_pair(const std::filesystem::path& folder, PairNumbers numbers,
                           SessionPart part, const std::function<void(const SessionPair&)>& take,
                           bool strangers) {
  const std::vector<Session> sessions = read_sessions(folder, part);
  for (std::uint64_t number = numbers.first; number < numbers.end; ++number) {
    Random random = Random(number).fork(static_cast<std::uint64_t>(part));
    const Session& one = sessions[random.index(sessions.size())];
    const bool same = number % 2 == 0;
    if (same && strangers) continue;
    std::vector<const Session*> others;
    for (const Session& session : sessions) {
      if ((session.place == one.place) == same) others.push_back(&session);
    }
    auto pair = draw_pair(one, others, kOverlaps[number / 2 % kOverlaps.size()], random);
    if (!pair) continue;
    pair->number = number;
    take(*pair);
  }
}

}  // namespace cairn::benchmarks
