// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/simulator.hpp"

#include <algorithm>
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

constexpr OptionField kSimulatorFields[] = {
    {"shutter_s", option_at<&SimulatorOptions::shutter_s>, within(0, 1), "--motion-blur",
     "Exposure time in seconds; 0: no blur. Blur makes rendering six times slower"},
    {"readout_s", option_at<&SimulatorOptions::readout_s>, within(0, 1), "--readout",
     "Readout time of a rolling shutter, from the first image row to the last, seconds"},
    {"blur_samples", option_at<&SimulatorOptions::blur_samples>, within(2, 100)},
};
constinit const OptionTable SimulatorOptions::table = {"SimulatorOptions", kSimulatorFields};

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
  check_options(*this);
}

RgbdSimulator::RgbdSimulator(Scene scene, Trajectory trajectory, const SimulatorOptions& options,
                             const Executor& executor)
    : options_(validated(options)),
      trajectory_(std::move(trajectory)),
      rays_(ray_table(options.camera)),
      renderer_(std::move(scene), options.renderer, executor) {}

// With a rolling shutter few rows at a time, each from where the camera is then.
RenderedFrame RgbdSimulator::picture_at(double timestamp_s, const Executor& executor) const {
  const Camera& camera = options_.camera;
  if (options_.readout_s <= 0.0) {
    return renderer_.render(camera, rays_, pose_at(trajectory_, timestamp_s), executor);
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
    const RayTable rays{part(rays_.x, from, to, 1), part(rays_.y, from, to, 1)};
    const double share = 0.5 * (first + last) / camera.height - 0.5;
    const RenderedFrame rows = renderer_.render(
        band, rays, pose_at(trajectory_, timestamp_s + share * options_.readout_s), executor);
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
  RenderedFrame picture = picture_at(pose.timestamp_s, executor);
  if (options_.shutter_s > 0.0) {
    std::vector<std::uint32_t> sum(picture.bgr.size(), 0);
    const auto samples = static_cast<std::uint32_t>(options_.blur_samples);
    for (std::uint32_t k = 0; k < samples; ++k) {
      const double offset = options_.shutter_s * ((k + 0.5) / samples - 0.5);
      const RenderedFrame part = picture_at(pose.timestamp_s + offset, executor);
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
