// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "cairn/alignment/detail/search/poses.hpp"
#include "cairn/alignment/detail/search/proposals.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

namespace cairn::detail {
namespace {

using Eigen::Vector3f;
using PointsF = std::vector<Vector3f>;

// In fine scales:
constexpr float kShortest = 3.0F;  // side of a constellation
constexpr float kLongest = 6.0F;
constexpr float kLeastHeight = 1.0F;
constexpr float kTolerance = 0.05F;  // by which sides may differ
constexpr float kPatch = 8.0F;       // radius of the landmarks that test a constellation's poses
constexpr float kVoxel = 0.125F;
constexpr float kReach = 0.15F;    // from a target point, within which a voxel counts as occupied
constexpr float kSamePose = 0.5F;  // largest distance of equal poses

constexpr std::size_t kMostPoints = 4096;  // of a map; fits into 16 bits
constexpr std::size_t kMostBits = std::size_t{1} << 26;
constexpr std::size_t kMostPartners = 128;  // at one distance from a target point
// Numbers of points in the first and second test of a pose.
constexpr std::size_t kBlink = 6;
constexpr std::size_t kBlinkHits = 1;  // least number to pass the first test
constexpr std::size_t kGlance = 16;
constexpr std::size_t kGlanceHits = 5;
constexpr std::size_t kLook = 64;
constexpr std::size_t kPatchPoints = 512;
constexpr std::size_t kLooked = 16;  // poses of a constellation that are tested with all points
constexpr std::size_t kKept = 3;     // poses that it proposes
// The search ends after a round of constellations if kEnough poses agree with the best to within kAgreeing
// fine scales, before any other pose with kRivalEvidence of its evidence.
constexpr std::size_t kRound = 48;
constexpr std::size_t kEnough = 4;
constexpr double kAgreeing = 1.0;
constexpr double kRivalEvidence = 0.5;
// Share of points that are in occupied voxels by chance if the surfaces coincide.
constexpr double kOccupiedByChance = 0.2;

// Which voxels are near target points.
class Occupancy {
 public:
  Occupancy(const PointsF& points, float fine) {
    Vector3f low = points.front();
    Vector3f high = points.front();
    for (const Vector3f& point : points) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
    }
    const float margin = kReach * fine;
    float voxel = kVoxel * fine;
    const Vector3f edges = high - low + Vector3f::Constant(2.0F * margin);
    const auto cells = [&](int axis) {
      return static_cast<std::size_t>(std::ceil(edges[axis] / voxel)) + 1;
    };
    // A distant outlier makes the voxels larger.
    while (cells(0) * cells(1) * cells(2) > kMostBits) voxel *= 1.25F;
    low_ = low - Vector3f::Constant(margin);
    per_length_ = 1.0F / voxel;
    for (int axis = 0; axis < 3; ++axis) size_[static_cast<std::size_t>(axis)] = cells(axis);
    for (int axis = 0; axis < 3; ++axis) limit_[axis] = static_cast<float>(cells(axis));
    bits_.assign((size_[0] * size_[1] * size_[2] + 63) / 64, 0);
    const float reach = std::max(margin, 0.87F * voxel);  // half a diagonal: none is missed
    for (const Vector3f& point : points) mark(point, reach, voxel);
  }

  bool taken(const Vector3f& x) const {
    const Eigen::Array3f cell = (x - low_).array() * per_length_;
    if (!((cell >= 0.0F).all() && (cell < limit_).all())) return false;
    const std::size_t at =
        index(static_cast<std::size_t>(cell[0]), static_cast<std::size_t>(cell[1]),
              static_cast<std::size_t>(cell[2]));
    return (bits_[at >> 6] >> (at & 63) & 1U) != 0;
  }

 private:
  std::size_t index(std::size_t x, std::size_t y, std::size_t z) const {
    return (z * size_[1] + y) * size_[0] + x;
  }
  void mark(const Vector3f& point, float reach, float voxel) {
    std::array<std::size_t, 3> begin{};
    std::array<std::size_t, 3> end{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float at =
          point[static_cast<Eigen::Index>(axis)] - low_[static_cast<Eigen::Index>(axis)];
      begin[axis] = static_cast<std::size_t>(std::max(0.0F, (at - reach) * per_length_));
      end[axis] = std::min(size_[axis], static_cast<std::size_t>((at + reach) * per_length_) + 1);
    }
    for (std::size_t z = begin[2]; z < end[2]; ++z) {
      for (std::size_t y = begin[1]; y < end[1]; ++y) {
        for (std::size_t x = begin[0]; x < end[0]; ++x) {
          const Vector3f centre =
              low_ + voxel * Vector3f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F,
                                      static_cast<float>(z) + 0.5F);
          if ((centre - point).squaredNorm() > reach * reach) continue;
          const std::size_t at = index(x, y, z);
          bits_[at >> 6] |= std::uint64_t{1} << (at & 63);
        }
      }
    }
  }

