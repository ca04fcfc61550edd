// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/foreign_formats.hpp"

#include "fuzz/imported.hpp"

// All readers that take one JSON object.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto with = [&](auto read) {
    cairn::testing::expect_read_or_refused([&] {
      cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
      read(source);
    });
  };
  with([](cairn::ByteSource& source) {
    cairn::detail::read_openmvg({.path = "/nowhere/input", .source = &source});
  });
  with([](cairn::ByteSource& source) {
    cairn::detail::read_alicevision({.path = "/nowhere/input", .source = &source});
  });
  with([](cairn::ByteSource& source) { cairn::detail::read_nerfstudio(source, "/nowhere"); });
  return 0;
}
