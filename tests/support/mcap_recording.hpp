// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// A reader of MCAP files (https://mcap.dev/spec) and of Protocol Buffers, written from their specifications and
// sharing nothing with the writer. It checks whatever the file states twice.
namespace cairn::testing {

inline void expect_mcap(bool holds, const std::string& what) {
  if (!holds) throw std::runtime_error("MCAP: " + what);
}

/// Bit by bit: the polynomial of IEEE 802.3, reflected.
inline std::uint32_t plain_crc32(std::string_view bytes) {
  std::uint32_t crc = ~0U;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ (0xEDB88320U & (0U - (crc & 1U)));
  }
  return ~crc;
}

/// Takes numbers and texts off the front of some bytes.
class McapBytes {
 public:
  explicit McapBytes(std::string_view bytes) : bytes_(bytes) {}

  bool empty() const { return bytes_.empty(); }
  std::string_view rest() { return take(bytes_.size()); }
  std::string_view take(std::uint64_t size) {
    expect_mcap(size <= bytes_.size(), "ends too early");
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  template <class Number>
  Number number() {
    Number value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);  // on a little-endian machine
    return value;
  }
  std::string text() { return std::string(sized()); }
  std::string_view sized() { return take(number<std::uint32_t>()); }

 private:
  std::string_view bytes_;
};

struct McapMessage {
  std::string topic;
  std::string schema;
  std::uint64_t time_ns = 0;
  std::string data;
};

struct McapRecording {
  struct Schema {
    std::string name;
    std::string encoding;
    std::string data;
  };
  struct Channel {
    std::uint16_t schema = 0;
    std::string topic;
    std::string encoding;
    std::map<std::string, std::string> metadata;
  };

  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::vector<McapMessage> messages;  ///< in the order of the file
  std::size_t chunks = 0;

  std::vector<McapMessage> of_topic(std::string_view topic) const {
    std::vector<McapMessage> found;
    for (const McapMessage& message : messages) {
      if (message.topic == topic) found.push_back(message);
    }
    return found;
  }
  const Channel& channel(std::string_view topic) const {
    for (const auto& [id, channel] : channels) {
      if (channel.topic == topic) return channel;
    }
    throw std::runtime_error("no topic " + std::string(topic));
  }
};

namespace mcap_detail {

enum : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kSummaryOffset = 14,
  kDataEnd = 15,
};

inline void read_schema(McapRecording& recording, std::string_view content) {
  McapBytes in(content);
  const auto id = in.number<std::uint16_t>();
  McapRecording::Schema schema;
  schema.name = in.text();
  schema.encoding = in.text();
  schema.data = in.text();
  expect_mcap(id != 0 && in.empty(), "schema");
  recording.schemas[id] = schema;
}

inline void read_channel(McapRecording& recording, std::string_view content) {
  McapBytes in(content);
  const auto id = in.number<std::uint16_t>();
  McapRecording::Channel channel;
  channel.schema = in.number<std::uint16_t>();
  channel.topic = in.text();
  channel.encoding = in.text();
  McapBytes metadata(in.sized());
  while (!metadata.empty()) {
    const std::string key = metadata.text();
    channel.metadata[key] = metadata.text();
  }
  expect_mcap(in.empty() && recording.schemas.contains(channel.schema), "channel");
  recording.channels[id] = channel;
}

// Where the messages of a chunk stand in it: channel, time, offset.
using Places = std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>>;

