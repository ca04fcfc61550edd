// SPDX-License-Identifier: BSD-3-Clause
//
// make_maps FOLDER: the small maps that tests/faults/run works on.

#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

namespace {

std::string matrix_text(const cairn::Rigid3& pose) {
  const cairn::Matrix4d matrix = pose.matrix();
  std::string text;
  for (int i = 0; i < 16; ++i) text += fmt::format("{}\n", matrix(i / 4, i % 4));
  return text;
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  cairn::write_file(path, [&](const cairn::ByteSink& sink) { sink(text); });
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    const std::filesystem::path folder = argv[1];
    // As few landmarks as a pair needs to be aligned without an initial pose.
    const cairn::SyntheticPair pair =
        cairn::synthetic_pair({.seed = 3, .landmarks = 600, .frames = 20});
    cairn::write_map(pair.source, folder / "source.map");
    cairn::write_map(pair.target, folder / "target.map");
    write_text(folder / "truth.txt", matrix_text(pair.target_from_source));
    for (const std::uint64_t seed : {1, 2, 3}) {
      cairn::write_map(cairn::synthetic_map({.seed = seed, .landmarks = 40, .frames = 4}),
                       folder / fmt::format("small{}.map", seed));
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_maps: %s\n", error.what());
  }
  return 1;
}
