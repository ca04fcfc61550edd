// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace cairn::detail {

/// A file that is open and locked. In all processes, one FileLock at a time holds the lock. A killed process leaves
/// the file behind unlocked; this distinguishes its file from one that a living process is writing.
class FileLock {
 public:
  enum class State {
    kLocked,
    kUnlockable,  ///< open, but the file system cannot lock files
    kTaken,       ///< another FileLock holds it
    kForeign,     ///< not a regular file, owned by another user, or a file with several names
    kFailed,      ///< cannot be opened, see error_number()
  };

  /// Opens and locks the file; never waits, follows no link, and keeps the content.
  /// @param create makes a private file (mode 0600) if there is none
  FileLock(std::filesystem::path path, bool create);
  /// Unlocks the file and leaves it.
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  State state() const { return state_; }
  /// Whether no other FileLock can hold the file. If the file system cannot lock files, this holds only for a file
  /// that this FileLock created.
  bool holds() const {
    return state_ == State::kLocked || (state_ == State::kUnlockable && is_new_);
  }
  /// @throws Error (storage) naming the file and why it is not held
  void require() const;
  /// Whether the file did not exist before.
  bool is_new() const { return is_new_; }
  /// File descriptor of the open file, for reading and writing; negative unless kLocked or kUnlockable.
  int descriptor() const { return descriptor_; }
  /// Why the file could not be opened, as an errno.
  int error_number() const { return error_number_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  bool open(bool create);
  bool is_in_place() const;
  void close();

  std::filesystem::path path_;
  int descriptor_ = -1;
  int error_number_ = 0;
  bool is_new_ = false;
  State state_ = State::kFailed;
};

}  // namespace cairn::detail
