// SPDX-License-Identifier: BSD-3-Clause
// Aligns one map file to another and prints the pose: example_align_two_maps SOURCE TARGET
#include <iostream>

#include <cairn/map/io/map_file.hpp>
#include <cairn/registration/icp.hpp>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: example_align_two_maps SOURCE TARGET\n";
    return 2;
  }
  const auto source = cairn::read_map(argv[1]);
  const auto target = cairn::read_map(argv[2]);
  const auto result = cairn::icp(source, target, cairn::observations_metric(), {.k = 5});
  std::cout << result.reason << "\n";
  if (!result.has_pose()) return 4;
  std::cout << result.target_from_source.matrix() << "\n";
  return 0;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
