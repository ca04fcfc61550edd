// SPDX-License-Identifier: BSD-3-Clause
// How often, how exactly and how fast maps are placed from no initial pose.
//   cairn_placement_benchmark halves TRIALS DATA_FOLDER   the two halves of map_fr1_desk.txt
//   cairn_placement_benchmark simulated PAIRS             synthetic pairs by overlap
//   cairn_placement_benchmark strangers PAIRS             synthetic maps of different scenes
//   cairn_placement_benchmark scaled PAIRS                both, the source of any scale and pose
// One CSV row a trial to stdout, a summary to stderr. [THREADS] may follow.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/io/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/placement/place.hpp"

#include "random_pose.hpp"

namespace {

using namespace cairn;
using benchmarks::random_pose;

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Tally {
  std::size_t trials = 0;
  std::size_t right = 0;           // aligned, to the true pose
  std::size_t wrong = 0;           // aligned, to another
  std::size_t found = 0;           // the true pose is the best, whatever the verdict
  std::vector<double> normalised;  // squared errors of the poses found, under their covariances
};

constexpr double kMostLogScale = 0.03;

class Bench {
 public:
  explicit Bench(unsigned threads) { options_.executor = Executor(threads); }

  void header() const {
    std::puts(
        "group,trial,verdict,rotation_deg,translation_m,log_scale,normalised,support,probability,"
        "runner_up,radius,processor_s,wall_s");
  }

  void run(const std::string& group, std::uint64_t trial, const LandmarkCloud& source,
           const LandmarkCloud& target, const std::optional<Similarity3>& truth, double most_deg,
           double most_translation, bool with_scale = false) {
    options_.seed = trial;
    options_.scale = with_scale ? std::optional(ScaleRange()) : std::nullopt;
    const double start = processor_seconds();
    const PlacementResult result = place(source, target, options_);
    const double used = processor_seconds() - start;
    processor_.push_back(used);
    wall_.push_back(result.duration_s);
    PoseError error{std::numbers::pi, 1e9};
    double log_scale = 0.0;
    const Similarity3 found = result.alignment.similarity();
    if (truth) {
      error = pose_error(found, *truth, source.positions);
      log_scale = std::log(found.scale() / truth->scale());
    }
    Tally& tally = tallies_[group];
    const bool right = degrees(error.rotation_rad) <= most_deg &&
                       error.translation <= most_translation &&
                       std::abs(log_scale) <= kMostLogScale;
    const bool aligned = result.verdict == Verdict::kAligned;
    ++tally.trials;
    tally.found += right ? 1 : 0;
    tally.right += aligned && right ? 1 : 0;
    tally.wrong += aligned && !right ? 1 : 0;
    double normalised = -1.0;
    if (truth && result.alignment.covariance) {
      const auto& with = result.alignment.covariance_with_scale;
      normalised = with ? normalised_squared_error(found, *with, *truth)
                        : normalised_squared_error(found.rigid(), *result.alignment.covariance,
                                                   truth->rigid());
      if (right) tally.normalised.push_back(normalised);
    }
    const auto& poses = result.candidates;
    std::printf("%s,%llu,%s,%.3f,%.4f,%.4f,%.2f,%.4f,%.4f,%.4f,%.4f,%.3f,%.3f\n", group.c_str(),
                static_cast<unsigned long long>(trial),
                std::string(to_string(result.verdict)).c_str(), degrees(error.rotation_rad),
                error.translation, log_scale, normalised, poses.empty() ? 0.0 : poses[0].support,
                poses.empty() ? 0.0 : poses[0].probability,
                poses.size() < 2 ? 0.0 : poses[1].support, result.radius, used, result.duration_s);
    std::fflush(stdout);
  }

  void summary() {
    for (auto& [group, tally] : tallies_) {
      std::fprintf(stderr,
                   "%s: %zu trials, true pose found %zu, aligned to it %zu, aligned wrongly %zu\n",
                   group.c_str(), tally.trials, tally.found, tally.right, tally.wrong);
      std::vector<double>& normalised = tally.normalised;
      if (normalised.empty()) continue;
      std::sort(normalised.begin(), normalised.end());
      const auto inside = std::lower_bound(
          normalised.begin(), normalised.end(),
          options_.scale ? kNormalisedSquaredErrorWithScale95 : kNormalisedSquaredError95);
      std::fprintf(
          stderr,
          "  of those found, in the 95 %% ellipsoid %.1f %%, median squared distance %.2f\n",
          100.0 * static_cast<double>(inside - normalised.begin()) /
              static_cast<double>(normalised.size()),
          normalised[normalised.size() / 2]);
    }
    for (auto* const times : {&processor_, &wall_}) {
      if (times->empty()) return;
      std::sort(times->begin(), times->end());
      std::fprintf(stderr, "%s time: median %.3f s, worst %.3f s\n",
                   times == &processor_ ? "processor" : "wall", (*times)[times->size() / 2],
                   times->back());
    }
  }

