// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/foreign_formats.hpp"

#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (auto* const read : {&cairn::detail::read_bundler, &cairn::detail::read_nvm}) {
    cairn::testing::expect_read_or_refused([&] {
      cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
      read(source, {});
    });
  }
  return 0;
}
