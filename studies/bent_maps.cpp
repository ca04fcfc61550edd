// SPDX-License-Identifier: BSD-3-Clause
// Aligns maps of simulated sessions that are bent smoothly, with truth.
//   cairn_bent_maps_benchmark FOLDER PAIRS [DEGREES,...]
// FOLDER holds sessions as studies/placement_sessions.sh makes them. Each pair is two sessions of one place, of which the
// second is cut and bent by each of DEGREES (default 0,2.5,5,7.5,10).
//   cairn_bent_maps_benchmark FOLDER PAIRS strangers
// takes sessions of different places, bent by up to 10 degrees, and aligns them by parts alone, which includes the
// whole. One CSV row a pair to stdout. PAIRS is a number, or the numbers of the pairs: 700-1400 are the next 700.
//   cairn_bent_maps_benchmark FOLDER PAIRS guesses
// aligns the pairs of one place, not bent, from guesses 0 to 60 degrees and 0 to 2 m off, and from nowhere.
//   cairn_bent_maps_benchmark FOLDER PAIRS merge
// merges each pair, bent by 0 to 10 degrees, with and without straightening, and states how far off the keyframes of
// the bent map are then.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/merging/merge.hpp"

#include "random_pose.hpp"
#include "session_pairs.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;
using benchmarks::Session;

constexpr double kRightAngle = 5.0;   // degrees
constexpr double kRightPlace = 0.05;  // metres

struct BentMap {
  LandmarkMap map;
  std::vector<Eigen::Vector3d> before;  // where each landmark was
};

// Every keyframe turns by a little more than the camera did, as odometry that drifts does; a landmark
// moves with the mean of the keyframes that observed it.
BentMap bent(const LandmarkMap& map, double angle, const Eigen::Vector3d& axis) {
  MapTables tables = LandmarkMap(map).tables();
  const std::size_t frames = map.frame_count();
  std::vector<Rigid3> new_from_old(frames);
  Rigid3 pose = map.world_from_camera(FrameIndex{0});
  const auto bend = [&](std::size_t i) {
    const double u =
        static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(frames - 1, 1));
    return angle * u * u * (3.0 - 2.0 * u);
  };
  for (std::uint32_t i = 0; i < frames; ++i) {
    const Rigid3 old = map.world_from_camera(FrameIndex{i});
    if (i > 0) {
      const Rigid3 step = map.world_from_camera(FrameIndex{i - 1}).inverse() * old;
      const Eigen::Vector3d about = old.quaternion().conjugate() * axis;
      pose = pose * step *
             Rigid3(rotation_exp(about * (bend(i) - bend(i - 1))), Eigen::Vector3d::Zero());
    }
    new_from_old[i] = pose * old.inverse();
    const Eigen::Quaterniond q = pose.quaternion();
    tables.frames.translations[i] = pose.translation();
    tables.frames.quaternions[i] = {q.w(), q.x(), q.y(), q.z()};
  }
  BentMap result{{}, tables.landmarks.positions};
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto seen = map.observing_frames(LandmarkIndex{i});
    if (seen.empty()) continue;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const FrameIndex frame : seen) sum += new_from_old[frame.value] * result.before[i];
    tables.landmarks.positions[i] = sum / static_cast<double>(seen.size());
  }
  result.map = LandmarkMap(std::move(tables));
  return result;
}

LandmarkMap cut(const LandmarkMap& map, double least, Random& random) {
  const auto& ids = map.frames().ids;
  const auto count = static_cast<double>(ids.size());
  const double share = random.uniform(least, 1.0);
  const auto first = static_cast<std::size_t>(random.uniform(0.0, 1.0 - share) * count);
  const auto last = std::min(first + static_cast<std::size_t>(share * count), ids.size() - 1);
  return cut_frames(map, ids[first], FrameId{ids[last].value + 1});
}

