// SPDX-License-Identifier: BSD-3-Clause
// Aligns one map file to another and prints the pose if it can be trusted. README shows what follows.
#include <iostream>
#include <stdexcept>

#include <cairn/cairn.hpp>

int main(int argc, char** argv) try {
  if (argc != 3) throw std::invalid_argument("expected two maps: SOURCE TARGET");
  const cairn::LandmarkMap source = cairn::read_map(argv[1]);
  const cairn::LandmarkMap target = cairn::read_map(argv[2]);
  const cairn::Alignment result = cairn::align(source, target);
  std::cout << cairn::status_of(result) << ": " << result.reason << "\n";
  if (!result.target_from_source) return 4;  // no pose that can be trusted
  std::cout << result.target_from_source->matrix() << "\n";
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
