// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image_locator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/vision/detail/image_pose.hpp"

namespace cairn {
namespace {

using detail::BodyImage;
using detail::BodyPose;
using detail::DescribedImage;
using detail::DescribedLandmarks;
using detail::ImageDescriber;
using detail::ImageDescriptor;
using detail::ImagePose;
using detail::ImagePoseSearch;
using detail::PoseEvidence;
using detail::SensorModel;

// A logistic model, fitted to images of simulated places (docs/evidence.md).
constexpr double kConstant = -16.95;
constexpr double kMatches = 6.39;
constexpr double kUnmatched = -2.76;

constexpr double kWorthCounting = 0.05;  // share of the probability that another pose must have

// A match counts for no more than the evidence that there is for one, because chance finds many where landmarks are
// dense.
double independent_matches(const PoseEvidence& pose) {
  return std::min(static_cast<double>(pose.spread), pose.evidence);
}

double log_odds_without_matches(const PoseEvidence& pose) {
  // Of several wrong poses, the one that fits best by chance is found.
  return kConstant + kUnmatched * std::log1p(static_cast<double>(pose.unmatched_cells)) -
         std::log(static_cast<double>(pose.tried));
}

double probability_of(const PoseEvidence& pose) {
  const double log_odds =
      log_odds_without_matches(pose) + kMatches * std::log1p(independent_matches(pose));
  return 1.0 / (1.0 + std::exp(-log_odds));
}

// How many independent matches would give the probability, if as many cells contradicted the pose.
double matches_for(const PoseEvidence& pose, double probability) {
  const double log_odds = std::log(probability / (1.0 - probability));
  return std::ceil(std::expm1((log_odds - log_odds_without_matches(pose)) / kMatches));
}

// Probability that a Gaussian error is at most so long: that of a chi-square distribution with the same mean and
// variance (Satterthwaite 1946), by the approximation of Wilson and Hilferty (1931).
double probability_within(double limit, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d variances = symmetric_eigenvalues<3>(covariance);
  const double sum = variances.sum();
  if (!(sum > 0.0)) return 1.0;
  const double spread = 2.0 / 9.0 * variances.squaredNorm() / (sum * sum);
  const double deviation = (std::cbrt(limit * limit / sum) - (1.0 - spread)) / std::sqrt(spread);
  return 0.5 * std::erfc(-deviation / std::numbers::sqrt2);
}

// How well right matches determine the pose.
struct Certainty {
  double probability = 0.0;  // of a right pose
  std::string text;
};

// @param covariance in the unit in which limits in metres are valid; std::nullopt if unknown
// @param distance   of what the image shows
// @param scale      factor of the map's lengths
Certainty certainty_of(const std::optional<Matrix6d>& covariance, double distance, double scale,
                       std::string_view unit) {
  constexpr double kRight = 0.05;         // metres
  constexpr double kRightShare = 0.01;    // of the distance; the larger counts
  constexpr double kRightRotation = 5.0;  // degrees
  constexpr std::string_view kWithout = "without the landmarks that may match by chance";
  if (!covariance) return {0.0, fmt::format("{}, the others leave the pose open", kWithout)};
  const Eigen::Matrix3d position = covariance->topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = covariance->bottomRightCorner<3, 3>();
  return {probability_within(std::max(kRight, kRightShare * distance), position) *
              probability_within(radians(kRightRotation), rotation),
          fmt::format("{}, the position has a standard deviation of {:.2g} {}", kWithout,
                      std::sqrt(position.trace()) / scale, unit)};
}

// A result by the matches alone, what to say of them, and how well they determine the pose.
struct Judged {
  ImageLocation result;
  std::string found;
  bool has_rival = false;
  Certainty certainty;
};

// Judges the matches of the pose with most evidence.
// @param next  another pose; null if there is none
// @param image what the text calls the image that contradicts
// @param blank the result without a pose
Judged judged_by_matches(const PoseEvidence& best, const PoseEvidence* next, double min_probability,
                         std::string_view image, ImageLocation blank) {
  Judged judged{.result = std::move(blank), .found = "", .certainty = {}};
  ImageLocation& result = judged.result;
  result.probability = probability_of(best);
  judged.found = fmt::format(
      "{} of the {} landmarks projected near a corner match it ({:.1f} expected by chance)",
      best.agreeing, best.visible, best.expected);
  if (best.unmatched_cells > 0) {
    judged.found += fmt::format(", and {} of {} parts of {} match nothing that was seen there",
                                best.unmatched_cells, detail::kImageCells, image);
  }
  if (next != nullptr && probability_of(*next) > kWorthCounting * result.probability) {
    const double other = probability_of(*next);
    // The odds of each versus none; at most one is right.
    const double odds = result.probability / (1.0 - result.probability);
    const double odds_of_other = other / (1.0 - other);
    result.probability = odds / (1.0 + odds + odds_of_other);
    judged.has_rival = true;
    judged.found += fmt::format(", and {} match at another pose", next->agreeing);
  }
  result.located = result.probability >= min_probability;
  result.failure.reset();
  if (!result.located && judged.has_rival) {
    result.failure = LocationFailure::kAmbiguous;
  } else if (!result.located) {
    constexpr double kChance = 0.01;  // a pose below it is hardly ever right
    result.failure =
        result.probability < kChance ? LocationFailure::kFewInliers : LocationFailure::kImprobable;
    judged.found +=
        fmt::format("; these count as {:.0f} independent matches, and {:.0f} would decide",
                    std::floor(independent_matches(best)), matches_for(best, min_probability));
  }
  return judged;
}

// The result, if nothing but an uncertain pose can take it back.
ImageLocation with_certainty(Judged judged, double min_probability) {
  ImageLocation& result = judged.result;
  const bool by_matches = result.located || result.failure == LocationFailure::kFewInliers ||
                          result.failure == LocationFailure::kImprobable ||
                          result.failure == LocationFailure::kAmbiguous;
  if (!by_matches) return std::move(result);
  result.probability *= judged.certainty.probability;
  if (result.located && result.probability < min_probability) {
    result.located = false;
    result.failure = LocationFailure::kUndetermined;
    result.world_from_camera.reset();
    judged.found += "; " + judged.certainty.text;
  }
  result.reason =
      fmt::format("{}: {}", decision_text(result.probability, min_probability), judged.found);
  return std::move(result);
}

std::optional<Matrix6d> sum_of(const Matrix6d& covariance, const std::optional<Matrix6d>& growth) {
  return growth ? std::optional<Matrix6d>(covariance + *growth) : std::nullopt;
}

std::string no_pose_text(std::size_t matches, std::size_t corners) {
  return fmt::format("no pose explains enough matches: {} of {} corners match a landmark", matches,
                     corners);
}

}  // namespace

std::string_view to_string(LocationFailure failure) {
  switch (failure) {
    case LocationFailure::kFewMatches:
      return "few_matches";
    case LocationFailure::kFewInliers:
      return "few_inliers";
    case LocationFailure::kImprobable:
      return "improbable";
    case LocationFailure::kAmbiguous:
      return "ambiguous";
    case LocationFailure::kFocalLength:
      return "focal_length";
    case LocationFailure::kLens:
      return "lens";
    case LocationFailure::kGivenPoses:
      return "given_poses";
    case LocationFailure::kUndetermined:
      return "undetermined";
  }
  return "";
}

constexpr OptionField kLocateFields[] = {
    {"features", option_at<&LocateOptions::features, &FeatureOptions::count>, kAny, "--features",
     "Number of corners to detect in an image; of SIFT features four times as many"},
    {"min_probability", option_at<&LocateOptions::min_probability>, kProbability,
     "--min-probability", "Least probability of a located image, at least 0.5 and below 1"},
};
constinit const OptionTable LocateOptions::table = {"LocateOptions", kLocateFields};

void LocateOptions::validate() const {
  features.validate();
  check_options(*this);
}

struct ImageLocator::Landmarks {
  explicit Landmarks(const LandmarkMap& map)
      : kind(detail::image_descriptor_of(map)),
        described(map),
        metric(map.info().length_unit == LengthUnit::kMetres) {}

