// SPDX-License-Identifier: BSD-3-Clause
// The bags of ROS 1, version 2.0: http://wiki.ros.org/Bags/Format/2.0
#include <optional>

#include "cairn/core/error.hpp"
#include "cairn/recording/detail/chunked_source.hpp"

namespace cairn::detail {
namespace {

// The value of a field of a header: lengths of 32 bits, each before "name=value".
std::optional<std::string_view> bag_field(std::string_view head, std::string_view name) {
  while (head.size() >= 4) {
    std::uint32_t length = 0;
    std::memcpy(&length, head.data(), 4);
    const std::string_view field = head.substr(4, length);
    const std::size_t equals = field.find('=');
    if (equals != std::string_view::npos && field.substr(0, equals) == name) {
      return field.substr(equals + 1);
    }
    head.remove_prefix(4 + field.size());
  }
  return std::nullopt;
}

class RosbagSource final : public ChunkedSource {
 public:
  RosbagSource(const std::filesystem::path& path, const LogSink& log) : ChunkedSource(path) {
    scan(kRosbagStart.size(), log);
  }

 private:
  enum Operation : std::uint8_t {
    kMessageData = 0x02,
    kBagHeader = 0x03,
    kIndexData = 0x04,
    kChunkData = 0x05,
    kChunkInfo = 0x06,
    kConnection = 0x07,
  };

  static RecordKind kind_of(std::uint8_t code) {
    switch (code) {
      case kMessageData:
        return RecordKind::kMessage;
      case kIndexData:
        return RecordKind::kIndex;
      case kChunkData:
        return RecordKind::kChunk;
      case kChunkInfo:  // these close a bag
        return RecordKind::kEnd;
      case kConnection:
        return RecordKind::kDefinition;
      default:
        return RecordKind::kOther;
    }
  }

  static std::string_view text_field(const Stretch& stretch, const Record& record,
                                     std::string_view name) {
    const auto value = bag_field(record.head, name);
    reject_if(!value, stretch.place(record.begin), "a record without " + std::string(name),
              "an undamaged bag");
    return *value;
  }

  template <class Number>
  static Number field(const Stretch& stretch, const Record& record, std::string_view name) {
    const std::string_view value = text_field(stretch, record, name);
    reject_if(value.size() != sizeof(Number), stretch.place(record.begin),
              std::string(name) + " of another size", "an undamaged bag");
    Number number;
    std::memcpy(&number, value.data(), sizeof number);
    return number;
  }

  // Seconds and nanoseconds, each of 32 bits.
  static std::uint64_t nanoseconds_of(std::uint64_t time) {
    return (time & 0xFFFFFFFFU) * 1'000'000'000U + (time >> 32U);
  }

  Record record_at(const Stretch& stretch, std::uint64_t offset) const override {
    Record record;
    record.head = stretch.text(offset);
    record.begin = offset + 4;
    const auto size = stretch.number<std::uint32_t>(offset);
    reject_if(size > stretch.size() - record.begin, stretch.place(offset),
              "a record longer than what is left", "an undamaged bag");
    record.end = record.begin + size;
    record.code = field<std::uint8_t>(stretch, record, "op");
    record.kind = kind_of(record.code);
    // A whole bag without messages is its header, which says that the index would begin behind it.
    if (record.code == kBagHeader && bag_field(record.head, "index_pos") &&
        field<std::uint64_t>(stretch, record, "index_pos") == stretch.size()) {
      record.kind = RecordKind::kEnd;
    }
    return record;
  }

  void define(const Stretch& stretch, const Record& record) override {
    const std::string data = stretch.read(record.begin, record.end - record.begin);
    define_topic(field<std::uint32_t>(stretch, record, "conn"),
                 {std::string(text_field(stretch, record, "topic")),
                  std::string(bag_field(data, "type").value_or("")), "ros1"});
  }

  Message message_of(const Stretch& stretch, const Record& record) const override {
    return {field<std::uint32_t>(stretch, record, "conn"),
            nanoseconds_of(field<std::uint64_t>(stretch, record, "time")), record.begin};
  }

  Chunk chunk_of(const Stretch& stretch, const Record& record) const override {
    Chunk chunk{record.begin, record.end - record.begin,
                field<std::uint32_t>(stretch, record, "size"),
                std::string(text_field(stretch, record, "compression"))};
    if (chunk.compression == "none") chunk.compression.clear();
    return chunk;
  }

  std::vector<Message> index_of(const Stretch& stretch, const Record& record) const override {
    constexpr std::size_t kEntry = 12;  // time and offset
    const auto id = field<std::uint32_t>(stretch, record, "conn");
    const std::string entries = stretch.read(record.begin, record.end - record.begin);
    std::vector<Message> indexed;
    for (std::size_t entry = 0; entry + kEntry <= entries.size(); entry += kEntry) {
      std::uint64_t time = 0;
      std::uint32_t offset = 0;
      std::memcpy(&time, entries.data() + entry, sizeof time);
      std::memcpy(&offset, entries.data() + entry + sizeof time, sizeof offset);
      indexed.push_back({id, nanoseconds_of(time), offset});
    }
    return indexed;
  }
};

}  // namespace

std::unique_ptr<MessageSource> open_rosbag(const std::filesystem::path& path, const LogSink& log) {
  return std::make_unique<RosbagSource>(path, log);
}

}  // namespace cairn::detail
