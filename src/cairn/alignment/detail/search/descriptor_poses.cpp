// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/registration/estimation/point_to_point.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kFewestAgreeing = 4;  // because three matches fit their own pose
constexpr std::size_t kWellKnown = 8;       // matches of a pose that is not proposed again
constexpr int kReestimations = 8;     // at most; the first that does not gain matches is the last
constexpr double kLeastLength = 4.0;  // in tolerances, of the sides of a triple
constexpr std::size_t kMostProposals = 256;
constexpr std::size_t kMatches = 800;  // that are used, the most similar ones
constexpr int kDraws = 4000;  // triples that are tried; three times as many with a free scale

using Places = std::vector<Eigen::Vector3d>;
using Indices = std::vector<std::uint32_t>;

// A set of small numbers.
class Bits {
 public:
  explicit Bits(std::size_t most) : words_((most + 63) / 64) {}

  void add(std::size_t i) { words_[i / 64] |= std::uint64_t{1} << (i % 64); }
  bool contains(std::size_t i) const { return (words_[i / 64] >> (i % 64) & 1U) != 0; }
  std::size_t size() const {
    std::size_t result = 0;
    for (const std::uint64_t word : words_) result += static_cast<std::size_t>(std::popcount(word));
    return result;
  }
  // The n-th lowest number of the set, from 0; the set has more than n numbers.
  std::size_t nth(std::size_t n) const {
    std::size_t at = 0;
    for (; n >= static_cast<std::size_t>(std::popcount(words_[at])); ++at) {
      n -= static_cast<std::size_t>(std::popcount(words_[at]));
    }
    std::uint64_t word = words_[at];
    for (; n > 0; --n) word &= word - 1;
    return 64 * at + static_cast<std::size_t>(std::countr_zero(word));
  }
  friend Bits operator&(Bits a, const Bits& b) {
    for (std::size_t i = 0; i < a.words_.size(); ++i) a.words_[i] &= b.words_[i];
    return a;
  }

 private:
  std::vector<std::uint64_t> words_;
};

struct Proposal {
  Similarity3 pose;
  Indices agreeing;  // of all matches, ascending
};

class Consensus {
 public:
  Consensus(const DescriptorMatches& matches, double tolerance,
            const std::optional<ScaleRange>& scale)
      : source_(matches.source_places()),
        target_(matches.target_places()),
        tolerance_(tolerance),
        scale_(scale),
        count_(std::min(kMatches, source_.size())),
        here_(distances(source_)),
        there_(distances(target_)) {
    if (scale_) return;
    for (std::size_t i = 0; i < count_; ++i) like_.push_back(like(i, 1.0));
  }

  std::vector<Proposal> proposals(Random& random) const {
    std::vector<Proposal> found;
    if (count_ < kFewestAgreeing) return found;
    std::vector<Bits> explained;
    const int draws = scale_ ? 3 * kDraws : kDraws;
    for (int draw = 0; draw < draws; ++draw) {
      const std::size_t first = random.index(count_);
      const auto second = scale_ ? any_second(first, random) : rigid_second(first, random);
      if (!second) continue;
      // Matches that agree with one pose would most probably give it again.
      const bool known = std::any_of(explained.begin(), explained.end(), [&](const Bits& matches) {
        return matches.contains(first) && matches.contains(*second);
      });
      if (known) continue;
      const Bits thirds = like_both(first, *second);
      const std::size_t count = thirds.size();
      // With a free scale, a fourth match is needed, which is usually also one of these.
      if (count == 0 || (scale_ && count < 2)) continue;
      const std::size_t third = thirds.nth(random.index(count));
      Proposal proposal =
          propose({static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(*second),
                   static_cast<std::uint32_t>(third)});
      if (proposal.agreeing.size() >= kWellKnown) explained.push_back(bits(proposal.agreeing));
      add(std::move(proposal), found);
    }
    sort(found);
    return found;
  }

