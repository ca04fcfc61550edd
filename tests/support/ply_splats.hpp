// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/splats.hpp"

namespace cairn::testing {

inline std::string ply_of(const LandmarkMap& map, bool ascii = false) {
  std::string ply;
  write_ply(map, [&](std::string_view bytes) { ply += bytes; }, {.ascii = ascii});
  return ply;
}

inline LandmarkMap read_splats(const std::string& ply) {
  MemoryReader source(ply, "splats.ply");
  return read_ply(source);
}

}  // namespace cairn::testing
