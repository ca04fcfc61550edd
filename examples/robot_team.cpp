// SPDX-License-Identifier: BSD-3-Clause
// Merges the maps of several robots into one, and says where each began and who is left out:
//   example_robot_team MERGED_MAP MAP MAP...
#include <iostream>
#include <stdexcept>
#include <vector>

#include <cairn/formats/map_file.hpp>
#include <cairn/merging/merge.hpp>

int main(int argc, char** argv) try {
  if (argc < 4) throw std::invalid_argument("expected a map to write and at least two to read");
  std::vector<cairn::LandmarkMap> maps;
  for (int i = 2; i < argc; ++i) maps.push_back(cairn::read_map(argv[i]));
  std::vector<cairn::MergeInput> robots;
  for (std::size_t i = 0; i < maps.size(); ++i) robots.push_back({argv[i + 2], &maps[i]});

  const cairn::MergeResult result = cairn::merge(robots);
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const cairn::MergedMap& robot = result.maps[i];
    std::cout << robots[i].name << ": ";
    if (robot.placed) {
      std::cout << "begins at " << robot.world_from_map->translation().transpose() << "\n";
    } else {
      std::cout << "left out: " << robot.reason << "\n";
    }
  }
  if (!result.map) return 4;  // no two maps can be trusted to show one place
  cairn::write_map(*result.map, argv[1]);
  std::cout << result.map->landmark_count() << " landmarks in " << argv[1] << "\n";
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
