// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/recording.hpp"

#include <algorithm>
#include <system_error>
#include <tuple>
#include <utility>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/recording/detail/message_source.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMetadataFile = "metadata.yaml";

using SourceOpener = std::unique_ptr<detail::MessageSource> (*)(const fs::path&, const LogSink&);

// Null for what is no recording.
SourceOpener opener_of(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return nullptr;
  const std::string start = FileReader(file).read_at(0, detail::kSqliteStart.size());
  if (start.starts_with(detail::kMcapStart)) return &detail::open_mcap;
  if (start.starts_with(detail::kRosbagStart)) return &detail::open_rosbag;
  // Other programs have databases too.
  const bool is_database = start == detail::kSqliteStart && file.extension() == ".db3";
  return is_database ? &detail::open_sqlite : nullptr;
}

// The files of a recording, in the order of their names; none if it is no recording.
std::vector<fs::path> files_of_recording(const fs::path& path) {
  std::vector<fs::path> files;
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) {
    if (opener_of(path) != nullptr) files.push_back(path);
    return files;
  }
  // ROS 2 writes its metadata last: a recorder that was killed leaves nothing but recordings.
  const bool has_metadata = fs::exists(path / kMetadataFile, ignored);
  for (const auto& entry : fs::directory_iterator(path, ignored)) {
    if (opener_of(entry.path()) != nullptr) {
      files.push_back(entry.path());
    } else if (!has_metadata) {
      return {};
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

std::string detail::ros1_type(std::string type) {
  constexpr std::string_view kMiddle = "/msg/";
  const std::size_t at = type.find(kMiddle);
  if (at != std::string::npos) type.replace(at, kMiddle.size(), "/");
  return type;
}

Recording::Recording(const fs::path& path, const LogSink& log) : name_(path.string()) {
  for (const fs::path& file : files_of_recording(path)) {
    std::unique_ptr<detail::MessageSource> source = opener_of(file)(file, log);
    std::vector<std::uint32_t> positions;
    for (const RecordedTopic& topic : source->topics) {
      const auto known =
          std::find_if(topics_.begin(), topics_.end(), [&](const RecordedTopic& other) {
            return std::tie(other.name, other.type, other.encoding) ==
                   std::tie(topic.name, topic.type, topic.encoding);
          });
      positions.push_back(static_cast<std::uint32_t>(known - topics_.begin()));
      if (known == topics_.end()) topics_.push_back(topic);
    }
    for (RecordedMessage message : source->messages) {
      message.topic = positions[message.topic];
      message.file = static_cast<std::uint32_t>(files_.size());
      messages_.push_back(message);
    }
    source->messages = {};
    files_.push_back(std::move(source));
  }
  reject_if(files_.empty(), name_, "is no recording", "a bag of ROS 1, or MCAP or .db3 of ROS 2");
  reject_if(messages_.empty(), name_, "holds no messages", "a recording with messages");
  std::stable_sort(
      messages_.begin(), messages_.end(),
      [](const RecordedMessage& a, const RecordedMessage& b) { return a.time_ns < b.time_ns; });
}

Recording::~Recording() = default;
Recording::Recording(Recording&&) noexcept = default;
Recording& Recording::operator=(Recording&&) noexcept = default;

bool Recording::is_at(const fs::path& path) {
  return !files_of_recording(path).empty();
}

std::string Recording::read(const RecordedMessage& message, std::size_t most) const {
  return files_.at(message.file)->read(message, most);
}

}  // namespace cairn
