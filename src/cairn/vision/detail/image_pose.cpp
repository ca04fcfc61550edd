// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/image_pose.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <ranges>
#include <set>
#include <utility>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/covariance.hpp"

namespace cairn::detail {
namespace {

constexpr double kProposalPixels = 5.0;
constexpr int kProposalIterations = 3000;
constexpr int kFrameIterations = 1000;
constexpr int kRivalIterations = 800;
constexpr std::size_t kMostRivalPairs = 1000;
constexpr double kDecisive = 60.0;        // evidence with which no other proposal is searched
constexpr std::size_t kMostFrames = 5;    // about which other proposals are searched
constexpr std::size_t kTogether = 4;      // frames that see most in common, with each of these
constexpr double kUsualLandmarks = 50.0;  // added to a frame's, so that few do not make it likely
constexpr double kExplained = 18.0;       // pixels: a pair within it does not suggest another pose
// About where a landmark should appear, one round after another.
constexpr std::array<double, 4> kSearchPixels = {10.0, 8.0, 6.0, 6.0};
constexpr double kLeastCosine = 0.5;      // of the directions from which a landmark was and is seen
constexpr double kMostChance = 0.01;      // of a match to be as similar
constexpr std::size_t kChances = 8000;    // comparisons that show what chance gives, about
constexpr std::size_t kFewestOthers = 4;  // of a landmark's features with other landmarks
constexpr std::size_t kMostOthers = 32;
constexpr int kCellColumns = 8;
constexpr int kCellRows = 6;
static_assert(kCellColumns * kCellRows == kImageCells);
constexpr int kFewestOfCell = 3;        // landmarks by which a cell is judged
constexpr double kCluster = 0.125;      // radius of a cluster, in widths of the image
constexpr double kSameRotation = 0.1;   // radians: largest difference of equal poses
constexpr double kSameDistance = 0.05;  // the same, times the median distance of what is seen
constexpr std::uint32_t kNoDistance = std::numeric_limits<std::uint32_t>::max();

using LandmarkSet = std::set<std::uint32_t>;

// The largest group of clusters that have landmarks in common: what one thing shows in several images.
LandmarkSet largest_thing(const std::vector<ImagePose>& images) {
  DisjointSets things(images.size());
  std::map<std::uint32_t, std::size_t>
      image_of;  // landmark: the first image with it in its cluster
  for (std::size_t k = 0; k < images.size(); ++k) {
    for (const std::uint32_t landmark : images[k].cluster) {
      things.join(image_of.try_emplace(landmark, k).first->second, k);
    }
  }
  std::map<std::size_t, LandmarkSet> found;
  for (const auto& [landmark, k] : image_of) found[things.first_of(k)].insert(landmark);
  LandmarkSet largest;
  for (LandmarkSet& thing : found | std::views::values) {
    if (thing.size() > largest.size()) largest = std::move(thing);
  }
  return largest;
}

// Log-likelihood ratio of a right pose to a wrong one without some landmarks, at the most likely share of right matches.
double log_likelihood_ratio(std::span<const ImagePose> images, const LandmarkSet& without) {
  std::vector<double> ratios;
  for (const ImagePose& image : images) {
    for (const auto& [landmark, ratio] : image.likelihood_ratios) {
      if (!without.contains(landmark)) ratios.push_back(ratio);
    }
  }
  constexpr double kStep = 0.02;
  double most = 0.0;
  for (double share = kStep; share < 1.0; share += kStep) {
    double sum = 0.0;
    for (const double ratio : ratios) sum += std::log1p(share * (ratio - 1.0));
    most = std::max(most, sum);
  }
  return most;
}

// Share of the matches that are independent: the smaller of distinct landmarks per match and of distinct directions per
// match. What an image shows beside a wrong match, the next image shows again.
double share_of_different(const std::vector<ImagePose>& images) {
  LandmarkSet landmarks;
  std::map<std::array<int, 3>, std::size_t> most;  // matches of one image in a direction
  std::size_t landmarks_of_each = 0;
  std::size_t matches = 0;
  for (const ImagePose& image : images) {
    LandmarkSet own;
    for (const FeatureMatch& match : image.matches) own.insert(match.landmark);
    landmarks_of_each += own.size();
    matches += image.matches.size();
    landmarks.merge(own);
    std::map<std::array<int, 3>, std::size_t> counts;
    for (const std::array<int, 3>& direction : image.directions) ++counts[direction];
    for (const auto& [direction, count] : counts) {
      most[direction] = std::max(most[direction], count);
    }
  }
  std::size_t different = 0;
  for (const auto& [direction, count] : most) different += count;
  return std::min(static_cast<double>(landmarks.size()) / static_cast<double>(landmarks_of_each),
                  static_cast<double>(different) / static_cast<double>(matches));
}

// The evidence of a body from that of its images.
void add_up(BodyPose& body) {
  const double once = body.independent = share_of_different(body.images);
  const LandmarkSet thing = largest_thing(body.images);
  std::size_t outside = 0;
  for (const ImagePose& image : body.images) {
    body.visible += image.visible;
    body.expected += image.expected;
    body.unmatched_cells = std::max(body.unmatched_cells, image.unmatched_cells);
    outside += static_cast<std::size_t>(std::ranges::count_if(
        image.matches, [&](const FeatureMatch& match) { return !thing.contains(match.landmark); }));
  }
  body.spread = static_cast<std::size_t>(std::round(once * static_cast<double>(outside)));
  body.evidence =
      once * std::min(log_likelihood_ratio(body.images, thing),
                      log_likelihood_ratio(body.images, {}) * static_cast<double>(outside) /
                          static_cast<double>(body.agreeing));
  // All images of a landmark share its error.
  body.pose.covariance /= once;
  for (ImagePose& image : body.images) image.pose.covariance /= once;
}

// Refers to the matches.
std::vector<BodyCamera> cameras_of(std::span<const BodyImage> images,
                                   const std::vector<std::vector<PointMatch>>& matches) {
  std::vector<BodyCamera> cameras;
  for (std::size_t k = 0; k < images.size(); ++k) {
    cameras.push_back({images[k].sensor.pinhole(), images[k].camera_from_body, matches[k]});
  }
  return cameras;
}

void sort_by_distance(std::vector<FeatureMatch>& matches) {
  std::ranges::stable_sort(matches, {}, &FeatureMatch::distance);
}

}  // namespace

// The landmarks that a pose projects near features.
struct ImagePoseSearch::View {
  std::vector<std::uint32_t> landmarks;
  std::vector<int> cells;                 // of those that were seen alike before, else -1
  std::vector<std::size_t> begins = {0};  // of each one's features
  std::vector<std::uint32_t> features;

