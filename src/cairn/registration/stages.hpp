// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <stop_token>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/execution.hpp"
#include "cairn/geometry/rigid3.hpp"

/// Replaceable stages of an ICP, the types passed between the stages, and run_icp(), the loop that
/// combines four stages. icp() (icp.hpp) is the ready-made combination.
namespace cairn {

/// A point of a set, found by a query.
struct Neighbor {
  std::uint32_t index = 0;
  double squared_distance = 0.0;

  friend bool operator==(const Neighbor&, const Neighbor&) = default;
};

/// A source point and the target point matched with it.
struct Match {
  std::uint32_t source = 0;
  std::uint32_t target = 0;
  double squared_distance = 0.0;  ///< at the pose of the search

  friend bool operator==(const Match&, const Match&) = default;
};

/// The squared distance exactly as a NeighborSearch computes it. The sum is written out because
/// Eigen may add in another order.
inline double squared_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double x = a.x() - b.x();
  const double y = a.y() - b.y();
  const double z = a.z() - b.z();
  return x * x + y * y + z * z;
}

/// The nearest points of a query, nearest first. The list may compute distances on demand.
template <class List>
concept NearestList = requires(const List& nearest, std::size_t j) {
  { nearest.size() } -> std::convertible_to<std::size_t>;
  { nearest.index(j) } -> std::convertible_to<std::uint32_t>;
  { nearest.squared_distance(j) } -> std::convertible_to<double>;
};

/// A NearestList of stored neighbours.
class NeighborList {
 public:
  explicit NeighborList(std::span<const Neighbor> neighbors) : neighbors_(neighbors) {}

  std::size_t size() const { return neighbors_.size(); }
  std::uint32_t index(std::size_t j) const { return neighbors_[j].index; }
  double squared_distance(std::size_t j) const { return neighbors_[j].squared_distance; }

 private:
  std::span<const Neighbor> neighbors_;
};

static_assert(NearestList<NeighborList>);

/// Finds the nearest points of a fixed set, exactly.
///
/// `nearest(query, out)` fills `out` with the out.size() nearest points (all points if there are
/// fewer) and returns their number. The nearest point comes first; equal distances are ordered by
/// index. If the k-th distance is tied, the lower indices are kept. Distances are
/// `(p - query).squaredNorm()`. Thread-safe.
template <class Search>
concept NeighborSearch =
    requires(const Search& search, const Eigen::Vector3d& query, std::span<Neighbor> out) {
      { search.size() } -> std::convertible_to<std::size_t>;
      { search.nearest(query, out) } -> std::same_as<std::size_t>;
    };

/// A NeighborSearch that also answers batches of queries and reuses earlier answers.
///
/// `search.batch(k)` makes a batch for the k nearest points of queries that move little between
/// calls. The stored state of a batch never changes an answer.
/// `batch.for_each(queries, executor, visit)` calls `visit(i, nearest)` once for each query, from
/// several threads, in any order. `nearest` is a NearestList with the result of `search.nearest`
/// for queries[i] and k; it is valid during the call. A batch is not thread-safe and must not
/// outlive its search.
template <class Search>
concept BatchSearch = NeighborSearch<Search> && requires(const Search& search, std::size_t k,
                                                         std::span<const Eigen::Vector3d> queries,
                                                         const Executor& executor) {
  search.batch(k).for_each(queries, executor,
                           [](std::size_t, const NearestList auto& /*nearest*/) {});
};

/// A batch for a NeighborSearch without batches: one query after the other.
template <NeighborSearch Search>
class OneByOneBatch {
 public:
  /// @param search must outlive this
  OneByOneBatch(const Search& search, std::size_t k)
      : search_(&search), count_(std::min(k, std::size_t{search.size()})) {}

  template <class Visit>
  void for_each(std::span<const Eigen::Vector3d> queries, const Executor& executor,
                const Visit& visit) const {
    constexpr std::size_t kBlock = 256;
    executor.for_blocks(queries.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      std::vector<Neighbor> found(count_);
      for (std::size_t i = begin; i < end; ++i) {
        search_->nearest(queries[i], found);
        visit(i, NeighborList(found));
      }
    });
  }

 private:
  const Search* search_;
  std::size_t count_;
};

/// Makes a batch for the k nearest points of many queries: the search's own batch if it is a
/// BatchSearch, else a OneByOneBatch.
template <NeighborSearch Search>
auto query_batch(const Search& search, std::size_t k) {
  if constexpr (BatchSearch<Search>) {
    return search.batch(k);
  } else {
    return OneByOneBatch<Search>(search, k);
  }
}

template <NeighborSearch Search>
using QueryBatch = decltype(query_batch(std::declval<const Search&>(), std::size_t{}));

