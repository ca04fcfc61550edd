// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/log.hpp"
#include "cairn/recording/recording.hpp"

namespace cairn::detail {

/// One file of a recording.
class MessageSource {
 public:
  virtual ~MessageSource() = default;

  /// Same as Recording::read(), for one of `messages`.
  virtual std::string read(const RecordedMessage& message, std::size_t most) const = 0;

  std::vector<RecordedTopic> topics;
  std::vector<RecordedMessage> messages;  ///< in the order of the file
};

/// First bytes of each format.
inline constexpr std::string_view kMcapStart = "\x89MCAP0\r\n";
inline constexpr std::string_view kRosbagStart = "#ROSBAG V2.0\n";
inline constexpr std::string_view kSqliteStart = "SQLite format 3";

/// @throws Error (input) if the file cannot be opened; damage further on is logged as a loss
std::unique_ptr<MessageSource> open_mcap(const std::filesystem::path& path, const LogSink& log);
std::unique_ptr<MessageSource> open_rosbag(const std::filesystem::path& path, const LogSink& log);
/// @throws Error (input) also for a database without the tables of a recording
std::unique_ptr<MessageSource> open_sqlite(const std::filesystem::path& path, const LogSink& log);

/// A type as ROS 1 names it: without the "msg/" that ROS 2 has in the middle.
std::string ros1_type(std::string type);

}  // namespace cairn::detail
