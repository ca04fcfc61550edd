// SPDX-License-Identifier: BSD-3-Clause
// What the verdict makes of different places in which one thing stands, and of pairs as they are.
//   cairn_shared_things_benchmark FOLDER NUMBERS [fit|choose|test [things|pairs|strangers [deformed|bare|coloured]]]
// FOLDER holds sessions as studies/placement_sessions.sh makes them; NUMBERS is "150" or "150-300". "things" (the
// default) takes two maps of different places and puts into both what two sessions of a third saw
// within 0.2 to 0.7 m of a landmark: any pose that is aligned is wrong. "pairs" leaves maps as they are,
// every other pair of one place; "strangers" are those of different places. "bare" leaves out descriptors, lines of
// sight and colours, "coloured" the first two. "deformed" frees the scale and judges pairs also up to a smooth deformation, both by
// descriptors alone. One CSV row a pair to stdout.
#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/detail/evidence/verdict.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"

#include "random_pose.hpp"
#include "session_pairs.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;
using benchmarks::Session;
using benchmarks::SessionPair;

constexpr std::size_t kFewest = 60;  // landmarks of a thing, in either session

// A ball of landmarks, about the origin, as one session mapped it.
struct Thing {
  LandmarkCloud cloud;
  double radius = 0.0;
};

std::vector<std::uint32_t> within(const LandmarkCloud& cloud, const Eigen::Vector3d& centre,
                                  double radius, bool inside) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    if (((cloud.positions[i] - centre).norm() <= radius) == inside) result.push_back(i);
  }
  return result;
}

LandmarkCloud rows_of(const LandmarkCloud& cloud, const std::vector<std::uint32_t>& rows) {
  LandmarkCloud result;
  for (const std::uint32_t i : rows) {
    result.positions.push_back(cloud.positions[i]);
    if (!cloud.covariances.empty()) result.covariances.push_back(cloud.covariances[i]);
    if (!cloud.weights.empty()) result.weights.push_back(cloud.weights[i]);
    if (!cloud.lightness.empty()) result.lightness.push_back(cloud.lightness[i]);
  }
  if (cloud.descriptors) result.descriptors = descriptor_rows(*cloud.descriptors, rows);
  return result;
}

LandmarkCloud moved(LandmarkCloud cloud, const Rigid3& pose) {
  for (Eigen::Vector3d& position : cloud.positions) position = pose * position;
  for (Eigen::Matrix3d& covariance : cloud.covariances) {
    covariance = pose.rotation() * covariance * pose.rotation().transpose();
  }
  return cloud;
}

// Of two sessions of one place, what both saw about a landmark.
std::optional<std::array<Thing, 2>> draw_thing(const std::vector<Session>& sessions,
                                               Random& random) {
  constexpr int kAttempts = 200;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const std::array both = {&sessions[random.index(sessions.size())],
                             &sessions[random.index(sessions.size())]};
    const double radius = random.uniform(0.2, 0.7);
    if (both[0] == both[1] || both[0]->place != both[1]->place) continue;
    std::array<LandmarkCloud, 2> clouds;
    std::array<Rigid3, 2> world;
    for (std::size_t i = 0; i < 2; ++i) {
      clouds[i] = landmark_cloud(both[i]->map);
      world[i] = benchmarks::world_from_map(both[i]->map, both[i]->truth).value();
    }
    const Eigen::Vector3d centre = world[0] * clouds[0].positions[random.index(clouds[0].size())];
    std::array<Thing, 2> things;
    bool enough = true;
    for (std::size_t i = 0; i < 2; ++i) {
      const Eigen::Vector3d here = world[i].inverse() * centre;
      const auto rows = within(clouds[i], here, radius, true);
      enough = enough && rows.size() >= kFewest;
      // Both in the world's directions, about the thing's centre.
      things[i] = {moved(rows_of(clouds[i], rows),
                         Rigid3(Eigen::Quaterniond::Identity(), -centre) * world[i]),
                   radius};
    }
    if (enough) return things;
  }
  return std::nullopt;
}

// Puts the thing in the place of what is about one of the cloud's landmarks; views that saw some of that see
// the thing.
LandmarkCloud with_thing(const LandmarkCloud& cloud, const Thing& thing, Random& random) {
  const Eigen::Vector3d centre = cloud.positions[random.index(cloud.size())];
  const auto kept = within(cloud, centre, thing.radius, false);
  LandmarkCloud result = rows_of(cloud, kept);
  std::vector<std::uint32_t> place(cloud.size(), static_cast<std::uint32_t>(cloud.size()));
  for (std::uint32_t i = 0; i < kept.size(); ++i) place[kept[i]] = i;
  Rigid3 pose = benchmarks::random_pose(random, 0.0);
  pose = Rigid3(pose.quaternion(), centre);
  const LandmarkCloud added = moved(thing.cloud, pose);
  for (const LandmarkView& view : cloud.views) {
    LandmarkView& left = result.views.emplace_back(LandmarkView{view.centre, {}});
    for (const std::uint32_t i : view.landmarks) {
      if (place[i] < cloud.size()) left.landmarks.push_back(place[i]);
    }
    if (left.landmarks.size() == view.landmarks.size()) continue;
    for (std::uint32_t i = 0; i < added.size(); ++i) {
      left.landmarks.push_back(static_cast<std::uint32_t>(kept.size()) + i);
    }
  }
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(result.positions, added.positions);
  append(result.covariances, added.covariances);
  append(result.weights, added.weights);
  append(result.lightness, added.lightness);
  std::vector<std::span<const std::uint8_t>> all;
  for (std::size_t i = 0; i < added.size(); ++i) {
    all.clear();
    for (std::size_t k = 0; k < added.descriptors->count(i); ++k) {
      all.push_back(added.descriptors->descriptor(i, k));
    }
    append_descriptors(*result.descriptors, all);
  }
  return result;
}

