// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <mutex>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cairn/core/detail/file_lock.hpp"
#include "cairn/core/detail/files_read.hpp"
#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"

namespace cairn {
namespace {

constexpr std::size_t kBlockSize = std::size_t{1} << 20;

std::string reason_of(int error_number) {
  return std::error_code(error_number, std::generic_category()).message();
}

[[noreturn]] void fail_reading(const std::filesystem::path& path, int error_number) {
  throw Error(ErrorKind::kInput, path.string(),
              fmt::format("cannot be read: {}", reason_of(error_number)), "a readable file");
}

[[noreturn]] void fail_writing(const std::filesystem::path& path, int error_number) {
  throw Error(ErrorKind::kStorage, path.string(),
              fmt::format("cannot be written: {}", reason_of(error_number)), "");
}

// Reading the mask requires setting it, so two threads at once could leave it changed.
mode_t file_mode_mask() {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return mask;
}

// Whether changing the mode of one's own file failed because its file system, e.g. FAT, has no modes.
bool has_no_modes(int error_number) {
  return error_number == EPERM || error_number == ENOTSUP || error_number == ENOSYS;
}

// Writes a folder's entries to the disk, e.g. after a rename.
void sync_folder(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder.empty() ? "." : folder;
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0 && errno == EACCES) return;  // a folder that may be written to but not read
  if (descriptor < 0) fail_writing(path, errno);
  const int result = ::fsync(descriptor);
  const int error_number = errno;
  ::close(descriptor);
  // EINVAL: a file system that cannot sync folders.
  if (result != 0 && error_number != EINVAL) fail_writing(path, error_number);
}

// A temporary file beside a destination, locked while it is open. A killed process leaves it behind unlocked;
// the next process that writes to the same destination takes it over.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::filesystem::path& destination) {
    constexpr int kMostAtOnce = 64;        // writers of one destination
    constexpr std::size_t kLongest = 200;  // of the 255 bytes that a name may have
    const std::string name = destination.filename().string().substr(0, kLongest);
    for (int i = 0; i < kMostAtOnce; ++i) {
      const std::string suffix = i == 0 ? std::string() : fmt::format("-{}", i);
      file_.emplace(destination.parent_path() / fmt::format(".{}.cairn-unfinished{}", name, suffix),
                    true);
      error_number_ = file_->error_number();
      if (file_->descriptor() >= 0) {
        if (::ftruncate(file_->descriptor(), 0) == 0) return;
        error_number_ = errno;
        ::unlink(file_->path().c_str());
        file_.reset();
        return;
      }
      const bool is_occupied = error_number_ == 0 || error_number_ == EACCES ||
                               error_number_ == EPERM || error_number_ == ELOOP ||
                               error_number_ == EISDIR;
      if (!is_occupied) return;
    }
    if (error_number_ == 0) error_number_ = EBUSY;
  }

  ~TemporaryFile() {
    // Deleted before it is unlocked, so that no other process takes it over.
    if (descriptor() >= 0 && !is_renamed_) ::unlink(file_->path().c_str());
  }

  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Negative if the file could not be opened.
  int descriptor() const { return file_ ? file_->descriptor() : -1; }
  /// Why it could not be opened.
  int error_number() const { return error_number_; }

  /// Renames the file to its destination, before it is closed so that no other process takes it over.
  bool rename_to(const std::filesystem::path& destination) {
    is_renamed_ = ::rename(file_->path().c_str(), destination.c_str()) == 0;
    return is_renamed_;
  }

 private:
  // If the file system cannot lock files, only the names separate writers.
  std::optional<detail::FileLock> file_;
  int error_number_ = 0;
  bool is_renamed_ = false;
};

// The file that a link stands for, whether it exists or not; `path` itself if it is no link.
std::filesystem::path without_links(std::filesystem::path path) {
  constexpr int kMostLinks = 40;  // as the kernel
  for (int i = 0; i < kMostLinks; ++i) {
    std::error_code error;
    if (!std::filesystem::is_symlink(std::filesystem::symlink_status(path, error))) return path;
    const std::filesystem::path target = std::filesystem::read_symlink(path, error);
    if (error) fail_writing(path, error.value());
    path = path.parent_path() / target;
  }
  fail_writing(path, ELOOP);
}

