// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <unistd.h>

namespace cairn::testing {

/// A path of this process's own in a file system in memory, for readers that take a path.
inline std::filesystem::path path_in_memory(std::string_view name) {
  return "/dev/shm/cairn_fuzz_" + std::to_string(::getpid()) + "_" + std::string(name);
}

inline void write_bytes(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << bytes;
}

}  // namespace cairn::testing
