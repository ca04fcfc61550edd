// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/output_folder.hpp"

#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

// In the hidden folder: tells ours from others', and is locked as long as its process lives.
constexpr std::string_view kLock = ".lock";

[[noreturn]] void refuse(const fs::path& folder, std::string_view reason) {
  throw Error(ErrorKind::kMisuse, folder.string(), fmt::format("cannot be written: {}", reason),
              "a new or an empty folder");
}

[[noreturn]] void fail(const fs::path& folder, std::string_view reason) {
  throw Error(ErrorKind::kStorage, folder.string(), fmt::format("cannot be written: {}", reason),
              "");
}

constexpr std::string_view kUnfinished = ".cairn-unfinished";

std::vector<fs::path> entries_of(const fs::path& folder, std::error_code& error) {
  std::vector<fs::path> entries;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    entries.push_back(entry->path());
  }
  return entries;
}

// Whether the folder exists; it must then be empty but for unfinished ones.
bool exists_and_is_empty(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(folder, error))) return false;
  if (!fs::is_directory(folder, error)) refuse(folder, "it is a file");
  for (const fs::path& entry : entries_of(folder, error)) {
    if (entry.filename().string().starts_with(kUnfinished)) continue;
    refuse(folder, "the folder is not empty");
  }
  if (error) fail(folder, error.message());
  return true;
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& folder)
    : folder_(folder.has_filename() ? folder : folder.parent_path()),
      exists_(exists_and_is_empty(folder_)) {
  constexpr int kMostAtOnce = 64;
  constexpr std::size_t kLongest = 200;  // of the 255 bytes that a name may have
  const std::string name = folder_.filename().string();
  const fs::path hidden =
      exists_ ? folder_ / kUnfinished
              : folder_.parent_path() / fmt::format(".{}{}", name.substr(0, kLongest), kUnfinished);
  for (int i = 0; i < kMostAtOnce; ++i) {
    fs::path container = hidden;
    if (i > 0) container += fmt::format("-{}", i);
    if (!take(container)) continue;
    container_ = container;
    unfinished_ = container / (exists_ ? "content" : name);  // for its name may be "."
    std::error_code error;
    for (const fs::path& left : entries_of(container, error)) {
      if (!error && left.filename() != kLock) fs::remove_all(left, error);
    }
    if (!error) fs::create_directory(unfinished_, error);
    if (!error) return;
    discard();
    fail(folder_, error.message());
  }
  fail(folder_, "there are too many unfinished folders beside it");
}

OutputFolder::~OutputFolder() {
  discard();
}

// Deletes the hidden folder, if there still is one.
void OutputFolder::discard() {
  if (!lock_) return;
  std::error_code error;
  fs::remove_all(unfinished_, error);
  if (error == std::errc::filename_too_long) error.clear();  // it was never made
  // The lock goes last, so that no other process takes over what is being deleted; and it stays with what cannot be
  // deleted, so that the next process knows that as ours.
  if (!error) fs::remove(container_ / kLock, error);
  if (!error) fs::remove(container_, error);
  lock_.reset();
}

// Makes the hidden folder, or takes over that of a process that has ended; false if it is in use or not ours.
bool OutputFolder::take(const fs::path& container) {
  for (;;) {
    std::error_code error;
    const bool is_new = fs::create_directory(container, error);
    if (error && error != std::errc::file_exists) fail(folder_, error.message());
    if (!fs::is_directory(fs::symlink_status(container, error))) return false;
    // A process killed at the start leaves it empty; without a lock it is ours only then.
    lock_.emplace(container / kLock, is_new || fs::is_empty(container, error));
    if (lock_->holds()) return true;
    if (lock_->state() != FileLock::State::kFailed) return false;
    if (!fs::exists(container, error)) continue;  // its owner has just committed
    if (!is_new) return false;
    fs::remove(container, error);
    fail(folder_, std::generic_category().message(lock_->error_number()));
  }
}

void OutputFolder::commit() {
  sync_files(container_);  // before it has its name
  std::error_code error;
  if (exists_) {
    exists_and_is_empty(folder_);  // nothing has been written to it meanwhile
    for (const fs::path& entry : entries_of(unfinished_, error)) {
      if (!error) fs::rename(entry, folder_ / entry.filename(), error);
    }
  } else {
    fs::rename(unfinished_, folder_, error);
  }
  if (error) fail(folder_, error.message());
  discard();
  sync_files(folder_);
}

}  // namespace cairn::detail