inline Places read_chunk(McapRecording& recording, std::string_view content) {
  McapBytes in(content);
  const auto first = in.number<std::uint64_t>();
  const auto last = in.number<std::uint64_t>();
  const auto size = in.number<std::uint64_t>();
  const auto crc = in.number<std::uint32_t>();
  expect_mcap(in.text().empty() && in.number<std::uint64_t>() == size, "chunk");
  const std::string_view records = in.rest();
  expect_mcap(records.size() == size && plain_crc32(records) == crc, "checksum of a chunk");
  Places places;
  McapBytes next(records);
  for (std::uint64_t at = 0; !next.empty();) {
    const std::uint64_t here = at;
    const auto opcode = next.number<std::uint8_t>();
    const auto length = next.number<std::uint64_t>();
    const std::string_view record = next.take(length);
    at += 9 + length;
    if (opcode == kSchema) {
      read_schema(recording, record);
    } else if (opcode == kChannel) {
      read_channel(recording, record);
    } else {
      expect_mcap(opcode == kMessage, "kind of a record in a chunk");
      McapBytes message(record);
      const auto id = message.number<std::uint16_t>();
      expect_mcap(recording.channels.contains(id), "a message before its channel");
      message.number<std::uint32_t>();
      const auto time = message.number<std::uint64_t>();
      expect_mcap(message.number<std::uint64_t>() == time, "time of publication");
      expect_mcap(time >= first && time <= last, "times of a chunk");
      const auto& channel = recording.channels.at(id);
      recording.messages.push_back({channel.topic, recording.schemas.at(channel.schema).name, time,
                                    std::string(message.rest())});
      places[id].emplace_back(time, here);
    }
  }
  ++recording.chunks;
  return places;
}

}  // namespace mcap_detail

/// Reads a whole file.
/// @throws std::runtime_error for whatever breaks the specification, or an index that is wrong
inline McapRecording read_mcap(std::string_view file) {
  using namespace mcap_detail;
  const std::string magic = "\x89MCAP\x30\r\n";
  expect_mcap(file.size() > 16 && file.starts_with(magic) && file.ends_with(magic), "magic");
  McapRecording recording;
  // Where the records of the file stand, by kind.
  std::map<std::uint8_t, std::vector<std::pair<std::uint64_t, std::string_view>>> found;
  std::map<std::uint64_t, std::uint64_t> ends;
  std::vector<Places> chunk_places;
  bool in_summary = false;
  for (std::uint64_t at = 8; at + 8 < file.size();) {
    McapBytes next(file.substr(at, file.size() - 8 - at));
    const auto opcode = next.number<std::uint8_t>();
    const std::string_view content = next.take(next.number<std::uint64_t>());
    expect_mcap((at == 8) == (opcode == kHeader), "header");
    if (opcode == kChunk) {
      expect_mcap(!in_summary, "a chunk in the summary");
      chunk_places.push_back(read_chunk(recording, content));
    } else if (opcode == kDataEnd) {
      expect_mcap(McapBytes(content).number<std::uint32_t>() == plain_crc32(file.substr(0, at)),
                  "checksum of the data");
      in_summary = true;
    } else if (opcode == kMessageIndex) {
      McapBytes index(content);
      const auto channel = index.number<std::uint16_t>();
      Places& places = chunk_places.back();
      McapBytes entries(index.sized());
      std::vector<std::pair<std::uint64_t, std::uint64_t>> stated;
      while (!entries.empty()) {
        const auto time = entries.number<std::uint64_t>();
        stated.emplace_back(time, entries.number<std::uint64_t>());
      }
      expect_mcap(index.empty() && stated == places[channel], "message index");
    } else {
      expect_mcap(opcode == kHeader || in_summary, "kind of a record of the data");
    }
    found[opcode].emplace_back(at, content);
    at += 9 + content.size();
    ends[found[opcode].back().first] = at;
  }
  expect_mcap(found[kFooter].size() == 1, "footer");
  const auto [footer_at, footer_content] = found[kFooter][0];
  McapBytes footer(footer_content);
  const auto summary_start = footer.number<std::uint64_t>();
  const auto offsets_start = footer.number<std::uint64_t>();
  expect_mcap(summary_start == ends[found[kDataEnd].at(0).first], "start of the summary");
  expect_mcap(offsets_start == found[kSummaryOffset].at(0).first, "start of the summary offsets");
  expect_mcap(footer.number<std::uint32_t>() ==
                  plain_crc32(file.substr(summary_start, footer_at + 9 + 16 - summary_start)),
              "checksum of the summary");
  // The summary repeats what the chunks say.
  expect_mcap(found[kSchema].size() == recording.schemas.size() &&
                  found[kChannel].size() == recording.channels.size(),
              "schemas and channels of the summary");
  for (const auto& [at, content] : found[kSummaryOffset]) {
    McapBytes offset(content);
    const auto& group = found[offset.number<std::uint8_t>()];
    const auto start = offset.number<std::uint64_t>();
    expect_mcap(start == group.at(0).first &&
                    start + offset.number<std::uint64_t>() == ends[group.back().first],
                "summary offset");
  }
  McapBytes statistics(found[kStatistics].at(0).second);
  expect_mcap(statistics.number<std::uint64_t>() == recording.messages.size() &&
                  statistics.number<std::uint16_t>() == recording.schemas.size() &&
                  statistics.number<std::uint32_t>() == recording.channels.size() &&
                  statistics.number<std::uint64_t>() == 0 &&
                  statistics.number<std::uint32_t>() == recording.chunks,
              "counts");
  std::uint64_t first = recording.messages.empty() ? 0 : ~std::uint64_t{0};
  std::uint64_t last = 0;
  for (const McapMessage& message : recording.messages) {
    first = std::min(first, message.time_ns);
    last = std::max(last, message.time_ns);
  }
  expect_mcap(
      statistics.number<std::uint64_t>() == first && statistics.number<std::uint64_t>() == last,
      "times");
  McapBytes counts(statistics.sized());
  while (!counts.empty()) {
    const auto& topic = recording.channels.at(counts.number<std::uint16_t>()).topic;
    expect_mcap(counts.number<std::uint64_t>() == recording.of_topic(topic).size(),
                "count of messages of " + topic);
  }
  expect_mcap(found[kChunkIndex].size() == recording.chunks, "count of chunk indexes");
  for (std::size_t i = 0; i < recording.chunks; ++i) {
    McapBytes index(found[kChunkIndex][i].second);
    index.take(16);  // times, which the chunk states
    const auto [at, content] = found[kChunk][i];
    expect_mcap(
        index.number<std::uint64_t>() == at && at + index.number<std::uint64_t>() == ends[at],
        "place of a chunk");
    McapBytes places(index.sized());
    std::uint64_t expected = ends[at];
    while (!places.empty()) {
      places.number<std::uint16_t>();
      expect_mcap(places.number<std::uint64_t>() == expected, "place of a message index");
      expected = ends[expected];
    }
    expect_mcap(index.number<std::uint64_t>() == expected - ends[at], "length of message indexes");
  }
  return recording;
}

