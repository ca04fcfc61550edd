// SPDX-License-Identifier: BSD-3-Clause
// align() as a C++ program calls it, for python_overheads.py: cairn_align_calls SOURCE TARGET THREADS
// For each line of standard input, one call; prints its wall time and processor time in seconds.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>

#include "cairn/alignment/align.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/formats/map_file.hpp"

namespace {

int run(char** arguments) {
  const cairn::LandmarkMap source = cairn::read_map(arguments[1]);
  const cairn::LandmarkMap target = cairn::read_map(arguments[2]);
  const cairn::Execution execution{
      .executor = cairn::Executor(static_cast<unsigned>(std::atoi(arguments[3])))};
  for (int c = std::getchar(); c != EOF; c = std::getchar()) {
    if (c != '\n') continue;
    const std::clock_t work = std::clock();
    const auto start = std::chrono::steady_clock::now();
    const cairn::Alignment alignment = cairn::align(source, target, {}, execution);
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
    std::printf("%.9f %.9f %s\n", wall.count(),
                static_cast<double>(std::clock() - work) / CLOCKS_PER_SEC,
                alignment.target_from_source ? "aligned" : "not aligned");
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("cairn_align_calls SOURCE TARGET THREADS\n", stderr);
    return 2;
  }
  try {
    return run(argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
