// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image_locator.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/detail/descriptor_kernel.hpp"
#include "cairn/core/detail/hamming.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/detail/centroid.hpp"
#include "cairn/vision/detail/pose_estimation.hpp"
#include "cairn/vision/detail/sensor_model.hpp"

namespace cairn {
namespace {

using detail::Descriptor;
using detail::FeatureExtractor;
using detail::Features;
using detail::kNearestDepth;
using detail::Pinhole;
using detail::PointMatch;
using detail::PoseEstimate;
using detail::SensorModel;

constexpr std::size_t kDescriptorBytes = sizeof(Descriptor);
constexpr std::uint32_t kMostBits = 64;      // largest difference of one landmark's descriptors
constexpr std::size_t kFewestProposals = 6;  // three determine a pose, the others must confirm it
constexpr double kProposalPixels = 5.0;
constexpr int kProposalIterations = 1500;
constexpr int kRivalIterations = 800;
constexpr std::size_t kMostRivalPairs = 1000;
constexpr double kSearchPixels = 6.0;  // about where a landmark should appear
constexpr double kExplained = 3.0;     // times that: a pair within it does not suggest another pose
constexpr int kSearchRounds = 3;
constexpr std::size_t kOthers =
    16;  // landmarks with which the search is tried, to see what chance gives
constexpr double kCluster = 0.125;      // radius of a cluster, in widths of the image
constexpr double kExtent = 3.0;         // assumed extent of a map without a scale, metres
constexpr double kSameRotation = 0.1;   // radians: largest difference of equal poses
constexpr double kSameDistance = 0.05;  // the same, times the median distance of what is seen

std::span<const std::uint8_t> bytes_of(std::span<const Descriptor> descriptors) {
  return {reinterpret_cast<const std::uint8_t*>(descriptors.data()),
          descriptors.size() * kDescriptorBytes};
}

// A landmark that a corner may show.
struct Pair {
  std::uint32_t corner = 0;
  std::uint32_t landmark = 0;  // of those with descriptors
  std::uint32_t bits = 0;
  bool mutual = false;  // mutual nearest neighbours
};

// A pose with its evidence.
struct Candidate {
  PoseEstimate pose;
  std::vector<Pair> pairs;  // that agree with it
  std::size_t visible = 0;
  double expected = 0.0;
  std::size_t spread = 0;
};

double evidence(const Candidate& candidate) {
  const double count = static_cast<double>(candidate.spread);
  const double chance = std::max(candidate.expected, 1.0);
  return count > chance ? count * std::log(count / chance) - (count - chance) : 0.0;
}

// A logistic model, fitted to images of simulated places (docs/evidence.md).
double probability_of(const Candidate& candidate) {
  constexpr double kConstant = -7.17;
  constexpr double kEvidence = 2.46;
  return 1.0 / (1.0 + std::exp(-kConstant - kEvidence * std::log1p(evidence(candidate))));
}

}  // namespace

constexpr OptionField kLocateFields[] = {
    {"features", option_at<&LocateOptions::features, &FeatureOptions::count>, kAny, "--features",
     "Number of corners to detect in an image"},
    {"min_probability", option_at<&LocateOptions::min_probability>, kProbability,
     "--min-probability", "Least probability of a located image, at least 0.5 and below 1"},
    {"seed", option_at<&LocateOptions::seed>},
};
constinit const OptionTable LocateOptions::table = {"LocateOptions", kLocateFields};

void LocateOptions::validate() const {
  features.validate();
  check_options(*this);
}

class ImageLocator::Parts {
 public:
  Parts(const LandmarkMap& map, const Camera& camera, const LocateOptions& options)
      : options_(options),
        camera_(camera),
        extractor_(camera, options.features),
        sensor_(SensorNoise(), extractor_.pinhole(), extractor_.scales()),
        metric_(map.info().length_unit == LengthUnit::kMetres) {
    const LandmarkTable& landmarks = map.landmarks();
    const auto& column = landmarks.descriptors;
    reject_if(!column || column->kind != "ORB" || column->bytes_each != kDescriptorBytes,
              "descriptors",
              column ? fmt::format("{} of {} bytes", column->kind, column->bytes_each) : "none",
              fmt::format("ORB of {} bytes: an image is compared with these", kDescriptorBytes));
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      if (column->known[i] == 0) continue;
      indices_.push_back(i);
      for (std::size_t k = 0; k < column->count(i); ++k) {
        Descriptor descriptor;
        std::memcpy(descriptor.data(), column->descriptor(i, k).data(), kDescriptorBytes);
        descriptors_.push_back(descriptor);
        owners_.push_back(static_cast<std::uint32_t>(begins_.size() - 1));
      }
      begins_.push_back(descriptors_.size());
      positions_.push_back(landmarks.positions[i]);
      const bool known =
          !landmarks.covariances.empty() && !std::isnan(landmarks.covariances[i](0, 0));
      covariances_.push_back(known ? landmarks.covariances[i] : Eigen::Matrix3d::Zero());
    }
    if (!metric_) scale_ = free_scale();
    for (Eigen::Vector3d& position : positions_) position *= scale_;
    for (Eigen::Matrix3d& covariance : covariances_) covariance *= scale_ * scale_;
  }

