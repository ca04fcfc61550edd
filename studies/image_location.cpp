// SPDX-License-Identifier: BSD-3-Clause
// Locates the images of a sequence in TUM layout, with its truth, in a map.
//   cairn_image_location_benchmark MAP SEQUENCE STEP colour|depth same|other
// Every STEP-th image is located, with depth or without. "same" holds the poses against groundtruth.txt, in whose world the map
// must be; of "other" places any pose that is located is wrong. The sequence has a camera.yaml. One CSV row an
// image to stdout; studies/image_location.sh runs it on simulated sessions.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/camera_file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/vision/image_locator.hpp"
#include "cairn/vision/sequence.hpp"

#include "study_main.hpp"

namespace {

using namespace cairn;
namespace fs = std::filesystem;

std::optional<Rigid3> pose_at(const Trajectory& truth, double timestamp_s) {
  constexpr double kMost = 0.02;  // seconds
  std::optional<Rigid3> nearest;
  double least = kMost;
  for (const TimedPose& pose : truth.poses()) {
    const double off = std::abs(pose.timestamp_s - timestamp_s);
    if (off > least) continue;
    least = off;
    nearest = pose.world_from_camera;
  }
  return nearest;
}

void run(const std::vector<std::string>& words) {
  const fs::path folder = words[1];
  const std::size_t step = std::stoul(words[2]);
  const bool with_depth = words[3] == "depth";
  const bool same = words[4] == "same";
  FileReader camera_file(folder / "camera.yaml");
  const CameraFile camera = read_camera_file(camera_file);
  FileReader truth_file(folder / "groundtruth.txt");
  const Trajectory truth = read_trajectory(truth_file);
  SequenceOptions options;
  if (camera.depth_units_per_metre) options.depth_units_per_metre = *camera.depth_units_per_metre;
  const ImageSequence sequence(folder, options);
  const ImageLocator locator(read_map(words[0]), camera.camera);
  fmt::print(
      "map,sequence,image,corners,proposals,visible,expected,matches,spread,located,probability,"
      "rotation_deg,translation_m,ms\n");
  for (std::size_t i = 0; i < sequence.frames().size(); i += step) {
    const ImageSequence::Images images = sequence.read(i);
    const auto start = std::chrono::steady_clock::now();
    const ImageLocation found =
        locator.locate(images.gray, with_depth ? images.depth : DepthImage());
    const double ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    double rotation = -1.0;
    double translation = -1.0;
    const auto there = pose_at(truth, sequence.frames()[i].timestamp_s);
    if (same && there && found.estimate) {
      const Vector6d off = found.estimate->difference_to(*there);
      translation = off.head<3>().norm();
      rotation = degrees(off.tail<3>().norm());
    }
    fmt::print("{},{},{},{},{},{},{:.2f},{},{},{},{:.6f},{:.3f},{:.4f},{:.1f}\n",
               fs::path(words[0]).stem().string(), folder.filename().string(), i, found.corners,
               found.proposals, found.visible, found.expected, found.matches.size(), found.spread,
               found.located ? 1 : 0, found.probability, rotation, translation, ms);
  }
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(argc, argv, 5, "MAP SEQUENCE STEP colour|depth same|other", run);
}