  ImageDescriptor kind;
  DescribedLandmarks described;
  bool metric;
};

class ImageLocator::View {
 public:
  View(std::shared_ptr<const Landmarks> landmarks, const Camera& camera, FocalLength focal_length,
       const LocateOptions& options)
      : options_(options),
        landmarks_(std::move(landmarks)),
        camera_(camera),
        focal_length_(focal_length),
        describer_(camera, options.features, landmarks_->kind) {}

  const LocateOptions& options() const { return options_; }
  const std::shared_ptr<const Landmarks>& landmarks() const { return landmarks_; }

  ImageLocation locate(const GrayImage& image, const DepthImage& depth, std::uint64_t seed) const {
    require_size(image.width, image.height, "image");
    if (!depth.empty()) require_size(depth.width, depth.height, "depth image");
    const cv::Mat depth_m =
        landmarks_->metric && !depth.empty() ? detail::matrix_of(depth) : cv::Mat();
    const DescribedImage described = describer_.describe(detail::matrix_of(image), depth_m);
    const ImagePoseSearch search(landmarks_->described, describer_, described, seed);
    if (focal_length_ == FocalLength::kUnknown) return locate_with_lens(search, described);
    const auto best = search.best(sensor());
    if (!best) return blank(search, described);
    Judged judged = judge(search, described, *best);
    // With depths, the pose fits more than pixels.
    if (judged.result.located && depth_m.empty()) {
      refuse(LocationFailure::kLens, lens_defect(search, *best), judged.result);
    }
    return with_certainty(std::move(judged), options_.min_probability);
  }

