// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/simulator.hpp"

#include <algorithm>
#include <numbers>
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

void SensorOptions::validate() const {
  detail::require_within(exposure, 0.01, 100.0, "SensorOptions.exposure");
  detail::require_within(color_noise, 0.0, 100.0, "SensorOptions.color_noise");
  detail::require_within(depth_noise_m, 0.0, 0.1, "SensorOptions.depth_noise_m");
  detail::require_within(depth_step_m, 0.0, 0.1, "SensorOptions.depth_step_m");
  detail::require_within(min_depth_m, 0.0, 1000.0, "SensorOptions.min_depth_m");
  detail::require_within(max_depth_m, 0.0, 1000.0, "SensorOptions.max_depth_m");
  detail::require(max_depth_m > min_depth_m, "SensorOptions.max_depth_m", max_depth_m,
                  fmt::format("more than min_depth_m, {}", min_depth_m));
  detail::require_within(baseline_m, 0.0, 10.0, "SensorOptions.baseline_m");
  constexpr double kRightAngle = 0.5 * std::numbers::pi;
  detail::require(max_incidence_rad >= 0.0 && max_incidence_rad <= kRightAngle,
                  "SensorOptions.max_incidence_rad", max_incidence_rad,
                  fmt::format("0 to {:.6g}", kRightAngle));
  detail::require_within(edge_holes, 0.0, 1.0, "SensorOptions.edge_holes");
  detail::require_within(dropout, 0.0, 1.0, "SensorOptions.dropout");
}

void RendererOptions::validate() const {
  detail::require_within(light_grid_m, 0.01, 1.0, "RendererOptions.light_grid_m");
}

void SimulatorOptions::validate() const {
  const std::string defect = camera_defect(camera);
  detail::require(defect.empty(), "SimulatorOptions.camera", defect, "a usable camera");
  constexpr std::uint32_t kLargest = 8192;
  detail::require(camera.width <= kLargest && camera.height <= kLargest, "SimulatorOptions.camera",
                  fmt::format("an image of {} x {}", camera.width, camera.height),
                  "at most 8192 pixels a side");
  sensor.validate();
  renderer.validate();
  detail::require_within(shutter_s, 0.0, 1.0, "SimulatorOptions.shutter_s");
  detail::require_within(readout_s, 0.0, 1.0, "SimulatorOptions.readout_s");
  detail::require_within(blur_samples, std::size_t{2}, std::size_t{100},
                         "SimulatorOptions.blur_samples");
}

// A camera and what it renders.
struct RgbdSimulator::Optics {
  Camera camera;
  double readout_s;
  detail::RayTable rays;
  detail::Renderer renderer;

  RenderedFrame picture_at(const Trajectory& trajectory, double timestamp_s,
                           const Executor& executor) const;
};

RgbdSimulator::RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options,
                             const Executor& executor)
    : options_(validated(options)),
      trajectory_(std::move(trajectory)),
      optics_(std::make_shared<const Optics>(
          Optics{options.camera, options.readout_s, detail::ray_table(options.camera),
                 detail::Renderer(std::move(scene), options.renderer, executor)})) {}

const Scene& RgbdSimulator::scene() const {
  return optics_->renderer.scene();
}

// With a rolling shutter few rows at a time, each from where the camera is then.
RenderedFrame RgbdSimulator::Optics::picture_at(const Trajectory& trajectory, double timestamp_s,
                                                const Executor& executor) const {
  if (readout_s <= 0.0) {
    return renderer.render(camera, rays, pose_at(trajectory, timestamp_s), executor);
  }
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
    const RenderedFrame rows = renderer.render(
        band, band_rays, pose_at(trajectory, timestamp_s + share * readout_s), executor);
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

RgbdFrame RgbdSimulator::frame(std::size_t index, const Executor& executor) const {
  if (index >= trajectory_.size()) {
    throw Error(ErrorKind::kMisuse, "RgbdSimulator::frame", fmt::format("frame {}", index),
                fmt::format("less than {}", trajectory_.size()));
  }
  const TimedPose& pose = trajectory_.poses()[index];
  RenderedFrame picture = optics_->picture_at(trajectory_, pose.timestamp_s, executor);
  if (options_.shutter_s > 0.0) {
    std::vector<std::uint32_t> sum(picture.bgr.size(), 0);
    const auto samples = static_cast<std::uint32_t>(options_.blur_samples);
    for (std::uint32_t k = 0; k < samples; ++k) {
      const double offset = options_.shutter_s * ((k + 0.5) / samples - 0.5);
      const RenderedFrame part =
          optics_->picture_at(trajectory_, pose.timestamp_s + offset, executor);
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part.bgr[i];
    }
    for (std::size_t i = 0; i < sum.size(); ++i) {
      picture.bgr[i] = static_cast<std::uint16_t>(sum[i] / samples);
    }
  }
  // Two numbers from the seed and the frame, for the two sensors.
  Random random = Random(options_.seed).fork(index);
  RgbdFrame frame;
  frame.timestamp_s = pose.timestamp_s;
  frame.world_from_camera = pose.world_from_camera;
  frame.width = picture.width;
  frame.height = picture.height;
  frame.bgr = detail::expose(picture, options_.sensor, random.draw_seed(), executor);
  frame.depth_m = detail::measure_depth(picture, intrinsics(options_.camera).fx, options_.sensor,
                                        random.draw_seed(), executor);
  frame.exact_depth_m = std::move(picture.depth_m);
  return frame;
}

}  // namespace cairn
