// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/core/log.hpp"

namespace cairn {

/// Sequential source of bytes, with a name for messages.
class ByteSource {
 public:
  ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;
  virtual ~ByteSource() = default;

  /// Name for messages; the path of a file.
  virtual const std::string& name() const = 0;
  /// Size in bytes when opened; std::nullopt if unknown, as for a pipe.
  virtual std::optional<std::uint64_t> size() const = 0;
  /// Reads up to `capacity` bytes; 0 means the end.
  /// @throws Error (input) if the operating system fails
  virtual std::size_t read(char* buffer, std::size_t capacity) = 0;
  /// Restarts from the first byte; requires a known size().
  virtual void rewind() = 0;
  /// All bytes of an in-memory source, valid for the source's lifetime; std::nullopt for other
  /// sources. Files are never memory-mapped: access to a file that another program truncates would
  /// kill the process.
  virtual std::optional<std::string_view> in_memory() { return std::nullopt; }
};

/// Largest number of bytes read from a pipe or device, which may be endless.
inline constexpr std::uint64_t kLongestStream = std::uint64_t{1} << 30;

/// Largest number of bytes in a line; bounds the memory for a file without line ends.
inline constexpr std::size_t kLongestLine = std::size_t{1} << 26;

/// A file, pipe or device opened for reading; refuses a directory. Reading more than kLongestStream bytes
/// from a pipe or device throws Error (input).
class FileReader final : public ByteSource {
 public:
  /// @throws Error (input) naming path and reason: missing, a directory, no permission; (misuse)
  ///        for an output named to refuse_to_read()
  explicit FileReader(const std::filesystem::path& path);
  ~FileReader() override;

  const std::string& name() const override { return name_; }
  std::optional<std::uint64_t> size() const override { return size_; }
  std::size_t read(char* buffer, std::size_t capacity) override;
  void rewind() override;
  /// Reads up to `count` bytes of a regular file from `offset`, fewer at its end. Thread-safe with
  /// concurrent read_at() calls; keeps the position of read().
  /// @throws Error (input) if the operating system fails
  std::string read_at(std::uint64_t offset, std::size_t count) const;

 private:
  std::string name_;
  int descriptor_ = -1;
  std::optional<std::uint64_t> size_;
  std::uint64_t streamed_ = 0;  // bytes read, if there is no size
};

/// Bytes in memory; they must outlive the reader.
class MemoryReader final : public ByteSource {
 public:
  MemoryReader(std::string_view bytes, std::string name);

  const std::string& name() const override { return name_; }
  std::optional<std::uint64_t> size() const override { return bytes_.size(); }
  std::size_t read(char* buffer, std::size_t capacity) override;
  void rewind() override { position_ = 0; }
  std::optional<std::string_view> in_memory() override { return bytes_; }

 private:
  std::string name_;
  std::string_view bytes_;
  std::size_t position_ = 0;
};

/// Block size for reads from a source, in bytes: 1 MiB, or the size of a smaller source plus one
/// byte to detect its end. At least 4 KiB, because a file may grow, and /proc files report size 0.
std::size_t block_size_for(const ByteSource& source);

/// Reads the rest of a source.
std::string read_all(ByteSource& source);

/// Reads the content of a file.
/// @throws Error as FileReader
std::string read_file(const std::filesystem::path& path);

/// Reads text line by line without a copy or an allocation per line. Buffers one block, or the
/// longest line if that is longer. Skips a byte order mark before the first line.
class LineReader {
 public:
  /// @param log receives a loss remark if the last line has content but no '\n': possibly truncated
  explicit LineReader(ByteSource& source, LogSink log = {})
      : LineReader(source, block_size_for(source), std::move(log)) {}
  LineReader(ByteSource& source, std::size_t block_size, LogSink log = {});

  /// The next line without its '\n'; std::nullopt at the end. Valid until the next call.
  /// @throws Error (input) for a line of more than kLongestLine bytes
  std::optional<std::string_view> next();
  /// Number of the last line returned, from 1.
  std::uint64_t line_number() const noexcept { return line_number_; }
  /// Whether the last returned line ended with '\n'; false only for a possibly truncated last line.
  bool line_was_terminated() const noexcept { return terminated_; }
  /// Bytes returned so far.
  std::uint64_t bytes_read() const noexcept { return bytes_; }

 private:
  bool refill();

  ByteSource& source_;
  LogSink log_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t scanned_ = 0;
  std::size_t end_ = 0;
  std::uint64_t line_number_ = 0;
  std::uint64_t bytes_ = 0;
  bool terminated_ = true;
  bool at_end_ = false;
};

/// Receives the bytes of a file in pieces.
using ByteSink = std::function<void(std::string_view bytes)>;

/// When the bytes of a written file reach the disk.
enum class Durability {
  kAtOnce,  ///< before write_file returns
  kLater,   ///< when the operating system flushes, or on sync_files: for many files in sequence
};

/// Writes a file atomically: a temporary file in the same folder replaces `path` after `produce`
/// has returned and all bytes are on disk. Follows a symbolic link, even a dangling one; writes
/// directly to a device or pipe. The next call for the same path reuses the temporary file
/// ".NAME.cairn-unfinished" of a killed process of this user. Thread-safe.
/// @param durability with kLater, a crash of the machine may leave the file empty
/// @throws Error (storage) naming path and reason (no such folder, no permission, disk full); an earlier
///        file at `path` then remains
void write_file(const std::filesystem::path& path,
                const std::function<void(const ByteSink& sink)>& produce,
                Durability durability = Durability::kAtOnce);

/// Waits until all data written to the file system of `folder` are on disk.
/// @throws Error (storage) naming the folder
void sync_files(const std::filesystem::path& folder);

/// 128-bit XXH3 hash of a file's bytes: "xxh3:" and 32 hexadecimal digits (as from `xxhsum -H2`).
std::string hash_file(const std::filesystem::path& path);

}  // namespace cairn