  Vector3f low_;
  float per_length_ = 0.0F;
  Eigen::Array3f limit_;
  std::array<std::size_t, 3> size_{};
  std::vector<std::uint64_t> bits_;
};

// For each point, the points at the distance of a constellation's side, by distance.
class Partners {
 public:
  Partners(const PointsF& points, float fine)
      : shortest_(kShortest * fine), per_bin_(1.0F / (kTolerance * fine)) {
    const float longest = kLongest * fine;
    bins_ = static_cast<std::size_t>((longest - shortest_) * per_bin_) + 1;
    begins_.reserve(points.size() * (bins_ + 1));
    std::vector<std::uint16_t> near;
    std::vector<std::uint32_t> bin_of;
    std::vector<std::uint32_t> count(bins_ + 1);
    const Eigen::ArrayX3f by_axis =
        Eigen::Map<const Eigen::Matrix3Xf>(points.front().data(), 3,
                                           static_cast<Eigen::Index>(points.size()))
            .transpose();
    Eigen::ArrayXf squares(by_axis.rows());
    for (const Vector3f& centre : points) {
      near.clear();
      bin_of.clear();
      std::fill(count.begin(), count.end(), 0U);
      squares = (by_axis.col(0) - centre.x()).square() +
                ((by_axis.col(1) - centre.y()).square() + (by_axis.col(2) - centre.z()).square());
      for (std::size_t i = 0; i < points.size(); ++i) {
        const float square = squares[static_cast<Eigen::Index>(i)];
        if (square < shortest_ * shortest_ || square >= longest * longest) continue;
        const std::size_t bin = bin_at(std::sqrt(square));
        near.push_back(static_cast<std::uint16_t>(i));
        bin_of.push_back(static_cast<std::uint32_t>(bin));
        ++count[bin];
      }
      auto begin = static_cast<std::uint32_t>(entries_.size());
      entries_.resize(entries_.size() + near.size());
      for (std::size_t bin = 0; bin <= bins_; ++bin) {
        begins_.push_back(begin);
        begin += std::exchange(count[bin], begin);
      }
      for (std::size_t k = 0; k < near.size(); ++k) entries_[count[bin_of[k]]++] = near[k];
    }
  }

  // Points at about this distance from point i.
  std::span<const std::uint16_t> at(std::size_t i, float distance, float tolerance) const {
    const std::size_t low = bin_at(std::max(distance - tolerance, shortest_));
    const std::size_t high = std::min(bin_at(distance + tolerance), bins_ - 1);
    const std::uint32_t* const begins = &begins_[i * (bins_ + 1)];
    return {entries_.data() + begins[low], entries_.data() + begins[high + 1]};
  }

 private:
  std::size_t bin_at(float distance) const {
    return std::min(static_cast<std::size_t>((distance - shortest_) * per_bin_), bins_ - 1);
  }

  float shortest_;
  float per_bin_;
  std::size_t bins_ = 0;
  std::vector<std::uint16_t>
      entries_;  // small, because all of them are read for each constellation
  std::vector<std::uint32_t> begins_;
};

// Axes of three points: along the first side, in their plane, and out of it.
Eigen::Matrix3f axes(const Vector3f& a, const Vector3f& b, const Vector3f& c) {
  Eigen::Matrix3f result;
  result.col(0) = (b - a).normalized();
  result.col(2) = result.col(0).cross(c - a).normalized();
  result.col(1) = result.col(2).cross(result.col(0));
  return result;
}

// Three source points, and the points around them in the axes of the three.
struct Constellation {
  float ab = 0.0F;
  float ac = 0.0F;
  float bc = 0.0F;
  Vector3f centre;
  Eigen::Matrix3f source_from_axes;
  PointsF patch;
};

// Points, stored by coordinate.
struct NearPoints {
  std::size_t count = 0;
  std::array<std::array<float, kMostPartners>, 3> at;

