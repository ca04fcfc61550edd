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
  std::string type;      ///< name in ROS 1: sensor_msgs/Image
  std::string encoding;  ///< message encoding: "cdr" (ROS 2), "ros1" or another
};

/// Location of a message, without its bytes.
struct RecordedMessage {
  std::uint64_t time_ns = 0;  ///< recording time
  std::uint32_t topic = 0;    ///< position in Recording::topics()
  std::uint32_t file = 0;
  std::uint32_t chunk = 0;  ///< chunk of the file; format-specific, as is `place`
  std::uint64_t place = 0;
};

/// ROS messages on disk: a ROS 1 bag (version 2.0), a ROS 2 recording as MCAP or SQLite (.db3), or
/// a folder with the files of one recording. Holds message locations and a few unpacked chunks.
class Recording {
 public:
  /// @param log receives a loss remark with the position at which a damaged or truncated file
  ///        becomes unreadable
  /// @throws Error (input) naming file and byte: another format, or no messages
  explicit Recording(const std::filesystem::path& path, const LogSink& log = {});
  ~Recording();
  Recording(Recording&&) noexcept;
  Recording& operator=(Recording&&) noexcept;

  /// Whether the file has a recording's signature, or the folder holds recordings, alone or with
  /// ROS 2's metadata.yaml.
  static bool is_at(const std::filesystem::path& path);

  const std::string& name() const { return name_; }
  std::span<const RecordedTopic> topics() const { return topics_; }
  /// Sorted by recording time.
  std::span<const RecordedMessage> messages() const { return messages_; }

  /// The bytes of a message, or its first `most` bytes. Thread-safe.
  /// @throws Error (input) naming file and byte if damaged
  std::string read(const RecordedMessage& message, std::size_t most = ~std::size_t{0}) const;

 private:
  std::string name_;
  std::vector<std::unique_ptr<detail::MessageSource>> files_;
  std::vector<RecordedTopic> topics_;
  std::vector<RecordedMessage> messages_;
};

}  // namespace cairn
