// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/interchange/opensfm.hpp"

#include "fuzz/round_trip.hpp"

// The input is a reconstruction and, behind a zero, the tracks.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view all(reinterpret_cast<const char*>(data), size);
  const std::size_t zero = all.find('\0');
  cairn::MemoryReader reconstruction(all.substr(0, zero), "input reconstruction");
  const bool has_tracks = zero != std::string_view::npos;
  cairn::MemoryReader tracks(has_tracks ? all.substr(zero + 1) : "", "input tracks");
  try {
    const cairn::LandmarkMap map =
        cairn::read_opensfm({&reconstruction, has_tracks ? &tracks : nullptr});
  } catch (const cairn::Error& error) {
    if (error.kind() != cairn::ErrorKind::kInput ||
        !std::string_view(error.what()).starts_with("input")) {
      cairn::testing::abort_because(std::string("refused otherwise: ") + error.what());
    }
  }
  return 0;
}
