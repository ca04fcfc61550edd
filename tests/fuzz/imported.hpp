// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/map/landmark_map.hpp"

#include "fuzz/round_trip.hpp"

namespace cairn::testing {

/// A reader of another system's files takes the bytes or refuses them as bad input, naming the file. Anything
/// else is a finding.
/// @param read LandmarkMap(), or anything else
template <class Read>
void expect_read_or_refused(const Read& read, std::string_view name = "input") {
  try {
    read();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput || !std::string_view(error.what()).starts_with(name)) {
      abort_because(std::string("refused otherwise: ") + error.what());
    }
  }
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace cairn::testing