  std::span<const std::uint32_t> near(std::size_t k) const {
    return std::span(features).subspan(begins[k], begins[k + 1] - begins[k]);
  }
};

// The most similar landmark of each feature that has one near, and what chance gives.
struct ImagePoseSearch::Found {
  std::vector<FeatureMatch> matches;
  std::vector<std::uint32_t> chances;  // the smallest distances of others, ascending
  std::size_t compared = 0;            // number of others

  // Probability that chance gives so small a distance; only a lower bound beyond kMostChance.
  double chance(std::uint32_t distance) const {
    const auto less = std::ranges::upper_bound(chances, distance) - chances.begin();
    return (static_cast<double>(less) + 0.5) / (static_cast<double>(compared) + 1.0);
  }
  void keep_smallest() {
    compared = chances.size();
    const auto kept =
        static_cast<std::size_t>(kMostChance * (static_cast<double>(compared) + 1.0)) + 1;
    const auto end = chances.begin() + static_cast<std::ptrdiff_t>(std::min(kept, compared));
    std::partial_sort(chances.begin(), end, chances.end());
    chances.erase(end, chances.end());
  }
};

ImagePoseSearch::ImagePoseSearch(const DescribedLandmarks& landmarks,
                                 const ImageDescriber& describer, const DescribedImage& image,
                                 std::uint64_t seed)
    : landmarks_(&landmarks), describer_(&describer), image_(&image), seed_(seed) {
  if (image.features.size() == 0 || landmarks.size() == 0) return;
  size_ = image.features.pyramid().front().size();
  set_extent();
  match_all();
}

void ImagePoseSearch::set_extent() {
  extent_.setEmpty();
  for (const Keypoint& keypoint : image_->features.keypoints()) {
    extent_.extend(keypoint.pixel.cast<double>());
  }
}

void ImagePoseSearch::match_all() {
  auto found = descriptor_kernel::nearest_both_ways(image_->descriptors, landmarks_->descriptors(),
                                                    describer_->bytes_each(), describer_->norm());
  nearest_features_ = std::move(found.of_b);
  for (std::uint32_t i = 0; i < landmarks_->size(); ++i) {
    const auto rows = std::span(nearest_features_)
                          .subspan(landmarks_->row_begin(i),
                                   landmarks_->row_begin(i + 1) - landmarks_->row_begin(i));
    const auto nearest = *std::ranges::min_element(rows, {}, &descriptor_kernel::Nearest::first);
    if (nearest.first > describer_->most_distance()) continue;
    pairs_.push_back({nearest.index, i, nearest.first});
    if (landmarks_->owners()[found.of_a[nearest.index].index] == i)
      mutual_.push_back(pairs_.back());
  }
  sort_by_distance(pairs_);
  sort_by_distance(mutual_);
}

// The frames that see most landmarks of the mutual pairs; each of these counts for one frame.
std::vector<std::uint32_t> ImagePoseSearch::likely_frames() const {
  std::vector<std::uint32_t> chosen;
  std::vector<FeatureMatch> left = mutual_;
  while (chosen.size() < kMostFrames) {
    std::vector<double> votes(landmarks_->frames(), 0.0);
    for (const FeatureMatch& match : left) {
      for (const std::uint32_t frame : landmarks_->frames_of(match.landmark)) votes[frame] += 1.0;
    }
    for (std::uint32_t f = 0; f < votes.size(); ++f) {
      votes[f] /= std::sqrt(static_cast<double>(landmarks_->seen_in(f).size()) + kUsualLandmarks);
    }
    const auto most = std::ranges::max_element(votes);
    if (most == votes.end() || *most <= 0.0) break;
    chosen.push_back(static_cast<std::uint32_t>(most - votes.begin()));
    std::erase_if(left, [&](const FeatureMatch& match) {
      return std::ranges::count(landmarks_->frames_of(match.landmark), chosen.back()) > 0;
    });
  }
  return chosen;
}

// The mutual pairs among the landmarks that a frame sees, and those that see most in common with it.
std::vector<FeatureMatch> ImagePoseSearch::pairs_near(std::uint32_t frame) const {
  std::vector<std::uint32_t> shared(landmarks_->frames(), 0);
  for (const std::uint32_t landmark : landmarks_->seen_in(frame)) {
    for (const std::uint32_t other : landmarks_->frames_of(landmark)) ++shared[other];
  }
  std::vector<std::uint32_t> frames(shared.size());
  std::iota(frames.begin(), frames.end(), 0U);
  std::ranges::stable_sort(frames, std::greater(), [&](std::uint32_t f) { return shared[f]; });
  std::vector<bool> is_near(landmarks_->size(), false);
  for (const std::uint32_t f : frames | std::views::take(kTogether)) {
    for (const std::uint32_t landmark : landmarks_->seen_in(f)) is_near[landmark] = true;
  }
  const std::size_t bytes_each = describer_->bytes_each();
  std::vector<std::uint8_t> bytes;
  std::vector<std::size_t> row_of;  // among the descriptors of all landmarks
  std::vector<bool> is_wanted(image_->features.size(), false);  // some row's nearest feature
  for (std::uint32_t i = 0; i < landmarks_->size(); ++i) {
    if (!is_near[i]) continue;
    const auto rows = landmarks_->rows(i);
    bytes.insert(bytes.end(), rows.begin(), rows.end());
    for (std::size_t row = landmarks_->row_begin(i); row < landmarks_->row_begin(i + 1); ++row) {
      row_of.push_back(row);
      const auto& nearest = nearest_features_[row];
      if (nearest.first <= describer_->most_distance()) is_wanted[nearest.index] = true;
    }
  }
  std::vector<std::uint32_t> features;
  std::vector<std::uint8_t> wanted;
  for (std::uint32_t i = 0; i < is_wanted.size(); ++i) {
    if (!is_wanted[i]) continue;
    features.push_back(i);
    const auto row = std::span(image_->descriptors).subspan(i * bytes_each, bytes_each);
    wanted.insert(wanted.end(), row.begin(), row.end());
  }
  std::vector<FeatureMatch> pairs;
  const auto found =
      descriptor_kernel::nearest_both_ways(wanted, bytes, bytes_each, describer_->norm());
  for (std::size_t k = 0; k < features.size(); ++k) {
    const auto& nearest = found.of_a[k];
    if (nearest.first > describer_->most_distance()) continue;
    const std::size_t row = row_of[nearest.index];
    if (nearest_features_[row].index != features[k]) continue;
    pairs.push_back({features[k], landmarks_->owners()[row], nearest.first});
  }
  sort_by_distance(pairs);
  return pairs;
}

std::optional<ImagePose> ImagePoseSearch::best(const SensorModel& sensor) const {
  std::optional<ImagePose> result;
  const auto consider = [&](std::span<const FeatureMatch> pairs, int iterations) {
    const std::optional<Rigid3> pose = proposed(sensor, pairs, iterations);
    if (!pose) return;
    std::optional<ImagePose> found = settled(sensor, *pose);
    if (found && (!result || found->evidence > result->evidence)) result = std::move(found);
  };
  consider(mutual_, kProposalIterations);
  if (result && result->evidence >= kDecisive) return result;
  // Among fewer landmarks, more of the mutual pairs are right.
  for (const std::uint32_t frame : likely_frames()) {
    consider(pairs_near(frame), kFrameIterations);
    if (result && result->evidence >= kDecisive) break;
  }
  return result;
}

SensorModel ImagePoseSearch::with_focal_length(const SensorModel& sensor,
                                               double focal_length) const {
  Pinhole pinhole = sensor.pinhole();
  pinhole.fx = focal_length;
  pinhole.fy = focal_length;
  return {sensor.noise(), pinhole, describer_->extractor().scales()};
}

std::vector<FocalLengthPose> ImagePoseSearch::of_focal_lengths(const SensorModel& sensor) const {
  constexpr double kLeast = 0.4;  // of the image's larger side
  constexpr double kMost = 4.0;
  constexpr double kStep = 1.15;
  if (mutual_.size() < kFewestMatches) return {};
  const double side = std::max(size_.width, size_.height);
  double focal_length = std::clamp(sensor.pinhole().fx, kLeast * side, kMost * side);
  while (focal_length / kStep >= kLeast * side) focal_length /= kStep;
  std::vector<FocalLengthPose> poses;
  for (; focal_length <= kMost * side; focal_length *= kStep) {
    const SensorModel model = with_focal_length(sensor, focal_length);
    const std::optional<Rigid3> pose = proposed(model, mutual_, kFrameIterations);
    std::optional<ImagePose> found = pose ? settled(model, *pose) : std::nullopt;
    if (found) poses.push_back({std::move(*found), focal_length});
  }
  std::ranges::stable_sort(poses, std::greater(),
                           [](const FocalLengthPose& pose) { return pose.pose.evidence; });
  return poses;
}

std::vector<PointMatch> ImagePoseSearch::matches_in_original(const SensorModel& sensor,
                                                             const ImagePose& pose) const {
  std::vector<PointMatch> matches = point_matches(sensor, pose);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Pixel& raw = image_->features.keypoints()[pose.matches[i].feature].raw;
    matches[i].measured.pixel = {raw.u, raw.v};
  }
  return matches;
}

