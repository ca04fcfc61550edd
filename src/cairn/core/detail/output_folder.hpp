// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "cairn/core/detail/file_lock.hpp"

namespace cairn::detail {

/// A folder that appears whole or not at all. It is filled under its own name in the hidden folder
/// ".NAME.cairn-unfinished" beside it, and commit() renames it. If an empty folder exists, which may be a link or a
/// mounted disk, the hidden folder ".cairn-unfinished" is in it, and commit() moves each file up. The next OutputFolder
/// of that name clears what a killed process left. Several at once do not meet; the first to commit wins.
class OutputFolder {
 public:
  /// @param folder must not exist, or be empty
  /// @throws Error naming the folder and the reason: (misuse) if something is there, (storage) if it cannot be made
  explicit OutputFolder(const std::filesystem::path& folder);
  /// Deletes what was not committed.
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where to write the folder's files; exists and is empty at first.
  const std::filesystem::path& unfinished() const { return unfinished_; }
  /// Moves the folder to its place, all of it on disk. Nothing is to be written to unfinished() afterwards.
  /// @throws Error (storage), or (misuse) if something has been written to its place meanwhile
  void commit();

 private:
  bool take(const std::filesystem::path& container);
  void discard();

  std::filesystem::path folder_;
  bool exists_;  // before; then it is kept
  std::filesystem::path container_;
  std::filesystem::path unfinished_;
  std::optional<FileLock> lock_;
};

}  // namespace cairn::detail
