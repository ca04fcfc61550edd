// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

struct stat;

namespace cairn {

/// A file that a program is going to write.
struct NamedOutput {
  std::string option;  ///< names it in messages, e.g. "--json"
  std::filesystem::path path;
};

/// From now on FileReader refuses the regular files that exist at these paths, whatever links lead to them:
/// a program that reads a file and then writes to it loses its input. Replaces the outputs of an earlier call.
/// Not thread-safe: to be called before other threads read.
void refuse_to_read(const std::vector<NamedOutput>& outputs);

/// For FileReader.
/// @throws Error (misuse) naming the option and `path`, whose status is given, if it is one of those outputs
void require_no_output(const std::filesystem::path& path, const struct stat& status);

}  // namespace cairn