// A file being written; removed again unless committed.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path) : path_(path) {
    std::error_code ignored;
    const auto status = std::filesystem::status(path, ignored);
    const bool special =
        std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
    if (special) {
      descriptor_ = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
      if (descriptor_ < 0) fail_writing(path, errno);
      return;
    }
    destination_ = without_links(path);
    if (std::filesystem::exists(status) && ::access(destination_.c_str(), W_OK) != 0) {
      fail_writing(path, errno);
    }
    temporary_.emplace(destination_);
    if (temporary_->descriptor() < 0) fail_writing(path, temporary_->error_number());
    // The temporary file is private; give it the permissions of the file it replaces, or of new files.
    struct stat existing = {};
    const bool has_mode = ::stat(destination_.c_str(), &existing) == 0;
    const mode_t mode = has_mode ? existing.st_mode & 07777 : 0666 & ~file_mode_mask();
    if (::fchmod(temporary_->descriptor(), mode) != 0 && !has_no_modes(errno)) {
      fail_writing(path, errno);
    }
  }

  ~OutputFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }

  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(std::string_view bytes) {
    const int descriptor = temporary_ ? temporary_->descriptor() : descriptor_;
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
      if (written < 0) {
        if (errno == EINTR) continue;
        fail_writing(path_, errno);
      }
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }

  void commit(Durability durability) {
    if (!temporary_) {
      if (::close(std::exchange(descriptor_, -1)) != 0) fail_writing(path_, errno);
      return;
    }
    const bool at_once = durability == Durability::kAtOnce;
    if (at_once && ::fsync(temporary_->descriptor()) != 0) fail_writing(path_, errno);
    if (!temporary_->rename_to(destination_)) fail_writing(path_, errno);
    if (at_once) sync_folder(destination_.parent_path());
  }

 private:
  std::filesystem::path path_;
  std::filesystem::path destination_;
  std::optional<TemporaryFile> temporary_;
  int descriptor_ = -1;  // of a device or pipe
};

}  // namespace

FileReader::FileReader(const std::filesystem::path& path) : name_(path.string()) {
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) fail_reading(path, errno);
  try {
    struct stat status = {};
    if (::fstat(descriptor_, &status) != 0) fail_reading(path, errno);
    if (S_ISDIR(status.st_mode)) fail_reading(path, EISDIR);
    if (!S_ISREG(status.st_mode)) return;
    detail::require_no_output(path, status);
    size_ = static_cast<std::uint64_t>(status.st_size);
    detail::note_file_read(path);
  } catch (...) {
    ::close(descriptor_);  // no destructor runs after a failed constructor
    throw;
  }
}

FileReader::~FileReader() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::size_t FileReader::read(char* buffer, std::size_t capacity) {
  for (;;) {
    const ssize_t count = ::read(descriptor_, buffer, capacity);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_reading(name_, errno);
    if (!size_) streamed_ += static_cast<std::uint64_t>(count);
    if (streamed_ > kLongestStream) {
      throw Error(ErrorKind::kInput, name_,
                  fmt::format("more than {} bytes from a pipe or device", kLongestStream),
                  "a regular file for as much");
    }
    return static_cast<std::size_t>(count);
  }
}

void FileReader::rewind() {
  if (::lseek(descriptor_, 0, SEEK_SET) != 0) fail_reading(name_, errno);
}

std::string FileReader::read_at(std::uint64_t offset, std::size_t count) const {
  // A length that a file states may exceed it by far.
  const std::uint64_t there = size_.value_or(0);
  std::string bytes(
      static_cast<std::size_t>(std::min<std::uint64_t>(count, there - std::min(there, offset))),
      '\0');
  std::size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t got = ::pread(descriptor_, bytes.data() + filled, bytes.size() - filled,
                                static_cast<off_t>(offset + filled));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_reading(name_, errno);
    if (got == 0) break;  // another program truncated the file
    filled += static_cast<std::size_t>(got);
  }
  bytes.resize(filled);
  return bytes;
}