 private:
  PlaceOptions options_;
  std::map<std::string, Tally> tallies_;
  std::vector<double> processor_;
  std::vector<double> wall_;
};

LandmarkMap part_of(const LandmarkMap& map, double share, Random& random) {
  std::vector<LandmarkIndex> kept;
  for (const LandmarkIndex landmark : landmarks_observed(map, 2)) {
    if (random.chance(share)) kept.push_back(landmark);
  }
  return with_landmarks(map, kept);
}

void halves(Bench& bench, std::uint64_t trials, const std::filesystem::path& data) {
  const LandmarkMap map = read_map(data / "map_fr1_desk.txt");
  const LandmarkMap target = cut_frames(map, FrameId{0}, FrameId{120});
  const LandmarkMap source = cut_frames(map, FrameId{120}, FrameId{1'000'000});
  const Rigid3 reference =
      place(landmark_cloud(source), landmark_cloud(target)).alignment.target_from_source;
  std::fprintf(stderr, "all landmarks: %.2f deg, %.3f m from the identity\n",
               degrees(reference.angle()),
               pose_error(reference, Rigid3(), landmark_cloud(source).positions).translation);
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    Random random = Random(trial).fork(7);
    const Rigid3 source_moved = random_pose(random, 5.0);
    const Rigid3 target_moved = random_pose(random, 5.0);
    bench.run("halves", trial,
              landmark_cloud(transformed(part_of(source, 0.8, random), source_moved)),
              landmark_cloud(transformed(part_of(target, 0.8, random), target_moved)),
              target_moved * reference * source_moved.inverse(), 1.5, 0.02);
  }
}

void simulated(Bench& bench, std::uint64_t pairs) {
  for (std::uint64_t trial = 0; trial < pairs; ++trial) {
    for (const double overlap : {0.25, 0.5, 0.8}) {
      for (const double outliers : {0.0, 0.2}) {
        const SyntheticPair pair = synthetic_pair(
            {.seed = 1000 + trial, .overlap = overlap, .outlier_fraction = outliers});
        char group[48];
        std::snprintf(group, sizeof group, "overlap %.2f outliers %.2f", overlap, outliers);
        bench.run(group, trial, landmark_cloud(pair.source), landmark_cloud(pair.target),
                  pair.target_from_source, 5.0, 0.05);
      }
    }
  }
}

void strangers(Bench& bench, std::uint64_t pairs) {
  for (std::uint64_t trial = 0; trial < pairs; ++trial) {
    Random random = Random(trial).fork(8);
    const LandmarkMap source = synthetic_map({.seed = 5000 + 2 * trial});
    const LandmarkMap target = synthetic_map({.seed = 5001 + 2 * trial});
    bench.run("strangers", trial, landmark_cloud(transformed(source, random_pose(random, 5.0))),
              landmark_cloud(target), std::nullopt, 0.0, 0.0);
  }
}

void with_scale(Bench& bench, std::uint64_t pairs) {
  for (std::uint64_t trial = 0; trial < pairs; ++trial) {
    Random random = Random(trial).fork(9);
    const double scale = std::pow(20.0, random.uniform(-1.0, 1.0));
    const Rigid3 moved = random_pose(random, 5.0);
    const auto resized = [&](const LandmarkMap& map) {
      return scaled(landmark_cloud(transformed(map, moved)), 1.0 / scale);
    };
    for (const double overlap : {0.25, 0.5, 0.8}) {
      const SyntheticPair pair =
          synthetic_pair({.seed = 1000 + trial, .overlap = overlap, .outlier_fraction = 0.2});
      char group[48];
      std::snprintf(group, sizeof group, "any scale, overlap %.2f", overlap);
      bench.run(group, trial, resized(pair.source), landmark_cloud(pair.target),
                Similarity3(scale, pair.target_from_source * moved.inverse()), 5.0, 0.05, true);
    }
    bench.run("any scale, strangers", trial, resized(synthetic_map({.seed = 5000 + 2 * trial})),
              landmark_cloud(synthetic_map({.seed = 5001 + 2 * trial})), std::nullopt, 0.0, 0.0,
              true);
  }
}

int run(const std::vector<std::string>& words) {
  const std::string mode = words.empty() ? "" : words[0];
  const std::size_t fixed = mode == "halves" ? 3 : 2;
  if (words.size() < fixed ||
      (mode != "halves" && mode != "simulated" && mode != "strangers" && mode != "scaled")) {
    std::fputs(
        "usage: halves TRIALS DATA | simulated PAIRS | strangers PAIRS | scaled PAIRS, [THREADS]\n",
        stderr);
    return 2;
  }
  Bench bench(words.size() > fixed ? static_cast<unsigned>(std::stoul(words[fixed])) : 0);
  const std::uint64_t count = std::stoull(words[1]);
  bench.header();
  if (mode == "halves") halves(bench, count, words[2]);
  if (mode == "simulated") simulated(bench, count);
  if (mode == "strangers") strangers(bench, count);
  if (mode == "scaled") with_scale(bench, count);
  bench.summary();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(std::vector<std::string>(argv + 1, argv + argc));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
