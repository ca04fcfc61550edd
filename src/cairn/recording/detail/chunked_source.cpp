// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/detail/chunked_source.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/recording/detail/compression.hpp"

namespace cairn::detail {

std::string Stretch::place(std::uint64_t offset) const {
  return file_ != nullptr ? fmt::format("{}: byte {}", place_, begin_ + offset)
                          : fmt::format("{}, unpacked byte {}", place_, offset);
}

std::string Stretch::read(std::uint64_t offset, std::uint64_t count) const {
  const std::uint64_t there = size_ - std::min(size_, offset);
  reject_if(count > there, place(offset), fmt::format("{} bytes are left", there),
            fmt::format("{}", count));
  if (file_ == nullptr) return bytes_.substr(offset, count);
  std::string bytes = file_->read_at(begin_ + offset, count);
  reject_if(bytes.size() < count, place(offset), "the file ends", fmt::format("{} bytes", count));
  return bytes;
}

std::string Stretch::text(std::uint64_t& offset) const {
  const auto length = number<std::uint32_t>(offset);
  std::string result = read(offset + sizeof length, length);
  offset += sizeof length + length;
  return result;
}

void ChunkedSource::define_topic(std::uint32_t id, RecordedTopic topic) {
  if (topic_of_.emplace(id, static_cast<std::uint32_t>(topics.size())).second) {
    topics.push_back(std::move(topic));
  }
}

std::shared_ptr<const Stretch> ChunkedSource::stretch_of(std::uint32_t chunk) const {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(cache_.begin(), cache_.end(),
                                  [&](const CachedChunk& entry) { return entry.chunk == chunk; });
  if (found != cache_.end()) {
    std::rotate(cache_.begin(), found, found + 1);
    return cache_.front().stretch;
  }
  std::shared_ptr<const Stretch> stretch;
  if (chunk == kNoChunk) {
    stretch = std::make_shared<Stretch>(file_, 0, file_.size().value_or(0));
  } else if (const Chunk& its = chunks_.at(chunk); its.compression.empty()) {
    stretch = std::make_shared<Stretch>(file_, its.begin, its.packed_size);
  } else {
    const Stretch packed(file_, its.begin, its.packed_size);
    const std::string place = packed.place(0);
    std::string bytes = unpacked(its.compression, packed.read(0, its.packed_size), its.size, place);
    reject_if(its.checksum != 0 && its.checksum != checksum_of(bytes), place,
              "a chunk that does not match its checksum", "an undamaged file");
    stretch = std::make_shared<Stretch>(std::move(bytes), place);
  }
  // Of two cameras with chunks of their own, each thread reads one or two at a time.
  constexpr std::size_t kCachedChunks = 4;
  cache_.push_front({chunk, stretch});
  if (cache_.size() > kCachedChunks) cache_.pop_back();
  return stretch;
}

std::string ChunkedSource::read(const RecordedMessage& message, std::size_t most) const {
  const auto stretch = stretch_of(message.chunk);
  const Record record = record_at(*stretch, message.place);
  reject_if(record.kind != RecordKind::kMessage, stretch->place(message.place),
            "the index names what is no message", "an undamaged file");
  const Message found = message_of(*stretch, record);
  const auto topic = topic_of_.find(found.topic);
  reject_if(topic == topic_of_.end() || topic->second != message.topic,
            stretch->place(message.place), "the index names a message of another topic",
            "an undamaged file");
  return stretch->read(found.begin, std::min<std::uint64_t>(most, record.end - found.begin));
}

void ChunkedSource::add_message(const Message& message, std::uint32_t chunk, std::uint64_t place) {
  const auto topic = topic_of_.find(message.topic);
  reject_if(topic == topic_of_.end(), file_.name(),
            fmt::format("a message of topic {}, which is not defined", message.topic),
            "topics before their messages");
  messages.push_back({message.time_ns, topic->second, 0, chunk, place});
}

void ChunkedSource::scan_chunk() {
  const auto number = static_cast<std::uint32_t>(chunks_.size() - 1);
  const auto stretch = stretch_of(number);
  for (std::uint64_t at = 0; at < stretch->size();) {
    const Record record = record_at(*stretch, at);
    if (record.kind == RecordKind::kDefinition) define(*stretch, record);
    if (record.kind == RecordKind::kMessage) add_message(message_of(*stretch, record), number, at);
    at = record.end;
  }
}

void ChunkedSource::end_chunk(bool is_index_complete, const LogSink& log) {
  if (!std::exchange(is_chunk_open_, false)) return;
  const std::vector<Message> indexed = std::exchange(indexed_, {});
  const bool knows_topics =
      std::all_of(indexed.begin(), indexed.end(),
                  [&](const Message& message) { return topic_of_.contains(message.topic); });
  if (!is_index_complete || indexed.empty() || !knows_topics) {
    try {
      scan_chunk();
    } catch (const Error& error) {  // the next chunk may be whole
      if (log)
        log({fmt::format("{}; the rest of this chunk is left out", error.what()),
             RemarkKind::kLoss});
    }
    return;
  }
  const auto number = static_cast<std::uint32_t>(chunks_.size() - 1);
  // The index is by topic, and who sorts by time keeps the order of equal ones.
  for (const Message& message : indexed) add_message(message, number, message.begin);
}

bool ChunkedSource::scan_file(std::uint64_t start, const Stretch& whole, const LogSink& log) {
  for (std::uint64_t at = start; at < whole.size();) {
    const Record record = record_at(whole, at);
    if (record.kind == RecordKind::kIndex && is_chunk_open_) {
      const std::vector<Message> more = index_of(whole, record);
      indexed_.insert(indexed_.end(), more.begin(), more.end());
    } else {
      end_chunk(true, log);
    }
    if (record.kind == RecordKind::kEnd) return true;
    if (record.kind == RecordKind::kDefinition) define(whole, record);
    if (record.kind == RecordKind::kMessage) add_message(message_of(whole, record), kNoChunk, at);
    if (record.kind == RecordKind::kChunk) {
      chunks_.push_back(chunk_of(whole, record));
      is_chunk_open_ = true;
    }
    at = record.end;
  }
  end_chunk(false, log);
  return false;
}

void ChunkedSource::scan(std::uint64_t start, const LogSink& log) {
  const Stretch whole(file_, 0, file_.size().value_or(0));
  std::string damage;
  try {
    if (!scan_file(start, whole, log)) {
      damage = whole.place(whole.size()) + ": the end of the recording is missing";
    }
  } catch (const Error& error) {
    damage = error.what();
    end_chunk(false, log);
  }
  if (damage.empty() || !log) return;
  log({fmt::format("{}; the {} messages before it are read", damage, messages.size()),
       RemarkKind::kLoss});
}

}  // namespace cairn::detail
