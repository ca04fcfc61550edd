// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

// Protocol Buffers' wire format (https://protobuf.dev/programming-guides/encoding).
namespace cairn::detail {

/// Builds a message field by field; field numbers are those of its .proto description.
class ProtobufMessage {
 public:
  /// For int32, int64, bool and enum; not negative.
  ProtobufMessage& whole(std::uint32_t field, std::uint64_t value);
  ProtobufMessage& fixed32(std::uint32_t field, std::uint32_t value);
  ProtobufMessage& fixed32s(std::uint32_t field, std::span<const std::uint32_t> values);
  ProtobufMessage& real(std::uint32_t field, double value);
  /// @param text UTF-8
  ProtobufMessage& text(std::uint32_t field, std::string_view text) { return bytes(field, text); }
  ProtobufMessage& bytes(std::uint32_t field, std::string_view value);
  ProtobufMessage& message(std::uint32_t field, const ProtobufMessage& message) {
    return bytes(field, message.bytes_);
  }

  const std::string& bytes() const { return bytes_; }

 private:
  void varint(std::uint64_t value);

  std::string bytes_;
};

}  // namespace cairn::detail
