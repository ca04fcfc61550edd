// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/simulator.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/simulation/detail/renderer.hpp"
#include "cairn/simulation/detail/sensor.hpp"
#include "cairn/simulation/path.hpp"

namespace cairn {
namespace {

using detail::RenderedFrame;

const SimulatorOptions& validated(const SimulatorOptions& options) {
  options.validate();
  return options;
}

}  // namespace

Camera default_simulated_camera() {
  return {CameraId{0}, "PINHOLE", 640, 480, {525.0, 525.0, 319.5, 239.5}};
}

SessionSeeds session_seeds(std::uint64_t seed, std::uint64_t session) {
  const Random random = Random(seed).fork(session);
  return {random.fork(1).draw_seed(), random.fork(2).draw_seed()};
}

constexpr OptionField kSensorFields[] = {
    {"exposure", option_at<&SensorOptions::exposure>, within(0.01, 100), "--exposure",
     "Brightness factor"},
    {"color_noise", option_at<&SensorOptions::color_noise>, within(0, 100), "--noise",
     "Standard deviation of the colour noise, grey levels"},
    {"ideal_depth", option_at<&SensorOptions::ideal_depth>, kAny, "--no-depth-noise",
     "Write exact depth: no noise, quantisation, holes or limits"},
    {"depth_noise_m", option_at<&SensorOptions::depth_noise_m>, within(0, 0.1), "--depth-noise",
     "Standard deviation of the depth at 1 m, metres; it grows with the square of the depth"},
    {"depth_step_m", option_at<&SensorOptions::depth_step_m>, within(0, 0.1)},
    {"min_depth_m", option_at<&SensorOptions::min_depth_m>, within(0, 1000)},
    {"max_depth_m", option_at<&SensorOptions::max_depth_m>, within(0, 1000), "--max-depth",
     "Largest measured depth, metres"},
    {"baseline_m", option_at<&SensorOptions::baseline_m>, within(0, 10)},
    {"max_incidence_rad",
     option_at<&SensorOptions::max_incidence_rad>,
     {.least = 0, .most = 0.5 * std::numbers::pi, .expected = "0 to 1.5708"}},
    {"edge_holes", option_at<&SensorOptions::edge_holes>, within(0, 1)},
    {"dropout", option_at<&SensorOptions::dropout>, within(0, 1)},
};
constinit const OptionTable SensorOptions::table = {"SensorOptions", kSensorFields};

void SensorOptions::validate() const {
  check_options(*this);
  detail::require(max_depth_m > min_depth_m, "SensorOptions.max_depth_m", max_depth_m,
                  fmt::format("more than min_depth_m, {}", min_depth_m));
}

constexpr OptionField kSimulatorFields[] = {
    {"shutter_s", option_at<&SimulatorOptions::shutter_s>, within(0, 1), "--motion-blur",
     "Exposure time in seconds; 0: no blur. Blur makes rendering six times slower"},
    {"readout_s", option_at<&SimulatorOptions::readout_s>, within(0, 1), "--readout",
     "Readout time of a rolling shutter, from the first image row to the last, seconds"},
    {"stereo_baseline_m", option_at<&SimulatorOptions::stereo_baseline_m>, within(0, 10)},
    {"light_grid_m", option_at<&SimulatorOptions::light_grid_m>, within(0.01, 1)},
    {"blur_samples", option_at<&SimulatorOptions::blur_samples>, within(2, 100)},
};
constinit const OptionTable SimulatorOptions::table = {"SimulatorOptions", kSimulatorFields};

void SimulatorOptions::validate() const {
  const std::string defect = camera_defect(camera);
  detail::require(defect.empty(), "SimulatorOptions.camera", defect, "a usable camera");
  constexpr std::uint32_t kLargest = 8192;
  detail::require(camera.width <= kLargest && camera.height <= kLargest, "SimulatorOptions.camera",
                  fmt::format("an image of {} x {}", camera.width, camera.height),
                  "at most 8192 pixels a side");
  sensor.validate();
  check_options(*this);
}

// A camera and what it renders.
struct RgbdSimulator::Optics {
  Camera camera;
  double readout_s;
  detail::RayTable rays;
  detail::Renderer renderer;

  // @param camera_from_eye places another camera beside that of the trajectory
  RenderedFrame picture_at(const Trajectory& trajectory, double timestamp_s,
                           const Rigid3& camera_from_eye, const Executor& executor) const;
  // The mean of several during the exposure.
  RenderedFrame blurred_at(const Trajectory& trajectory, double timestamp_s,
                           const Rigid3& camera_from_eye, const SimulatorOptions& options,
                           const Executor& executor) const;
};

RgbdSimulator::RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options,
                             const Executor& executor)
    : options_(validated(options)),
      trajectory_(std::move(trajectory)),
      optics_(std::make_shared<const Optics>(
          Optics{options.camera, options.readout_s, detail::ray_table(options.camera),
                 detail::Renderer(std::move(scene), options.light_grid_m, options.smooth_edges,
                                  executor)})) {}

