// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "fuzz/round_trip.hpp"

// The input is a reconstruction and, each behind a zero, the tracks, ground_control_points.json and gcp_list.txt. A
// missing or empty piece is a missing file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  const auto next = [&rest] {
    const std::string_view piece = rest.substr(0, rest.find('\0'));
    rest.remove_prefix(std::min(piece.size() + 1, rest.size()));
    return piece;
  };
  cairn::MemoryReader reconstruction(next(), "input reconstruction");
  std::array<std::optional<cairn::MemoryReader>, 3> others;
  std::array<cairn::ByteSource*, 3> sources = {};
  for (std::size_t i = 0; i < others.size(); ++i) {
    const std::string_view piece = next();
    if (piece.empty()) continue;
    sources[i] = &others[i].emplace(piece, "input file " + std::to_string(i + 2));
  }
  try {
    const cairn::LandmarkMap map =
        cairn::detail::read_opensfm({&reconstruction, sources[0], sources[1], sources[2]});
    // What it accepts is a map that the text format can hold.
    std::string text;
    cairn::write_native(map, [&](std::string_view written) { text += written; });
    cairn::testing::expect_round_trip(
        text, cairn::testing::Fidelity::kWholeMap,
        [](cairn::ByteSource& source) { return cairn::read_native(source); },
        [](const cairn::LandmarkMap& read, const cairn::ByteSink& sink) {
          cairn::write_native(read, sink);
        });
  } catch (const cairn::Error& error) {
    if (error.kind() != cairn::ErrorKind::kInput ||
        !std::string_view(error.what()).starts_with("input")) {
      cairn::testing::abort_because(std::string("refused otherwise: ") + error.what());
    }
  }
  return 0;
}
