// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/odometry.hpp"

#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/odometry/tracker.hpp"

namespace cairn {

void OdometryOptions::validate() const {
  features.validate();
  noise.validate();
  const auto require = [](bool holds, std::string_view field, auto value,
                          std::string_view expected) {
    if (holds) return;
    throw Error(ErrorKind::kMisuse, fmt::format("OdometryOptions.{}", field),
                fmt::format("{}", value), expected);
  };
  require(readout_s >= 0.0 && readout_s <= 1.0, "readout_s", readout_s, "0 to 1 second");
  require(min_tracked >= 6, "min_tracked", min_tracked, "at least 6");
  require(adjusted_keyframes >= 1, "adjusted_keyframes", adjusted_keyframes, "at least 1");
  require(final_iterations >= 0 && final_iterations <= 1000, "final_iterations", final_iterations,
          "0 to 1000");
}

void MapOptions::validate() const {
  if (min_observations < 1) {
    throw Error(ErrorKind::kMisuse, "MapOptions.min_observations", "0", "at least 1");
  }
  if (descriptors_each < 1 || descriptors_each > kMostDescriptorsEach) {
    throw Error(ErrorKind::kMisuse, "MapOptions.descriptors_each",
                fmt::format("{}", descriptors_each), fmt::format("1 to {}", kMostDescriptorsEach));
  }
}

Odometry::Odometry(const Camera& camera, const OdometryOptions& options)
    : tracker_(std::make_unique<Tracker>(camera, options)) {}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

Features Odometry::extract(const cv::Mat& gray, const cv::Mat& depth_m) const {
  return tracker_->extractor().extract(gray, depth_m);
}

FrameReport Odometry::track(double timestamp_s, Features features, std::string image_name) {
  return tracker_->track(timestamp_s, std::move(features), std::move(image_name));
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

bool Odometry::can_begin_new_map() const {
  return tracker_->can_begin_new_map();
}

FinishedMap Odometry::begin_new_map(const MapOptions& options) {
  return tracker_->begin_new_map(options);
}

}  // namespace cairn
