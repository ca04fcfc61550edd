// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/formats/pose_graph_file.hpp"

#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

// Pose graphs as JSON and as g2o.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = cairn::testing::text_of(data, size);
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(text, "input");
    const cairn::PoseGraph graph = cairn::read_pose_graph(source);
    const std::string once = cairn::pose_graph_text(graph);
    cairn::MemoryReader written(once, "written");
    if (cairn::pose_graph_text(cairn::read_pose_graph(written)) != once) {
      cairn::testing::abort_because("a graph written twice differs");
    }
  });
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(text, "input");
    const cairn::G2oGraph graph = cairn::read_g2o(source);
    std::string once;
    cairn::write_g2o(graph, [&](std::string_view piece) { once += piece; });
    cairn::MemoryReader written(once, "written");
    if (!(cairn::read_g2o(written) == graph)) {
      cairn::testing::abort_because("a g2o file written and read back differs");
    }
    cairn::pose_graph(graph);
  });
  return 0;
}
