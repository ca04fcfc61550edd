// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>

namespace cairn::testing {

/// The folder of real data that CAIRN_DATA names; nothing for who has the repository only. Tests then
/// skip, saying kNoRealData.
inline std::optional<std::filesystem::path> real_data() {
  const char* const folder = std::getenv("CAIRN_DATA");
  if (folder == nullptr || *folder == '\0') return std::nullopt;
  return std::filesystem::path(folder);
}

inline constexpr const char* kNoRealData =
    "CAIRN_DATA does not name the folder of real data: nothing was tested";

}  // namespace cairn::testing