  // The features of an image of a body, and the search with them.
  struct Seen {
    DescribedImage image;
    std::optional<ImagePoseSearch> search;
    std::optional<ImagePose> best;
  };
  // @param name the image's name in error messages
  std::unique_ptr<Seen> seen(const GrayImage& image, std::string_view name,
                             std::uint64_t seed) const {
    require_size(image.width, image.height, name);
    auto result = std::make_unique<Seen>();
    result->image = describer_.describe(detail::matrix_of(image), cv::Mat());
    result->search.emplace(landmarks_->described, describer_, result->image, seed);
    result->best = result->search->best(sensor());
    return result;
  }
  BodyImage on_body(const Seen& seen, const Rigid3& body_from_camera) const {
    const double scale = landmarks_->described.scale();
    return {
        &*seen.search, sensor(),
        Rigid3(body_from_camera.quaternion(), scale * body_from_camera.translation()).inverse()};
  }
  FocalLength focal_length() const { return focal_length_; }

  // A pose through the wrong lens is off by more than its covariance says, and no match need be wrong for it.
  // @return why the pose is refused; empty if it is not
  std::string lens_defect(const ImagePoseSearch& search, const ImagePose& best) const {
    // At most 29 and 5 % for images through the right lens, at least 108 and 21 % through another (docs/evidence.md).
    constexpr double kLeastDecrease = 30.0;
    constexpr double kLeastShare = 0.12;
    const auto lens =
        search.lens_of(sensor(), detail::radial_camera(camera_, intrinsics(camera_).fx), best);
    if (!lens) return "";
    const auto gain = search.gain_of(camera_, best, *lens);
    if (gain.decrease < kLeastDecrease || gain.share < kLeastShare) return "";
    return fmt::format(
        "the matches fit another lens far better: their squared residuals are {:.0f} % less with a "
        "focal length of {:.0f} px and a radial distortion of {:.2f} than with the camera's focal "
        "length of {:.0f} px",
        100.0 * gain.share, lens->camera.parameters[0], lens->camera.parameters[3],
        intrinsics(camera_).fx);
  }

  // Takes a located image's pose back, for a reason that is not empty.
  static void refuse(LocationFailure failure, const std::string& reason, ImageLocation& result) {
    if (reason.empty() || !result.located) return;
    result.located = false;
    result.probability = 0.0;
    result.failure = failure;
    result.world_from_camera.reset();
    result.covariance.reset();
    result.reason = reason;
  }

  // The result without a pose.
  ImageLocation blank(const ImagePoseSearch& search, const DescribedImage& image) const {
    ImageLocation result;
    result.camera = camera_;
    result.corners = image.features.size();
    result.proposals = search.proposals();
    result.failure = LocationFailure::kFewMatches;
    result.reason = no_pose_text(search.proposals(), image.features.size());
    return result;
  }

