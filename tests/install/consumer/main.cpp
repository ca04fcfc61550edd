// SPDX-License-Identifier: BSD-3-Clause
// Uses the installed library as a stranger would: reads a map, aligns two maps.
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>

#include <cairn/confidence/metric.hpp>
#include <cairn/core/error.hpp>
#include <cairn/evaluation/pose_error.hpp>
#include <cairn/formats/map_file.hpp>
#include <cairn/map/synthetic.hpp>
#include <cairn/registration/icp.hpp>

namespace {

int failures = 0;

void check(bool condition, const char* what) {
  if (condition) return;
  std::cerr << "consumer: not so: " << what << '\n';
  ++failures;
}

void read_a_map() {
  const std::filesystem::path path = "consumer.map";
  std::ofstream(path) << "FRAME 7 0 0 0 1 0 0 0\n"
                         "FRAME 8 1 0 0 1 0 0 0\n"
                         "LANDMARK 3 0 0 2 1e-4 0 0 0 1e-4 0 0 0 4e-4 2 7 320 240 8 70 240\n"
                         "LANDMARK 5 1 0 4 1e-4 0 0 0 1e-4 0 0 0 4e-4 1 8 320 240\n";
  const cairn::LandmarkMap map = cairn::read_map(path);
  std::cout << map.frame_count() << " frames, " << map.landmark_count() << " landmarks, "
            << map.observation_count() << " observations\n";
  check(map.frame_count() == 2, "2 frames");
  check(map.landmark_count() == 2, "2 landmarks");
  check(map.observation_count() == 3, "3 observations");
  check(map.observation_count(*map.find(cairn::LandmarkId{3})) == 2, "landmark 3 was seen twice");
  check(map.world_from_camera(cairn::FrameIndex{1}).translation().x() == 1.0, "camera 8 at x = 1");

  bool thrown = false;
  try {
    cairn::read_map("absent.map");
  } catch (const cairn::Error& error) {
    thrown = error.kind() == cairn::ErrorKind::kInput;
  }
  check(thrown, "a missing file is an input error");
}

void align_two_maps() {
  const cairn::SyntheticPair pair = cairn::synthetic_pair({.seed = 1, .landmarks = 1000});
  cairn::IcpOptions options = {.initial = pair.target_from_source, .max_distance = 0.1};
  options.initial =
      cairn::Rigid3::from_roll_pitch_yaw({0.02, 0.01, 0.0}, 0.0, 0.0, 0.01) * options.initial;
  const cairn::RegistrationResult result =
      cairn::icp(pair.source, pair.target, cairn::covariance_metric(), options);
  std::cout << result.reason << '\n';
  check(result.has_pose(), "has a pose");
  const cairn::PoseError error = cairn::pose_error(
      result.target_from_source, pair.target_from_source, pair.source.landmarks().positions);
  check(error.translation < 0.02, "less than 2 cm off");
}

}  // namespace

int main() {
  try {
    read_a_map();
    align_two_maps();
  } catch (const std::exception& error) {
    std::cerr << "consumer: " << error.what() << '\n';
    return 1;
  }
  return failures == 0 ? 0 : 1;
}