ImagePoseSearch ImagePoseSearch::seen_through(const ImageDescriber& describer,
                                              const DescribedImage& image) const {
  ImagePoseSearch search = *this;
  search.describer_ = &describer;
  search.image_ = &image;
  search.set_extent();
  return search;
}

std::optional<ImagePose> ImagePoseSearch::rival(const SensorModel& sensor,
                                                const ImagePose& pose) const {
  const Rigid3 camera_from_world = pose.pose.world_from_camera.inverse();
  std::vector<FeatureMatch> unexplained;
  for (const FeatureMatch& pair : pairs_) {
    const Eigen::Vector3d x = camera_from_world * landmarks_->position(pair.landmark);
    const Eigen::Vector2d pixel = image_->features.keypoints()[pair.feature].pixel.cast<double>();
    if (x.z() >= kNearestDepth && (sensor.pinhole().project(x) - pixel).norm() <= kExplained) {
      continue;
    }
    unexplained.push_back(pair);
    if (unexplained.size() == kMostRivalPairs) break;  // the others are less similar
  }
  const std::optional<Rigid3> other = proposed(sensor, unexplained, kRivalIterations);
  return other ? settled(sensor, *other) : std::nullopt;
}

std::optional<ImagePose> ImagePoseSearch::settled(const SensorModel& sensor,
                                                  const Rigid3& world_from_camera) const {
  const BodyImage alone{this, sensor, Rigid3()};
  auto body = settled_images({&alone, 1}, world_from_camera);
  return body ? std::optional(std::move(body->images.front())) : std::nullopt;
}

