// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/bundle_files.hpp"

#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (auto* const read : {&cairn::read_bundler, &cairn::read_bal, &cairn::read_nvm}) {
    cairn::testing::expect_read_or_refused([&] {
      cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
      read(source, {});
    });
  }
  return 0;
}
