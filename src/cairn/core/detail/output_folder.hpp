// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "cairn/core/detail/file_lock.hpp"

namespace cairn::detail {

/// A folder that appears whole or not at all. Its files are written to a folder of the same name in the hidden folder
/// ".NAME.cairn-unfinished" beside it, and commit() renames that folder. If the folder already exists and is empty (it
/// may be a link or a mounted disk), the hidden folder ".cairn-unfinished" is inside it, and commit() moves each file
/// up. The next OutputFolder of the same name deletes what a killed process left. Several OutputFolders of one name do
/// not disturb each other; the first to commit wins.
class OutputFolder {
 public:
  /// @param folder must not exist, or must be empty
  /// @throws Error naming the folder and the reason: (misuse) if it is a file or not empty, (storage) if it cannot be
  ///         made
  explicit OutputFolder(const std::filesystem::path& folder);
  /// Deletes what was not committed.
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where to write the folder's files; exists and is empty at first.
  const std::filesystem::path& unfinished() const { return unfinished_; }
  /// Moves the folder to its place, after all of it is on disk. Do not write to unfinished() afterwards.
  /// @throws Error (storage), or (misuse) if something has been written to its place meanwhile
  void commit();

 private:
  bool take(const std::filesystem::path& container);
  void discard();

  std::filesystem::path folder_;
  bool exists_;  // whether the folder existed before; it is then kept
  std::filesystem::path container_;
  std::filesystem::path unfinished_;
  std::optional<FileLock> lock_;
};

}  // namespace cairn::detail