/// Matches source points with target points.
///
/// Called with the source points moved into the target frame and the pose that moved them; returns at most
/// one match per source point, by ascending source index.
template <class Correspondence>
concept CorrespondenceSearch =
    requires(const Correspondence& find_matches, std::span<const Eigen::Vector3d> moved_source,
             const Rigid3& target_from_source) {
      { find_matches(moved_source, target_from_source) } -> std::same_as<std::vector<Match>>;
    };

/// Estimates the motion that aligns matched points.
///
/// Called with the moved source points and their matches; returns the motion to apply to the moved source
/// points.
template <class Estimator>
concept TransformEstimation =
    requires(const Estimator& estimate_step, std::span<const Eigen::Vector3d> moved_source,
             std::span<const Match> matches) {
      { estimate_step(moved_source, matches) } -> std::same_as<Rigid3>;
    };

/// Why an alignment ended.
enum class StopReason {
  kMseChange,       ///< the mean squared match distance converged
  kNoMotion,        ///< a step with exactly no motion
  kFixedPoint,      ///< same matches as in the iteration before: the pose is final
  kCycle,           ///< same matches as in an earlier iteration: a limit cycle
  kIterationLimit,  ///< the iteration limit; counts as converged in PCL
  kTimeLimit,       ///< the caller's time limit; treated like the iteration limit
  kTooFewMatches,   ///< fewer than three matches, which do not determine a pose
  kCancelled,       ///< the caller asked to stop
};

/// "mse_change" etc.: the names in results.
std::string_view to_string(StopReason reason);

/// Input of a convergence test after each iteration.
struct IterationState {
  int iteration = 0;                   ///< from 1
  Rigid3 step;                         ///< the motion of this iteration
  Rigid3 target_from_source;           ///< after the step
  double mean_squared_distance = 0.0;  ///< over the matches, before the step
  double previous_mean_squared_distance = std::numeric_limits<double>::max();
};

/// Returns the reason to stop after an iteration, if any.
template <class Convergence>
concept ConvergenceTest = requires(const Convergence& test, const IterationState& state) {
  { test(state) } -> std::same_as<std::optional<StopReason>>;
};

/// Fewer matches do not determine a pose.
inline constexpr std::size_t kFewestMatches = 3;

/// Record of one iteration.
struct Iteration {
  Rigid3 target_from_source;           ///< after the iteration's step
  double mean_squared_distance = 0.0;  ///< over its matches, before the step
  std::vector<Match> matches;
};

struct IcpRun {
  Rigid3 target_from_source;
  int iterations = 0;  ///< number of steps
  StopReason stop_reason = StopReason::kTooFewMatches;
};

inline double mean_squared_distance(std::span<const Match> matches) {
  double sum = 0.0;
  for (const Match& match : matches) sum += match.squared_distance;
  return sum / static_cast<double>(matches.size());
}

/// Iterative closest point (Besl and McKay 1992) with exchangeable stages: match, estimate the motion, move
/// the source, repeat.
///
/// @param source   points in the source frame
/// @param initial  initial target_from_source
/// @param observe  called after each iteration; may be empty
template <CorrespondenceSearch Correspondence, TransformEstimation Estimator,
          ConvergenceTest Convergence>
IcpRun run_icp(std::span<const Eigen::Vector3d> source, const Rigid3& initial,
               const Correspondence& find_matches, const Estimator& estimate_step,
               const Convergence& converged, const std::stop_token& stop = {},
               const std::function<void(Iteration)>& observe = {}) {
  IcpRun run;
  run.target_from_source = initial;
  std::vector<Eigen::Vector3d> moved_source(source.size());
  const auto move_source = [&] {
    const Eigen::Matrix3d rotation = run.target_from_source.rotation();
    const Eigen::Vector3d& translation = run.target_from_source.translation();
    for (std::size_t i = 0; i < source.size(); ++i) {
      moved_source[i] = rotation * source[i] + translation;
    }
  };
  move_source();

  IterationState state;
  for (;;) {
    if (stop.stop_requested()) {
      run.stop_reason = StopReason::kCancelled;
      return run;
    }
    std::vector<Match> matches = find_matches(moved_source, run.target_from_source);
    if (matches.size() < kFewestMatches) {
      run.stop_reason = StopReason::kTooFewMatches;
      return run;
    }
    state.iteration = ++run.iterations;
    state.mean_squared_distance = mean_squared_distance(matches);
    state.step = estimate_step(moved_source, matches);
    run.target_from_source = state.step * run.target_from_source;
    state.target_from_source = run.target_from_source;
    move_source();
    if (observe) observe({run.target_from_source, state.mean_squared_distance, std::move(matches)});
    if (const auto reason = converged(state)) {
      run.stop_reason = *reason;
      return run;
    }
    state.previous_mean_squared_distance = state.mean_squared_distance;
  }
}

}  // namespace cairn
