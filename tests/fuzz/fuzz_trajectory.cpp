// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/formats/trajectory_file.hpp"

#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

namespace {

std::string written(const cairn::Trajectory& trajectory) {
  std::string text;
  cairn::write_trajectory(trajectory, cairn::TrajectoryFormat::kTum,
                          [&](std::string_view piece) { text += piece; });
  return text;
}

}  // namespace

// Trajectories of all formats, which are recognised by their first record.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
    const cairn::Trajectory trajectory = cairn::read_trajectory(source);
    if (trajectory.empty()) return;
    const std::string once = written(trajectory);
    cairn::MemoryReader again(once, "written");
    if (written(cairn::read_trajectory(again)) != once) {
      cairn::testing::abort_because("written twice it differs");
    }
  });
  return 0;
}
