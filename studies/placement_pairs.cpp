// SPDX-License-Identifier: BSD-3-Clause
#include "placement_pairs.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "random_pose.hpp"
#include "session_pairs.hpp"

namespace cairn::benchmarks {
namespace {

using Take = std::function<void(const PlacementPair&)>;

constexpr double kMovedUpTo = 5.0;

std::string group_of(const char* format, double a, double b = 0.0) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, a, b);
  return text.data();
}

LandmarkMap part_of(const LandmarkMap& map, double share, Random& random) {
  std::vector<LandmarkIndex> kept;
  for (const LandmarkIndex landmark : landmarks_observed(map, 2)) {
    if (random.chance(share)) kept.push_back(landmark);
  }
  return with_landmarks(map, kept);
}

// Of parts of two maps.
// @param reference where the maps lie; nothing: where Cairn places all their landmarks
void trials(const std::string& group, std::uint64_t count, const LandmarkMap& source,
            const LandmarkMap& target, std::optional<Rigid3> reference, const Take& take) {
  constexpr double kShare = 0.8;
  PlacementPair pair{.group = group, .source = {}, .target = {}};
  if (reference) {
    // Both maps drift against the truth.
    pair.most_deg = 2.0;
    pair.most_translation = 0.04;
  } else {
    // The whole drifts as its parts do.
    pair.most_deg = 1.5;
    pair.most_translation = 0.02;
    pair.truth_by_cairn = true;
    const LandmarkCloud all = landmark_cloud(source);
    const Alignment whole = place(all, landmark_cloud(target));
    if (whole.registration.status == RegistrationStatus::kFailed) {
      throw std::runtime_error("all landmarks: " + whole.reason);
    }
    reference = whole.registration.target_from_source;
    std::fprintf(stderr, "all landmarks: %.2f deg, %.3f m from the identity\n",
                 degrees(reference->angle()),
                 pose_error(*reference, Rigid3(), all.positions).translation);
  }
  for (std::uint64_t trial = 0; trial < count; ++trial) {
    Random random = Random(trial).fork(7);
    const Rigid3 source_moved = random_pose(random, kMovedUpTo);
    const Rigid3 target_moved = random_pose(random, kMovedUpTo);
    pair.trial = trial;
    pair.source = landmark_cloud(transformed(part_of(source, kShare, random), source_moved));
    pair.target = landmark_cloud(transformed(part_of(target, kShare, random), target_moved));
    pair.truth = target_moved * *reference * source_moved.inverse();
    take(pair);
  }
}

Rigid3 pose_of_file(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw Error(ErrorKind::kInput, path, "cannot be read", "");
  Matrix4d matrix;
  for (int i = 0; i < 16; ++i) {
    if (!(file >> matrix(i / 4, i % 4))) {
      throw Error(ErrorKind::kInput, path, "holds no 4x4 matrix", "16 numbers, row by row");
    }
  }
  return Rigid3::from_matrix(matrix);
}

void simulated(std::uint64_t count, const Take& take) {
  for (std::uint64_t trial = 0; trial < count; ++trial) {
    for (const double overlap : {0.25, 0.5, 0.8}) {
      for (const double outliers : {0.0, 0.2}) {
        const SyntheticPair pair = synthetic_pair(
            {.seed = 1000 + trial, .overlap = overlap, .outlier_fraction = outliers});
        take({.group = group_of("overlap %.2f outliers %.2f", overlap, outliers),
              .trial = trial,
              .source = landmark_cloud(pair.source),
              .target = landmark_cloud(pair.target),
              .truth = pair.target_from_source});
      }
    }
  }
}

void large(std::uint64_t count, std::uint64_t landmarks, const Take& take) {
  for (std::uint64_t trial = 0; trial < count; ++trial) {
    const SyntheticPair pair = synthetic_pair({.seed = 1000 + trial,
                                               .landmarks = static_cast<std::size_t>(landmarks),
                                               .overlap = 0.5,
                                               .outlier_fraction = 0.1});
    take({.group = "large",
          .trial = trial,
          .source = landmark_cloud(pair.source),
          .target = landmark_cloud(pair.target),
          .truth = pair.target_from_source});
  }
}

