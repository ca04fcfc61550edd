// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <bzlib.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include "cairn/recording/messages.hpp"
#include "cairn/storage/sqlite/database.hpp"

// Writers of ROS's recordings, which share no code with the readers.
namespace cairn::testing {

/// The fields of a message, one after another.
class MessageFields {
 public:
  /// @param encoding "ros1", "cdr" or "cdr-be", which is big-endian
  explicit MessageFields(std::string_view encoding)
      : is_cdr_(encoding != "ros1"), is_big_endian_(encoding == "cdr-be") {
    if (is_cdr_) bytes_ = std::string("\0\1\0\0", 4);
    if (is_big_endian_) bytes_[1] = 0;
  }

  template <class Number>
  MessageFields& number(Number value) {
    if (is_cdr_)
      bytes_.resize(4 + (bytes_.size() - 4 + sizeof value - 1) / sizeof value * sizeof value);
    std::array<char, sizeof value> stored;
    std::memcpy(stored.data(), &value, sizeof value);
    if (is_big_endian_) std::reverse(stored.begin(), stored.end());
    bytes_.append(stored.data(), stored.size());
    return *this;
  }
  MessageFields& data(std::string_view bytes) {
    number(static_cast<std::uint32_t>(bytes.size()));
    bytes_ += bytes;
    return *this;
  }
  MessageFields& text(std::string_view words) {
    return data(std::string(words) + (is_cdr_ ? std::string(1, '\0') : ""));
  }
  MessageFields& doubles(std::span<const double> values) {
    for (const double value : values) number(value);
    return *this;
  }
  MessageFields& header(std::uint64_t time_ns, std::string_view frame) {
    if (!is_cdr_) number(std::uint32_t{7});
    number(static_cast<std::uint32_t>(time_ns / 1'000'000'000));
    number(static_cast<std::uint32_t>(time_ns % 1'000'000'000));
    return text(frame);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  bool is_cdr_;
  bool is_big_endian_;
  std::string bytes_;
};

inline std::string image_bytes(std::string_view encoding, std::uint64_t time_ns,
                               const ImageMessage& image) {
  MessageFields fields(encoding);
  fields.header(time_ns, image.header.frame);
  if (image.is_compressed) return fields.text(image.encoding).data(image.data).bytes();
  return fields.number(image.height)
      .number(image.width)
      .text(image.encoding)
      .number(static_cast<std::uint8_t>(image.is_big_endian))
      .number(image.row_bytes)
      .data(image.data)
      .bytes();
}

inline std::string camera_info_bytes(std::string_view encoding, const CameraInfo& info) {
  MessageFields fields(encoding);
  fields.header(0, info.header.frame)
      .number(info.height)
      .number(info.width)
      .text(info.distortion_model)
      .number(static_cast<std::uint32_t>(info.distortion.size()))
      .doubles(info.distortion)
      .doubles(info.intrinsics)
      .doubles(info.rectification)
      .doubles(info.projection);
  for (int i = 0; i < 6; ++i) fields.number(std::uint32_t{0});  // binning and region of interest
  return fields.number(std::uint8_t{0}).bytes();
}

struct WrittenMessage {
  std::string topic;
  std::string type;  // as ROS 1 names it
  std::uint64_t time_ns = 0;
  std::string bytes;
};
using WrittenMessages = std::vector<WrittenMessage>;

/// @param compression "" or "none", "lz4", "zstd" or "bz2"
inline std::string packed(std::string_view compression, const std::string& bytes) {
  if (compression.empty() || compression == "none") return bytes;
  std::string out(bytes.size() * 2 + 4096, '\0');
  if (compression == "lz4") {
    out.resize(LZ4F_compressFrame(out.data(), out.size(), bytes.data(), bytes.size(), nullptr));
  } else if (compression == "zstd") {
    out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 1));
  } else if (compression == "bz2") {
    auto size = static_cast<unsigned>(out.size());
    BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(bytes.data()),
                             static_cast<unsigned>(bytes.size()), 9, 0, 0);
    out.resize(size);
  } else {
    throw std::invalid_argument("compression");
  }
  return out;
}

template <class... Numbers>
std::string little_endian(Numbers... numbers) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&numbers), sizeof numbers), ...);
  return bytes;
}
inline std::string sized(std::string_view text) {
  return little_endian(static_cast<std::uint32_t>(text.size())) + std::string(text);
}