std::optional<BodyPose> ImagePoseSearch::settled_together(std::span<const BodyImage> images,
                                                          const Rigid3& world_from_body) {
  std::optional<BodyPose> body = settled_images(images, world_from_body);
  if (body) add_up(*body);
  return body;
}

// Without the evidence of the body.
std::optional<BodyPose> ImagePoseSearch::settled_images(std::span<const BodyImage> images,
                                                        const Rigid3& world_from_body) {
  BodyPose body;
  body.pose.world_from_camera = world_from_body;
  body.images.resize(images.size());
  std::vector<View> views(images.size());
  std::vector<Found> found(images.size());
  for (const double pixels : kSearchPixels) {
    body.agreeing = 0;
    for (std::size_t k = 0; k < images.size(); ++k) {
      ImagePose& image = body.images[k];
      image.pose.world_from_camera =
          body.pose.world_from_camera * images[k].camera_from_body.inverse();
      views[k] =
          images[k].search->view_from(images[k].sensor, image.pose.world_from_camera, pixels);
      found[k] = images[k].search->matches_in(views[k]);
      image.matches.clear();
      for (const FeatureMatch& match : found[k].matches) {
        if (found[k].chance(match.distance) <= kMostChance) image.matches.push_back(match);
      }
      body.agreeing += image.matches.size();
    }
    if (body.agreeing < kFewestMatches) return std::nullopt;
    refine_together(images, body);
    if (body.agreeing < kFewestMatches) return std::nullopt;
  }
  for (std::size_t k = 0; k < images.size(); ++k) {
    images[k].search->weigh(views[k], found[k], body.images[k]);
  }
  return body;
}

