// SPDX-License-Identifier: BSD-3-Clause
// Where in a map was an image taken? locate_an_image MAP IMAGE; the camera is the map's.
#include <exception>
#include <iostream>

#include <cairn/formats/map_file.hpp>
#include <cairn/vision/image.hpp>
#include <cairn/vision/image_locator.hpp>

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "Usage: locate_an_image MAP IMAGE\n";
    return 2;
  }
  try {
    const cairn::LandmarkMap map = cairn::read_map(argv[1]);
    if (map.cameras().empty()) {
      std::cerr << argv[1] << ": the map has no camera\n";
      return 3;
    }
    const cairn::ImageLocator locator(map, map.cameras().front());
    const cairn::ImageLocation found = locator.locate(cairn::read_gray_image(argv[2]));
    std::cout << found.reason << "\n";
    if (!found.world_from_camera) return 4;
    std::cout << found.world_from_camera->matrix() << "\n";
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 3;
  }
}
