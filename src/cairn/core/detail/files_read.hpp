// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

struct stat;

namespace cairn::detail {

/// Lists the regular files that FileReader opens in this thread while the FilesRead exists, e.g. to record
/// which files of a folder were read.
class FilesRead {
 public:
  FilesRead();
  ~FilesRead();
  FilesRead(const FilesRead&) = delete;
  FilesRead& operator=(const FilesRead&) = delete;

  /// Paths in the order in which the files were first opened, each once.
  const std::vector<std::filesystem::path>& paths() const { return paths_; }

 private:
  friend void note_file_read(const std::filesystem::path& path);

  std::vector<std::filesystem::path> paths_;
  std::set<std::filesystem::path> known_;
  FilesRead* outer_;
};

/// FileReader calls this for each regular file that it opens.
void note_file_read(const std::filesystem::path& path);

/// 128-bit XXH3 hash of several files: the hash of a text with one line per file, its hash by hash_file().
std::string hash_files(const std::vector<std::filesystem::path>& paths);

/// A file that a program is going to write.
struct NamedOutput {
  std::string option;  ///< name in messages, e.g. "--json"
  std::filesystem::path path;
};

/// Forbids FileReader, from now on, to read the regular files that exist at these paths, whatever links lead
/// to them: a program that reads a file and then writes to it loses its input. Replaces the outputs of an
/// earlier call. Not thread-safe: call it before other threads read.
void refuse_to_read(const std::vector<NamedOutput>& outputs);

/// FileReader calls this before it reads a file.
/// @param status status of the file at `path`
/// @throws Error (misuse) naming the option and `path`, if the file is one of the outputs of refuse_to_read()
void require_no_output(const std::filesystem::path& path, const struct stat& status);

}  // namespace cairn::detail
