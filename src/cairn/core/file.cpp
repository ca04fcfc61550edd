// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cairn/core/error.hpp"
#include "cairn/core/hash.hpp"

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

// The mask can be read only by setting it: two threads at once would leave it changed.
mode_t file_mode_mask() {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return mask;
}

// A file being written; removed again unless committed.
class OutputFile {
 public:
  explicit OutputFile(const std::filesystem::path& path) : path_(path) {
    std::error_code ignored;
    const auto status = std::filesystem::status(path, ignored);
    const bool special =
        std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
    if (std::filesystem::is_directory(status)) fail_writing(path, EISDIR);
    if (special) {
      descriptor_ = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
      if (descriptor_ < 0) fail_writing(path, errno);
      return;
    }
    destination_ = path;
    if (std::filesystem::is_symlink(std::filesystem::symlink_status(path, ignored))) {
      destination_ = std::filesystem::weakly_canonical(path);
    }
    if (std::filesystem::exists(status) && ::access(destination_.c_str(), W_OK) != 0) {
      fail_writing(path, errno);
    }
    temporary_ = destination_.string() + ".XXXXXX";
    descriptor_ = ::mkostemp(temporary_.data(), O_CLOEXEC);
    if (descriptor_ < 0) {
      const int error_number = errno;
      temporary_.clear();
      fail_writing(path, error_number);
    }
    // mkostemp makes the file private; give it the rights the user's new files have, or had.
    struct stat existing = {};
    if (::stat(destination_.c_str(), &existing) == 0) {
      ::fchmod(descriptor_, existing.st_mode & 07777);
    } else {
      ::fchmod(descriptor_, 0666 & ~file_mode_mask());
    }
  }

  ~OutputFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
  }

  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0) {
        if (errno == EINTR) continue;
        fail_writing(path_, errno);
      }
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }

  void commit(Durability durability) {
    if (!temporary_.empty() && durability == Durability::kAtOnce && ::fsync(descriptor_) != 0) {
      fail_writing(path_, errno);
    }
    if (::close(std::exchange(descriptor_, -1)) != 0) fail_writing(path_, errno);
    if (temporary_.empty()) return;
    if (::rename(temporary_.c_str(), destination_.c_str()) != 0) fail_writing(path_, errno);
    temporary_.clear();
  }

 private:
  std::filesystem::path path_;
  std::filesystem::path destination_;
  std::string temporary_;
  int descriptor_ = -1;
};

}  // namespace

FileReader::FileReader(const std::filesystem::path& path) : name_(path.string()) {
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0) fail_reading(path, errno);
  struct stat status = {};
  const bool known = ::fstat(descriptor_, &status) == 0;
  if (!known || S_ISDIR(status.st_mode)) {
    const int error_number = known ? EISDIR : errno;
    ::close(std::exchange(descriptor_, -1));
    fail_reading(path, error_number);
  }
  if (S_ISREG(status.st_mode)) size_ = static_cast<std::uint64_t>(status.st_size);
}

FileReader::~FileReader() {
  if (!mapped_.empty()) ::munmap(const_cast<char*>(mapped_.data()), mapped_.size());
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::size_t FileReader::read(char* buffer, std::size_t capacity) {
  for (;;) {
    const ssize_t count = ::read(descriptor_, buffer, capacity);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR) fail_reading(name_, errno);
  }
}

void FileReader::rewind() {
  if (::lseek(descriptor_, 0, SEEK_SET) != 0) fail_reading(name_, errno);
}

std::optional<std::string_view> FileReader::mapped() {
  if (!size_) return std::nullopt;
  if (mapped_.empty() && *size_ > 0) {
    // All pages at once, which page faults would bring one by one; of more, it would delay the start.
    constexpr std::uint64_t kMostPopulated = std::uint64_t{64} << 20;
    const int flags = MAP_PRIVATE | (*size_ <= kMostPopulated ? MAP_POPULATE : 0);
    void* const bytes = ::mmap(nullptr, *size_, PROT_READ, flags, descriptor_, 0);
    if (bytes == MAP_FAILED) return std::nullopt;
    mapped_ = {static_cast<const char*>(bytes), *size_};
  }
  return mapped_;
}

MemoryReader::MemoryReader(std::string_view bytes, std::string name)
    : name_(std::move(name)), bytes_(bytes) {}

std::size_t MemoryReader::read(char* buffer, std::size_t capacity) {
  const std::size_t count = bytes_.copy(buffer, capacity, position_);
  position_ += count;
  return count;
}

std::string read_all(ByteSource& source) {
  std::string bytes;
  std::size_t filled = 0;
  for (;;) {
    // The size is a hint: a file may grow, and a pipe has none.
    const std::size_t hint = static_cast<std::size_t>(source.size().value_or(0)) + 1;
    bytes.resize(std::max({hint, filled + filled / 2, kBlockSize}));
    const std::size_t count = source.read(bytes.data() + filled, bytes.size() - filled);
    filled += count;
    if (count == 0) break;
  }
  bytes.resize(filled);
  return bytes;
}

std::string read_file(const std::filesystem::path& path) {
  FileReader file(path);
  return read_all(file);
}

LineReader::LineReader(ByteSource& source, std::size_t block_size)
    : source_(source), buffer_(block_size > 0 ? block_size : 1) {}

std::optional<std::string_view> LineReader::next() {
  for (;;) {
    const char* const found =
        static_cast<const char*>(std::memchr(buffer_.data() + scanned_, '\n', end_ - scanned_));
    if (found != nullptr || (at_end_ && begin_ < end_)) {
      const std::size_t stop =
          found != nullptr ? static_cast<std::size_t>(found - buffer_.data()) : end_;
      const std::string_view line(buffer_.data() + begin_, stop - begin_);
      terminated_ = found != nullptr;
      const std::size_t next_begin = stop + (terminated_ ? 1 : 0);
      bytes_ += next_begin - begin_;
      begin_ = scanned_ = next_begin;
      ++line_number_;
      return line;
    }
    scanned_ = end_;
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
  Hasher hasher;
  std::vector<char> block(kBlockSize);
  while (const std::size_t count = file.read(block.data(), block.size())) {
    hasher.update({block.data(), count});
  }
  return "xxh3:" + to_string(hasher.digest());
}

}  // namespace cairn
