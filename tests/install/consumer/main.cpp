// SPDX-License-Identifier: BSD-3-Clause
// Uses the installed library as a stranger would: writes a map, reads it back, prints what it holds.
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "cairn/core/error.hpp"
#include "cairn/map/io/map_file.hpp"

namespace {

int failures = 0;

void check(bool condition, const char* what) {
  if (condition) return;
  std::cerr << "consumer: not so: " << what << '\n';
  ++failures;
}

}  // namespace

int main() {
  try {
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
  } catch (const std::exception& error) {
    std::cerr << "consumer: " << error.what() << '\n';
    return 1;
  }
  return failures == 0 ? 0 : 1;
}