std::optional<Rigid3> ImagePoseSearch::proposed(const SensorModel& sensor,
                                                std::span<const FeatureMatch> pairs,
                                                int iterations) const {
  if (pairs.size() < kFewestMatches) return std::nullopt;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const FeatureMatch& pair : pairs) {
    const Eigen::Vector3d& x = landmarks_->position(pair.landmark);
    points.emplace_back(x.x(), x.y(), x.z());
    const Eigen::Vector2f& pixel = image_->features.keypoints()[pair.feature].pixel;
    pixels.emplace_back(pixel.x(), pixel.y());
  }
  const Pinhole& pinhole = sensor.pinhole();
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
  parameters.randomGeneratorState = static_cast<int>(seed_);
  parameters.isParallel = false;
  cv::Mat turn;
  cv::Mat shift;
  std::vector<int> inliers;
  if (!cv::solvePnPRansac(points, pixels, matrix, cv::noArray(), turn, shift, inliers,
                          parameters)) {
    return std::nullopt;
  }
  if (inliers.size() < kFewestMatches) return std::nullopt;
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

ImagePoseSearch::View ImagePoseSearch::view_from(const SensorModel& sensor,
                                                 const Rigid3& world_from_camera,
                                                 double pixels) const {
  View view;
  const Eigen::Vector2d margin(pixels, pixels);
  const Eigen::AlignedBox2d reached(extent_.min() - margin, extent_.max() + margin);
  const Rigid3 camera_from_world = world_from_camera.inverse();
  for (std::uint32_t i = 0; i < landmarks_->size(); ++i) {
    const Eigen::Vector3d x = camera_from_world * landmarks_->position(i);
    if (x.z() < kNearestDepth) continue;
    const Eigen::Vector2d pixel = sensor.pinhole().project(x);
    if (!reached.contains(pixel)) continue;
    image_->features.visit_near(pixel, pixels,
                                [&](std::uint32_t feature) { view.features.push_back(feature); });
    if (view.features.size() == view.begins.back()) continue;
    const Sight sight = landmarks_->sight(i, world_from_camera.translation());
    if (sight.cosine < kLeastCosine) {
      view.features.resize(view.begins.back());
      continue;
    }
    view.begins.push_back(view.features.size());
    view.landmarks.push_back(i);
    const auto cell = [](double at, int size, int cells) {
      return std::clamp(static_cast<int>(at * cells / size), 0, cells - 1);
    };
    view.cells.push_back(sight.alike ? cell(pixel.y(), size_.height, kCellRows) * kCellColumns +
                                           cell(pixel.x(), size_.width, kCellColumns)
                                     : -1);
  }
  return view;
}