// The rigid pose that fits best where points went.
Rigid3 fitted(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  Eigen::Matrix3Xd a(3, static_cast<Eigen::Index>(from.size()));
  Eigen::Matrix3Xd b(3, static_cast<Eigen::Index>(from.size()));
  for (std::size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[i];
    b.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  return Rigid3::from_matrix(Eigen::umeyama(a, b, false));
}

bool is_right(const PoseError& error) {
  return degrees(error.rotation_rad) <= kRightAngle && error.translation <= kRightPlace;
}

// The source, bent, is moved anyhow; so is the target.
struct Case {
  std::string source_place;
  std::string target_place;
  double overlap = 0.0;
  double bend = 0.0;
  LandmarkMap source;
  LandmarkMap target;
  std::vector<Eigen::Vector3d> here;   // kept landmarks of the source
  std::vector<Eigen::Vector3d> there;  // and where they are in the target
  std::vector<Rigid3> keyframes;       // true poses of the source's in the target
};

Case make_case(const Session& one, const Session& other, double degrees_bent, std::uint64_t seed,
               double least) {
  Random random(seed);
  const LandmarkMap source = cut(one.map, least, random);
  const LandmarkMap target = cut(other.map, least, random);
  const Eigen::Vector3d axis =
      Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
  const BentMap bend = bent(source, radians(degrees_bent), axis);
  const Rigid3 moved_source = benchmarks::random_pose(random, 5.0);
  const Rigid3 moved_target = benchmarks::random_pose(random, 5.0);
  const Rigid3 truth = benchmarks::world_from_map(target, other.truth).value().inverse() *
                       benchmarks::world_from_map(source, one.truth).value();
  Case result{one.place,
              other.place,
              0.0,
              degrees_bent,
              transformed(bend.map, moved_source),
              transformed(target, moved_target),
              {},
              {},
              {}};
  if (one.place == other.place)
    result.overlap = benchmarks::overlap(landmark_cloud(source), landmark_cloud(target), truth);
  for (const LandmarkIndex i : landmarks_observed(result.source, 2)) {
    result.here.push_back(result.source.landmarks().positions[i.value]);
    result.there.emplace_back(moved_target * (truth * bend.before[i.value]));
  }
  for (std::uint32_t i = 0; i < source.frame_count(); ++i) {
    result.keyframes.push_back(moved_target * truth * source.world_from_camera(FrameIndex{i}));
  }
  return result;
}

void tell_stranger(const Case& one, std::uint64_t number) {
  AlignOptions options;
  options.parts = PartsUse::kAlways;
  const Alignment result = align(one.source, one.target, options, {.seed = number});
  std::printf("%llu,%s,%s,%.1f,%zu,%zu,%s,%.2f\n", static_cast<unsigned long long>(number),
              one.source_place.c_str(), one.target_place.c_str(), one.bend,
              one.source.landmark_count(), one.target.landmark_count(),
              std::string(status_of(result)).c_str(), result.duration_s);
  std::fflush(stdout);
}

void tell(const Case& one, std::uint64_t number) {
  AlignOptions options;
  options.parts = PartsUse::kNever;
  const Alignment whole = align(one.source, one.target, options, {.seed = number});
  options.parts = PartsUse::kAlways;
  const Alignment result = align(one.source, one.target, options, {.seed = number});
  const bool same = one.source_place == one.target_place;
  PoseError error{radians(180.0), 100.0};
  PoseError at_place = error;
  double stated = -1.0;
  double worst_angle = 0.0;
  double worst_place = 0.0;
  if (result.parts && result.parts->bend) stated = degrees(result.parts->bend->rotation_rad);
  if (same && result.estimate) {
    error = pose_error(*result.estimate, fitted(one.here, one.there), one.here);
    at_place = error;
    // A whole that is placed is placed where it overlaps: somewhere along the bend.
    for (std::size_t begin = 0; begin + 20 < one.here.size(); begin += one.here.size() / 8 + 1) {
      const std::size_t end = std::min(begin + one.here.size() / 8 + 1, one.here.size());
      const std::vector<Eigen::Vector3d> a(one.here.begin() + begin, one.here.begin() + end);
      const std::vector<Eigen::Vector3d> b(one.there.begin() + begin, one.there.begin() + end);
      const PoseError there = pose_error(*result.estimate, fitted(a, b), a);
      if (there.rotation_rad + there.translation < at_place.rotation_rad + at_place.translation) {
        at_place = there;
      }
    }
  }
  if (same && result.parts) {
    for (const PartPose& part : result.parts->parts) {
      if (!part.agrees || part.map != MapRole::kSource || !part.target_from_source) continue;
      std::vector<Eigen::Vector3d> a;
      std::vector<Eigen::Vector3d> b;
      // By the keyframes that see them most.
      const std::vector<LandmarkIndex> kept = landmarks_observed(one.source, 2);
      for (std::size_t i = 0; i < kept.size(); ++i) {
        const auto seen = one.source.observing_frames(kept[i]);
        const FrameId middle = one.source.frames().ids[seen[(seen.size() - 1) / 2].value];
        if (middle < part.first || part.last < middle) continue;
        a.push_back(one.here[i]);
        b.push_back(one.there[i]);
      }
      if (a.size() < 20) continue;
      const PoseError off = pose_error(*part.target_from_source, fitted(a, b), a);
      worst_angle = std::max(worst_angle, degrees(off.rotation_rad));
      worst_place = std::max(worst_place, off.translation);
    }
  }
  std::printf(
      "%llu,%s,%s,%.1f,%.3f,%zu,%zu,%s,%s,%d,%d,%zu,%zu,%.2f,%.2f,%.3f,%d,%d,%.2f,%.3f,%.2f,%.2f\n",
      static_cast<unsigned long long>(number), one.source_place.c_str(), one.target_place.c_str(),
      one.bend, one.overlap, one.source.landmark_count(), one.target.landmark_count(),
      std::string(status_of(whole)).c_str(), std::string(status_of(result)).c_str(),
      result.parts && result.parts->consensus, result.parts && result.parts->contradictory,
      result.parts ? result.parts->aligned : 0, result.parts ? result.parts->parts.size() : 0,
      stated, degrees(error.rotation_rad), error.translation, is_right(error) ? 1 : 0,
      is_right(at_place) ? 1 : 0, worst_angle, worst_place, whole.duration_s, result.duration_s);
  std::fflush(stdout);
}

void tell_guesses(const Case& one, std::uint64_t number) {
  constexpr int kGuesses = 6;
  const Rigid3 truth = fitted(one.here, one.there);
  const Eigen::Vector3d middle = truth * centroid(one.here);
  Random random(number + 99);
  for (int i = -1; i < kGuesses; ++i) {
    AlignOptions options;
    options.parts = PartsUse::kNever;
    double angle = 0.0;
    double offset = 0.0;
    if (i >= 0) {
      angle = radians(60.0) * random.uniform();
      offset = 2.0 * random.uniform();
      const auto direction = [&] {
        return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
      };
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, direction()));
      options.prior =
          PosePrior{.target_from_source =
                        Rigid3(turn, middle + offset * direction() - turn * middle) * truth};
    }
    const Alignment result = align(one.source, one.target, options, {.seed = number});
    PoseError error{radians(180.0), 100.0};
    if (result.estimate) error = pose_error(*result.estimate, truth, one.here);
    std::printf("%llu,%s,%.3f,%s,%.1f,%.2f,%s,%.2f,%.3f,%d\n",
                static_cast<unsigned long long>(number), one.source_place.c_str(), one.overlap,
                i < 0 ? "nowhere" : "guess", degrees(angle), offset,
                std::string(status_of(result)).c_str(), degrees(error.rotation_rad),
                error.translation, is_right(error) ? 1 : 0);
    std::fflush(stdout);
  }
}

