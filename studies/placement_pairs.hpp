// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn::benchmarks {

/// Two maps to be placed on each other from no initial pose, and what to think of the answer.
struct PlacementPair {
  std::string group;
  std::uint64_t trial = 0;
  LandmarkCloud source;
  LandmarkCloud target;
  std::optional<Similarity3> truth = {};  ///< target_from_source; nothing: of different scenes
  bool truth_by_cairn = false;            ///< it is where Cairn places all landmarks
  double most_deg = 5.0;                  ///< a pose is right up to here,
  double most_translation = 0.05;         ///< and here
  bool any_scale = false;                 ///< of the source's unit
};

/// The words that for_each_pair takes, a line each.
inline constexpr char kPairsUsage[] =
    "  halves TRIALS DATA_FOLDER            of map_fr1_desk.txt, 80 % of their landmarks, any "
    "poses\n"
    "  maps TRIALS SOURCE TARGET [TRUTH]    80 % of the landmarks of two maps, any poses; TRUTH: a "
    "file of\n"
    "                                       the 4x4 target_from_source, else the pose of all "
    "landmarks\n"
    "  simulated PAIRS                      synthetic pairs by overlap\n"
    "  large PAIRS LANDMARKS                synthetic pairs of so many landmarks a map, half of "
    "them in common\n"
    "  strangers PAIRS                      synthetic maps of different scenes\n"
    "  scaled PAIRS                         both, the source of any scale and pose\n"
    "  sessions PAIRS|FIRST-END FOLDER      parts of mapped sessions, by overlap; see "
    "session_pairs.hpp\n";

/// Makes the pairs that the words ask for, one after the other, the same each time.
/// @throws Error (misuse) for other words
void for_each_pair(std::span<const std::string> words,
                   const std::function<void(const PlacementPair&)>& take);

}  // namespace cairn::benchmarks
