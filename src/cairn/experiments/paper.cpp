// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/paper.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/registration/neighbors/batch_tree.hpp"
#include "cairn/registration/score/fitness.hpp"

namespace cairn {
namespace {

constexpr std::size_t kStrategyCount = kPaperStrategies.size();

class PaperRunner {
 public:
  PaperRunner(const MapPair& pair, const PaperOptions& options, const Execution& execution)
      : pair_(pair), options_(options), of_run_{.stop = execution.stop} {
    points_.reserve(kStrategyCount);
    for (const std::string_view name : kPaperStrategies) {
      points_.push_back(pair_points(pair, strategy_named(name), options.points));
    }
  }

  TrialResult run(std::string experiment, std::size_t number, std::size_t k,
                  const Displacement& initial, std::size_t strategy) const {
    Trial trial{.pair = pair_.name,
                .experiment = std::move(experiment),
                .number = number,
                .strategy = std::string(kPaperStrategies[strategy]),
                .k = k,
                .initial = initial};
    return run_trial(std::move(trial), points_[strategy], initial_pose(initial, pair_.truth),
                     pair_.truth, options_.align, of_run_);
  }

  std::span<const Eigen::Vector3d> source() const { return points_.front().source.positions; }

  // The displaced runs hardly ever come near the inverse of a wrong truth.
  bool fits_inverse() const {
    constexpr double kClearly = 0.5;
    if (!pair_.truth) return false;
    const BatchTree target(points_.front().target.positions);
    const auto score = [&](const Rigid3& pose) {
      return fitness_score(
          nearest_squared_distances(source(), Similarity3(1.0, pose), target, Executor(1)));
    };
    const auto of_truth = score(*pair_.truth);
    return of_truth && *score(pair_.truth->inverse()) < kClearly * *of_truth;
  }

  QuadrantSearch search(int sign_x, int sign_y, const PaperResults& results) const {
    QuadrantSearch search{.sign_x = sign_x, .sign_y = sign_y};
    constexpr double kStep = 0.25;
    double good = 0.0;
    double bad = 0.0;
    for (double displacement = kStep; displacement <= options_.search_limit_m;
         displacement += kStep) {
      if (!try_at(displacement, results, search)) {
        bad = displacement;
        break;
      }
      good = displacement;
    }
    while (bad > 0.0 && bad - good > options_.search_resolution_m) {
      const double middle = 0.5 * (good + bad);
      (try_at(middle, results, search) ? good : bad) = middle;
    }
    if (good > 0.0) search.last_success_m = good;
    if (bad > 0.0) search.first_failure_m = bad;
    return search;
  }

 private:
  // Whether all strategies succeed; where not, the search keeps which failed.
  bool try_at(double displacement, const PaperResults& results, QuadrantSearch& search) const {
    const Displacement initial{.x_m = search.sign_x * displacement,
                               .y_m = search.sign_y * displacement};
    std::vector<std::string> failed;
    const std::size_t number = search.runs.size() / kStrategyCount + 1;
    const std::string name = fmt::format("xy_search_{}x{}y", search.sign_x > 0 ? '+' : '-',
                                         search.sign_y > 0 ? '+' : '-');
    constexpr std::size_t kCandidates = 5;  // as in the paper's experiment
    for (std::size_t strategy = 0; strategy < kStrategyCount; ++strategy) {
      search.runs.push_back(run(name, number, kCandidates, initial, strategy));
      if (!results.score_success(search.runs.back())) {
        failed.push_back(search.runs.back().trial.strategy);
      }
    }
    if (failed.empty()) return true;
    search.failed = std::move(failed);
    return false;
  }

  const MapPair& pair_;
  const PaperOptions& options_;
  Execution of_run_;  // the runs are spread over threads, not the work of one
  std::vector<PairPoints> points_;
};

std::vector<TrialResult> run_all(const PaperRunner& runner, const Execution& execution) {
  const auto published = published_experiments();
  std::vector<TrialResult> runs(published.size() * kStrategyCount);
  std::mutex mutex;
  std::size_t done = 0;
  execution.executor.for_blocks(runs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t configuration = i / kStrategyCount;
      const PublishedExperiment& experiment = published[configuration];
      runs[i] = runner.run(std::string(experiment_name(experiment.experiment)), configuration + 1,
                           experiment.k, experiment.initial, i % kStrategyCount);
      const std::lock_guard lock(mutex);
      ++done;
      if (execution.progress) {
        execution.progress(static_cast<double>(done) / static_cast<double>(runs.size()));
      }
    }
  });
  return runs;
}

double relative_success_score(const PaperResults& results) {
  const auto published = published_experiments();
  const auto identity =
      std::find_if(published.begin(), published.end(),
                   [](const auto& experiment) { return experiment.initial == Displacement{}; });
  const auto& reference =
      run_of(results, static_cast<std::size_t>(identity - published.begin()), 0).score;
  refuse_if(!reference, "PaperOptions.success_score",
            "base ICP from the undisplaced start found no pose that could give it", "a score");
  return success_score_above(*reference);
}

