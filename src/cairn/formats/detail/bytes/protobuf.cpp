// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/protobuf.hpp"

#include "cairn/formats/detail/bytes/scalars.hpp"

namespace cairn::detail {
namespace {

// How a field's value is laid out.
enum WireType : std::uint32_t { kVarint = 0, kEightBytes = 1, kSized = 2, kFourBytes = 5 };

constexpr std::uint32_t tag(std::uint32_t field, WireType type) {
  return field << 3U | type;
}

}  // namespace

ProtobufMessage& ProtobufMessage::whole(std::uint32_t field, std::uint64_t value) {
  varint(tag(field, kVarint));
  varint(value);
  return *this;
}

ProtobufMessage& ProtobufMessage::fixed32(std::uint32_t field, std::uint32_t value) {
  varint(tag(field, kFourBytes));
  append_scalar(bytes_, value);
  return *this;
}

ProtobufMessage& ProtobufMessage::fixed32s(std::uint32_t field,
                                           std::span<const std::uint32_t> values) {
  varint(tag(field, kSized));
  varint(4 * values.size());
  for (const std::uint32_t value : values) append_scalar(bytes_, value);
  return *this;
}

ProtobufMessage& ProtobufMessage::real(std::uint32_t field, double value) {
  varint(tag(field, kEightBytes));
  append_scalar(bytes_, value);
  return *this;
}

ProtobufMessage& ProtobufMessage::bytes(std::uint32_t field, std::string_view value) {
  varint(tag(field, kSized));
  varint(value.size());
  bytes_ += value;
  return *this;
}

// Seven bits a byte, the lowest first; all but the last have the high bit.
void ProtobufMessage::varint(std::uint64_t value) {
  for (; value >= 0x80; value >>= 7U) bytes_ += static_cast<char>(value | 0x80U);
  bytes_ += static_cast<char>(value);
}

}  // namespace cairn::detail