  Vector3f operator[](std::size_t i) const { return {at[0][i], at[1][i], at[2][i]}; }
  // Sets the point after the last.
  void set(const Vector3f& point) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      at[axis][count] = point[static_cast<Eigen::Index>(axis)];
    }
  }
  // Selects the points whose squared distance from `from` is within the limits.
  // @return number of selected points
  std::size_t select(const Vector3f& from, float low, float high,
                     std::array<std::uint32_t, kMostPartners>& selected) const {
    std::array<float, kMostPartners> squares;
    for (std::size_t i = 0; i < count; ++i) {
      const float x = at[0][i] - from.x();
      const float y = at[1][i] - from.y();
      const float z = at[2][i] - from.z();
      squares[i] = x * x + (y * y + z * z);
    }
    std::size_t result = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      // Without a branch, which would be guessed wrong.
      selected[result] = i;
      result += static_cast<std::size_t>(squares[i] >= low) &
                static_cast<std::size_t>(squares[i] <= high);
    }
    return result;
  }
};

struct Pose {
  Eigen::Matrix3f target_from_axes;
  Vector3f centre;
  std::size_t hits = 0;
};

class Finder {
 public:
  Finder(std::span<const Eigen::Vector3d> source, std::span<const Eigen::Vector3d> target,
         Random random, double fine, std::size_t draws, const Execution& execution)
      : draws_(draws),
        execution_(execution),
        random_(random),
        unit_(fine),
        fine_(static_cast<float>(fine)),
        source_(single(source)),
        target_(single(target)),
        occupancy_(target_, fine_),
        partners_(target_, fine_),
        distance_(PoseDistance::of(source)) {}

