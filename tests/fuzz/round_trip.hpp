// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/maps.hpp"

namespace cairn::testing {

[[noreturn]] inline void abort_because(const std::string& finding) {
  std::fprintf(stderr, "FINDING: %s\n", finding.c_str());
  std::abort();
}

enum class Fidelity {
  kEveryByte,  ///< the format holds all of a map, in one form: what was read is what is written
  kWholeMap,   ///< it holds all of a map
  kItsPart,    ///< it holds a part, which does not shrink when written again
};

/// What a reader accepts must be written to bytes that are read back and written to the same bytes;
/// what it refuses, it refuses by cairn::Error as bad input. Anything else (another exception, a
/// crash, memory out of proportion) is a finding.
/// @param read  LandmarkMap(ByteSource&)
/// @param write void(const LandmarkMap&, const ByteSink&)
template <class Read, class Write>
void expect_round_trip(std::string_view bytes, Fidelity fidelity, const Read& read,
                       const Write& write) {
  const auto read_bytes = [&](std::string_view text) {
    MemoryReader source(text, "input");
    return read(source);
  };
  const auto written = [&](const LandmarkMap& map) {
    std::string text;
    write(map, [&](std::string_view piece) { text += piece; });
    return text;
  };
  LandmarkMap map;
  try {
    map = read_bytes(bytes);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput) {
      abort_because(std::string("refused, but not as input: ") + error.what());
    }
    if (!std::string_view(error.what()).starts_with("input")) {
      abort_because(std::string("refused without naming the file: ") + error.what());
    }
    return;
  }
  try {
    const std::string once = written(map);
    if (fidelity == Fidelity::kEveryByte && once != bytes) abort_because("it is written otherwise");
    const LandmarkMap again = read_bytes(once);
    if (fidelity != Fidelity::kItsPart) {
      const std::string difference = map_difference(again, map);
      if (!difference.empty()) abort_because("written and read back it differs in " + difference);
    }
    if (written(again) != once) abort_because("written twice it differs");
  } catch (const Error& error) {
    abort_because(std::string("accepted, but not when written: ") + error.what());
  }
}

}  // namespace cairn::testing