void tell_merge(const Case& one, std::uint64_t number) {
  MergeOptions options;
  const std::vector<MergeInput> maps = {{"target", &one.target}, {"source", &one.source}};
  std::string row =
      fmt::format("{},{},{:.1f},{:.3f}", number, one.source_place, one.bend, one.overlap);
  for (const bool straighten : {false, true}) {
    options.straighten = straighten;
    const MergeResult merged = merge(maps, options, {.seed = number});
    if (merged.placed() < 2) {
      row += ",0,,,";
      continue;
    }
    std::vector<double> angles;
    std::vector<double> distances;
    const auto first = static_cast<std::uint32_t>(one.target.frame_count());
    for (std::uint32_t i = 0; i < one.keyframes.size(); ++i) {
      const Rigid3 error =
          one.keyframes[i].inverse() * merged.map->world_from_camera(FrameIndex{first + i});
      angles.push_back(degrees(error.angle()));
      distances.push_back(error.translation().norm());
    }
    const auto median = [](std::vector<double>& values) {
      std::sort(values.begin(), values.end());
      return values[values.size() / 2];
    };
    const auto& bend = merged.maps[1].bend ? merged.maps[1].bend : merged.maps[0].bend;
    row += fmt::format(",1,{:.2f},{:.3f},{:.4f}", bend ? degrees(bend->rotation_rad) : 0.0,
                       median(angles), median(distances));
  }
  std::printf("%s\n", row.c_str());
  std::fflush(stdout);
}