/// A field of a Protocol Buffers message: a number, or bytes (a text, a message, packed values).
struct ProtobufField {
  std::uint64_t number = 0;  ///< bits of a double, too
  std::string bytes;

  double real() const {
    double value;
    std::memcpy(&value, &number, sizeof value);
    return value;
  }
};

/// Fields by their numbers, each in the order of the message.
inline std::map<std::uint32_t, std::vector<ProtobufField>> protobuf_fields(std::string_view bytes) {
  McapBytes in(bytes);
  const auto varint = [&] {
    std::uint64_t value = 0;
    for (unsigned shift = 0;; shift += 7) {
      const auto byte = in.number<std::uint8_t>();
      value |= std::uint64_t{byte & 0x7FU} << shift;
      if (byte < 0x80) return value;
    }
  };
  std::map<std::uint32_t, std::vector<ProtobufField>> fields;
  while (!in.empty()) {
    const std::uint64_t tag = varint();
    ProtobufField field;
    switch (tag & 7U) {
      case 0:
        field.number = varint();
        break;
      case 1:
        field.number = in.number<std::uint64_t>();
        break;
      case 2:
        field.bytes = in.take(varint());
        break;
      case 5:
        field.number = in.number<std::uint32_t>();
        break;
      default:
        throw std::runtime_error("protobuf: unknown wire type");
    }
    fields[static_cast<std::uint32_t>(tag >> 3U)].push_back(field);
  }
  return fields;
}

}  // namespace cairn::testing
