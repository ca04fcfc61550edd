// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/detail/evidence/support_counter.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/detail/search/descriptor_matches.hpp"
#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/core/detail/alarm.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {

/// Radius within which landmarks count as matched, in fine scales.
inline constexpr double kMatched = 0.5;
/// Least ratio of two merits: a refinement must keep this share of its candidate's merit, and a pose must have this
/// share of the merit of a candidate near it.
inline constexpr double kKeptMerit = 0.95;

/// Time limit of a placement, if any.
class TimeLimit {
 public:
  TimeLimit(std::chrono::steady_clock::time_point start, std::optional<double> limit_s,
            std::stop_token caller)
      : start_(start), limit_s_(limit_s), caller_(std::move(caller)) {}

  /// Calls work(stop), and requests a stop when this share of the time limit is over.
  /// @return whether the time limit requested a stop
  template <class Work>
  bool cuts(double share, const Work& work) const {
    if (!limit_s_) {
      work(caller_);
      return false;
    }
    const auto end = start_ + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                  std::chrono::duration<double>(share * *limit_s_));
    // Starts no thread if the time is already over.
    if (std::chrono::steady_clock::now() >= end) {
      std::stop_source over;
      over.request_stop();
      work(over.get_token());
      return !caller_.stop_requested();
    }
    const detail::Alarm alarm(end, caller_);
    work(alarm.token());
    return alarm.token().stop_requested() && !caller_.stop_requested();
  }

 private:
  std::chrono::steady_clock::time_point start_;
  std::optional<double> limit_s_;
  std::stop_token caller_;
};

/// Kernel scales of a pair of clouds, as a function of the source's scale.
struct PairScales {
  CloudScales source;
  CloudScales target;

  KernelScales at(double scale) const {
    return kernel_scales({scale * source.extent, scale * source.spacing, scale * source.noise},
                         target);
  }
};

/// Why the gravity or the scale range of `options` forbids a pose; std::nullopt if both allow it.
std::optional<std::string> forbidden(const Similarity3& target_from_source,
                                     const AlignOptions& options);

/// Sets the pose of a candidate.
void set_similarity(PlacementCandidate& candidate, const Similarity3& pose);

/// A centred pose that may become a candidate.
struct Finalist : PlacementCandidate {
  Proximity proximity = {};
};

struct Candidates {
  std::vector<Finalist> poses;  ///< likeliest first
  bool cut_short = false;
};

/// Search on samples of both maps. The source should be the smaller map, so that most of it is in the target if the
/// maps overlap.
class Placement {
 public:
  /// @param scales likely scales of the source
  /// @param equal  scale at which both clouds have the same unit; std::nullopt if this scale is not allowed
  /// @param identities see DescriptorMatches
  Placement(const PreparedCloud& source, const PreparedCloud& target, std::vector<double> scales,
            std::optional<double> equal, const AlignOptions& options, const Execution& execution,
            std::span<const DescriptorMatch> identities = {});

  /// Fine kernel scale for a source of this scale.
  double fine(double scale) const { return all_.at(scale).fine; }

  /// The pose with its support.
  /// @param partners number of random partners per descriptor match, to estimate chance agreements
  Finalist assessed(const Similarity3& pose,
                    std::size_t partners = DescriptorMatches::kPartners) const;

  /// Score for ranking a pose: evidence of positions and descriptors, and a term for the share of matched landmarks.
  /// Most wrong poses have no evidence; for them, a few landmarks that match by chance must not outweigh a tenth of all
  /// landmarks.
  static double merit(const PlacementCandidate& pose);

  /// The poses with their probabilities, each versus the others; likeliest first.
  std::vector<Finalist> with_probabilities(std::vector<Finalist> poses) const;

  /// Whether the requested gravity and scale range allow the pose.
  bool allows(const Finalist& pose) const;

  /// Refines a pose to the nearest optimum.
  Finalist settled(const Similarity3& pose, const std::stop_token& stop) const;

  /// Whether a user would consider both poses the same.
  bool near(const Finalist& a, const Finalist& b) const;

  /// Of `poses`, the best-fitting one that is near `pose` but not equal to it, and its distance from `pose`.
  /// std::nullopt if none fits clearly better than `pose`.
  std::pair<std::optional<Finalist>, double> better_near(const std::vector<Finalist>& poses,
                                                         const Finalist& pose) const;

