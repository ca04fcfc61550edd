// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry.hpp"

#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/vision/detail/tracker.hpp"

namespace cairn {

void FeatureOptions::validate() const {
  detail::require_within(count, 50, 20000, "FeatureOptions.count");
  detail::require_within(levels, 1, 12, "FeatureOptions.levels");
  detail::require_within(scale, 1.05, 2.0, "FeatureOptions.scale");
  detail::require_within(threshold, 1, 254, "FeatureOptions.threshold");
  detail::require(least_threshold >= 1 && least_threshold <= threshold,
                  "FeatureOptions.least_threshold", least_threshold, "1 to threshold");
  detail::require(max_depth_m > 0.0, "FeatureOptions.max_depth_m", max_depth_m,
                  "a positive number of metres");
}

void SensorNoise::validate() const {
  detail::require(pixel > 0.0 && std::isfinite(pixel), "SensorNoise.pixel", pixel,
                  "a positive number");
  detail::require(aligned_pixel > 0.0 && std::isfinite(aligned_pixel), "SensorNoise.aligned_pixel",
                  aligned_pixel, "a positive number");
  detail::require(depth_floor_m > 0.0 && std::isfinite(depth_floor_m), "SensorNoise.depth_floor_m",
                  depth_floor_m, "a positive number of metres");
  detail::require(depth_quadratic >= 0.0 && std::isfinite(depth_quadratic),
                  "SensorNoise.depth_quadratic", depth_quadratic, "a number that is not negative");
}

void OdometryOptions::validate() const {
  features.validate();
  noise.validate();
  detail::require(readout_s >= 0.0 && readout_s <= 1.0, "OdometryOptions.readout_s", readout_s,
                  "0 to 1 second");
  detail::require(min_tracked >= 6, "OdometryOptions.min_tracked", min_tracked, "at least 6");
  detail::require(adjusted_keyframes >= 1, "OdometryOptions.adjusted_keyframes", adjusted_keyframes,
                  "at least 1");
  detail::require_within(final_iterations, 0, 1000, "OdometryOptions.final_iterations");
}

void MapOptions::validate() const {
  detail::require(min_observations >= 1, "MapOptions.min_observations", min_observations,
                  "at least 1");
  detail::require_within(descriptors_each, std::size_t{1}, kMostDescriptorsEach,
                         "MapOptions.descriptors_each");
}

FrameImages frame_images(double timestamp_s, std::uint32_t width, std::uint32_t height,
                         std::span<const std::uint8_t> bgr, std::span<const float> depth_m) {
  const std::size_t pixels = std::size_t{width} * height;
  if (bgr.size() != 3 * pixels || (!depth_m.empty() && depth_m.size() != pixels)) {
    throw Error(ErrorKind::kMisuse, "frame_images",
                fmt::format("{} bytes of colour and {} depths", bgr.size(), depth_m.size()),
                fmt::format("those of {} x {} pixels", width, height));
  }
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

FrameImages frame_images(const RgbdSequence& sequence, std::size_t frame, const Camera& camera,
                         bool skip_unreadable) {
  const SequenceFrame& entry = sequence.frames()[frame];
  FrameImages result;
  result.timestamp_s = entry.timestamp_s;
  result.name = entry.color.filename().string();
  try {
    RgbdSequence::Images images = sequence.read(frame);
    if (images.gray.width != camera.width || images.gray.height != camera.height) {
      throw Error(ErrorKind::kInput, entry.color.string(),
                  fmt::format("{} x {} pixels", images.gray.width, images.gray.height),
                  fmt::format("{} x {}, as the camera has", camera.width, camera.height));
    }
    result.gray = std::move(images.gray);
    result.depth_m = std::move(images.depth);
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
                                                       detail::matrix_of(images.depth_m)),
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