std::vector<double> numbers_of(const std::string& text) {
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    numbers.push_back(std::stod(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return numbers;
}

void run(const std::vector<std::string>& words) {
  const std::vector<Session> sessions = benchmarks::read_sessions(words[0]);
  const benchmarks::PairNumbers numbers = benchmarks::pair_numbers(words[1]);
  const std::string what = words.size() > 2 ? words[2] : "0,2.5,5,7.5,10";
  const bool strangers = what == "strangers";
  const bool guesses = what == "guesses";
  const bool merges = what == "merge";
  std::vector<double> bends = {0.0};
  if (!strangers && !guesses) bends = numbers_of(merges ? "0,2.5,5,7.5,10" : what);
  std::puts(
      merges      ? "pair,place,bend_deg,overlap,placed,mended_deg,rotation_deg,translation_m,"
                    "placed_straight,mended_straight_deg,rotation_straight_deg,translation_straight_m"
      : strangers ? "pair,source,target,bend_deg,source_landmarks,target_landmarks,verdict,total_s"
      : guesses
          ? "pair,place,overlap,start,guess_deg,guess_m,verdict,rotation_deg,translation_m,right"
          : "pair,source,target,bend_deg,overlap,source_landmarks,target_landmarks,whole,verdict,"
            "consensus,contradictory,parts_aligned,parts,stated_deg,rotation_deg,translation_m,"
            "right,right_somewhere,worst_part_deg,worst_part_m,whole_s,total_s");
  for (std::uint64_t number = numbers.first; number < numbers.end; ++number) {
    Random random = Random(number).fork(1);
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < sessions.size(); ++i) {
      for (std::size_t j = 0; j < sessions.size(); ++j) {
        if (i != j && (sessions[i].place == sessions[j].place) != strangers)
          pairs.emplace_back(i, j);
      }
    }
    if (pairs.empty()) throw std::runtime_error("no such pair of sessions");
    const auto [source, target] = pairs[random.index(pairs.size())];
    if (strangers) bends = {random.uniform(0.0, 10.0)};
    for (const double bend : bends) {
      const Case one =
          make_case(sessions[source], sessions[target], bend, number + 1000, strangers ? 0.1 : 0.6);
      if (strangers) {
        tell_stranger(one, number);
      } else if (guesses) {
        tell_guesses(one, number);
      } else if (merges) {
        tell_merge(one, number);
      } else {
        tell(one, number);
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(argc, argv, 2, "FOLDER PAIRS [DEGREES,...|strangers|guesses|merge]",
                                run);
}
