// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/alicevision.hpp"
#include "cairn/formats/foreign/nerfstudio.hpp"
#include "cairn/formats/foreign/openmvg.hpp"

#include "fuzz/imported.hpp"

// All readers that take one JSON object.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto with = [&](auto read) {
    cairn::testing::expect_read_or_refused([&] {
      cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
      read(source);
    });
  };
  with([](cairn::ByteSource& source) { return cairn::read_openmvg(source); });
  with([](cairn::ByteSource& source) { return cairn::read_alicevision(source); });
  with([](cairn::ByteSource& source) { return cairn::read_nerfstudio(source, "/nowhere"); });
  return 0;
}
