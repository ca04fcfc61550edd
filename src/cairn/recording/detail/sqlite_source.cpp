// SPDX-License-Identifier: BSD-3-Clause
// The SQLite storage of rosbag2: tables topics and messages.
#include <algorithm>
#include <limits>
#include <map>
#include <mutex>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/recording/detail/message_source.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {
namespace {

class SqliteSource final : public MessageSource {
 public:
  SqliteSource(const std::filesystem::path& path, const LogSink& log)
      : database_(path, {.immutable = true}) {
    reject_if(!database_.has_table("topics") || !database_.has_table("messages"), path.string(),
              "has no tables topics and messages", "a recording of ROS 2");
    std::map<std::int64_t, std::uint32_t> topic_of;
    sqlite::Statement rows =
        database_.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    while (rows.step()) {
      topic_of.emplace(rows.integer(0), static_cast<std::uint32_t>(topics.size()));
      topics.push_back({std::string(rows.text(1)), ros1_type(std::string(rows.text(2))),
                        std::string(rows.text(3))});
    }
    try {
      // In the order of the table, whose pages are damaged from some place on if the file was cut.
      sqlite::Statement found =
          database_.prepare("SELECT id, topic_id, timestamp FROM messages ORDER BY id");
      while (found.step()) {
        const auto topic = topic_of.find(found.integer(1));
        reject_if(topic == topic_of.end(), path.string(),
                  fmt::format("message {} is of topic {}, which is not defined", found.integer(0),
                              found.integer(1)),
                  "topics of all messages");
        messages.push_back(
            {found.unsigned_integer(2), topic->second, 0, 0, found.unsigned_integer(0)});
      }
    } catch (const Error& error) {
      if (log) {
        log({fmt::format("{}; the {} messages before it are read", error.what(), messages.size()),
             RemarkKind::kLoss});
      }
    }
  }

  std::string read(const RecordedMessage& message, std::size_t most) const override {
    const std::lock_guard lock(mutex_);
    constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
    sqlite::Statement row =
        database_.prepare("SELECT substr(data, 1, ?2) FROM messages WHERE id = ?1");
    row.bind_all(message.place, std::min(most, kMost));
    reject_if(!row.step(), database_.name(),
              fmt::format("message {} is not there any more", message.place), "one recording");
    const std::span<const std::byte> blob = row.blob(0);
    return {reinterpret_cast<const char*>(blob.data()), blob.size()};
  }

 private:
  mutable std::mutex mutex_;
  mutable sqlite::Database database_;
};

}  // namespace

std::unique_ptr<MessageSource> open_sqlite(const std::filesystem::path& path, const LogSink& log) {
  return std::make_unique<SqliteSource>(path, log);
}

}  // namespace cairn::detail