// The pose and verdict up to a deformation; std::nullopt if there clearly is none.
std::optional<std::pair<Similarity3, Verdict>> as_deformed(const PreparedMap& source,
                                                           const PreparedMap& target,
                                                           const Alignment& placed,
                                                           const AlignOptions& options,
                                                           const Execution& execution) {
  std::vector<Similarity3> starts;
  for (const PlacementCandidate& candidate : placed.candidates) {
    starts.push_back(candidate.similarity());
  }
  const DeformablePair pair(source, target);
  const auto pose = pair.fit(starts);
  if (!pose || !pose->is_clear()) return std::nullopt;
  return std::pair(pose->target_from_source, *pair.judge(*pose, options, execution).verdict);
}

// Columns of the result up to a deformation: verdict, scale, and the error of its rigid part.
std::string columns_of(const std::pair<Similarity3, Verdict>& found, const SessionPair& pair) {
  const PoseError error = pose_error(found.first.rigid(), pair.truth, pair.source.positions);
  return fmt::format("{},{:.4f},{:.2f},{:.4f}", to_string(found.second), found.first.scale(),
                     degrees(error.rotation_rad), error.translation);
}

void tell(const SessionPair& pair, double thing, bool deformed) {
  AlignOptions options;
  const Execution execution{.seed = pair.number};
  if (deformed) {
    options.scale = ScaleRange();
    options.search = PoseSearch::kNever;
  }
  const PreparedMap source(pair.source, "source", execution);
  const PreparedMap target(pair.target, "target", execution);
  const Alignment result = PreparedPair(source, target, options, execution).place();
  const auto found =
      deformed ? as_deformed(source, target, result, options, execution) : std::nullopt;
  PoseError error{0.0, 0.0};
  if (pair.same_place() && thing == 0.0 && result.registration.has_pose()) {
    error = pose_error(result.registration.target_from_source, pair.truth, pair.source.positions);
  }
  const bool right = pair.same_place() && thing == 0.0 && result.registration.has_pose() &&
                     degrees(error.rotation_rad) <= 5.0 && error.translation <= 0.05;
  const std::size_t spread =
      result.candidates.empty() ? 0 : detail::agreement_spread(result.candidates.front().support);
  fmt::print(
      "{},{},{},{:.3f},{:.3f},{},{},{},{:.6f},{:.2f},{:.4f},{},{},{},{},{:.2f},{:.3f},{},{},{},{}"
      "\n",
      pair.number, pair.source_place, pair.target_place, pair.overlap, thing, pair.source.size(),
      pair.target.size(), to_string(*result.verdict), *result.probability,
      degrees(error.rotation_rad), error.translation, right ? 1 : 0,
      result.around.landmarks.in_front, result.around.landmarks.agree,
      result.around.landmarks.behind, result.around.extent, result.around.share, spread,
      result.around.seen_alike.landmarks, result.around.seen_alike.distinctive,
      found ? columns_of(*found, pair) : ",,,");
  std::fflush(stdout);
}

// The pair as points alone.
SessionPair positions_of(SessionPair pair, bool coloured) {
  for (LandmarkCloud* const cloud : {&pair.source, &pair.target}) {
    cloud->descriptors.reset();
    cloud->views.clear();
    if (!coloured) cloud->lightness.clear();
  }
  return pair;
}

void run(const std::vector<std::string>& words) {
  const std::string& folder = words[0];
  const auto part = benchmarks::session_part(words.size() > 2 ? words[2] : "test");
  const bool strangers = words.size() > 3 && words[3] == "strangers";
  const bool things = words.size() <= 3 || words[3] == "things";
  const bool deformed = words.size() > 4 && words[4] == "deformed";
  const bool coloured = words.size() > 4 && words[4] == "coloured";
  const bool bare = words.size() > 4 && words[4] == "bare";
  const auto tell_as_asked = [&](const SessionPair& pair, double share) {
    tell(bare || coloured ? positions_of(pair, coloured) : pair, share, deformed);
  };
  const std::vector<Session> sessions = benchmarks::read_sessions(folder, part);
  fmt::print(
      "pair,source,target,overlap,thing,source_landmarks,target_landmarks,verdict,probability,"
      "rotation_deg,translation_m,right,in_front,agree,behind,extent,around,agreeing,seen_alike,"
      "distinctive,deformed,deformed_scale,deformed_deg,deformed_m\n");
  benchmarks::for_each_session_pair(
      folder, benchmarks::pair_numbers(words[1]), part,
      [&](const SessionPair& pair) {
        if (!things) return tell_as_asked(pair, 0.0);
        if (pair.same_place()) return;
        Random random = Random(pair.number).fork(99);
        const auto thing = draw_thing(sessions, random);
        if (!thing) return;
        SessionPair with = pair;
        with.source = with_thing(pair.source, (*thing)[0], random);
        with.target = with_thing(pair.target, (*thing)[1], random);
        const auto share = [](const Thing& one, const LandmarkCloud& in) {
          return static_cast<double>(one.cloud.size()) / static_cast<double>(in.size());
        };
        tell_as_asked(with,
                      std::min(share((*thing)[0], with.source), share((*thing)[1], with.target)));
      },
      strangers);
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(
      argc, argv, 2,
      "FOLDER NUMBERS [fit|choose|test [things|pairs|strangers [deformed|bare|coloured]]]", run);
}