  Certainty certainty(const ImagePoseSearch& search, const ImagePose& pose,
                      const std::optional<Matrix6d>& covariance) const {
    return certainty_of(covariance, search.distance_of(pose), landmarks_->described.scale(),
                        landmarks_->metric ? "m" : "units");
  }

  // Fills in the pose of an image that has been judged.
  // @param next another pose; null if there is none
  void report(const DescribedImage& image, const ImagePose& best,
              const std::optional<Matrix6d>& covariance, const ImagePose* next,
              ImageLocation& result) const {
    const double scale = landmarks_->described.scale();
    result.estimate = in_map(best.pose.world_from_camera);
    if (result.located) result.world_from_camera = result.estimate;
    if (next != nullptr) result.rival = in_map(next->pose.world_from_camera);
    result.covariance = covariance;
    if (covariance) {
      result.covariance->topRows<3>() /= scale;
      result.covariance->leftCols<3>() /= scale;
    }
    result.visible = best.visible;
    result.expected = best.expected;
    result.spread = best.spread;
    for (const detail::FeatureMatch& match : best.matches) {
      result.matches.push_back({image.features.keypoints()[match.feature].raw,
                                landmarks_->described.index(match.landmark)});
      const std::size_t bytes_each = describer_.bytes_each();
      const auto row = std::span(image.descriptors).subspan(match.feature * bytes_each, bytes_each);
      result.descriptors.insert(result.descriptors.end(), row.begin(), row.end());
    }
  }

 private:
  void require_size(std::uint32_t width, std::uint32_t height, std::string_view what) const {
    if (width == camera_.width && height == camera_.height) return;
    throw Error(ErrorKind::kInput, what, fmt::format("{} x {} pixels", width, height),
                fmt::format("{} x {}, as the camera has", camera_.width, camera_.height));
  }

  SensorModel sensor() const {
    return {SensorNoise(), describer_.extractor().pinhole(), describer_.extractor().scales()};
  }

  // Finds the lens by the matches, and the matches with the lens, in turn.
  ImageLocation locate_with_lens(const ImagePoseSearch& search, const DescribedImage& image) const {
    constexpr int kRounds = 4;
    const auto coarse = search.best_of_focal_lengths(sensor());
    if (!coarse) return blank(search, image);
    auto lens = search.lens_of(sensor(), detail::radial_camera(camera_, coarse->focal_length),
                               coarse->pose);
    for (int round = 1; lens; ++round) {
      const View view(landmarks_, lens->camera, FocalLength::kKnown, options_);
      DescribedImage undistorted = image;
      view.describer_.extractor().correct(undistorted.features, {});
      const ImagePoseSearch again = search.seen_through(view.describer_, undistorted);
      auto settled = again.settled(view.sensor(), lens->world_from_camera);
      if (!settled) break;
      lens = again.lens_of(view.sensor(), lens->camera, *settled);
      if (!lens || round < kRounds) continue;
      settled->pose.world_from_camera = lens->world_from_camera;
      widen_by_halves(again, view.sensor(), *settled, *lens);
      Judged judged = view.judge(again, undistorted, *settled, &*lens);
      take_lens(*lens, judged.result);
      return with_certainty(std::move(judged), options_.min_probability);
    }
    return blank(search, image);
  }

  // A lens that rests on a few matches, one of which may be wrong, differs between two halves of the matches.
  static void widen_by_halves(const ImagePoseSearch& search, const SensorModel& sensor,
                              const ImagePose& pose, detail::LensEstimate& lens) {
    std::array<double, 2> focal_lengths{};
    for (std::size_t half = 0; half < 2; ++half) {
      ImagePose part = pose;
      part.matches.clear();
      for (std::size_t i = half; i < pose.matches.size(); i += 2) {
        part.matches.push_back(pose.matches[i]);
      }
      const auto own = search.lens_of(sensor, lens.camera, part);
      if (!own) {
        lens.focal_length_sigma = lens.camera.parameters.front();  // unknown
        return;
      }
      focal_lengths[half] = own->camera.parameters.front();
    }
    const double sigma = 0.5 * std::abs(focal_lengths[0] - focal_lengths[1]);
    if (sigma <= lens.focal_length_sigma) return;
    lens.covariance *= sigma * sigma / (lens.focal_length_sigma * lens.focal_length_sigma);
    lens.focal_length_sigma = sigma;
  }

