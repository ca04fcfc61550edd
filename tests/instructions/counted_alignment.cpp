// SPDX-License-Identifier: BSD-3-Clause
// One alignment of synthetic maps on AVX2, always the same, for tests/instructions/run to count:
// cairn_counted_alignment base|weighted. The exit code is 77 where there is no AVX2.
#include <cstdint>
#include <cstdio>
#include <string_view>

#include <hwy/targets.h>

#include "cairn/confidence/metric.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/registration/icp.hpp"

// libhwy times rdtscp when it is loaded, an instruction that Valgrind does not know on every
// processor. This definition comes before the library's; nothing here asks for the time.
namespace hwy::platform {
std::uint64_t TimerResolution() {
  return 1;
}
}  // namespace hwy::platform

int main(int argc, char** argv) {
  const std::string_view strategy = argc == 2 ? argv[1] : "";
  if (strategy != "base" && strategy != "weighted") {
    std::fputs("usage: cairn_counted_alignment base|weighted\n", stderr);
    return 2;
  }
  if ((hwy::SupportedTargets() & HWY_AVX2) == 0) {
    std::fputs("no AVX2 here\n", stderr);
    return 77;
  }
  hwy::SetSupportedTargetsForTest(HWY_AVX2);
  const cairn::SyntheticPair maps = cairn::synthetic_pair({.seed = 1});
  const cairn::PointSet source = cairn::point_set(maps.source, cairn::observations_metric());
  const cairn::PointSet target = cairn::point_set(maps.target, cairn::observations_metric());
  cairn::IcpOptions options;
  options.k = strategy == "base" ? 1 : 5;
  options.initial =
      cairn::Rigid3::from_roll_pitch_yaw({0.1, 0.05, 0.0}, 0.0, 0.0, cairn::radians(5.0)) *
      maps.target_from_source;
  const cairn::RegistrationResult result = cairn::icp(source, target, options);
  std::printf("%s: %d iterations, score %.6f\n", argv[1], result.iterations,
              result.score.value_or(-1.0));
  return result.has_pose() ? 0 : 1;
}
