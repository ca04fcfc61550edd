// SPDX-License-Identifier: BSD-3-Clause
// Adds maps to an atlas as a program would that maps while it drives, and prints where each is.
#include <cstdio>
#include <exception>

#include <cairn/atlas/atlas.hpp>
#include <cairn/formats/map_file.hpp>

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "Usage: keep_an_atlas NEW_ATLAS MAP...\n");
    return 2;
  }
  try {
    cairn::Atlas::create(argv[1]);
    cairn::Atlas atlas = cairn::Atlas::open(argv[1]);
    for (int i = 2; i < argc; ++i) {
      const cairn::LandmarkMap map = cairn::read_map(argv[i]);
      const cairn::NodeId node = atlas.add(map, argv[i], "robot2").node;
      cairn::AtlasLinkOptions with_the_new_one;
      with_the_new_one.only = {node};
      atlas.link(with_the_new_one);
      atlas.update_poses();
      const cairn::AtlasState state = atlas.state();
      const auto pose = state.poses.find(node);
      if (pose == state.poses.end()) continue;  // nothing connects it yet
      const Eigen::Vector3d& t = pose->second.frame_from_node.translation();
      std::printf("%s is at %.3f %.3f %.3f\n", argv[i], t.x(), t.y(), t.z());
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