ImagePoseSearch::Found ImagePoseSearch::matches_in(const View& view) const {
  Found found;
  const std::size_t others = std::clamp(kChances / std::max<std::size_t>(view.landmarks.size(), 1),
                                        kFewestOthers, kMostOthers);
  const std::size_t step = landmarks_->size() / (others + 1) + 1;
  std::vector<FeatureMatch> best(image_->features.size(), FeatureMatch{0, 0, kNoDistance});
  const std::size_t bytes = describer_->bytes_each();
  std::vector<std::uint8_t> rows;  // of the features near a landmark
  const auto nearest = [&](std::size_t landmark) {
    return descriptor_kernel::nearest_pair(landmarks_->rows(static_cast<std::uint32_t>(landmark)),
                                           rows, bytes, describer_->norm());
  };
  for (std::size_t v = 0; v < view.landmarks.size(); ++v) {
    const std::uint32_t landmark = view.landmarks[v];
    rows.clear();
    for (const std::uint32_t feature : view.near(v)) {
      const auto row = std::span(image_->descriptors).subspan(feature * bytes, bytes);
      rows.insert(rows.end(), row.begin(), row.end());
    }
    const auto match = nearest(landmark);
    const std::uint32_t feature = view.near(v)[match.b];
    if (match.distance < best[feature].distance)
      best[feature] = {feature, landmark, match.distance};
    for (std::size_t k = 1; k <= others; ++k) {
      found.chances.push_back(nearest((landmark + k * step) % landmarks_->size()).distance);
    }
  }
  found.keep_smallest();
  std::ranges::copy_if(best, std::back_inserter(found.matches),
                       [](const FeatureMatch& match) { return match.distance != kNoDistance; });
  return found;
}

