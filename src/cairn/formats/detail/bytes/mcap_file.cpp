// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/mcap_file.hpp"

#include <algorithm>
#include <initializer_list>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

#include "cairn/core/error.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/formats/detail/bytes/scalars.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 20;  // a chunk ends at this size
constexpr std::uint64_t kMessageLimit = std::uint64_t{1} << 31;

// Numbers of the kinds of records.
enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

void append_text(std::string& out, std::string_view text) {
  append_scalar(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

void append_record(std::string& out, Opcode opcode, std::string_view content) {
  append_scalar(out, opcode);
  append_scalar(out, std::uint64_t{content.size()});
  out += content;
}

std::string record(Opcode opcode, std::string_view content) {
  std::string bytes;
  append_record(bytes, opcode, content);
  return bytes;
}

std::uint32_t crc_of(std::string_view bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace

void McapWriter::TimeRange::add(std::uint64_t time_ns) {
  first_ns = empty ? time_ns : std::min(first_ns, time_ns);
  last_ns = std::max(last_ns, time_ns);
  empty = false;
}

McapWriter::McapWriter(ByteSink sink) : sink_(std::move(sink)) {
  put(kMcapMagic);
  std::string header;
  append_text(header, "");  // no profile
  append_text(header, fmt::format("cairn {}", kVersion));
  put(record(kHeader, header));
}

std::uint16_t McapWriter::add_schema(std::string_view name, std::string_view encoding,
                                     std::string_view data) {
  std::string content;
  append_scalar(content, ++schema_count_);
  append_text(content, name);
  append_text(content, encoding);
  append_text(content, data);
  append_record(chunk_, kSchema, content);
  append_record(schemas_, kSchema, content);
  return schema_count_;
}

std::uint16_t McapWriter::add_channel(std::uint16_t schema, std::string_view topic,
                                      std::string_view message_encoding, const Metadata& metadata) {
  reject_if(channel_count_ == std::numeric_limits<std::uint16_t>::max(), "MCAP",
            "more than 65535 topics", "fewer maps in one file");
  std::string words;
  for (const auto& [key, value] : metadata) {
    append_text(words, key);
    append_text(words, value);
  }
  std::string content;
  append_scalar(content, ++channel_count_);
  append_scalar(content, schema);
  append_text(content, topic);
  append_text(content, message_encoding);
  append_text(content, words);
  append_record(chunk_, kChannel, content);
  append_record(channels_, kChannel, content);
  return channel_count_;
}

void McapWriter::add_message(std::uint16_t channel, std::uint64_t time_ns, std::string_view data) {
  if (data.size() >= kMessageLimit) {
    throw Error(ErrorKind::kInput, "MCAP", fmt::format("a message of {} bytes", data.size()),
                "fewer than 2^31: fewer landmarks, or without their covariances and columns");
  }
  chunk_index_[channel].push_back({time_ns, chunk_.size()});
  std::string head;
  append_scalar(head, channel);
  append_scalar(head, static_cast<std::uint32_t>(message_counts_[channel]++));
  append_scalar(head, time_ns);
  append_scalar(head, time_ns);
  append_scalar(chunk_, kMessage);
  append_scalar(chunk_, std::uint64_t{head.size() + data.size()});
  chunk_ += head;
  chunk_ += data;
  ++message_count_;
  chunk_times_.add(time_ns);
  times_.add(time_ns);
  if (chunk_.size() >= kChunkBytes) end_chunk();
}

void McapWriter::finish() {
  end_chunk();
  std::string content;
  append_scalar(content, crc_);
  put(record(kDataEnd, content));

  std::string statistics;
  append_scalar(statistics, message_count_);
  append_scalar(statistics, schema_count_);
  append_scalar(statistics, std::uint32_t{channel_count_});
  append_scalar(statistics, std::uint32_t{0});  // attachments
  append_scalar(statistics, std::uint32_t{0});  // metadata records
  append_scalar(statistics, chunk_count_);
  append_scalar(statistics, times_.first_ns);
  append_scalar(statistics, times_.last_ns);
  std::string counts;
  for (const auto& [channel, count] : message_counts_) {
    append_scalar(counts, channel);
    append_scalar(counts, count);
  }
  append_text(statistics, counts);

  // Records are grouped by kind, and followed by the groups' positions.
  const std::uint64_t summary_start = position_;
  std::string summary;
  std::string offsets;
  for (const auto& [opcode, records] : std::initializer_list<std::pair<Opcode, std::string>>{
           {kSchema, schemas_},
           {kChannel, channels_},
           {kStatistics, record(kStatistics, statistics)},
           {kChunkIndex, chunk_indexes_}}) {
    if (records.empty()) continue;
    std::string place;
    append_scalar(place, opcode);
    append_scalar(place, summary_start + summary.size());
    append_scalar(place, std::uint64_t{records.size()});
    append_record(offsets, kSummaryOffset, place);
    summary += records;
  }
  const std::uint64_t offsets_start = summary_start + summary.size();
  summary += offsets;
  // The footer's checksum is of the summary and of the footer itself up to the checksum.
  constexpr std::uint64_t kFooterBytes = 8 + 8 + 4;
  append_scalar(summary, kFooter);
  append_scalar(summary, kFooterBytes);
  append_scalar(summary, summary_start);
  append_scalar(summary, offsets_start);
  append_scalar(summary, crc_of(summary));
  put(summary);
  put(kMcapMagic);
}

void McapWriter::put(std::string_view bytes) {
  sink_(bytes);
  position_ += bytes.size();
  crc_ = crc_of(bytes, crc_);
}

void McapWriter::end_chunk() {
  if (chunk_.empty()) return;
  const std::uint64_t start = position_;
  const std::uint64_t size = chunk_.size();
  std::string head;
  append_scalar(head, chunk_times_.first_ns);
  append_scalar(head, chunk_times_.last_ns);
  append_scalar(head, size);
  append_scalar(head, crc_of(chunk_));
  append_text(head, "");  // not compressed
  append_scalar(head, size);
  std::string begin;
  append_scalar(begin, kChunk);
  append_scalar(begin, head.size() + size);
  put(begin + head);
  put(chunk_);
  const std::uint64_t length = position_ - start;

  std::string places;  // of the message indexes
  const std::uint64_t indexes_start = position_;
  for (const auto& [channel, messages] : chunk_index_) {
    append_scalar(places, channel);
    append_scalar(places, position_);
    std::string entries;
    for (const MessagePlace& message : messages) {
      append_scalar(entries, message.time_ns);
      append_scalar(entries, message.offset);
    }
    std::string content;
    append_scalar(content, channel);
    append_text(content, entries);
    put(record(kMessageIndex, content));
  }

  std::string content;
  append_scalar(content, chunk_times_.first_ns);
  append_scalar(content, chunk_times_.last_ns);
  append_scalar(content, start);
  append_scalar(content, length);
  append_text(content, places);
  append_scalar(content, position_ - indexes_start);
  append_text(content, "");
  append_scalar(content, size);
  append_scalar(content, size);
  append_record(chunk_indexes_, kChunkIndex, content);

  ++chunk_count_;
  chunk_.clear();
  chunk_index_.clear();
  chunk_times_ = {};
}

}  // namespace cairn::detail