LandmarkMap stranger(std::uint64_t trial) {
  return synthetic_map({.seed = 5000 + 2 * trial});
}

LandmarkMap place_of_stranger(std::uint64_t trial) {
  return synthetic_map({.seed = 5001 + 2 * trial});
}

void strangers(std::uint64_t count, const Take& take) {
  for (std::uint64_t trial = 0; trial < count; ++trial) {
    Random random = Random(trial).fork(8);
    const Rigid3 moved = random_pose(random, kMovedUpTo);
    take({.group = "strangers",
          .trial = trial,
          .source = landmark_cloud(transformed(stranger(trial), moved)),
          .target = landmark_cloud(place_of_stranger(trial))});
  }
}

void with_scale(std::uint64_t count, const Take& take) {
  for (std::uint64_t trial = 0; trial < count; ++trial) {
    Random random = Random(trial).fork(9);
    const double scale = std::pow(20.0, random.uniform(-1.0, 1.0));
    const Rigid3 moved = random_pose(random, kMovedUpTo);
    const auto resized = [&](const LandmarkMap& map) {
      return scaled(landmark_cloud(transformed(map, moved)), 1.0 / scale);
    };
    for (const double overlap : {0.25, 0.5, 0.8}) {
      const SyntheticPair pair =
          synthetic_pair({.seed = 1000 + trial, .overlap = overlap, .outlier_fraction = 0.2});
      take({.group = group_of("any scale, overlap %.2f", overlap),
            .trial = trial,
            .source = resized(pair.source),
            .target = landmark_cloud(pair.target),
            .truth = Similarity3(scale, pair.target_from_source * moved.inverse()),
            .any_scale = true});
    }
    take({.group = "any scale, strangers",
          .trial = trial,
          .source = resized(stranger(trial)),
          .target = landmark_cloud(place_of_stranger(trial)),
          .any_scale = true});
  }
}

void sessions(PairNumbers numbers, const std::string& folder, const Take& take) {
  for_each_session_pair(folder, numbers, SessionPart::kTest, [&](const SessionPair& pair) {
    const auto& [least, most] = pair.overlap_range;
    const std::string group = pair.same_place()
                                  ? group_of("sessions, overlap %.2f to %.2f", least, most)
                                  : "sessions, strangers";
    take({.group = group,
          .trial = pair.number,
          .source = pair.source,
          .target = pair.target,
          .truth = pair.same_place() ? std::optional<Similarity3>(pair.truth) : std::nullopt});
  });
}

}  // namespace

void for_each_pair(std::span<const std::string> words, const Take& take) {
  const std::string kind = words.empty() ? "" : words[0];
  const std::size_t more = words.size() < 2 ? 0 : words.size() - 2;
  if (kind == "halves" && more == 1) {
    const LandmarkMap map = read_map(std::filesystem::path(words[2]) / "map_fr1_desk.txt");
    trials(kind, whole_number(words[1]), cut_frames(map, FrameId{120}, FrameId{1'000'000}),
           cut_frames(map, FrameId{0}, FrameId{120}), std::nullopt, take);
  } else if (kind == "maps" && (more == 2 || more == 3)) {
    trials(words[2] + " to " + words[3], whole_number(words[1]), read_map(words[2]),
           read_map(words[3]), more == 3 ? std::optional(pose_of_file(words[4])) : std::nullopt,
           take);
  } else if (kind == "sessions" && more == 1) {
    sessions(pair_numbers(words[1]), words[2], take);
  } else if (kind == "simulated" && more == 0 && words.size() == 2) {
    simulated(whole_number(words[1]), take);
  } else if (kind == "large" && more == 1) {
    large(whole_number(words[1]), whole_number(words[2]), take);
  } else if (kind == "strangers" && more == 0 && words.size() == 2) {
    strangers(whole_number(words[1]), take);
  } else if (kind == "scaled" && more == 0 && words.size() == 2) {
    with_scale(whole_number(words[1]), take);
  } else {
    throw Error(ErrorKind::kMisuse, "pairs", "no such pairs",
                "one of\n" + std::string(kPairsUsage));
  }
}

}  // namespace cairn::benchmarks