  static void take_lens(const detail::LensEstimate& lens, ImageLocation& result) {
    // A focal length that is less certain leaves the distance to what is seen open.
    constexpr double kMostSigma = 0.03;
    const double focal_length = lens.camera.parameters.front();
    result.camera = lens.camera;
    result.focal_length_sigma = lens.focal_length_sigma;
    if (result.located && lens.focal_length_sigma > kMostSigma * focal_length) {
      result.located = false;
      result.failure = LocationFailure::kFocalLength;
      result.world_from_camera.reset();
      result.reason = fmt::format(
          "the matches do not determine the focal length: {:.0f} px with a standard deviation of "
          "{:.0f} px",
          focal_length, lens.focal_length_sigma);
    }
  }

  // @param lens found with the pose; null if it is known
  Judged judge(const ImagePoseSearch& search, const DescribedImage& image, const ImagePose& best,
               const detail::LensEstimate* lens = nullptr) const {
    // Similar objects may occur in several places, so pairs that a good pose does not explain may give
    // another pose.
    std::optional<ImagePose> next;
    if (probability_of(best) >= options_.min_probability) next = search.rival(sensor(), best);
    if (next && search.same(best, *next)) next.reset();
    Judged judged = judged_by_matches(best, next ? &*next : nullptr, options_.min_probability,
                                      "the image", blank(search, image));
    const BodyImage alone{&search, sensor(), Rigid3()};
    BodyPose body;
    body.pose = best.pose;
    body.images = {best};
    const auto growth = ImagePoseSearch::growth_without_chance({&alone, 1}, body);
    // The lens has a verdict of its own.
    judged.certainty = certainty(search, best, sum_of(best.pose.covariance, growth));
    report(image, best, sum_of(lens ? lens->covariance : best.pose.covariance, growth),
           judged.has_rival ? &*next : nullptr, judged.result);
    return judged;
  }

  Rigid3 in_map(const Rigid3& pose) const {
    return {pose.quaternion(), pose.translation() / landmarks_->described.scale()};
  }

  LocateOptions options_;
  std::shared_ptr<const Landmarks> landmarks_;
  Camera camera_;
  FocalLength focal_length_;
  ImageDescriber describer_;
};

namespace {

void require_sound(const Camera& camera) {
  if (const std::string defect = camera_defect(camera); !defect.empty()) {
    throw Error(ErrorKind::kMisuse, "camera", defect, "a camera without defect");
  }
}

}  // namespace

// Images with poses relative to each other, and what is seen in them.
class ImageLocator::Together {
 public:
  Together(std::span<const BodyView> views, const Execution& execution)
      : execution_(execution), seen_(views.size()) {
    for (const BodyView& view : views) views_.push_back(view.locator->view_.get());
    // The body is where the first camera is: far from it, rotations and positions could not be told apart.
    const Rigid3 first_from_body = views.front().body_from_camera.inverse();
    execution.executor.for_blocks(views.size(), 1, [&](std::size_t k, std::size_t) {
      require_not_stopped();
      seen_[k] =
          views_[k]->seen(*views[k].image, fmt::format("views[{}].image", k), execution.seed);
    });
    for (std::size_t k = 0; k < views.size(); ++k) {
      images_.push_back(views_[k]->on_body(*seen_[k], first_from_body * views[k].body_from_camera));
    }
  }

