// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"

// Sequential writer of the MCAP container (https://mcap.dev/spec).
namespace cairn::detail {

/// First and last bytes of a file.
inline constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";

/// Writes messages in uncompressed chunks, with all checksums and the indexes for seeking.
class McapWriter {
 public:
  /// Metadata of a channel, by key.
  using Metadata = std::map<std::string, std::string>;

  explicit McapWriter(ByteSink sink);

  /// @return the schema's id
  std::uint16_t add_schema(std::string_view name, std::string_view encoding, std::string_view data);
  /// @param schema id of the schema of the channel's messages
  /// @return the channel's id
  /// @throws Error (input) for more than 65535 channels
  std::uint16_t add_channel(std::uint16_t schema, std::string_view topic,
                            std::string_view message_encoding, const Metadata& metadata = {});
  /// @param time_ns when the message was logged and published
  /// @throws Error (input) for a message of 2 GiB or more, because readers refuse it
  void add_message(std::uint16_t channel, std::uint64_t time_ns, std::string_view data);
  /// Writes the end of the file; nothing may be added afterwards.
  void finish();

 private:
  struct MessagePlace {
    std::uint64_t time_ns;
    std::uint64_t offset;  // in the chunk
  };
  struct TimeRange {
    std::uint64_t first_ns = 0;
    std::uint64_t last_ns = 0;
    bool empty = true;

    void add(std::uint64_t time_ns);
  };

  void put(std::string_view bytes);
  void end_chunk();

  ByteSink sink_;
  std::uint64_t position_ = 0;  // of the file, in bytes
  std::uint32_t crc_ = 0;       // of all bytes so far
  std::string chunk_;           // records
  TimeRange chunk_times_;
  std::map<std::uint16_t, std::vector<MessagePlace>> chunk_index_;
  TimeRange times_;
  std::map<std::uint16_t, std::uint64_t> message_counts_;
  // Records to be repeated in the summary.
  std::string schemas_;
  std::string channels_;
  std::string chunk_indexes_;
  std::uint16_t schema_count_ = 0;
  std::uint16_t channel_count_ = 0;
  std::uint32_t chunk_count_ = 0;
  std::uint64_t message_count_ = 0;
};

}  // namespace cairn::detail