/// What a container holds in a chunk, and how.
struct ContainerOptions {
  std::string compression;
  bool is_indexed = true;  ///< whether an index follows each chunk
  bool is_closed = true;   ///< whether the end is there
  std::size_t messages_a_chunk = 3;
  enum class Checksum { kNone, kRight, kWrong } checksum = Checksum::kNone;  ///< of a chunk of MCAP
};

namespace detail {

inline std::map<std::string, std::uint16_t> topic_numbers(const WrittenMessages& messages) {
  std::map<std::string, std::uint16_t> numbers;
  for (const WrittenMessage& message : messages) {
    numbers.emplace(message.topic, static_cast<std::uint16_t>(numbers.size() + 1));
  }
  return numbers;
}

inline std::string ros2_type(const std::string& type) {
  const std::size_t slash = type.find('/');
  return type.substr(0, slash) + "/msg" + type.substr(slash);
}

inline std::string mcap_record(std::uint8_t code, const std::string& content) {
  return little_endian(code, std::uint64_t{content.size()}) + content;
}

inline std::string bag_fields(const std::vector<std::pair<std::string, std::string>>& fields) {
  std::string head;
  for (const auto& [name, value] : fields) head += sized(name + "=" + value);
  return head;
}

inline std::string bag_record(const std::vector<std::pair<std::string, std::string>>& fields,
                              const std::string& data) {
  return sized(bag_fields(fields)) + sized(data);
}

inline std::string bag_time(std::uint64_t time_ns) {
  return little_endian(static_cast<std::uint32_t>(time_ns / 1'000'000'000),
                       static_cast<std::uint32_t>(time_ns % 1'000'000'000));
}

}  // namespace detail

/// An MCAP file of CDR messages, or of those of ROS 1 (`encoding` "ros1"). Topics are defined in the chunk of their first
/// message, and not again.
inline std::string mcap_bytes(const WrittenMessages& messages, const ContainerOptions& options = {},
                              const std::string& encoding = "cdr") {
  const std::string magic = "\x89MCAP0\r\n";
  std::string file = magic + detail::mcap_record(1, sized("ros2") + sized("test"));
  auto numbers = detail::topic_numbers(messages);
  std::map<std::string, bool> defined;
  for (std::size_t begin = 0; begin < messages.size(); begin += options.messages_a_chunk) {
    std::string chunk;
    std::map<std::uint16_t, std::string> index;
    const std::size_t end = std::min(messages.size(), begin + options.messages_a_chunk);
    for (std::size_t i = begin; i < end; ++i) {
      const WrittenMessage& message = messages[i];
      const std::uint16_t number = numbers.at(message.topic);
      if (!std::exchange(defined[message.topic], true)) {
        const std::string type =
            encoding == "ros1" ? message.type : detail::ros2_type(message.type);
        chunk += detail::mcap_record(
            3, little_endian(number) + sized(type) + sized("ros2msg") + sized(""));
        chunk += detail::mcap_record(
            4, little_endian(number, number) + sized(message.topic) + sized(encoding) + sized(""));
      }
      index[number] += little_endian(message.time_ns, std::uint64_t{chunk.size()});
      chunk += detail::mcap_record(
          5, little_endian(number, std::uint32_t{0}, message.time_ns, message.time_ns) +
                 message.bytes);
    }
    const std::string data = packed(options.compression, chunk);
    auto checksum = static_cast<std::uint32_t>(
        crc32_z(0, reinterpret_cast<const Bytef*>(chunk.data()), chunk.size()));
    if (options.checksum == ContainerOptions::Checksum::kNone) checksum = 0;
    if (options.checksum == ContainerOptions::Checksum::kWrong) ++checksum;
    file += detail::mcap_record(6, little_endian(messages[begin].time_ns, messages[end - 1].time_ns,
                                                 std::uint64_t{chunk.size()}, checksum) +
                                       sized(options.compression) +
                                       little_endian(std::uint64_t{data.size()}) + data);
    for (const auto& [number, entries] : index) {
      if (options.is_indexed)
        file += detail::mcap_record(7, little_endian(number) + sized(entries));
    }
  }
  if (!options.is_closed) return file;
  file += detail::mcap_record(15, little_endian(std::uint32_t{0}));
  return file + detail::mcap_record(2, std::string(20, '\0')) + magic;
}

/// A bag of ROS 1.
inline std::string rosbag_bytes(const WrittenMessages& messages, ContainerOptions options = {}) {
  if (options.compression.empty()) options.compression = "none";
  const auto op = [](char code) { return std::pair{std::string("op"), std::string(1, code)}; };
  std::string file = "#ROSBAG V2.0\n" + detail::bag_record({op(3)}, std::string(100, ' '));
  auto numbers = detail::topic_numbers(messages);
  std::map<std::string, bool> defined;
  for (std::size_t begin = 0; begin < messages.size(); begin += options.messages_a_chunk) {
    std::string chunk;
    std::map<std::uint32_t, std::string> index;
    const std::size_t end = std::min(messages.size(), begin + options.messages_a_chunk);
    for (std::size_t i = begin; i < end; ++i) {
      const WrittenMessage& message = messages[i];
      const std::uint32_t number = numbers.at(message.topic);
      const std::pair<std::string, std::string> connection{"conn", little_endian(number)};
      if (!std::exchange(defined[message.topic], true)) {
        chunk += detail::bag_record(
            {op(7), connection, {"topic", message.topic}},
            detail::bag_fields({{"topic", message.topic}, {"type", message.type}}));
      }
      index[number] += detail::bag_time(message.time_ns) +
                       little_endian(static_cast<std::uint32_t>(chunk.size()));
      chunk += detail::bag_record({op(2), connection, {"time", detail::bag_time(message.time_ns)}},
                                  message.bytes);
    }
    file += detail::bag_record({op(5),
                                {"compression", options.compression},
                                {"size", little_endian(static_cast<std::uint32_t>(chunk.size()))}},
                               packed(options.compression, chunk));
    for (const auto& [number, entries] : index) {
      if (!options.is_indexed) continue;
      const auto count = static_cast<std::uint32_t>(entries.size() / 12);
      file += detail::bag_record({op(4),
                                  {"ver", little_endian(std::uint32_t{1})},
                                  {"conn", little_endian(number)},
                                  {"count", little_endian(count)}},
                                 entries);
    }
  }
  if (options.is_closed) file += detail::bag_record({op(6)}, "");
  return file;
}

/// The SQLite storage of rosbag2.
inline void write_db3(const std::filesystem::path& path, const WrittenMessages& messages) {
  sqlite::Database database(path, {.access = sqlite::Access::kCreate});
  database.execute(
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
      "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER "
      "NOT NULL, data BLOB NOT NULL);");
  sqlite::Transaction transaction(database);
  std::map<std::string, bool> defined;
  const auto numbers = detail::topic_numbers(messages);
  for (const WrittenMessage& message : messages) {
    const std::int64_t topic = numbers.at(message.topic);
    if (!std::exchange(defined[message.topic], true)) {
      database.run("INSERT INTO topics VALUES(?1, ?2, ?3, 'cdr', '')", topic, message.topic,
                   detail::ros2_type(message.type));
    }
    database.run("INSERT INTO messages(topic_id, timestamp, data) VALUES(?1, ?2, ?3)", topic,
                 message.time_ns, std::as_bytes(std::span(message.bytes)));
  }
  transaction.commit();
}

/// Each container with messages of its encoding: by file name.
template <class MessagesOf>
std::vector<std::filesystem::path> write_all_containers(const std::filesystem::path& folder,
                                                        const MessagesOf& messages_of) {
  std::vector<std::filesystem::path> files;
  const auto put = [&](const std::string& name, const std::string& bytes) {
    files.push_back(folder / name);
    std::ofstream(files.back(), std::ios::binary) << bytes;
  };
  const WrittenMessages ros1 = messages_of("ros1");
  const WrittenMessages ros2 = messages_of("cdr");
  for (const char* const compression : {"none", "bz2", "lz4"}) {
    put(std::string(compression) + ".bag", rosbag_bytes(ros1, {compression}));
  }
  for (const char* const compression : {"", "lz4", "zstd"}) {
    put("chunks_" + std::string(compression) + ".mcap", mcap_bytes(ros2, {compression}));
  }
  put("no_index.mcap", mcap_bytes(ros2, {"zstd", false}));
  put("big_endian.mcap", mcap_bytes(messages_of("cdr-be")));
  put("of_ros1.mcap", mcap_bytes(ros1, {}, "ros1"));
  files.push_back(folder / "recording.db3");
  write_db3(files.back(), ros2);
  return files;
}

}  // namespace cairn::testing