  /// Distance of two poses: root mean square over the source's landmarks.
  double apart(const Similarity3& a, const Similarity3& b) const { return distance_(a, b); }

  /// The best pose of the source's mirror image, by positions alone; std::nullopt if none is found.
  std::optional<Finalist> of_mirror_image(const std::stop_token& stop) const;

  /// The least-squares fit to the identities near a pose, and these identities (see DescriptorMatches). std::nullopt
  /// unless the fit brings them much closer together than the pose does, and they prove the fit.
  std::optional<std::pair<Finalist, std::vector<Match>>> fitted_to_identities(
      const Finalist& pose) const;

  /// The matches that agree with `pose`: it brings their two landmarks within `radii` matching radii.
  std::vector<Match> agreeing(const Similarity3& pose, double radii) const;

  Surroundings around(const Similarity3& pose) const;

  /// matches_in_plane() of two clouds that were sampled on lattices; zeros for others.
  PlaneMatches lattice_matches_in_plane(const Similarity3& pose) const;

  Similarity3 centred(const Similarity3& pose) const {
    return centred_pose(source_, target_, pose);
  }
  Similarity3 uncentred(const Similarity3& pose) const {
    return uncentred_pose(source_, target_, pose);
  }

  /// Number of landmarks of the smaller cloud.
  std::size_t landmarks() const { return std::min(source_.size(), target_.size()); }

  Candidates candidates(const TimeLimit& time) const;

 private:
  // Free-space check in both directions; all zeros if the clouds have no views.
  SightCounts sights(const Similarity3& pose) const;

  // Poses from descriptor matches.
  std::vector<DescriptorPose> proposals() const;

  // Poses that align a constellation and its surroundings. Constellations need distances, hence one unit.
  std::vector<ConstellationPose> constellations(const std::stop_token& stop) const;

  // Poses from the proportions of neighbouring landmarks.
  std::vector<QuadPose> quads(const std::stop_token& stop) const;
  static bool is_clear(const std::vector<QuadPose>& quads);

  // Those of the quads' poses, and the likely scales.
  std::vector<double> scales_to_search(const std::vector<QuadPose>& quads) const;

  // The first pose and the poses that may be right instead; empty if too few matches agree with the first.
  static std::vector<Finalist> rivals_of(const std::vector<Finalist>& proposed);

  // The distinct poses with their probabilities, likeliest first.
  std::vector<Finalist> judged(std::vector<Finalist> poses) const;

  // Searches by quads, then at all scales and by constellations; after a clear pose from quads, at its scale alone, if
  // that gives an aligned pose. Judges what is found with the proposed poses.
  void search_widely(std::vector<Finalist> proposed, const TimeLimit& time,
                     Candidates& result) const;
  // Adds what a search at the scales finds to the poses, refines all, and judges the best.
  // @param begin, end share of the progress
  void search_at(const std::vector<double>& scales, double begin, double end,
                 bool with_constellations, const TimeLimit& time, std::vector<Finalist>& poses,
                 Candidates& result) const;
  // Adds the poses that a search at the scale finds.
  void search(double scale, std::size_t candidates, std::span<const Eigen::Quaterniond> turns,
              const Execution& execution, std::vector<Finalist>& poses) const;

  // Refines each pose to the nearest optimum, at the fine scale of the lengths, and computes its support there.
  void refine_all(std::vector<Finalist>& poses, const PairScales& lengths, std::size_t points,
                  int iterations, const std::stop_token& stop) const;

  // The best distinct poses; at most `variants` of the poses that a user would consider the same.
  std::vector<Finalist> distinct(std::vector<Finalist> poses, const PairScales& lengths,
                                 std::ptrdiff_t variants) const;

  const AlignOptions& options_;
  const Execution& execution_;
  std::vector<double> scales_;
  std::optional<double> equal_;
  PreparedCloud source_;
  PreparedCloud target_;
  SupportCounter support_;
  DescriptorMatches matches_;
  PairScales all_;     // of all landmarks
  PairScales sample_;  // of the landmarks that the search uses
  PoseDistance distance_;
};

}  // namespace cairn::detail
