// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/file_lock.hpp"

#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {

FileLock::FileLock(std::filesystem::path path, bool create) : path_(std::move(path)) {
  // Whoever held the file may just have renamed or deleted it: then its name is free again.
  constexpr int kMostTries = 100;
  for (int i = 0; i < kMostTries; ++i) {
    close();
    if (!open(create)) {
      state_ = State::kFailed;
      return;
    }
    struct stat status = {};
    // Some file systems name another owner even for a file that this process has just made.
    const bool is_ours = ::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode) &&
                         status.st_nlink <= 1 && (is_new_ || status.st_uid == ::geteuid());
    if (!is_ours) {
      state_ = State::kForeign;
      close();
      return;
    }
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0) {
      state_ = State::kLocked;
    } else if (errno == EWOULDBLOCK || errno == EINTR) {
      state_ = State::kTaken;
    } else {
      state_ = State::kUnlockable;
    }
    if (!is_in_place()) continue;
    if (state_ == State::kTaken) close();
    return;
  }
  state_ = State::kTaken;
  close();
}

FileLock::~FileLock() {
  close();
}

void FileLock::require() const {
  if (holds()) return;
  const auto fail = [&](const std::string& what, const std::string& expected) {
    throw Error(ErrorKind::kStorage, path_.string(), what, expected);
  };
  switch (state_) {
    case State::kLocked:
    case State::kTaken:
      fail("another process is writing it", "one process a folder");
      break;
    case State::kUnlockable:
      fail("cannot be locked: another process may be writing it", "no such file, if none is");
      break;
    case State::kForeign:
      fail("is not a file that this user's processes leave", "no such file");
      break;
    case State::kFailed:
      fail("cannot be written: " + std::generic_category().message(error_number_), "");
      break;
  }
}

bool FileLock::open(bool create) {
  constexpr int kFlags = O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
  for (;;) {
    is_new_ = false;
    if (create) {
      descriptor_ = ::open(path_.c_str(), kFlags | O_CREAT | O_EXCL, 0600);
      is_new_ = descriptor_ >= 0;
      error_number_ = is_new_ ? 0 : errno;
      if (error_number_ != EEXIST) return is_new_;
    }
    descriptor_ = ::open(path_.c_str(), kFlags);
    error_number_ = descriptor_ >= 0 ? 0 : errno;
    const bool was_just_deleted = create && error_number_ == ENOENT;
    if (!was_just_deleted) return descriptor_ >= 0;
  }
}

bool FileLock::is_in_place() const {
  struct stat open = {};
  struct stat named = {};
  return ::fstat(descriptor_, &open) == 0 && ::lstat(path_.c_str(), &named) == 0 &&
         open.st_ino == named.st_ino && open.st_dev == named.st_dev;
}

void FileLock::close() {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

}  // namespace cairn::detail
