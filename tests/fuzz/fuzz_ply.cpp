// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/map_file.hpp"

#include "fuzz/round_trip.hpp"
#include "fuzz/token_mutator.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto read = [](cairn::ByteSource& source) { return cairn::read_ply(source); };
  for (const bool ascii : {true, false}) {
    cairn::testing::expect_round_trip(
        bytes, cairn::testing::Fidelity::kItsPart, read,
        [&](const cairn::LandmarkMap& map, const cairn::ByteSink& sink) {
          cairn::write_ply(map, sink, {.ascii = ascii});
        });
  }
  return 0;
}
