// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#include "cairn/simulation/simulator.hpp"
#include "cairn/vision/map_sequence.hpp"

namespace cairn::testing {

inline const Camera kCamera{{1}, "PINHOLE", 320, 240, {262.0, 262.0, 159.5, 119.5}};

inline const Environment& desk() {
  static const Environment environment =
      make_environment({.kind = EnvironmentKind::kDesk, .texture_scale = 0.5});
  return environment;
}

inline FrameImages images_of(const RgbdFrame& frame, std::size_t index) {
  FrameImages images =
      frame_images(frame.timestamp_s, frame.width, frame.height, frame.bgr, frame.depth_m);
  images.name = std::to_string(index) + ".png";
  if (!frame.right_bgr.empty()) {
    images.right =
        frame_images(frame.timestamp_s, frame.width, frame.height, frame.right_bgr, {}).gray;
  }
  return images;
}

// Frames on the way of a camera through the desk environment, and where they truly were.
struct Recording {
  Camera camera;
  Trajectory truth;
  std::vector<FrameImages> frames;
  std::vector<std::vector<float>> exact_depths_m;  // one a frame, row by row

  const FrameImages& operator()(std::size_t i) const { return frames[i]; }
};

// Every so-manieth pose of the path becomes a frame.
inline Recording record(const Trajectory& path, const Camera& camera = kCamera,
                        std::uint64_t noise = 1, double readout_s = 0.0, std::size_t every = 1,
                        double stereo_baseline_m = 0.0) {
  SimulatorOptions options;
  options.stereo_baseline_m = stereo_baseline_m;
  options.camera = camera;
  options.seed = noise;
  options.readout_s = readout_s;
  const RgbdSimulator simulator(desk().scene, path, options, Executor(2));
  Recording recording{camera, {}, {}, {}};
  std::vector<TimedPose> truth;
  for (std::size_t i = 0; i < simulator.frame_count(); i += every) {
    RgbdFrame frame = simulator.frame(i, Executor(2));
    recording.frames.push_back(images_of(frame, i));
    recording.exact_depths_m.push_back(std::move(frame.exact_depth_m));
    truth.push_back(path.poses()[i]);
  }
  recording.truth = Trajectory(std::move(truth));
  return recording;
}

inline const Recording& sweep() {
  static const Recording recording = record(make_path(desk(), {.frames = 60}));
  return recording;
}

}  // namespace cairn::testing
