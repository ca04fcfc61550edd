// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image_locator.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/vision/detail/image_pose.hpp"
#include "cairn/vision/detail/lens_estimation.hpp"
#include "cairn/vision/detail/location_verdict.hpp"
#include "cairn/vision/detail/shared_lens.hpp"

namespace cairn {
namespace {

using detail::BodyImage;
using detail::BodyPose;
using detail::Certainty;
using detail::certainty_of;
using detail::DescribedImage;
using detail::DescribedLandmarks;
using detail::ImageDescriber;
using detail::ImageDescriptor;
using detail::ImagePose;
using detail::ImagePoseSearch;
using detail::Judged;
using detail::judged_by_matches;
using detail::kWorthCounting;
using detail::log_odds;
using detail::probability_of;
using detail::SensorModel;
using detail::with_certainty;

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
     "Number of corners to detect in an image; four times as many SIFT features"},
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
  // @param shared for an unknown focal length: what other images by the camera tell of its lens, and of which `camera` has
  //               the mean
  View(std::shared_ptr<const Landmarks> landmarks, const Camera& camera, FocalLength focal_length,
       const LocateOptions& options, const std::optional<detail::LensPrior>& shared = {})
      : options_(options),
        landmarks_(std::move(landmarks)),
        camera_(camera),
        focal_length_(focal_length),
        is_shared_(shared.has_value()),
        prior_(shared.value_or(detail::LensPrior::usual(camera))),
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
    if (focal_length_ == FocalLength::kUnknown) {
      return locate_with_lens(search, described).location;
    }
    const auto best = search.best(sensor());
    if (!best) return blank(search, described);
    Judged judged = judge(search, described, *best);
    if (judged.result.located) {
      refuse(LocationFailure::kLens, lens_defect(search, described, *best), judged.result);
    }
    return with_certainty(std::move(judged), options_.min_probability);
  }

  struct WithLens {
    ImageLocation location;
    std::optional<detail::LensEstimate> lens;  // if the matches are right by themselves
  };
  // Finds the lens with the pose. The search begins at the lens of the camera.
  WithLens locate_with_lens(const GrayImage& image, std::uint64_t seed) const {
    require_size(image.width, image.height, "image");
    const DescribedImage described = describer_.describe(detail::matrix_of(image), cv::Mat());
    const ImagePoseSearch search(landmarks_->described, describer_, described, seed);
    return locate_with_lens(search, described);
  }
  const Camera& camera() const { return camera_; }
  const detail::LensPrior& prior() const { return prior_; }

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

  // A pose through the wrong lens is off by more than its covariance says. The matches that fit it best hide that, so the
  // lens is estimated in turn with the matches that are found through it.
  // @return why the pose is refused; empty if it is not
  std::string lens_defect(const ImagePoseSearch& search, const DescribedImage& image,
                          const ImagePose& best) const {
    if (!image.features.has_depth()) return lens_defect(search, best);
    // Depths fit the pose through any lens.
    DescribedImage flat = image;
    flat.features.drop_depths();
    const ImagePoseSearch by_pixels = search.seen_through(describer_, flat);
    const auto settled = by_pixels.settled(sensor(), best.pose.world_from_camera);
    return settled ? lens_defect(by_pixels, *settled) : "";
  }
  std::string lens_defect(const ImagePoseSearch& search, const ImagePose& best) const {
    // docs/evidence.md explains the choice.
    constexpr double kLeastDecrease = 18.0;
    constexpr double kLeastShare = 0.14;
    constexpr int kRounds = 3;
    const detail::Pinhole own = describer_.extractor().pinhole();
    // In the undistorted image, with square pixels.
    Camera camera = detail::radial_camera(camera_, own.fx);
    camera.parameters[1] = own.cx;
    camera.parameters[2] = own.cy;
    const auto prior = detail::LensPrior::usual_about_centre(camera);
    std::vector<detail::PointMatch> matches;
    const auto lens_of_matches = [&](const SensorModel& model, const ImagePose& pose,
                                     const Camera& start) {
      matches = search.point_matches(model, pose);
      for (detail::PointMatch& match : matches) {
        double& v = match.measured.pixel.y();
        v = own.cy + own.fx / own.fy * (v - own.cy);
      }
      return estimate_lens(start, matches, pose.pose.world_from_camera, prior);
    };
    auto lens = lens_of_matches(sensor(), best, camera);
    for (int round = 0; lens && round < kRounds; ++round) {
      detail::Pinhole pinhole = own;
      pinhole.fx = lens->camera.parameters[0];
      pinhole.fy = own.fy / own.fx * pinhole.fx;
      const SensorModel model(SensorNoise(), pinhole, describer_.extractor().scales());
      const auto found = search.settled(model, lens->world_from_camera);
      if (!found) return "";
      lens = lens_of_matches(model, *found, lens->camera);
    }
    const auto fixed = estimate_lens(camera, matches, best.pose.world_from_camera,
                                     detail::LensPrior::certain(camera));
    if (!lens || !fixed) return "";
    const auto gain = gain_of(*lens, *fixed, matches);
    if (gain.decrease < kLeastDecrease || gain.share < kLeastShare) return "";
    return fmt::format(
        "the matches fit another lens far better: with {:.2f} times the camera's focal length and "
        "a radial distortion that differs by {:.2f}, their squared residuals are {:.0f} % less",
        lens->camera.parameters[0] / own.fx, lens->camera.parameters[3], 100.0 * gain.share);
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
      const detail::Keypoint& keypoint = image.features.keypoints()[match.feature];
      result.matches.push_back(
          {keypoint.raw, landmarks_->described.index(match.landmark), keypoint.octave,
           keypoint.read_depth_m > 0.0F ? std::optional<double>(keypoint.read_depth_m)
                                        : std::nullopt});
      const std::size_t bytes_each = describer_.bytes_each();
      const auto row = std::span(image.descriptors).subspan(match.feature * bytes_each, bytes_each);
      result.descriptors.insert(result.descriptors.end(), row.begin(), row.end());
    }
  }

 private:
  void require_size(std::uint32_t width, std::uint32_t height, std::string_view what) const {
    if (width == camera_.width && height == camera_.height) return;
    const bool is_resized =
        std::uint64_t{width} * camera_.height == std::uint64_t{height} * camera_.width;
    throw Error(
        ErrorKind::kInput, what, fmt::format("{} x {} pixels", width, height),
        fmt::format("{} x {}, as the camera has", camera_.width, camera_.height) +
            (is_resized ? fmt::format("; if the image was resized, multiply the camera's size, "
                                      "focal length and principal point by {:.4g}",
                                      static_cast<double>(width) / camera_.width)
                        : ""));
  }

  SensorModel sensor() const {
    return {SensorNoise(), describer_.extractor().pinhole(), describer_.extractor().scales()};
  }

  // A lens found with the pose, and what it shows.
  struct SettledLens {
    detail::LensEstimate lens;
    std::unique_ptr<const View> view;  // through the lens of the last round but one
    std::unique_ptr<const DescribedImage> image;
    std::optional<ImagePoseSearch> search;  // refers to the former two
    ImagePose pose;
    std::vector<detail::PointMatch> matches;
  };

  // Finds the lens by the matches, and the matches with the lens, in turn.
  std::optional<SettledLens> settled_lens(const ImagePoseSearch& search,
                                          const DescribedImage& image,
                                          const detail::FocalLengthPose& start) const {
    constexpr int kRounds = 4;
    Camera camera = detail::with_lens(camera_, prior_.mean);  // but for the focal length
    camera.parameters.front() = start.focal_length;
    auto lens = estimate_lens(camera, search.matches_in_original(sensor(), start.pose),
                              start.pose.pose.world_from_camera, prior_);
    SettledLens result;
    for (int round = 0; lens && round < kRounds; ++round) {
      result.view =
          std::make_unique<const View>(landmarks_, lens->camera, FocalLength::kKnown, options_);
      const View& view = *result.view;
      auto undistorted = std::make_unique<DescribedImage>(image);
      view.describer_.extractor().correct(undistorted->features, {});
      result.image = std::move(undistorted);
      result.search = search.seen_through(view.describer_, *result.image);
      auto settled = result.search->settled(view.sensor(), lens->world_from_camera);
      if (!settled) return std::nullopt;
      result.pose = std::move(*settled);
      result.matches = result.search->matches_in_original(view.sensor(), result.pose);
      lens = estimate_lens(lens->camera, result.matches, lens->world_from_camera, prior_);
    }
    if (!lens) return std::nullopt;
    result.lens = std::move(*lens);
    result.pose.pose.world_from_camera = result.lens.world_from_camera;
    return result;
  }

  WithLens locate_with_lens(const ImagePoseSearch& search, const DescribedImage& image) const {
    std::optional<SettledLens> best;
    std::vector<std::pair<detail::LensEstimate, double>> others;  // and their log odds
    for (const detail::FocalLengthPose& start : coarse_poses(search)) {
      std::optional<SettledLens> found = settled_lens(search, image, start);
      if (!found) continue;
      if (best && found->pose.evidence > best->pose.evidence) std::swap(best, found);
      if (!best) {
        best = std::move(found);
      } else {
        others.emplace_back(found->lens, log_odds(found->pose));
      }
    }
    if (!best) return {blank(search, image), std::nullopt};
    const bool determined = add_jackknife(best->lens, best->matches, prior_);
    add_others(best->lens, log_odds(best->pose), others);
    Judged judged = best->view->judge(*best->search, *best->image, best->pose, &best->lens);
    const bool is_right = judged.result.probability >= options_.min_probability;
    take_lens(best->lens, determined, judged);
    if (is_shared_) {
      refuse(LocationFailure::kLens, best->view->lens_defect(*best->search, best->pose),
             judged.result);
    }
    WithLens result{with_certainty(std::move(judged), options_.min_probability), std::nullopt};
    if (is_right && determined) result.lens = std::move(best->lens);
    return result;
  }

  // Matches are found with the lens, so other lenses may agree with other matches about as well. The covariance becomes
  // the mean square of the difference to the estimate, each lens weighted by its odds.
  static void add_others(detail::LensEstimate& lens, double log_odds,
                         std::vector<std::pair<detail::LensEstimate, double>>& others) {
    // Share of the focal length; of the principal point, in larger sides.
    constexpr double kSame = 0.01;
    std::ranges::stable_sort(others, std::greater(),
                             &std::pair<detail::LensEstimate, double>::second);
    std::vector<std::pair<detail::LensEstimate, double>> different = {{lens, 1.0}};  // and weights
    double sum = 1.0;
    for (const auto& [other, odds] : others) {
      const detail::LensVector own = detail::lens_of(other.camera);
      const auto is_same = [&](const auto& known) {
        const detail::LensVector off = detail::lens_of(known.first.camera) - own;
        return std::abs(off[0]) < kSame && off.tail<2>().norm() < kSame;
      };
      if (std::ranges::any_of(different, is_same)) continue;
      different.emplace_back(other, std::exp(std::min(0.0, odds - log_odds)));
      sum += different.back().second;
    }
    for (const auto& [other, odds] : different) {
      const double weight = odds / sum;
      const Vector6d moved = lens.world_from_camera.difference_to(other.world_from_camera);
      const detail::LensVector changed =
          detail::lens_of(other.camera) - detail::lens_of(lens.camera);
      lens.covariance += weight * moved * moved.transpose();
      lens.lens_covariance += weight * changed * changed.transpose();
    }
  }

  std::vector<detail::FocalLengthPose> coarse_poses(const ImagePoseSearch& search) const {
    constexpr std::size_t kMost = 6;
    std::vector<detail::FocalLengthPose> poses;
    if (!is_shared_) {
      poses = search.of_focal_lengths(sensor());
      poses.resize(std::min(poses.size(), kMost));
      return poses;
    }
    auto best = search.best(sensor());
    if (best) poses.push_back({std::move(*best), sensor().pinhole().fx});
    return poses;
  }

  // @param determined whether the lens rests on more than one part of the image
  static void take_lens(const detail::LensEstimate& lens, bool determined, Judged& judged) {
    ImageLocation& result = judged.result;
    // A focal length that is less certain leaves the distance to what is seen open.
    constexpr double kMostSigma = 0.03;
    const double focal_length = lens.camera.parameters.front();
    const double sigma = determined ? lens.focal_length_sigma() : focal_length;
    result.camera = lens.camera;
    result.focal_length_sigma = sigma;
    if (result.failure == LocationFailure::kFocalLength ||
        (result.located && sigma > kMostSigma * focal_length)) {
      result.located = false;
      result.failure = LocationFailure::kFocalLength;
      result.world_from_camera.reset();
      result.reason = fmt::format(
          "the matches do not determine the focal length: {:.0f} px with a standard deviation of "
          "{:.0f} px; {}",
          focal_length, sigma, judged.certainty.text);
      result.probability *= judged.certainty.probability;
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
    const auto covariance = sum_of(lens ? lens->covariance : best.pose.covariance, growth);
    judged.certainty = certainty(search, best, covariance);
    report(image, best, covariance, judged.has_rival ? &*next : nullptr, judged.result);
    if (lens && judged.result.located) {
      // Whether the lens alone leaves the pose open.
      const double known =
          certainty(search, best, sum_of(best.pose.covariance, growth)).probability;
      const double least = options_.min_probability / judged.result.probability;
      if (judged.certainty.probability < least && known >= least) {
        judged.result.located = false;
        judged.result.failure = LocationFailure::kFocalLength;
        judged.result.world_from_camera.reset();
      }
    }
    return judged;
  }

  Rigid3 in_map(const Rigid3& pose) const {
    return {pose.quaternion(), pose.translation() / landmarks_->described.scale()};
  }

  LocateOptions options_;
  std::shared_ptr<const Landmarks> landmarks_;
  Camera camera_;
  FocalLength focal_length_;
  bool is_shared_;
  detail::LensPrior prior_;  // for an unknown focal length
  ImageDescriber describer_;
};