std::vector<PointMatch> ImagePoseSearch::point_matches(const SensorModel& sensor,
                                                       const ImagePose& pose) const {
  const Rigid3 camera_from_world = pose.pose.world_from_camera.inverse();
  const Eigen::Matrix3d rotation = camera_from_world.rotation();
  std::vector<PointMatch> matches;
  for (const FeatureMatch& found : pose.matches) {
    PointMatch match{landmarks_->position(found.landmark),
                     sensor.measurement(image_->features.keypoints()[found.feature])};
    // The landmark's own error, in pixels.
    const double depth = std::max((camera_from_world * match.x_in_world).z(), kNearestDepth);
    const Eigen::Matrix3d own =
        rotation * landmarks_->covariance(found.landmark) * rotation.transpose();
    const double across = 0.5 * (own(0, 0) + own(1, 1));
    const double per_metre = sensor.pinhole().fx / depth;
    match.measured.sigma_pixel = std::sqrt(match.measured.sigma_pixel * match.measured.sigma_pixel +
                                           per_metre * per_metre * across);
    match.measured.sigma_depth_m =
        std::sqrt(match.measured.sigma_depth_m * match.measured.sigma_depth_m + own(2, 2));
    matches.push_back(match);
  }
  return matches;
}

// The matches of each image.
std::vector<std::vector<PointMatch>> ImagePoseSearch::point_matches_of(
    std::span<const BodyImage> images, const BodyPose& body) {
  std::vector<std::vector<PointMatch>> matches;
  for (std::size_t k = 0; k < images.size(); ++k) {
    matches.push_back(images[k].search->point_matches(images[k].sensor, body.images[k]));
  }
  return matches;
}

std::optional<Matrix6d> ImagePoseSearch::growth_without_chance(std::span<const BodyImage> images,
                                                               const BodyPose& body) {
  // Of the matches that chance gives within the last radius of kSearchPixels, the share that fits the pose by chance
  // too: the ratio of the areas, with a residual of at most three standard deviations of 1.4 pixels.
  constexpr double kChanceThatFits = 0.5;
  double expected = 0.0;
  std::vector<std::uint32_t> landmarks;
  for (const ImagePose& image : body.images) {
    expected += image.expected;
    for (const FeatureMatch& match : image.matches) landmarks.push_back(match.landmark);
  }
  const auto matches = point_matches_of(images, body);
  constexpr std::size_t kMostLeftOut = 64;  // more hardly change the result
  const double chance = kChanceThatFits * body.independent * expected;
  auto growth =
      growth_without_landmarks(cameras_of(images, matches), landmarks, body.pose.world_from_camera,
                               std::min(static_cast<std::size_t>(std::ceil(chance)), kMostLeftOut));
  if (growth) *growth /= body.independent;
  return growth;
}

double ImagePoseSearch::distance_of(const ImagePose& pose) const {
  std::vector<double> distances;
  for (const FeatureMatch& match : pose.matches) {
    distances.push_back(
        (landmarks_->position(match.landmark) - pose.pose.world_from_camera.translation()).norm());
  }
  return upper_median(distances);
}

// Moves the pose to where its matches fit best, and keeps those that do.
void ImagePoseSearch::refine_together(std::span<const BodyImage> images, BodyPose& body) {
  const auto matches = point_matches_of(images, body);
  body.pose = refine_pose(cameras_of(images, matches), body.pose.world_from_camera);
  body.agreeing = body.pose.inlier_count;
  auto is_inlier = body.pose.inliers.begin();
  for (std::size_t k = 0; k < images.size(); ++k) {
    ImagePose& image = body.images[k];
    image.pose.world_from_camera =
        body.pose.world_from_camera * images[k].camera_from_body.inverse();
    image.pose.covariance =
        covariance_at_point(body.pose.covariance, image.pose.world_from_camera.translation() -
                                                      body.pose.world_from_camera.translation());
    std::vector<FeatureMatch> kept;
    for (const FeatureMatch& match : image.matches) {
      if (*is_inlier++) kept.push_back(match);
    }
    image.matches = std::move(kept);
    image.agreeing = image.matches.size();
  }
}