const Scene& RgbdSimulator::scene() const {
  return optics_->renderer.scene();
}

// With a rolling shutter few rows at a time, each from where the camera is then.
RenderedFrame RgbdSimulator::Optics::picture_at(const Trajectory& trajectory, double timestamp_s,
                                                const Rigid3& camera_from_eye,
                                                const Executor& executor) const {
  const auto eye_at = [&](double time) { return pose_at(trajectory, time) * camera_from_eye; };
  if (readout_s <= 0.0) return renderer.render(camera, rays, eye_at(timestamp_s), executor);
  constexpr std::uint32_t kRowsAtOnce = 4;
  constexpr std::uint32_t kMargin = 1;  // an edge is found by the rows beside it
  RenderedFrame whole;
  whole.width = camera.width;
  whole.height = camera.height;
  for (std::uint32_t first = 0; first < camera.height; first += kRowsAtOnce) {
    const std::uint32_t last = std::min(first + kRowsAtOnce, camera.height);
    const std::uint32_t from = first - std::min(first, kMargin);
    const std::uint32_t to = std::min(last + kMargin, camera.height);
    Camera band = camera;
    band.height = to - from;
    const auto part = [&](const auto& values, std::size_t begin, std::size_t end,
                          std::size_t each) {
      const auto row = static_cast<std::ptrdiff_t>(each * camera.width);
      return std::vector(values.begin() + static_cast<std::ptrdiff_t>(begin) * row,
                         values.begin() + static_cast<std::ptrdiff_t>(end) * row);
    };
    const detail::RayTable band_rays{part(rays.x, from, to, 1), part(rays.y, from, to, 1)};
    const double share = 0.5 * (first + last) / camera.height - 0.5;
    const RenderedFrame rows =
        renderer.render(band, band_rays, eye_at(timestamp_s + share * readout_s), executor);
    const auto append = [&](auto& all, const auto& values, std::size_t each) {
      const auto inner = part(values, first - from, last - from, each);
      all.insert(all.end(), inner.begin(), inner.end());
    };
    append(whole.bgr, rows.bgr, 3);
    append(whole.depth_m, rows.depth_m, 1);
    append(whole.facing, rows.facing, 1);
  }
  return whole;
}

RenderedFrame RgbdSimulator::Optics::blurred_at(const Trajectory& trajectory, double timestamp_s,
                                                const Rigid3& camera_from_eye,
                                                const SimulatorOptions& options,
                                                const Executor& executor) const {
  RenderedFrame picture = picture_at(trajectory, timestamp_s, camera_from_eye, executor);
  if (options.shutter_s <= 0.0) return picture;
  std::vector<std::uint32_t> sum(picture.bgr.size(), 0);
  const auto samples = static_cast<std::uint32_t>(options.blur_samples);
  for (std::uint32_t k = 0; k < samples; ++k) {
    const double offset = options.shutter_s * ((k + 0.5) / samples - 0.5);
    const RenderedFrame part =
        picture_at(trajectory, timestamp_s + offset, camera_from_eye, executor);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part.bgr[i];
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    picture.bgr[i] = static_cast<std::uint16_t>(sum[i] / samples);
  }
  return picture;
}

RgbdFrame RgbdSimulator::frame(std::size_t index, const Executor& executor) const {
  refuse_if(index >= trajectory_.size(), "RgbdSimulator::frame", fmt::format("frame {}", index),
            fmt::format("less than {}", trajectory_.size()));
  const TimedPose& pose = trajectory_.poses()[index];
  RenderedFrame picture =
      optics_->blurred_at(trajectory_, pose.timestamp_s, Rigid3(), options_, executor);
  // Two numbers from the seed and the frame, for the two sensors.
  Random random = Random(options_.seed).fork(index);
  RgbdFrame frame;
  frame.timestamp_s = pose.timestamp_s;
  frame.world_from_camera = pose.world_from_camera;
  frame.width = picture.width;
  frame.height = picture.height;
  frame.bgr = detail::expose(picture, options_.sensor, random.draw_seed(), executor);
  if (options_.stereo_baseline_m > 0.0) {
    const Rigid3 camera_from_right(Eigen::Quaterniond::Identity(),
                                   {options_.stereo_baseline_m, 0.0, 0.0});
    const RenderedFrame right =
        optics_->blurred_at(trajectory_, pose.timestamp_s, camera_from_right, options_, executor);
    frame.right_bgr = detail::expose(right, options_.sensor, random.draw_seed(), executor);
  } else {
    frame.depth_m = detail::measure_depth(picture, intrinsics(options_.camera).fx, options_.sensor,
                                          random.draw_seed(), executor);
  }
  frame.exact_depth_m = std::move(picture.depth_m);
  return frame;
}

}  // namespace cairn