namespace {

void require_not_stopped(const Execution& execution) {
  if (!execution.stop.stop_requested()) return;
  throw Error(ErrorKind::kCancelled, "locating images", "was cancelled", "");
}

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
      require_not_stopped(execution_);
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
      require_not_stopped(execution_);
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

namespace {

// Share of the matches that show different landmarks.
double share_of_landmarks(const std::vector<const ImageLocation*>& images) {
  std::set<LandmarkIndex> landmarks;
  std::size_t matches = 0;
  for (const ImageLocation* image : images) {
    for (const ImageMatch& match : image->matches) landmarks.insert(match.landmark);
    matches += image->matches.size();
  }
  return static_cast<double>(landmarks.size()) / static_cast<double>(matches);
}

}  // namespace

std::vector<ImageLocation> locate_with_shared_lens(
    const ImageLocator& locator, std::size_t count,
    const std::function<GrayImage(std::size_t)>& image_of, const Execution& execution) {
  using View = ImageLocator::View;
  const View& view = *locator.view_;
  refuse_if(view.focal_length() != FocalLength::kUnknown, "locator", "a known focal length",
            "one for images of unknown focal length");
  std::vector<View::WithLens> found(count);
  const auto for_images = [&](const auto& locate) {
    execution.executor.for_blocks(count, 1, [&](std::size_t k, std::size_t) {
      require_not_stopped(execution);
      locate(k);
    });
  };
  for_images([&](std::size_t k) { found[k] = view.locate_with_lens(image_of(k), execution.seed); });
  std::vector<detail::ImageLens> lenses;
  std::vector<const ImageLocation*> images;
  std::vector<std::optional<std::size_t>> lens_of_image(count);
  for (std::size_t k = 0; k < count; ++k) {
    if (!found[k].lens) continue;
    lens_of_image[k] = lenses.size();
    const detail::LensEstimate& lens = *found[k].lens;
    lenses.push_back(
        {detail::lens_of(lens.camera), lens.lens_covariance, lens.lens_covariance_by_noise});
    images.push_back(&found[k].location);
  }
  if (lenses.size() >= 2) {
    const detail::SharedLens shared(view.prior(), lenses, share_of_landmarks(images));
    for_images([&](std::size_t k) {
      const detail::LensPrior others =
          lens_of_image[k] ? shared.without(*lens_of_image[k]) : shared.of_all();
      const Camera camera = detail::with_lens(view.camera(), others.mean);
      if (!camera_defect(camera).empty()) return;
      found[k] = View(view.landmarks(), camera, FocalLength::kUnknown, view.options(), others)
                     .locate_with_lens(image_of(k), execution.seed);
    });
  }
  std::vector<ImageLocation> locations;
  for (View::WithLens& one : found) locations.push_back(std::move(one.location));
  return locations;
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
