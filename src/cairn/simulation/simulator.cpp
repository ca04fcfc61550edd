// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/simulator.hpp"

#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/simulation/path.hpp"

namespace cairn {
namespace {

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

void SimulatorOptions::validate() const {
  const std::string defect = camera_defect(camera);
  if (!defect.empty()) {
    throw Error(ErrorKind::kMisuse, "SimulatorOptions.camera", defect, "a usable camera");
  }
  constexpr std::uint32_t kLargest = 8192;
  if (camera.width > kLargest || camera.height > kLargest) {
    throw Error(ErrorKind::kMisuse, "SimulatorOptions.camera",
                fmt::format("an image of {} x {}", camera.width, camera.height),
                "at most 8192 pixels a side");
  }
  sensor.validate();
  renderer.validate();
  const bool possible = shutter_s >= 0.0 && shutter_s <= 1.0;
  if (!possible) {
    throw Error(ErrorKind::kMisuse, "SimulatorOptions.shutter_s", fmt::format("{}", shutter_s),
                "0 to 1");
  }
  if (blur_samples < 2 || blur_samples > 100) {
    throw Error(ErrorKind::kMisuse, "SimulatorOptions.blur_samples",
                fmt::format("{}", blur_samples), "2 to 100");
  }
}

RgbdSimulator::RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options,
                             const Executor& executor)
    : options_(validated(options)),
      trajectory_(std::move(trajectory)),
      rays_(ray_table(options.camera)),
      renderer_(std::move(scene), options.renderer, executor) {}

RgbdFrame RgbdSimulator::frame(std::size_t index, const Executor& executor) const {
  if (index >= trajectory_.size()) {
    throw Error(ErrorKind::kMisuse, "RgbdSimulator::frame", fmt::format("frame {}", index),
                fmt::format("less than {}", trajectory_.size()));
  }
  const TimedPose& pose = trajectory_.poses()[index];
  RenderedFrame picture =
      renderer_.render(options_.camera, rays_, pose.world_from_camera, executor);
  if (options_.shutter_s > 0.0) {
    std::vector<std::uint32_t> sum(picture.bgr.size(), 0);
    const auto samples = static_cast<std::uint32_t>(options_.blur_samples);
    for (std::uint32_t k = 0; k < samples; ++k) {
      const double offset = options_.shutter_s * ((k + 0.5) / samples - 0.5);
      const RenderedFrame part = renderer_.render(
          options_.camera, rays_, pose_at(trajectory_, pose.timestamp_s + offset), executor);
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
  frame.bgr = expose(picture, options_.sensor, random.draw_seed(), executor);
  frame.depth_m = measure_depth(picture, intrinsics(options_.camera).fx, options_.sensor,
                                random.draw_seed(), executor);
  frame.exact_depth_m = std::move(picture.depth_m);
  return frame;
}

}  // namespace cairn
