// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/recording/detail/message_source.hpp"

namespace cairn::detail {

/// Bytes of a file, or of an unpacked chunk of a file; offsets begin at 0.
class Stretch {
 public:
  /// A part of a file; the file must outlive the Stretch.
  Stretch(const FileReader& file, std::uint64_t begin, std::uint64_t size)
      : file_(&file), begin_(begin), size_(size), place_(file.name()) {}
  /// @param place place of the chunk in messages
  Stretch(std::string unpacked, std::string place)
      : bytes_(std::move(unpacked)), size_(bytes_.size()), place_(std::move(place)) {}

  std::uint64_t size() const { return size_; }
  /// Place of a byte in messages.
  std::string place(std::uint64_t offset) const;
  /// @throws Error (input) if the bytes end before
  std::string read(std::uint64_t offset, std::uint64_t count) const;
  template <class Number>
  Number number(std::uint64_t offset) const {
    Number value;
    std::memcpy(&value, read(offset, sizeof value).data(), sizeof value);
    return value;
  }
  /// Reads a text that follows its length of 32 bits, and moves `offset` to the text's end.
  std::string text(std::uint64_t& offset) const;

 private:
  const FileReader* file_ = nullptr;
  std::string bytes_;
  std::uint64_t begin_ = 0;
  std::uint64_t size_ = 0;
  std::string place_;
};

/// A file of records, of which some are chunks of further records: MCAP files and bags of ROS 1. All records outside
/// the chunks are read, from start to end. The index behind a chunk states its messages; a chunk without an index is
/// unpacked.
class ChunkedSource : public MessageSource {
 public:
  std::string read(const RecordedMessage& message, std::size_t most) const final;

 protected:
  enum class RecordKind { kDefinition, kMessage, kChunk, kIndex, kEnd, kOther };
  struct Record {
    RecordKind kind = RecordKind::kOther;
    std::uint8_t code = 0;    // record kind of the format
    std::string head;         // fields of a ROS 1 record
    std::uint64_t begin = 0;  // offset of the body
    std::uint64_t end = 0;    // of body and record
  };
  struct Chunk {
    std::uint64_t begin = 0;  // offset of the packed bytes in the file
    std::uint64_t packed_size = 0;
    std::uint64_t size = 0;
    std::string compression;     // empty: none
    std::uint32_t checksum = 0;  // CRC-32 of the unpacked bytes; 0 if unknown
  };
  struct Message {
    std::uint32_t topic = 0;  // the format's own id
    std::uint64_t time_ns = 0;
    std::uint64_t begin = 0;  // offset of its bytes; in an index, of its record
  };

  ChunkedSource(const std::filesystem::path& path) : file_(path) {}

  virtual Record record_at(const Stretch& stretch, std::uint64_t offset) const = 0;
  /// Calls define_topic() for a topic.
  virtual void define(const Stretch& stretch, const Record& record) = 0;
  virtual Message message_of(const Stretch& stretch, const Record& record) const = 0;
  virtual Chunk chunk_of(const Stretch& stretch, const Record& record) const = 0;
  virtual std::vector<Message> index_of(const Stretch& stretch, const Record& record) const = 0;

  void define_topic(std::uint32_t id, RecordedTopic topic);
  /// Fills topics and messages; `start` is the first record's offset.
  void scan(std::uint64_t start, const LogSink& log);

 private:
  static constexpr std::uint32_t kNoChunk = ~std::uint32_t{0};

  std::shared_ptr<const Stretch> stretch_of(std::uint32_t chunk) const;
  void add_message(const Message& message, std::uint32_t chunk, std::uint64_t place);
  bool scan_file(std::uint64_t start, const Stretch& whole, const LogSink& log);
  void scan_chunk();
  void end_chunk(bool is_index_complete, const LogSink& log);

  FileReader file_;
  std::vector<Chunk> chunks_;
  std::map<std::uint32_t, std::uint32_t> topic_of_;  // positions in topics, by the format's id
  // Messages of the chunk that was read last, as far as its index has been read.
  std::vector<Message> indexed_;
  bool is_chunk_open_ = false;

  struct CachedChunk {
    std::uint32_t chunk;
    std::shared_ptr<const Stretch> stretch;
  };
  mutable std::mutex mutex_;
  mutable std::deque<CachedChunk> cache_;  // the most recently used first
};

}  // namespace cairn::detail
