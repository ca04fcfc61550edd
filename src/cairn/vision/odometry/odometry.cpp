// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry/odometry.hpp"

#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/odometry/tracker.hpp"

namespace cairn {

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
    {"min_observations", option_at<&MapOptions::min_observations>, kAtLeastOne},
    {"descriptors", option_at<&MapOptions::descriptors>, {}},
    {"descriptors_each", option_at<&MapOptions::descriptors_each>, within(1, kMostDescriptorsEach)},
};
constinit const OptionTable MapOptions::table = {"MapOptions", kMapFields};

void MapOptions::validate() const {
  check_options(*this);
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
