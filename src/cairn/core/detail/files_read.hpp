// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

struct stat;

namespace cairn::detail {

/// While it lives, lists the regular files that FileReader opens in this thread: what was read of a folder.
class FilesRead {
 public:
  FilesRead();
  ~FilesRead();
  FilesRead(const FilesRead&) = delete;
  FilesRead& operator=(const FilesRead&) = delete;

  /// In the order in which they were first opened, each once.
  const std::vector<std::filesystem::path>& paths() const { return paths_; }

 private:
  friend void note_file_read(const std::filesystem::path& path);

  std::vector<std::filesystem::path> paths_;
  std::set<std::filesystem::path> known_;
  FilesRead* outer_;
};

/// For FileReader.
void note_file_read(const std::filesystem::path& path);

/// 128-bit XXH3 hash of several files: of their hashes by hash_file(), one a line.
std::string hash_files(const std::vector<std::filesystem::path>& paths);

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

}  // namespace cairn::detail
