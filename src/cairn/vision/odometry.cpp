// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry.hpp"

#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/vision/detail/tracker.hpp"

namespace cairn {

constexpr OptionField kFeatureFields[] = {
    {"count", option_at<&FeatureOptions::count>, within(50, 20000), "--features",
     "Number of corners to detect in an image"},
    {"levels", option_at<&FeatureOptions::levels>, within(1, 12)},
    {"scale", option_at<&FeatureOptions::scale>, within(1.05, 2)},
    {"threshold", option_at<&FeatureOptions::threshold>, within(1, 254)},
    {"least_threshold", option_at<&FeatureOptions::least_threshold>, kAtLeastOne},
    {"max_depth_m",
     option_at<&FeatureOptions::max_depth_m>,
     {.least = 0,
      .expected = "a positive number of metres",
      .least_is = OptionRange::End::kExcluded}},
    {"baseline_m", option_at<&FeatureOptions::baseline_m>, within(0, 10)},
};
constinit const OptionTable FeatureOptions::table = {"FeatureOptions", kFeatureFields};

void FeatureOptions::validate() const {
  check_options(*this);
  detail::require(least_threshold <= threshold, "FeatureOptions.least_threshold", least_threshold,
                  "1 to threshold");
}

constexpr OptionField kSensorNoiseFields[] = {
    {"pixel", option_at<&SensorNoise::pixel>, kFinitePositive},
    {"aligned_pixel", option_at<&SensorNoise::aligned_pixel>, kFinitePositive},
    {"depth_floor_m",
     option_at<&SensorNoise::depth_floor_m>,
     {.least = 0,
      .expected = "a positive number of metres",
      .least_is = OptionRange::End::kExcluded,
      .most_is = OptionRange::End::kExcluded}},
    {"depth_quadratic",
     option_at<&SensorNoise::depth_quadratic>,
     {.least = 0,
      .expected = "a number that is not negative",
      .most_is = OptionRange::End::kExcluded}},
    {"disparity", option_at<&SensorNoise::disparity>, kFinitePositive},
};
constinit const OptionTable SensorNoise::table = {"SensorNoise", kSensorNoiseFields};

void SensorNoise::validate() const {
  check_options(*this);
}

constexpr OptionField kOdometryFields[] = {
    {"readout_s",
     option_at<&OdometryOptions::readout_s>,
     {.least = 0, .most = 1, .expected = "0 to 1 second"}},
    {"min_tracked", option_at<&OdometryOptions::min_tracked>, {.least = 6}},
    {"adjusted_keyframes", option_at<&OdometryOptions::adjusted_keyframes>, kAtLeastOne},
    {"final_iterations", option_at<&OdometryOptions::final_iterations>, within(0, 1000)},
};
constinit const OptionTable OdometryOptions::table = {"OdometryOptions", kOdometryFields};

void OdometryOptions::validate() const {
  features.validate();
  noise.validate();
  check_options(*this);
}

constexpr OptionField kMapFields[] = {
    {"min_observations", option_at<&MapOptions::min_observations>, kAtLeastOne,
     "--min-observations", "Leave out landmarks with fewer observations"},
    {"descriptors", option_at<&MapOptions::descriptors>, kAny, "!--no-descriptors",
     "Leave out the landmarks' descriptors"},
    {"descriptors_each", option_at<&MapOptions::descriptors_each>, within(1, kMostDescriptorsEach),
     "--descriptors-each",
     "Largest number of descriptors per landmark, of its most distinct views"},
};
constinit const OptionTable MapOptions::table = {"MapOptions", kMapFields};

void MapOptions::validate() const {
  check_options(*this);
}

FrameImages frame_images(double timestamp_s, std::uint32_t width, std::uint32_t height,
                         std::span<const std::uint8_t> bgr, std::span<const float> depth_m) {
  const std::size_t pixels = std::size_t{width} * height;
  refuse_if(bgr.size() != 3 * pixels || (!depth_m.empty() && depth_m.size() != pixels),
            "frame_images",
            fmt::format("{} bytes of colour and {} depths", bgr.size(), depth_m.size()),
            fmt::format("those of {} x {} pixels", width, height));
  FrameImages images;
  images.timestamp_s = timestamp_s;
  images.name = fmt::format("{:.6f}", timestamp_s);
  images.gray = GrayImage(width, height);
  const int rows = static_cast<int>(height);
  const int columns = static_cast<int>(width);
  // OpenCV's header does not accept const, but the data is only read.
  auto* const color = const_cast<std::uint8_t*>(bgr.data());
  cv::Mat gray(rows, columns, CV_8UC1, images.gray.values.data());
  cv::cvtColor(cv::Mat(rows, columns, CV_8UC3, color), gray, cv::COLOR_BGR2GRAY);
  if (!depth_m.empty())
    images.depth_m = DepthImage(width, height, {depth_m.begin(), depth_m.end()});
  return images;
}

FrameImages frame_images(const ImageSequence& sequence, std::size_t frame, const Camera& camera,
                         bool skip_unreadable) {
  const SequenceFrame& entry = sequence.frames()[frame];
  FrameImages result;
  result.timestamp_s = entry.timestamp_s;
  result.name = entry.color.filename().string();
  try {
    ImageSequence::Images images = sequence.read(frame);
    reject_if(images.gray.width != camera.width || images.gray.height != camera.height,
              entry.color.string(),
              fmt::format("{} x {} pixels", images.gray.width, images.gray.height),
              fmt::format("{} x {}, as the camera has", camera.width, camera.height));
    result.gray = std::move(images.gray);
    result.depth_m = std::move(images.depth);
    result.right = std::move(images.right);
  } catch (const Error& error) {
    if (!skip_unreadable || error.kind() != ErrorKind::kInput) throw;
    result.defect = error.what();
  }
  return result;
}

Odometry::Odometry(const Camera& camera, const OdometryOptions& options)
    : tracker_(std::make_unique<detail::Tracker>(camera, options)) {}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

FrameReport Odometry::track(const FrameImages& images) {
  return tracker_->track(images.timestamp_s,
                         tracker_->extractor().extract(detail::matrix_of(images.gray),
                                                       detail::matrix_of(images.depth_m),
                                                       detail::matrix_of(images.right)),
                         images.name);
}

void Odometry::complete() {
  tracker_->complete();
}

Trajectory Odometry::trajectory() const {
  return tracker_->trajectory();
}

LandmarkMap Odometry::map(const MapOptions& options) const {
  return tracker_->map(options);
}

std::optional<Rigid3> Odometry::last_pose() const {
  return tracker_->last_pose();
}

}  // namespace cairn