  std::vector<ConstellationPose> run() const {
    std::vector<ConstellationPose> found;  // most evidence first
    for (std::size_t first = 0; first < draws_ && !clear(found); first += kRound) {
      if (execution_.stop.stop_requested()) break;
      std::array<std::vector<ConstellationPose>, kRound> round;
      const std::size_t count = std::min(kRound, draws_ - first);
      execution_.executor.for_blocks(count, 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          if (execution_.stop.stop_requested()) return;
          if (const auto one = draw(random_.fork(first + i))) round[i] = poses_of(*one);
        }
      });
      for (const auto& some : round) found.insert(found.end(), some.begin(), some.end());
      std::stable_sort(found.begin(), found.end(),
                       [](const auto& a, const auto& b) { return a.evidence > b.evidence; });
    }
    return first_distinct(found, kMostConstellationPoses,
                          [&](const auto& a, const auto& b) { return are_one(a, b, kSamePose); });
  }

 private:
  bool are_one(const ConstellationPose& a, const ConstellationPose& b, double radii) const {
    return distance_(a.target_from_source, b.target_from_source) < radii * unit_;
  }

  // Whether several constellations agree on a pose, and no other has similar evidence.
  bool clear(const std::vector<ConstellationPose>& found) const {
    std::size_t agreeing = 0;
    for (const ConstellationPose& pose : found) {
      if (are_one(pose, found.front(), kAgreeing)) {
        if (++agreeing == kEnough) return true;
      } else if (pose.evidence > kRivalEvidence * found.front().evidence) {
        return false;
      }
    }
    return false;
  }

  static PointsF single(std::span<const Eigen::Vector3d> points) {
    PointsF result;
    for (const Eigen::Vector3d& point : points.first(std::min(points.size(), kMostPoints))) {
      result.push_back(point.cast<float>());
    }
    return result;
  }

  bool is_side(float length) const {
    return length >= (kShortest + kTolerance) * fine_ && length <= (kLongest - kTolerance) * fine_;
  }

  // Whether the third point is too close to the line of the others to determine the rotation about it.
  bool slender(const Vector3f& a, const Vector3f& b, const Vector3f& c) const {
    return (b - a).cross(c - a).norm() < kLeastHeight * fine_ * (b - a).norm();
  }

  std::optional<Constellation> draw(Random random) const {
    constexpr int kTrials = 200;
    const Vector3f a = source_[random.index(source_.size())];
    std::vector<std::uint32_t> near;
    for (std::size_t i = 0; i < source_.size(); ++i) {
      if (is_side((source_[i] - a).norm())) near.push_back(static_cast<std::uint32_t>(i));
    }
    if (near.size() < 2) return {};
    for (int trial = 0; trial < kTrials; ++trial) {
      const Vector3f b = source_[near[random.index(near.size())]];
      const Vector3f c = source_[near[random.index(near.size())]];
      Constellation result;
      result.bc = (c - b).norm();
      if (!is_side(result.bc) || slender(a, b, c)) continue;
      result.ab = (b - a).norm();
      result.ac = (c - a).norm();
      result.centre = (a + b + c) / 3.0F;
      result.source_from_axes = axes(a, b, c);
      // The first points are a sample, because the source is in random order.
      for (const Vector3f& point : source_) {
        if ((point - result.centre).squaredNorm() > kPatch * kPatch * fine_ * fine_) continue;
        if (point == a || point == b || point == c) continue;
        result.patch.push_back(result.source_from_axes.transpose() * (point - result.centre));
        if (result.patch.size() == kPatchPoints) break;
      }
      if (result.patch.size() < kLook) return {};
      return result;
    }
    return {};
  }

  // The target points at a distance from target point i.
  NearPoints gather(std::size_t i, float distance) const {
    const float tolerance = kTolerance * fine_;
    const float low = (distance - tolerance) * (distance - tolerance);
    const float high = (distance + tolerance) * (distance + tolerance);
    NearPoints result;
    for (const std::uint16_t j : partners_.at(i, distance, tolerance)) {
      const float square = (target_[j] - target_[i]).squaredNorm();
      result.set(target_[j]);
      result.count +=
          static_cast<std::size_t>(square >= low) & static_cast<std::size_t>(square <= high);
      if (result.count == kMostPartners) break;
    }
    return result;
  }

  std::size_t hits(const Constellation& constellation, const Pose& pose, std::size_t begin,
                   std::size_t end) const {
    std::size_t count = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const Vector3f moved = pose.target_from_axes * constellation.patch[i] + pose.centre;
      count += occupancy_.taken(moved) ? 1 : 0;
    }
    return count;
  }

  std::vector<ConstellationPose> poses_of(const Constellation& constellation) const {
    const float tolerance = kTolerance * fine_;
    const float low = (constellation.bc - tolerance) * (constellation.bc - tolerance);
    const float high = (constellation.bc + tolerance) * (constellation.bc + tolerance);
    std::vector<Pose> best;  // a heap with the fewest hits on top
    const auto more = [](const Pose& a, const Pose& b) { return a.hits > b.hits; };
    std::array<std::uint32_t, kMostPartners> thirds;
    for (std::size_t i = 0; i < target_.size(); ++i) {
      const NearPoints bs = gather(i, constellation.ab);
      if (bs.count == 0) continue;
      const NearPoints cs = gather(i, constellation.ac);
      for (std::size_t j = 0; j < bs.count; ++j) {
        const Vector3f b = bs[j];
        const std::size_t count = cs.select(b, low, high, thirds);
        for (std::size_t k = 0; k < count; ++k) {
          const Vector3f c = cs[thirds[k]];
          Pose pose;
          pose.target_from_axes = axes(target_[i], b, c);
          pose.centre = (target_[i] + b + c) / 3.0F;
          pose.hits = hits(constellation, pose, 0, kBlink);
          if (pose.hits < kBlinkHits) continue;
          pose.hits += hits(constellation, pose, kBlink, kGlance);
          if (pose.hits < kGlanceHits) continue;
          pose.hits += hits(constellation, pose, kGlance, kLook);
          if (best.size() == kLooked) {
            if (pose.hits <= best.front().hits) continue;
            std::pop_heap(best.begin(), best.end(), more);
            best.pop_back();
          }
          best.push_back(pose);
          std::push_heap(best.begin(), best.end(), more);
        }
      }
    }
    std::vector<ConstellationPose> result;
    for (const Pose& pose : best) {
      const std::size_t total = constellation.patch.size();
      const std::size_t count = pose.hits + hits(constellation, pose, kLook, total);
      const double evidence = hit_evidence(count, total, kOccupiedByChance);
      if (!(evidence > 0.0)) continue;
      const Eigen::Quaterniond rotation(
          (pose.target_from_axes * constellation.source_from_axes.transpose()).cast<double>());
      const Rigid3 turn(rotation.normalized(), Eigen::Vector3d::Zero());
      result.push_back({Rigid3(turn.quaternion(), pose.centre.cast<double>() -
                                                      turn * constellation.centre.cast<double>()),
                        evidence});
    }
    std::stable_sort(result.begin(), result.end(),
                     [](const auto& a, const auto& b) { return a.evidence > b.evidence; });
    if (result.size() > kKept) result.resize(kKept);
    return result;
  }

  std::size_t draws_;
  const Execution& execution_;
  Random random_;
  double unit_;
  float fine_;
  PointsF source_;
  PointsF target_;
  Occupancy occupancy_;
  Partners partners_;
  PoseDistance distance_;
};

}  // namespace

std::vector<ConstellationPose> constellation_poses(std::span<const Eigen::Vector3d> source,
                                                   std::span<const Eigen::Vector3d> target,
                                                   Random random, double fine, std::size_t draws,
                                                   const Execution& execution) {
  if (source.empty() || target.empty()) return {};
  return Finder(source, target, random, fine, draws, execution).run();
}

}  // namespace cairn::detail
