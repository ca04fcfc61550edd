// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image_locator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
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

// Sets what the result says of the pose with most evidence.
// @param next another pose; null if there is none
// @return whether the other pose lowers the probability
bool judge(const PoseEvidence& best, const PoseEvidence* next, double min_probability,
           ImageLocation& result) {
  result.probability = probability_of(best);
  std::string found = fmt::format(
      "{} of the {} landmarks projected near a corner match it ({:.1f} expected by chance)",
      best.agreeing, best.visible, best.expected);
  if (best.unmatched_cells > 0) {
    found += fmt::format(", and {} of {} parts of the image match nothing that was seen there",
                         best.unmatched_cells, detail::kImageCells);
  }
  bool has_rival = false;
  if (next != nullptr && probability_of(*next) > kWorthCounting * result.probability) {
    const double other = probability_of(*next);
    // The odds of each versus none; at most one is right.
    const double odds = result.probability / (1.0 - result.probability);
    const double odds_of_other = other / (1.0 - other);
    result.probability = odds / (1.0 + odds + odds_of_other);
    has_rival = true;
    found += fmt::format(", and {} match at another pose", next->agreeing);
  }
  result.located = result.probability >= min_probability;
  result.failure.reset();
  if (!result.located && has_rival) {
    result.failure = LocationFailure::kAmbiguous;
  } else if (!result.located) {
    constexpr double kChance = 0.01;  // a pose below it is hardly ever right
    result.failure =
        result.probability < kChance ? LocationFailure::kFewInliers : LocationFailure::kImprobable;
    found += fmt::format("; these count as {:.0f} independent matches, and {:.0f} would decide",
                         std::floor(independent_matches(best)), matches_for(best, min_probability));
  }
  result.reason = fmt::format("{}: {}", decision_text(result.probability, min_probability), found);
  return has_rival;
}

ImageDescriptor descriptor_kind(const LandmarkMap& map) {
  const auto& column = map.landmarks().descriptors;
  const auto kind = column ? detail::image_descriptor_of(*column) : std::nullopt;
  reject_if(!kind, "descriptors",
            column ? fmt::format("{} of {} bytes", column->kind, column->bytes_each) : "none",
            "ORB of 32 bytes or SIFT of 128: an image is compared with these");
  return *kind;
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
      : kind(descriptor_kind(map)),
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
    ImageLocation result = judged(search, described, best);
    // With depths, the pose fits more than pixels.
    if (result.located && depth_m.empty()) {
      refuse(LocationFailure::kLens, lens_defect(search, *best), result);
    }
    return result;
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
    result.reason =
        fmt::format("no pose explains enough matches: {} of {} corners match a landmark",
                    search.proposals(), image.features.size());
    return result;
  }

  // Fills in the pose of an image that has been judged.
  // @param next another pose; null if there is none
  void report(const DescribedImage& image, const ImagePose& best, const ImagePose* next,
              ImageLocation& result) const {
    const double scale = landmarks_->described.scale();
    result.estimate = in_map(best.pose.world_from_camera);
    if (result.located) result.world_from_camera = result.estimate;
    if (next != nullptr) result.rival = in_map(next->pose.world_from_camera);
    Matrix6d covariance = best.pose.covariance;
    covariance.topRows<3>() /= scale;
    covariance.leftCols<3>() /= scale;
    result.covariance = covariance;
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
    if (!coarse) return judged(search, image, std::nullopt);
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
      settled->pose.covariance = lens->covariance;
      return with_lens(view.judged(again, undistorted, settled), *lens);
    }
    return judged(search, image, std::nullopt);
  }

  static ImageLocation with_lens(ImageLocation result, const detail::LensEstimate& lens) {
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
    return result;
  }

  ImageLocation judged(const ImagePoseSearch& search, const DescribedImage& image,
                       const std::optional<ImagePose>& best) const {
    ImageLocation result = blank(search, image);
    if (!best) return result;
    // Similar objects may occur in several places, so pairs that a good pose does not explain may give
    // another pose.
    std::optional<ImagePose> next;
    if (probability_of(*best) >= options_.min_probability) next = search.rival(sensor(), *best);
    if (next && search.same(*best, *next)) next.reset();
    const bool has_rival = judge(*best, next ? &*next : nullptr, options_.min_probability, result);
    report(image, *best, has_rival ? &*next : nullptr, result);
    return result;
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
  Together(std::span<const BodyView> views, const Execution& execution) : seen_(views.size()) {
    for (const BodyView& view : views) views_.push_back(view.locator->view_.get());
    execution.executor.for_blocks(views.size(), 1, [&](std::size_t k, std::size_t) {
      seen_[k] =
          views_[k]->seen(*views[k].image, fmt::format("views[{}].image", k), execution.seed);
    });
    for (std::size_t k = 0; k < views.size(); ++k) {
      images_.push_back(views_[k]->on_body(*seen_[k], views[k].body_from_camera));
    }
  }

  std::vector<ImageLocation> locate() const {
    std::vector<ImageLocation> results;
    for (std::size_t k = 0; k < views_.size(); ++k) {
      results.push_back(views_[k]->blank(*seen_[k]->search, seen_[k]->image));
    }
    std::vector<std::optional<ImagePose>> proposals;
    for (const auto& seen : seen_) proposals.push_back(seen->best);
    const std::optional<BodyPose> best = most_evident(proposals, nullptr);
    if (!best) return results;
    const double least = views_[0]->options().min_probability;
    std::optional<BodyPose> next;
    std::string contradiction;
    if (probability_of(*best) >= least) {
      contradiction = contradiction_of(*best);
      if (contradiction.empty()) next = rival(*best);
    }
    ImageLocation verdict;
    const bool has_rival = judge(*best, next ? &*next : nullptr, least, verdict);
    std::string lens_defect;
    if (verdict.located && contradiction.empty()) {
      // Without the error of the poses relative to each other.
      const std::size_t most = most_matches(*best);
      const ImagePoseSearch& search = *seen_[most]->search;
      const auto alone =
          search.settled(images_[most].sensor, best->images[most].pose.world_from_camera);
      if (alone) lens_defect = views_[most]->lens_defect(search, *alone);
    }
    for (std::size_t k = 0; k < views_.size(); ++k) {
      results[k].located = verdict.located;
      results[k].probability = verdict.probability;
      results[k].failure = verdict.failure;
      results[k].reason = verdict.reason;
      views_[k]->report(seen_[k]->image, best->images[k], has_rival ? &next->images[k] : nullptr,
                        results[k]);
      View::refuse(LocationFailure::kGivenPoses, contradiction, results[k]);
      View::refuse(LocationFailure::kLens, lens_defect, results[k]);
    }
    return results;
  }

 private:
  // The pose of the body with most evidence, of those that poses of its images propose.
  // @param other a pose that is not wanted; null if each is
  std::optional<BodyPose> most_evident(std::span<const std::optional<ImagePose>> proposals,
                                       const BodyPose* other) const {
    std::vector<BodyPose> found;  // each once
    for (std::size_t k = 0; k < proposals.size(); ++k) {
      if (!proposals[k]) continue;
      auto body = ImagePoseSearch::settled_together(
          images_, proposals[k]->pose.world_from_camera * images_[k].camera_from_body);
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
    std::vector<std::optional<ImagePose>> proposals;
    for (std::size_t k = 0; k < images_.size(); ++k) {
      proposals.push_back(images_[k].search->rival(images_[k].sensor, best.images[k]));
    }
    return most_evident(proposals, &best);
  }

  // Of images that show well enough where they are, and that it is not where the body puts them.
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