  std::vector<ImageLocation> locate() const {
    std::vector<ImageLocation> results;
    std::size_t corners = 0;
    std::size_t matches = 0;
    for (std::size_t k = 0; k < views_.size(); ++k) {
      results.push_back(views_[k]->blank(*seen_[k]->search, seen_[k]->image));
      corners += results.back().corners;
      matches += results.back().proposals;
    }
    for (ImageLocation& result : results) result.reason = no_pose_text(matches, corners);
    const std::optional<BodyPose> best =
        most_evident([&](std::size_t k) { return seen_[k]->best; }, nullptr);
    if (!best) return results;
    const double least = views_[0]->options().min_probability;
    std::optional<BodyPose> next;
    std::string contradiction;
    if (probability_of(*best) >= least) {
      contradiction = contradiction_of(*best);
      if (contradiction.empty()) next = rival(*best);
    }
    const auto growth = ImagePoseSearch::growth_without_chance(images_, *best);
    const auto covariance_of = [&](std::size_t k) {
      const Eigen::Vector3d arm = best->images[k].pose.world_from_camera.translation() -
                                  best->pose.world_from_camera.translation();
      const auto own =
          growth ? std::optional<Matrix6d>(covariance_at_point(*growth, arm)) : std::nullopt;
      return sum_of(best->images[k].pose.covariance, own);
    };
    Judged verdict =
        judged_by_matches(*best, next ? &*next : nullptr, least, "an image", ImageLocation());
    verdict.certainty.probability = 1.0;
    for (std::size_t k = 0; k < views_.size(); ++k) {
      const ImagePose& pose = best->images[k];
      if (pose.agreeing < detail::kFewestMatches) continue;
      Certainty own = views_[k]->certainty(*images_[k].search, pose, covariance_of(k));
      if (own.probability <= verdict.certainty.probability) verdict.certainty = std::move(own);
    }
    const std::string lens_defect =
        verdict.result.located && contradiction.empty() ? lens_defect_of(*best) : "";
    for (std::size_t k = 0; k < views_.size(); ++k) {
      results[k].located = verdict.result.located;
      results[k].probability = verdict.result.probability;
      results[k].failure = verdict.result.failure;
      views_[k]->report(seen_[k]->image, best->images[k], covariance_of(k),
                        verdict.has_rival ? &next->images[k] : nullptr, results[k]);
      View::refuse(LocationFailure::kGivenPoses, contradiction, results[k]);
      View::refuse(LocationFailure::kLens, lens_defect, results[k]);
      View::refuse(LocationFailure::kFewMatches, too_few_text(best->images[k]), results[k]);
      Judged own = verdict;
      own.result = std::move(results[k]);
      results[k] = with_certainty(std::move(own), least);
    }
    return results;
  }

 private:
  void require_not_stopped() const {
    if (!execution_.stop.stop_requested()) return;
    throw Error(ErrorKind::kCancelled, "locating images", "was cancelled", "");
  }

  // The pose of the body with most evidence, of those that the images with most evidence propose.
  // @param proposed the pose that an image proposes
  // @param other    a pose to leave out; null for none
  template <class Proposed>
  std::optional<BodyPose> most_evident(const Proposed& proposed, const BodyPose* other) const {
    constexpr std::size_t kMost = 8;
    std::vector<std::size_t> order(images_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, std::ranges::greater(), [&](std::size_t k) {
      return seen_[k]->best ? seen_[k]->best->evidence : 0.0;
    });
    order.resize(std::min(order.size(), kMost));
    std::vector<std::optional<BodyPose>> bodies(order.size());
    execution_.executor.for_blocks(order.size(), 1, [&](std::size_t i, std::size_t) {
      require_not_stopped();
      const std::size_t k = order[i];
      const std::optional<ImagePose> pose = proposed(k);
      if (!pose) return;
      bodies[i] = ImagePoseSearch::settled_together(
          images_, pose->pose.world_from_camera * images_[k].camera_from_body);
    });
    std::vector<BodyPose> found;  // each once
    for (std::optional<BodyPose>& body : bodies) {
      const auto is_known = [&](const BodyPose& pose) { return same(pose, *body); };
      if (!body || (other != nullptr && is_known(*other))) continue;
      const auto known = std::ranges::find_if(found, is_known);
      if (known == found.end()) {
        found.push_back(std::move(*body));
      } else if (body->evidence > known->evidence) {
        *known = std::move(*body);
      }
    }
    const auto best = std::ranges::max_element(found, {}, &BodyPose::evidence);
    if (best == found.end()) return std::nullopt;
    best->tried = found.size();
    return std::move(*best);
  }

  std::optional<BodyPose> rival(const BodyPose& best) const {
    return most_evident(
        [&](std::size_t k) { return images_[k].search->rival(images_[k].sensor, best.images[k]); },
        &best);
  }

