// SPDX-License-Identifier: BSD-3-Clause
// Aligns one map file to another and prints the pose if it can be trusted:
//   example_align_two_maps SOURCE TARGET
#include <iostream>

#include <cairn/alignment/align.hpp>
#include <cairn/formats/map_file.hpp>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: example_align_two_maps SOURCE TARGET\n";
    return 2;
  }
  const auto source = cairn::read_map(argv[1]);
  const auto target = cairn::read_map(argv[2]);
  const cairn::Alignment result = cairn::align(source, target);
  std::cout << cairn::status_of(result) << ": " << result.reason << "\n";
  if (!result.target_from_source) return 4;
  std::cout << result.target_from_source->matrix() << "\n";
  return 0;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
