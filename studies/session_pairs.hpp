// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn::benchmarks {

/// A mapped session with its truth.
struct Session {
  std::string place;
  LandmarkMap map;
  std::map<double, Rigid3> truth;  ///< world_from_camera by time
};

/// Parts of two mapped sessions, both moved anyhow.
struct SessionPair {
  std::uint64_t number = 0;
  std::string source_place;
  std::string target_place;
  LandmarkCloud source;
  LandmarkCloud target;
  Rigid3 truth;  ///< target_from_source; means nothing between places
  /// Share of the smaller part's landmarks with a counterpart; 0 between places.
  double overlap = 0.0;
  std::array<double, 2> overlap_range = {};  ///< which it was drawn for, the end not among it

  bool same_place() const { return source_place == target_place; }
};

/// The pairs from the number first on, up to end, which is not among them.
struct PairNumbers {
  std::uint64_t first = 0;
  std::uint64_t end = 0;
};

/// @throws Error (misuse) for anything but the digits of a number
std::uint64_t whole_number(std::string_view word);

/// Numbers as written: "700" for the first 700 pairs, "700-1400" for the next.
/// @throws Error (misuse) for anything else, and where there is no such pair
PairNumbers pair_numbers(const std::string& word);

/// Places are split by their seed, so that what is measured with one part was not fitted to another.
enum class SessionPart {
  kFit = 1,     ///< seeds 1, 5, 9, ...: the model is fitted to them
  kChoose = 3,  ///< seeds 3, 7, 11, ...: the threshold is chosen with them
  kTest = 2,    ///< even seeds
};

/// "fit", "choose" or "test".
/// @throws Error (misuse) for another name
SessionPart session_part(std::string_view name);

/// @param folder as of for_each_session_pair()
/// @param part   std::nullopt: sessions of all seeds
/// @throws Error or std::runtime_error if there are no two sessions
std::vector<Session> read_sessions(const std::filesystem::path& folder,
                                   std::optional<SessionPart> part = {});

/// Where a map lies in the world: the mean of what its keyframes say, since odometry drifts and a part is to be
/// judged by its own place. std::nullopt if the truth knows no keyframe.
std::optional<Rigid3> world_from_map(const LandmarkMap& map, const std::map<double, Rigid3>& truth);

/// Share of the smaller cloud's landmarks with a counterpart.
double overlap(const LandmarkCloud& source, const LandmarkCloud& target, const Rigid3& truth);

/// Draws pairs, every other (odd number) of two different places; a number means the same pair each time. For
/// some no parts that overlap as wanted are found: these are left out.
///
/// @param strangers only those of different places
/// @param folder holds, for each session, PLACE-SEED-SESSION.cairn and PLACE-SEED-SESSION.gt, its ground
///               truth (studies/placement_sessions.sh makes them)
/// @throws Error or std::runtime_error if there are no two sessions
void for_each_session_pair(const std::filesystem::path& folder, PairNumbers numbers,
                           SessionPart part, const std::function<void(const SessionPair&)>& take,
                           bool strangers = false);

}  // namespace cairn::benchmarks