  // Why the lens of a camera is refused, by the camera's image with most matches; empty if none is.
  std::string lens_defect_of(const BodyPose& body) const {
    std::map<const View*, std::size_t> image_of;
    for (std::size_t k = 0; k < images_.size(); ++k) {
      const auto [place, is_new] = image_of.try_emplace(views_[k], k);
      if (body.images[k].agreeing > body.images[place->second].agreeing) place->second = k;
    }
    for (std::size_t k = 0; k < images_.size(); ++k) {
      if (image_of.at(views_[k]) != k) continue;
      // Without the error of the poses relative to each other.
      const ImagePoseSearch& search = *seen_[k]->search;
      const auto alone = search.settled(images_[k].sensor, body.images[k].pose.world_from_camera);
      const std::string defect = alone ? views_[k]->lens_defect(search, *alone) : "";
      if (!defect.empty()) return defect;
    }
    return "";
  }

  // Why an image has no pose though the body has one; empty if its own matches show where it is.
  static std::string too_few_text(const ImagePose& image) {
    if (image.agreeing >= detail::kFewestMatches) return "";
    return fmt::format(
        "{} of its own matches agree with the pose of all images: what is stated of it rests on "
        "the given poses alone",
        image.agreeing);
  }

  // Why the given poses are refused: an image that would be located alone does not fit them. Empty if none is.
  std::string contradiction_of(const BodyPose& body) const {
    std::size_t elsewhere = 0;
    std::string most;
    for (std::size_t k = 0; k < images_.size(); ++k) {
      const std::optional<ImagePose>& own = seen_[k]->best;
      const ImagePose& here = body.images[k];
      if (!own || probability_of(*own) < views_[0]->options().min_probability ||
          probability_of(here) > kWorthCounting * probability_of(*own)) {
        continue;
      }
      if (elsewhere++ > 0) continue;
      most = fmt::format("; image {} alone has {} matches elsewhere, and {} here", k + 1,
                         own->agreeing, here.agreeing);
    }
    if (elsewhere == 0) return "";
    return fmt::format("the given poses contradict {} of the {} images{}", elsewhere,
                       images_.size(), most);
  }

  static std::size_t most_matches(const BodyPose& body) {
    const auto most = std::ranges::max_element(body.images, {}, &ImagePose::agreeing);
    return static_cast<std::size_t>(most - body.images.begin());
  }

  bool same(const BodyPose& a, const BodyPose& b) const {
    const std::size_t k = most_matches(a);
    return images_[k].search->same(a.images[k], b.images[k]);
  }

  const Execution& execution_;
  std::vector<const View*> views_;
  std::vector<std::unique_ptr<View::Seen>> seen_;
  std::vector<BodyImage> images_;
};

ImageLocator::ImageLocator(const LandmarkMap& map, const Camera& camera,
                           const LocateOptions& options) {
  options.validate();
  require_sound(camera);
  view_ = std::make_unique<const View>(std::make_shared<const Landmarks>(map), camera,
                                       FocalLength::kKnown, options);
}
ImageLocator::ImageLocator(std::unique_ptr<const View> view) : view_(std::move(view)) {}
ImageLocator::~ImageLocator() = default;
ImageLocator::ImageLocator(ImageLocator&&) noexcept = default;
ImageLocator& ImageLocator::operator=(ImageLocator&&) noexcept = default;

ImageLocator ImageLocator::with_camera(const Camera& camera, FocalLength focal_length) const {
  require_sound(camera);
  return ImageLocator(
      std::make_unique<const View>(view_->landmarks(), camera, focal_length, view_->options()));
}

ImageLocation ImageLocator::locate(const GrayImage& image, const DepthImage& depth,
                                   const Execution& execution) const {
  return view_->locate(image, depth, execution.seed);
}

std::vector<ImageLocation> locate_together(std::span<const BodyView> views,
                                           const Execution& execution) {
  refuse_if(views.empty(), "views", "no image", "at least one");
  const auto& map = views.front().locator->view_->landmarks();
  for (const BodyView& view : views) {
    refuse_if(view.locator->view_->landmarks() != map, "views", "locators of several maps",
              "locators that share a map, as with_camera() returns them");
    refuse_if(view.locator->view_->focal_length() != FocalLength::kKnown, "views",
              "an unknown focal length", "known cameras");
  }
  return ImageLocator::Together(views, execution).locate();
}

}  // namespace cairn
