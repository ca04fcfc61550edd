// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace cairn {

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

}  // namespace cairn
