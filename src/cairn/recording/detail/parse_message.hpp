// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/recording/messages.hpp"
#include "cairn/recording/recording.hpp"

namespace cairn::detail {

/// Whether the messages of a topic can be parsed.
inline bool is_readable(const RecordedTopic& topic) {
  return topic.encoding == "cdr" || topic.encoding == "ros1";
}

/// Reads a message and returns `parse(MessageBytes)`.
template <class Parse>
auto parse_message(const Recording& recording, const RecordedMessage& message, const Parse& parse) {
  const RecordedTopic& topic = recording.topics()[message.topic];
  const std::string bytes = recording.read(message);
  return parse(MessageBytes{bytes, topic.encoding, recording.name() + ": " + topic.name});
}

}  // namespace cairn::detail