std::vector<QuadrantSearch> search_quadrants(const PaperRunner& runner, const PaperResults& results,
                                             const Executor& executor) {
  constexpr std::array<std::pair<int, int>, 4> kQuadrants = {{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
  std::vector<QuadrantSearch> searches(kQuadrants.size());
  executor.for_blocks(kQuadrants.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      searches[i] = runner.search(kQuadrants[i].first, kQuadrants[i].second, results);
    }
  });
  return searches;
}

}  // namespace

std::optional<CommonView> find_common_view(const LandmarkMap& source, const LandmarkMap& target,
                                           const Rigid3& target_from_source, double radius) {
  if (!source.has_observations() || !target.has_observations() || target.landmark_count() == 0) {
    return std::nullopt;
  }
  const BatchTree tree(target.landmarks().positions);
  std::map<std::pair<FrameIndex, FrameIndex>, std::size_t> counts;
  std::vector<Eigen::Vector3d> moved;
  for (const Eigen::Vector3d& x : source.landmarks().positions) {
    moved.push_back(target_from_source * x);
  }
  std::vector<Neighbor> nearest(moved.size());
  tree.batch(1).for_each(moved, Executor(), [&](std::size_t i, const NearestList auto& found) {
    nearest[i] = {found.index(0), found.squared_distance(0)};
  });
  for (std::uint32_t i = 0; i < source.landmark_count(); ++i) {
    if (nearest[i].squared_distance > radius * radius) continue;
    const auto seen_by = source.observing_frames(LandmarkIndex{i});
    const auto counterpart_seen_by = target.observing_frames(LandmarkIndex{nearest[i].index});
    // A frame may observe a landmark twice; it has it in view once.
    const std::set<FrameIndex> source_frames(seen_by.begin(), seen_by.end());
    const std::set<FrameIndex> target_frames(counterpart_seen_by.begin(),
                                             counterpart_seen_by.end());
    for (const FrameIndex source_frame : source_frames) {
      for (const FrameIndex target_frame : target_frames) ++counts[{source_frame, target_frame}];
    }
  }
  std::optional<CommonView> best;
  for (const auto& [frames, count] : counts) {
    if (!best || count > best->landmarks) best = CommonView{frames.first, frames.second, count};
  }
  return best;
}

constexpr OptionField kPaperFields[] = {
    {"success_score", option_at<&PaperOptions::success_score>, kPositive, "--success-score",
     "Largest score of a success, m^2 (default: the score of base ICP without displacement, times "
     "the ratio of 0.0037 to that score in the paper)"},
    {"max_rotation_deg", option_at<&PaperOptions::tolerance, &PoseTolerance::rotation_deg>,
     kPositive, "--max-rotation-deg",
     "Largest rotation error of a success, and largest difference of agreeing poses, degrees"},
    {"max_translation_m", option_at<&PaperOptions::tolerance, &PoseTolerance::translation_m>,
     kPositive, "--max-translation-m",
     "Largest displacement of the source's centroid in a success, metres"},
    {"search_xy", option_at<&PaperOptions::search_xy>, kAny, "--search-xy",
     "Also search for the displacement at which each XY quadrant fails, as in the paper"},
    {"max_iterations",
     option_at<&PaperOptions::align, &IcpOptions::max_iterations>,
     {},
     "--max-iterations",
     "Largest number of iterations"},
    {"max_distance", option_at<&PaperOptions::align, &IcpOptions::max_distance>, kAny,
     "--max-distance", "Largest distance of a match, metres (default: unlimited, as in the paper)"},
    {"min_observations", option_at<&PaperOptions::points, &PointSetOptions::min_observations>, kAny,
     "--min-observations", "Leave out landmarks with fewer observations"},
};
constinit const OptionTable PaperOptions::table = {"PaperOptions", kPaperFields};

void PaperOptions::validate() const {
  align.validate();
  check_options(*this);
  detail::require(search_limit_m > 0.0, "PaperOptions.search_limit_m", search_limit_m,
                  "a positive number");
  detail::require(search_resolution_m > 0.0, "PaperOptions.search_resolution_m",
                  search_resolution_m, "a positive number");
}

PaperResults run_paper_experiments(const MapPair& pair, const PaperOptions& options,
                                   const Execution& execution) {
  options.validate();
  const PaperRunner runner(pair, options, execution);
  PaperResults results;
  results.has_truth = pair.truth.has_value();
  results.fits_inverse = runner.fits_inverse();
  results.runs = run_all(runner, execution);
  results.success_score =
      options.success_score ? *options.success_score : relative_success_score(results);
  std::vector<std::optional<Rigid3>> poses;
  poses.reserve(results.runs.size());
  for (const TrialResult& run : results.runs) poses.push_back(run.target_from_source);
  results.agreement = find_agreement(poses, runner.source(), options.tolerance);
  if (options.search_xy) results.searches = search_quadrants(runner, results, execution.executor);
  return results;
}

Rigid3 initial_pose(const Displacement& displacement, const std::optional<Rigid3>& truth) {
  return truth ? displacement.pose() * *truth : displacement.pose();
}

const TrialResult& run_of(const PaperResults& results, std::size_t configuration,
                          std::size_t strategy) {
  return results.runs[configuration * kStrategyCount + strategy];
}

}  // namespace cairn
