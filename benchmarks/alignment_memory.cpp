// SPDX-License-Identifier: BSD-3-Clause
// Time and memory of aligning large maps: cairn_alignment_memory [LANDMARKS=1000000] [THREADS=2]
// Memory is what the alignment takes beside the two sets of points that it is given.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include "cairn/core/execution.hpp"
#include "cairn/registration/icp.hpp"

#include "counting_heap.hpp"
#include "workload.hpp"

int main(int argc, char** argv) {
  const std::size_t landmarks = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 1'000'000;
  const unsigned threads = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 2;
  const cairn::benchmarks::Workload& work = cairn::benchmarks::workload(landmarks);
  const auto size = static_cast<double>(work.source.positions.size());
  cairn::IcpOptions options = work.options;
  const cairn::Execution execution{.executor = cairn::Executor(threads)};
  for (const std::size_t k : {1, 5}) {
    for (const int iterations : {1, 11}) {
      options.k = k;
      options.max_iterations = iterations;
      double fastest = 1e9;
      std::size_t peak = 0;
      for (int run = 0; run < 3; ++run) {
        const cairn::benchmarks::HeapUse heap;
        const cairn::RegistrationResult result =
            cairn::icp(work.source, work.target, options, execution);
        fastest = std::min(fastest, result.duration_s);
        peak = std::max(peak, heap.peak());
      }
      std::printf(
          "%.0f landmarks each, k = %zu, %d iterations, %u threads: %.3f s, %.1f bytes a "
          "landmark\n",
          size, k, iterations, execution.executor.threads(), fastest,
          static_cast<double>(peak) / size);
    }
  }
  return 0;
}
