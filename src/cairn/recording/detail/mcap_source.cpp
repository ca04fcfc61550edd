// SPDX-License-Identifier: BSD-3-Clause
// The MCAP container: https://mcap.dev/spec
#include <map>

#include "cairn/core/error.hpp"
#include "cairn/recording/detail/chunked_source.hpp"

namespace cairn::detail {
namespace {

class McapSource final : public ChunkedSource {
 public:
  McapSource(const std::filesystem::path& path, const LogSink& log) : ChunkedSource(path) {
    scan(kMcapStart.size(), log);
  }

 private:
  enum Opcode : std::uint8_t {
    kSchema = 0x03,
    kChannel = 0x04,
    kMessageCode = 0x05,
    kChunkCode = 0x06,
    kMessageIndex = 0x07,
    kDataEnd = 0x0F,
  };

  static RecordKind kind_of(std::uint8_t code) {
    switch (code) {
      case kSchema:
      case kChannel:
        return RecordKind::kDefinition;
      case kMessageCode:
        return RecordKind::kMessage;
      case kChunkCode:
        return RecordKind::kChunk;
      case kMessageIndex:
        return RecordKind::kIndex;
      case kDataEnd:
        return RecordKind::kEnd;
      default:
        return RecordKind::kOther;
    }
  }

  Record record_at(const Stretch& stretch, std::uint64_t offset) const override {
    constexpr std::uint64_t kHead = 9;  // code and size
    Record record;
    record.code = stretch.number<std::uint8_t>(offset);
    record.kind = kind_of(record.code);
    record.begin = offset + kHead;
    const auto size = stretch.number<std::uint64_t>(offset + 1);
    reject_if(size > stretch.size() - record.begin, stretch.place(offset),
              "a record longer than what is left", "an undamaged file");
    record.end = record.begin + size;
    return record;
  }

  void define(const Stretch& stretch, const Record& record) override {
    const auto id = stretch.number<std::uint16_t>(record.begin);
    std::uint64_t at = record.begin + sizeof id;
    if (record.code == kSchema) {
      schemas_.emplace(id, ros1_type(stretch.text(at)));
      return;
    }
    const auto schema = schemas_.find(stretch.number<std::uint16_t>(at));
    at += sizeof id;
    RecordedTopic topic;
    topic.name = stretch.text(at);
    topic.encoding = stretch.text(at);
    if (schema != schemas_.end()) topic.type = schema->second;
    define_topic(id, std::move(topic));
  }

  Message message_of(const Stretch& stretch, const Record& record) const override {
    // Topic, number, times of recording and of sending.
    constexpr std::uint64_t kHead = 2 + 4 + 8 + 8;
    reject_if(record.end - record.begin < kHead, stretch.place(record.begin),
              "a message without its head", "an undamaged file");
    return {stretch.number<std::uint16_t>(record.begin),
            stretch.number<std::uint64_t>(record.begin + 6), record.begin + kHead};
  }

  Chunk chunk_of(const Stretch& stretch, const Record& record) const override {
    Chunk chunk;
    chunk.size = stretch.number<std::uint64_t>(record.begin + 16);
    chunk.checksum = stretch.number<std::uint32_t>(record.begin + 24);
    std::uint64_t at = record.begin + 28;  // behind times, size and checksum
    chunk.compression = stretch.text(at);
    chunk.packed_size = stretch.number<std::uint64_t>(at);
    chunk.begin = at + 8;
    reject_if(chunk.begin > record.end || chunk.packed_size > record.end - chunk.begin,
              stretch.place(record.begin), "a chunk longer than its record", "an undamaged file");
    return chunk;
  }

  std::vector<Message> index_of(const Stretch& stretch, const Record& record) const override {
    const auto id = stretch.number<std::uint16_t>(record.begin);
    std::uint64_t at = record.begin + sizeof id;
    const std::string entries = stretch.text(at);
    std::vector<Message> indexed;
    for (std::size_t entry = 0; entry + 16 <= entries.size(); entry += 16) {
      Message message{id};
      std::memcpy(&message.time_ns, entries.data() + entry, 8);
      std::memcpy(&message.begin, entries.data() + entry + 8, 8);
      indexed.push_back(message);
    }
    return indexed;
  }

  std::map<std::uint16_t, std::string> schemas_;  // types, by id
};

}  // namespace

std::unique_ptr<MessageSource> open_mcap(const std::filesystem::path& path, const LogSink& log) {
  return std::make_unique<McapSource>(path, log);
}

}  // namespace cairn::detail
