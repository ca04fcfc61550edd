// SPDX-License-Identifier: BSD-3-Clause
// How often, how exactly and how fast maps are placed from no initial pose. See its usage; one CSV row a
// trial to stdout, a summary to stderr.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"

#include "placement_pairs.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;
using benchmarks::PlacementPair;

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
  explicit Bench(unsigned threads) : execution_{.executor = Executor(threads)} {}

  void run(const PlacementPair& pair) {
    if (tallies_.empty()) {
      std::puts(
          "group,trial,verdict,rotation_deg,translation_m,log_scale,normalised,support,"
          "probability,runner_up,radius,processor_s,wall_s");
    }
    execution_.seed = pair.trial;
    options_.scale = pair.any_scale ? std::optional(ScaleRange()) : std::nullopt;
    const double start = processor_seconds();
    const Alignment result = place(pair.source, pair.target, options_, execution_);
    const double used = processor_seconds() - start;
    processor_.push_back(used);
    wall_.push_back(result.duration_s);
    const std::optional<Similarity3>& truth = pair.truth;
    PoseError error{std::numbers::pi, 1e9};
    double log_scale = 0.0;
    const Similarity3 found = result.registration.similarity();
    if (truth) {
      error = pose_error(found, *truth, pair.source.positions);
      log_scale = std::log(found.scale() / truth->scale());
    }
    Tally& tally = tallies_[pair.group];
    const bool right = degrees(error.rotation_rad) <= pair.most_deg &&
                       error.translation <= pair.most_translation &&
                       std::abs(log_scale) <= kMostLogScale;
    const bool aligned = result.verdict == Verdict::kAligned;
    ++tally.trials;
    tally.found += right ? 1 : 0;
    tally.right += aligned && right ? 1 : 0;
    tally.wrong += aligned && !right ? 1 : 0;
    double normalised = -1.0;
    if (truth && result.registration.covariance) {
      const auto& with = result.registration.covariance_with_scale;
      normalised = with ? normalised_squared_error(found, *with, *truth)
                        : normalised_squared_error(found.rigid(), *result.registration.covariance,
                                                   truth->rigid());
      if (right) tally.normalised.push_back(normalised);
    }
    const auto& poses = result.candidates;
    std::printf(
        "\"%s\",%llu,%s,%.3f,%.4f,%.4f,%.2f,%.4f,%.4f,%.4f,%.4f,%.3f,%.3f\n", pair.group.c_str(),
        static_cast<unsigned long long>(pair.trial),
        std::string(to_string(*result.verdict)).c_str(), degrees(error.rotation_rad),
        error.translation, log_scale, normalised, poses.empty() ? 0.0 : poses[0].support.share,
        poses.empty() ? 0.0 : poses[0].probability, poses.size() < 2 ? 0.0 : poses[1].support.share,
        result.radius, used, result.duration_s);
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
  AlignOptions options_;
  Execution execution_;
  std::map<std::string, Tally> tallies_;
  std::vector<double> processor_;
  std::vector<double> wall_;
};

}  // namespace

int main(int argc, char** argv) {
  const std::string usage =
      std::string("[--threads N] PAIRS, which is one of\n") + benchmarks::kPairsUsage;
  return benchmarks::study_main(argc, argv, 1, usage.c_str(), [](std::vector<std::string> words) {
    unsigned threads = 0;
    if (words.size() > 1 && words[0] == "--threads") {
      threads = static_cast<unsigned>(std::stoul(words[1]));
      words.erase(words.begin(), words.begin() + 2);
    }
    Bench bench(threads);
    benchmarks::for_each_pair(words, [&](const PlacementPair& pair) { bench.run(pair); });
    bench.summary();
  });
}
