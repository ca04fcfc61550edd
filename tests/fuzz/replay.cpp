// SPDX-License-Identifier: BSD-3-Clause
// Reads each seed of the fuzz targets once, without libFuzzer: replay TARGET FOLDER...
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"

// Made by CMake: the sources of the targets, their functions renamed, and replayed_targets().
#include "replayed_targets.hpp"

// The targets' own mutators are not called.
// NOLINTNEXTLINE(readability-identifier-naming): named by libFuzzer
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* /*data*/, std::size_t size,
                                        std::size_t /*max_size*/) {
  return size;
}

int main(int count, char** words) {
  const std::map<std::string_view, Target> targets = replayed_targets();
  const auto target = count < 3 ? targets.end() : targets.find(words[1]);
  if (target == targets.end()) {
    std::fprintf(stderr, "usage: fuzz_replay TARGET FOLDER...\n");
    return 2;
  }
  std::vector<std::filesystem::path> seeds;
  for (int i = 2; i < count; ++i) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(words[i])) {
      if (entry.is_regular_file()) seeds.push_back(entry.path());
    }
  }
  std::sort(seeds.begin(), seeds.end());
  for (const std::filesystem::path& seed : seeds) {
    std::printf("%s\n", seed.c_str());
    std::fflush(stdout);  // the last name is that of a seed that ends the program
    const std::string text = cairn::read_file(seed);
    // As large as the seed, so that the sanitizer sees each byte read behind its end.
    const std::vector<std::uint8_t> bytes(text.begin(), text.end());
    target->second(bytes.data(), bytes.size());
  }
  std::printf("%zu seeds\n", seeds.size());
  return seeds.empty() ? 1 : 0;
}