  ImageLocation locate(const GrayImage& image, const DepthImage& depth) const {
    require_size(image.width, image.height, "image");
    if (!depth.empty()) require_size(depth.width, depth.height, "depth image");
    const cv::Mat depth_m = metric_ && !depth.empty() ? detail::matrix_of(depth) : cv::Mat();
    const Features features = extractor_.extract(detail::matrix_of(image), depth_m);
    const std::vector<Pair> pairs = nearest(features);
    std::vector<Pair> mutual;
    std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(mutual),
                 [](const Pair& pair) { return pair.mutual; });
    ImageLocation result;
    result.corners = features.size();
    result.proposals = mutual.size();
    const std::optional<Candidate> best = candidate(features, mutual, kProposalIterations);
    if (!best) {
      result.reason =
          fmt::format("no pose explains {} or more matches: {} of {} corners match a landmark",
                      kFewestProposals, mutual.size(), features.size());
      return result;
    }
    // Similar objects may occur in several places, so pairs that a good pose does not explain may give
    // another pose.
    std::optional<Candidate> next;
    if (probability_of(*best) >= options_.min_probability) {
      next = candidate(features, unexplained(features, *best, pairs), kRivalIterations);
    }
    report(features, *best, next && !same(*best, *next) ? &*next : nullptr, result);
    return result;
  }

 private:
  void require_size(std::uint32_t width, std::uint32_t height, std::string_view what) const {
    if (width == camera_.width && height == camera_.height) return;
    throw Error(ErrorKind::kInput, what, fmt::format("{} x {} pixels", width, height),
                fmt::format("{} x {}, as the camera has", camera_.width, camera_.height));
  }

  // So that limits in metres are also valid for maps in other units.
  double free_scale() const {
    if (positions_.empty()) return 1.0;
    const Eigen::Vector3d mean = centroid(positions_);
    std::vector<double> distances;
    for (const Eigen::Vector3d& position : positions_)
      distances.push_back((position - mean).norm());
    const double middle = upper_median(distances);
    return middle > 0.0 ? kExtent / middle : 1.0;
  }

  // Each landmark with its most similar corner, the most similar first.
  std::vector<Pair> nearest(const Features& features) const {
    std::vector<Pair> pairs;
    if (features.size() == 0 || descriptors_.empty()) return pairs;
    const auto found = detail::descriptor_kernel::nearest_both_ways(
        bytes_of(features.descriptors()), bytes_of(descriptors_), kDescriptorBytes,
        detail::descriptor_kernel::Norm::kHamming);
    for (std::uint32_t i = 0; i < positions_.size(); ++i) {
      detail::descriptor_kernel::Nearest corner;
      for (std::size_t k = begins_[i]; k < begins_[i + 1]; ++k) {
        if (found.of_b[k].first < corner.first) corner = found.of_b[k];
      }
      if (corner.first > kMostBits) continue;
      pairs.push_back(
          {corner.index, i, corner.first, owners_[found.of_a[corner.index].index] == i});
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.bits < b.bits; });
    return pairs;
  }

  // The pairs whose landmark is not where the candidate has the corner.
  std::vector<Pair> unexplained(const Features& features, const Candidate& candidate,
                                std::span<const Pair> pairs) const {
    const Rigid3 camera_from_world = candidate.pose.world_from_camera.inverse();
    std::vector<Pair> result;
    for (const Pair& pair : pairs) {
      const Eigen::Vector3d x = camera_from_world * positions_[pair.landmark];
      const Eigen::Vector2d pixel = features.keypoints()[pair.corner].pixel.cast<double>();
      if (x.z() >= kNearestDepth &&
          (extractor_.pinhole().project(x) - pixel).norm() <= kExplained * kSearchPixels) {
        continue;
      }
      result.push_back(pair);
      if (result.size() == kMostRivalPairs) break;  // the others are less similar
    }
    return result;
  }

  std::optional<Candidate> candidate(const Features& features, std::span<const Pair> pairs,
                                     int iterations) const {
    if (pairs.size() < kFewestProposals) return std::nullopt;
    const std::optional<Rigid3> proposed = proposed_pose(features, pairs, iterations);
    if (!proposed) return std::nullopt;
    Candidate result;
    result.pose.world_from_camera = *proposed;
    for (int round = 0; round < kSearchRounds; ++round) {
      search(features, result);
      if (result.pairs.size() < kFewestProposals) return std::nullopt;
      refine(features, result);
      if (result.pairs.size() < kFewestProposals) return std::nullopt;
    }
    result.spread = result.pairs.size() - largest_cluster(features, result.pairs);
    return result;
  }

  std::optional<Rigid3> proposed_pose(const Features& features, std::span<const Pair> pairs,
                                      int iterations) const {
    std::vector<cv::Point3d> landmarks;
    std::vector<cv::Point2d> pixels;
    for (const Pair& pair : pairs) {
      const Eigen::Vector3d& x = positions_[pair.landmark];
      landmarks.emplace_back(x.x(), x.y(), x.z());
      const Eigen::Vector2f& pixel = features.keypoints()[pair.corner].pixel;
      pixels.emplace_back(pixel.x(), pixel.y());
    }
    const Pinhole& pinhole = extractor_.pinhole();
    cv::Mat matrix = (cv::Mat_<double>(3, 3) << pinhole.fx, 0.0, pinhole.cx, 0.0, pinhole.fy,
                      pinhole.cy, 0.0, 0.0, 1.0);
    cv::UsacParams parameters;
    parameters.sampler = cv::SAMPLING_PROSAC;
    parameters.score = cv::SCORE_METHOD_MSAC;
    parameters.loMethod = cv::LOCAL_OPTIM_INNER_LO;
    parameters.loIterations = 5;
    parameters.loSampleSize = 20;
    parameters.confidence = 0.999;
    parameters.maxIterations = iterations;
    parameters.threshold = kProposalPixels;
    parameters.randomGeneratorState = static_cast<int>(options_.seed);
    parameters.isParallel = false;
    cv::Mat turn;
    cv::Mat shift;
    std::vector<int> inliers;
    if (!cv::solvePnPRansac(landmarks, pixels, matrix, cv::noArray(), turn, shift, inliers,
                            parameters)) {
      return std::nullopt;
    }
    if (inliers.size() < kFewestProposals) return std::nullopt;
    cv::Mat rotation;
    cv::Rodrigues(turn, rotation);
    Eigen::Matrix3d r;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) r(i, j) = rotation.at<double>(i, j);
    }
    const Eigen::Vector3d t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
    if (!r.allFinite() || !t.allFinite()) return std::nullopt;
    return Rigid3(Eigen::Quaterniond(r), t).inverse();
  }

  // The landmarks that project near a similar corner; each corner once.
  void search(const Features& features, Candidate& candidate) const {
    const Rigid3 camera_from_world = candidate.pose.world_from_camera.inverse();
    const Pinhole& pinhole = extractor_.pinhole();
    candidate.visible = 0;
    std::size_t chance = 0;
    std::vector<Pair> best(features.size(), Pair{0, 0, kMostBits + 1, false});
    std::vector<std::uint32_t> near;
    const auto most_alike = [&](std::size_t landmark) {
      Pair pair{0, 0, kMostBits + 1, false};
      for (std::size_t k = begins_[landmark]; k < begins_[landmark + 1]; ++k) {
        for (const std::uint32_t corner : near) {
          const auto bits = static_cast<std::uint32_t>(
              detail::hamming_distance(features.descriptors()[corner], descriptors_[k]));
          if (bits < pair.bits) pair = {corner, 0, bits, false};
        }
      }
      return pair;
    };
    for (std::uint32_t i = 0; i < positions_.size(); ++i) {
      const Eigen::Vector3d x = camera_from_world * positions_[i];
      if (x.z() < kNearestDepth) continue;
      const Eigen::Vector2d pixel = pinhole.project(x);
      if (pixel.x() < -kSearchPixels || pixel.y() < -kSearchPixels ||
          pixel.x() > camera_.width + kSearchPixels || pixel.y() > camera_.height + kSearchPixels) {
        continue;
      }
      near.clear();
      features.visit_near(pixel, kSearchPixels,
                          [&](std::uint32_t corner) { near.push_back(corner); });
      if (near.empty()) continue;
      ++candidate.visible;
      Pair pair = most_alike(i);
      pair.landmark = i;
      if (pair.bits < best[pair.corner].bits) best[pair.corner] = pair;
      for (std::size_t k = 1; k <= kOthers; ++k) {
        const std::size_t other =
            (i + k * (positions_.size() / (kOthers + 1) + 1)) % positions_.size();
        if (most_alike(other).bits <= kMostBits) ++chance;
      }
    }
    candidate.expected = static_cast<double>(chance) / static_cast<double>(kOthers);
    candidate.pairs.clear();
    for (const Pair& pair : best) {
      if (pair.bits <= kMostBits) candidate.pairs.push_back(pair);
    }
  }

  // Moves the pose to where its pairs fit best, and keeps those that do.
  void refine(const Features& features, Candidate& candidate) const {
    const Rigid3 camera_from_world = candidate.pose.world_from_camera.inverse();
    std::vector<PointMatch> matches;
    for (const Pair& pair : candidate.pairs) {
      PointMatch match{positions_[pair.landmark],
                       sensor_.measurement(features.keypoints()[pair.corner])};
      // The landmark's own error, in pixels.
      const Eigen::Matrix3d rotation = camera_from_world.rotation();
      const double depth = std::max((camera_from_world * match.x_in_world).z(), kNearestDepth);
      const Eigen::Matrix3d own = rotation * covariances_[pair.landmark] * rotation.transpose();
      const double across = 0.5 * (own(0, 0) + own(1, 1));
      const double per_metre = extractor_.pinhole().fx / depth;
      match.measured.sigma_pixel = std::sqrt(
          match.measured.sigma_pixel * match.measured.sigma_pixel + per_metre * per_metre * across);
      match.measured.sigma_depth_m =
          std::sqrt(match.measured.sigma_depth_m * match.measured.sigma_depth_m + own(2, 2));
      matches.push_back(match);
    }
    candidate.pose =
        detail::refine_pose(extractor_.pinhole(), matches, candidate.pose.world_from_camera);
    std::vector<Pair> kept;
    for (std::size_t i = 0; i < candidate.pairs.size(); ++i) {
      if (candidate.pose.inliers[i]) kept.push_back(candidate.pairs[i]);
    }
    candidate.pairs = std::move(kept);
  }

  std::size_t largest_cluster(const Features& features, std::span<const Pair> pairs) const {
    const auto radius = static_cast<float>(kCluster * camera_.width);
    std::size_t most = 0;
    for (const Pair& centre : pairs) {
      const Eigen::Vector2f& at = features.keypoints()[centre.corner].pixel;
      const auto inside = std::count_if(pairs.begin(), pairs.end(), [&](const Pair& pair) {
        return (features.keypoints()[pair.corner].pixel - at).squaredNorm() <= radius * radius;
      });
      most = std::max(most, static_cast<std::size_t>(inside));
    }
    return most;
  }

  bool same(const Candidate& a, const Candidate& b) const {
    const Rigid3 between = a.pose.world_from_camera.inverse() * b.pose.world_from_camera;
    std::vector<double> depths;
    const Rigid3 camera_from_world = a.pose.world_from_camera.inverse();
    for (const Pair& pair : a.pairs) {
      depths.push_back((camera_from_world * positions_[pair.landmark]).z());
    }
    return between.quaternion().angularDistance(Eigen::Quaterniond::Identity()) <= kSameRotation &&
           between.translation().norm() <= kSameDistance * upper_median(depths);
  }

  void report(const Features& features, const Candidate& best, const Candidate* next,
              ImageLocation& result) const {
    const Rigid3& pose = best.pose.world_from_camera;
    result.estimate = Rigid3(pose.quaternion(), pose.translation() / scale_);
    Matrix6d covariance = best.pose.covariance;
    covariance.topRows<3>() /= scale_;
    covariance.leftCols<3>() /= scale_;
    result.covariance = covariance;
    result.visible = best.visible;
    result.expected = best.expected;
    result.spread = best.spread;
    for (const Pair& pair : best.pairs) {
      result.matches.push_back(
          {features.keypoints()[pair.corner].raw, LandmarkIndex{indices_[pair.landmark]}});
    }
    result.probability = probability_of(best);
    std::string found = fmt::format(
        "{} of the {} landmarks projected near a corner match it ({:.1f} expected by chance)",
        best.pairs.size(), best.visible, best.expected);
    if (next != nullptr && probability_of(*next) > 0.05 * result.probability) {
      const double other = probability_of(*next);
      // The odds of each versus none; at most one is right.
      const double odds = result.probability / (1.0 - result.probability);
      const double odds_of_other = other / (1.0 - other);
      result.probability = odds / (1.0 + odds + odds_of_other);
      found += fmt::format(", and {} match at another pose", next->pairs.size());
    }
    result.located = result.probability >= options_.min_probability;
    result.reason =
        fmt::format("{}: {}", decision_text(result.probability, options_.min_probability), found);
    if (result.located) result.world_from_camera = result.estimate;
  }

  LocateOptions options_;
  Camera camera_;
  FeatureExtractor extractor_;
  SensorModel sensor_;
  bool metric_;
  double scale_ = 1.0;  // of lengths of the map, to be about metres
  // Of the landmarks with descriptors:
  std::vector<std::uint32_t> indices_;
  std::vector<std::size_t> begins_ = {0};  // of each one's descriptors, and the end
  std::vector<Descriptor> descriptors_;
  std::vector<std::uint32_t> owners_;  // of each descriptor
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Eigen::Matrix3d> covariances_;
};

ImageLocator::ImageLocator(const LandmarkMap& map, const Camera& camera,
                           const LocateOptions& options) {
  options.validate();
  if (const std::string defect = camera_defect(camera); !defect.empty()) {
    throw Error(ErrorKind::kMisuse, "camera", defect, "a camera without defect");
  }
  parts_ = std::make_unique<const Parts>(map, camera, options);
}
ImageLocator::~ImageLocator() = default;
ImageLocator::ImageLocator(ImageLocator&&) noexcept = default;
ImageLocator& ImageLocator::operator=(ImageLocator&&) noexcept = default;

ImageLocation ImageLocator::locate(const GrayImage& image, const DepthImage& depth) const {
  return parts_->locate(image, depth);
}

}  // namespace cairn