// The chances of matches are uniform for a wrong pose. For a right one, a share of them is small.
void ImagePoseSearch::weigh(const View& view, const Found& found, ImagePose& pose) const {
  constexpr double kPower = 0.15;  // density of a right match's chance u: kPower u^(kPower - 1)
  pose.visible = view.landmarks.size();
  std::vector<int> near(image_->features.size(), 0);  // landmarks near each feature
  for (const std::uint32_t feature : view.features) ++near[feature];
  pose.expected = 0.0;
  for (const int count : near) pose.expected += 1.0 - std::pow(1.0 - kMostChance, count);
  pose.directions.clear();
  for (const FeatureMatch& match : pose.matches) {
    constexpr double kCells = 12.0;  // of a radian: about five degrees each
    const Eigen::Vector3d sight =
        landmarks_->position(match.landmark) - pose.pose.world_from_camera.translation();
    const Eigen::Vector3d cell = (kCells * sight.normalized()).array().round();
    pose.directions.push_back(
        {static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z())});
  }
  pose.cluster = largest_cluster(pose.matches);
  pose.spread = pose.matches.size() - pose.cluster.size();
  std::vector<bool> agrees(image_->features.size(), false);
  std::vector<bool> matched(landmarks_->size(), false);
  for (const FeatureMatch& match : pose.matches) {
    agrees[match.feature] = true;
    matched[match.landmark] = true;
  }
  pose.likelihood_ratios.clear();
  for (const FeatureMatch& match : found.matches) {
    const double chance = agrees[match.feature] ? found.chance(match.distance) : 1.0;
    pose.likelihood_ratios.emplace_back(match.landmark, kPower * std::pow(chance, kPower - 1.0));
  }
  pose.evidence = pose.matches.empty()
                      ? 0.0
                      : log_likelihood_ratio({&pose, 1}, {}) * static_cast<double>(pose.spread) /
                            static_cast<double>(pose.matches.size());
  std::array<int, kImageCells> familiar{};
  std::array<bool, kImageCells> shown{};
  for (std::size_t v = 0; v < view.landmarks.size(); ++v) {
    if (view.cells[v] < 0) continue;
    const auto cell = static_cast<std::size_t>(view.cells[v]);
    ++familiar[cell];
    shown[cell] = shown[cell] || matched[view.landmarks[v]];
  }
  pose.unmatched_cells = 0;
  for (std::size_t cell = 0; cell < familiar.size(); ++cell) {
    if (familiar[cell] >= kFewestOfCell && !shown[cell]) ++pose.unmatched_cells;
  }
}

std::vector<std::uint32_t> ImagePoseSearch::largest_cluster(
    std::span<const FeatureMatch> matches) const {
  const auto radius = static_cast<float>(kCluster * size_.width);
  std::vector<std::uint32_t> most;
  std::vector<std::uint32_t> inside;
  for (const FeatureMatch& centre : matches) {
    const Eigen::Vector2f& at = image_->features.keypoints()[centre.feature].pixel;
    inside.clear();
    for (const FeatureMatch& match : matches) {
      const Eigen::Vector2f off = image_->features.keypoints()[match.feature].pixel - at;
      if (off.squaredNorm() <= radius * radius) inside.push_back(match.landmark);
    }
    if (inside.size() > most.size()) std::swap(most, inside);
  }
  return most;
}

bool ImagePoseSearch::same(const ImagePose& a, const ImagePose& b) const {
  const Rigid3 camera_from_world = a.pose.world_from_camera.inverse();
  const Rigid3 between = camera_from_world * b.pose.world_from_camera;
  std::vector<double> depths;
  for (const FeatureMatch& match : a.matches) {
    depths.push_back((camera_from_world * landmarks_->position(match.landmark)).z());
  }
  return between.quaternion().angularDistance(Eigen::Quaterniond::Identity()) <= kSameRotation &&
         between.translation().norm() <= kSameDistance * upper_median(depths);
}

}  // namespace cairn::detail