MemoryReader::MemoryReader(std::string_view bytes, std::string name)
    : name_(std::move(name)), bytes_(bytes) {}

std::size_t MemoryReader::read(char* buffer, std::size_t capacity) {
  const std::size_t count = bytes_.copy(buffer, capacity, position_);
  position_ += count;
  return count;
}

std::size_t block_size_for(const ByteSource& source) {
  constexpr std::uint64_t kLeast = 4096;
  const std::uint64_t size = source.size().value_or(kBlockSize);
  return static_cast<std::size_t>(std::clamp<std::uint64_t>(size, kLeast - 1, kBlockSize - 1)) + 1;
}

std::string read_all(ByteSource& source) {
  // The size is a hint: a file may grow, and a pipe has none. With one byte more its end shows without growing.
  const std::size_t hint = static_cast<std::size_t>(source.size().value_or(0)) + 1;
  std::string bytes(std::max(hint, block_size_for(source)), '\0');
  std::size_t filled = 0;
  while (const std::size_t count = source.read(bytes.data() + filled, bytes.size() - filled)) {
    filled += count;
    if (filled == bytes.size()) bytes.resize(filled + filled / 2);
  }
  bytes.resize(filled);
  return bytes;
}

std::string read_file(const std::filesystem::path& path) {
  FileReader file(path);
  return read_all(file);
}

LineReader::LineReader(ByteSource& source, std::size_t block_size, LogSink log)
    : source_(source), log_(std::move(log)), buffer_(block_size > 0 ? block_size : 1) {}

std::optional<std::string_view> LineReader::next() {
  for (;;) {
    const char* const found =
        static_cast<const char*>(std::memchr(buffer_.data() + scanned_, '\n', end_ - scanned_));
    if (found != nullptr || (at_end_ && begin_ < end_)) {
      const std::size_t stop =
          found != nullptr ? static_cast<std::size_t>(found - buffer_.data()) : end_;
      std::string_view line(buffer_.data() + begin_, stop - begin_);
      if (line_number_ == 0) line = without_byte_order_mark(line);
      terminated_ = found != nullptr;
      const std::size_t next_begin = stop + (terminated_ ? 1 : 0);
      bytes_ += next_begin - begin_;
      begin_ = scanned_ = next_begin;
      ++line_number_;
      if (!terminated_ && log_ && !trimmed(line).empty()) {
        log_({fmt::format("{}:{}: the last line does not end; the file may have been cut off",
                          source_.name(), line_number_),
              RemarkKind::kLoss});
      }
      return line;
    }
    scanned_ = end_;
    if (end_ - begin_ > kLongestLine) {
      throw Error(ErrorKind::kInput, fmt::format("{}:{}", source_.name(), line_number_ + 1),
                  fmt::format("a line of more than {} bytes", kLongestLine), "a line end before");
    }
    if (at_end_ || !refill()) {
      if (begin_ == end_) return std::nullopt;
    }
  }
}

bool LineReader::refill() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    scanned_ -= begin_;
    begin_ = 0;
  }
  if (end_ == buffer_.size()) buffer_.resize(buffer_.size() * 2);
  const std::size_t count = source_.read(buffer_.data() + end_, buffer_.size() - end_);
  end_ += count;
  at_end_ = count == 0;
  return count > 0;
}

void write_file(const std::filesystem::path& path,
                const std::function<void(const ByteSink& sink)>& produce, Durability durability) {
  OutputFile file(path);
  produce([&](std::string_view bytes) { file.write(bytes); });
  file.commit(durability);
}

void sync_files(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) fail_writing(folder, errno);
  const int result = ::syncfs(descriptor);
  const int error_number = errno;
  ::close(descriptor);
  if (result != 0) fail_writing(folder, error_number);
}

std::string hash_file(const std::filesystem::path& path) {
  FileReader file(path);
  detail::Hasher hasher;
  std::vector<char> block(block_size_for(file));
  while (const std::size_t count = file.read(block.data(), block.size())) {
    hasher.update({block.data(), count});
  }
  return "xxh3:" + to_string(hasher.digest());
}

}  // namespace cairn
