// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cairn/core/log.hpp"

namespace cairn {

namespace detail {
class MessageSource;
}  // namespace detail

struct RecordedTopic {
  std::string name;
  std::string type;      ///< as ROS 1 names it: sensor_msgs/Image
  std::string encoding;  ///< of its messages: "cdr" (ROS 2), "ros1" or another
};

/// Where a message is, not its bytes.
struct RecordedMessage {
  std::uint64_t time_ns = 0;  ///< when it was recorded
  std::uint32_t topic = 0;    ///< position in Recording::topics()
  std::uint32_t file = 0;
  std::uint32_t chunk = 0;  ///< of the file; what follows is of the file's format
  std::uint64_t place = 0;
};

/// Messages of ROS on disk: a ROS 1 bag (version 2.0), a ROS 2 recording as MCAP or SQLite (.db3), or the folder of one
/// that may be several files. Holds where the messages are, and a few unpacked chunks.
class Recording {
 public:
  /// @param log receives a loss that says where a damaged or truncated file cannot be read further
  /// @throws Error (input) naming file and byte: neither of these formats, or no messages
  explicit Recording(const std::filesystem::path& path, const LogSink& log = {});
  ~Recording();
  Recording(Recording&&) noexcept;
  Recording& operator=(Recording&&) noexcept;

  /// Whether the file begins as one, or the folder holds such files and the metadata.yaml of ROS 2.
  static bool is_at(const std::filesystem::path& path);

  const std::string& name() const { return name_; }
  std::span<const RecordedTopic> topics() const { return topics_; }
  /// In the order of their times.
  std::span<const RecordedMessage> messages() const { return messages_; }

  /// The bytes of a message, or its first `most`. Thread-safe.
  /// @throws Error (input) naming file and byte of damage
  std::string read(const RecordedMessage& message, std::size_t most = ~std::size_t{0}) const;

 private:
  std::string name_;
  std::vector<std::unique_ptr<detail::MessageSource>> files_;
  std::vector<RecordedTopic> topics_;
  std::vector<RecordedMessage> messages_;
};

}  // namespace cairn