 private:
  // Distances between the places of the first matches; one row per match.
  std::vector<float> distances(std::span<const Eigen::Vector3d> places) const {
    std::vector<float> result(count_ * count_);
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        result[i * count_ + j] = result[j * count_ + i] =
            static_cast<float>((places[i] - places[j]).norm());
      }
    }
    return result;
  }

  // The first matches that have the same distance from this one in both clouds, long enough to determine a pose.
  Bits like(std::size_t i, double scale) const {
    const auto factor = static_cast<float>(scale);
    const auto tolerance = static_cast<float>(tolerance_);
    const auto least = static_cast<float>(kLeastLength * tolerance_);
    const float* const here = &here_[i * count_];
    const float* const there = &there_[i * count_];
    Bits result(count_);
    for (std::size_t j = 0; j < count_; ++j) {
      const float length = factor * here[j];
      if (std::min(length, there[j]) > least && std::abs(length - there[j]) < tolerance) {
        result.add(j);
      }
    }
    return result;
  }

  Bits like_both(std::size_t first, std::size_t second) const {
    if (!scale_) return like_[first] & like_[second];
    const double scale = static_cast<double>(there_[first * count_ + second]) /
                         static_cast<double>(here_[first * count_ + second]);
    return like(first, scale) & like(second, scale);
  }

  Bits bits(const Indices& matches) const {
    Bits result(count_);
    for (const std::uint32_t match : matches) {
      if (match < count_) result.add(match);
    }
    return result;
  }

  std::optional<std::size_t> rigid_second(std::size_t first, Random& random) const {
    const std::size_t count = like_[first].size();
    if (count < kFewestAgreeing - 1) return std::nullopt;
    return like_[first].nth(random.index(count));
  }

  std::optional<std::size_t> any_second(std::size_t first, Random& random) const {
    const std::size_t second = random.index(count_);
    const auto here = static_cast<double>(here_[first * count_ + second]);
    const auto there = static_cast<double>(there_[first * count_ + second]);
    if (!(here > 0.0) || there < kLeastLength * tolerance_) return std::nullopt;
    const double scale = there / here;
    if (scale < scale_->least || scale > scale_->most) return std::nullopt;
    return second;
  }

  Indices agreeing_with(const Similarity3& pose) const {
    const double squared = tolerance_ * tolerance_;
    const Eigen::Matrix3d linear = pose.linear();
    Indices result;
    for (std::uint32_t i = 0; i < source_.size(); ++i) {
      const Eigen::Vector3d moved = linear * source_[i] + pose.translation();
      if ((moved - target_[i]).squaredNorm() < squared) result.push_back(i);
    }
    return result;
  }

  Proposal propose(Indices chosen) const {
    Proposal best;
    for (int i = 0; i < kReestimations; ++i) {
      Places from;
      Places to;
      for (const std::uint32_t match : chosen) {
        from.push_back(source_[match]);
        to.push_back(target_[match]);
      }
      Proposal proposal{fitted_pose(from, to, scale_.has_value()), {}};
      proposal.agreeing = agreeing_with(proposal.pose);
      if (proposal.agreeing.size() <= best.agreeing.size()) break;
      best = std::move(proposal);
      chosen = best.agreeing;
      if (chosen.size() < kFewestAgreeing) break;
    }
    return best;
  }

  // Adds a proposal unless it is known, because most draws of correct matches give the same pose.
  static void add(Proposal proposal, std::vector<Proposal>& found) {
    if (proposal.agreeing.size() < kFewestAgreeing) return;
    const bool known = std::any_of(found.begin(), found.end(), [&](const Proposal& other) {
      return other.agreeing == proposal.agreeing;
    });
    if (!known) found.push_back(std::move(proposal));
    if (found.size() < 2 * kMostProposals) return;
    sort(found);
    found.resize(kMostProposals);
  }

  static void sort(std::vector<Proposal>& proposals) {
    std::stable_sort(proposals.begin(), proposals.end(), [](const Proposal& a, const Proposal& b) {
      return a.agreeing.size() > b.agreeing.size();
    });
  }

  std::span<const Eigen::Vector3d> source_;
  std::span<const Eigen::Vector3d> target_;
  double tolerance_;
  const std::optional<ScaleRange>& scale_;
  std::size_t count_;
  std::vector<float> here_;   // distances between the source's landmarks
  std::vector<float> there_;  // and the target's
  std::vector<Bits> like_;    // of each match, if the scale is known
};

}  // namespace

Similarity3 fitted_pose(const std::vector<Eigen::Vector3d>& from,
                        const std::vector<Eigen::Vector3d>& to, bool free_scale) {
  const Rigid3 motion = closest_motion(from, to);
  if (!free_scale) return motion;
  const Eigen::Vector3d from_centre = centroid(from);
  const Eigen::Vector3d to_centre = centroid(to);
  double along = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d turned = motion.quaternion() * (from[i] - from_centre);
    along += turned.dot(to[i] - to_centre);
    squares += turned.squaredNorm();
  }
  const double scale = squares > 0.0 && along > 0.0 ? along / squares : 1.0;
  return {scale,
          Rigid3(motion.quaternion(), to_centre - scale * (motion.quaternion() * from_centre))};
}

std::vector<DescriptorPose> descriptor_poses(const DescriptorMatches& matches, Random random,
                                             double tolerance,
                                             const std::optional<ScaleRange>& scale) {
  std::vector<DescriptorPose> poses;
  std::vector<Proposal> kept;
  for (Proposal& proposal : Consensus(matches, tolerance, scale).proposals(random)) {
    if (poses.size() == kMostDescriptorPoses) break;
    // Two proposals are the same if they share half of the matches of the smaller one.
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Proposal& other) {
      Indices both;
      std::set_intersection(proposal.agreeing.begin(), proposal.agreeing.end(),
                            other.agreeing.begin(), other.agreeing.end(), std::back_inserter(both));
      return 2 * both.size() >= proposal.agreeing.size();
    });
    if (known) continue;
    poses.push_back({proposal.pose, proposal.agreeing.size()});
    kept.push_back(std::move(proposal));
  }
  return poses;
}

}  // namespace cairn::detail
