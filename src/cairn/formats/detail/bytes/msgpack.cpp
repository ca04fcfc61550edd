// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/msgpack.hpp"

#include <bit>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint64_t kMostWhole = std::numeric_limits<std::int64_t>::max();

}  // namespace

MsgpackReader::Head MsgpackReader::next(std::string_view field) {
  const std::uint8_t head = in_.u8(field);
  const auto big_endian = [&](int bytes) {
    std::uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value = value << 8 | in_.u8(field);
    return value;
  };
  const auto sized = [&](Kind kind, std::uint64_t size) {
    // Each value takes a byte at least, each pair two.
    const std::uint64_t least = kind == Kind::kMap ? 2 : 1;
    if (const auto left = in_.bytes_left(); left && size > *left / least) {
      in_.refuse(field, fmt::format("states a size of {}, but {} bytes are left", size, *left),
                 "no more than there are");
    }
    return Head{kind, size};
  };
  const auto whole = [](std::int64_t value) {
    return Head{Kind::kWhole, 0, static_cast<double>(value), value};
  };
  const auto natural = [&](std::uint64_t value) {
    if (value > kMostWhole) {
      in_.refuse(field, fmt::format("{} is too large", value), "a number of 63 bits");
    }
    return whole(static_cast<std::int64_t>(value));
  };
  const auto number = [](double value) { return Head{Kind::kNumber, 0, value}; };
  if (head < 0x80) return whole(head);
  if (head < 0x90) return sized(Kind::kMap, head & 0x0fU);
  if (head < 0xa0) return sized(Kind::kArray, head & 0x0fU);
  if (head < 0xc0) return sized(Kind::kText, head & 0x1fU);
  if (head >= 0xe0) return whole(static_cast<std::int8_t>(head));
  // Of four heads in a row, each states twice as many bytes as the one before.
  const int bytes_of_four = 1 << (head & 3U);
  switch (head) {
    case 0xc0:
      return {};
    case 0xc2:
    case 0xc3:
      return {Kind::kBool};
    case 0xc4:
    case 0xc5:
    case 0xc6:
      return sized(Kind::kBytes, big_endian(bytes_of_four));
    case 0xc7:
    case 0xc8:
    case 0xc9:  // extensions: a type before the bytes
      return sized(Kind::kBytes, big_endian(1 << (head - 0xc7U)) + 1);
    case 0xca:
      return number(std::bit_cast<float>(static_cast<std::uint32_t>(big_endian(4))));
    case 0xcb:
      return number(std::bit_cast<double>(big_endian(8)));
    case 0xcc:
    case 0xcd:
    case 0xce:
    case 0xcf:
      return natural(big_endian(bytes_of_four));
    case 0xd0:
      return whole(static_cast<std::int8_t>(big_endian(1)));
    case 0xd1:
      return whole(static_cast<std::int16_t>(big_endian(2)));
    case 0xd2:
      return whole(static_cast<std::int32_t>(big_endian(4)));
    case 0xd3:
      return whole(static_cast<std::int64_t>(big_endian(8)));
    case 0xd4:
    case 0xd5:
    case 0xd6:
    case 0xd7:
    case 0xd8:  // extensions of 1, 2, 4, 8, 16 bytes
      return sized(Kind::kBytes, (std::uint64_t{1} << (head - 0xd4U)) + 1);
    case 0xd9:
    case 0xda:
    case 0xdb:
      return sized(Kind::kText, big_endian(1 << (head - 0xd9U)));
    case 0xdc:
    case 0xdd:
      return sized(Kind::kArray, big_endian(2 << (head - 0xdcU)));
    case 0xde:
    case 0xdf:
      return sized(Kind::kMap, big_endian(2 << (head - 0xdeU)));
    default:
      in_.refuse(field, fmt::format("byte {:#04x} begins no value", head), "MessagePack");
  }
}

std::uint64_t MsgpackReader::begin_map(std::string_view field) {
  const Head head = next(field);
  if (head.kind != Kind::kMap) in_.refuse(field, "is no map", "a map");
  return head.size;
}

std::uint64_t MsgpackReader::begin_array(std::string_view field) {
  const Head head = next(field);
  if (head.kind != Kind::kArray) in_.refuse(field, "is no array", "an array");
  return head.size;
}

void MsgpackReader::begin_array(std::string_view field, std::uint64_t size) {
  const std::uint64_t found = begin_array(field);
  if (found != size) {
    in_.refuse(field, fmt::format("has {} entries", found), fmt::format("{} of them", size));
  }
}

std::string MsgpackReader::text(std::string_view field) {
  const Head head = next(field);
  if (head.kind != Kind::kText) in_.refuse(field, "is no text", "a text");
  std::string text;
  for (std::uint64_t i = 0; i < head.size; ++i) text += static_cast<char>(in_.u8(field));
  return text;
}

double MsgpackReader::number(std::string_view field) {
  const double number = number_or_nan(field);
  if (!std::isfinite(number)) in_.refuse(field, "is not finite", "a finite number");
  return number;
}

double MsgpackReader::number_or_nan(std::string_view field) {
  const Head head = next(field);
  if (head.kind != Kind::kNumber && head.kind != Kind::kWhole) {
    in_.refuse(field, "is no number", "a number");
  }
  return head.number;
}

std::int64_t MsgpackReader::whole(std::string_view field) {
  const Head head = next(field);
  if (head.kind != Kind::kWhole) in_.refuse(field, "is no whole number", "a whole number");
  return head.whole;
}

void MsgpackReader::skip() {
  constexpr std::string_view kField = "a value that is passed over";
  std::uint64_t left = 1;
  while (left > 0) {
    --left;
    const Head head = next(kField);
    if (head.kind == Kind::kText || head.kind == Kind::kBytes) {
      for (std::uint64_t i = 0; i < head.size; ++i) in_.u8(kField);
    }
    const bool is_nested = head.kind == Kind::kArray || head.kind == Kind::kMap;
    const std::uint64_t more = !is_nested ? 0 : head.kind == Kind::kMap ? 2 * head.size : head.size;
    left += more;
    if (const auto bytes = in_.bytes_left(); bytes && left > *bytes) {
      in_.refuse(kField,
                 fmt::format("{} values are to follow, but {} bytes are left", left, *bytes),
                 "no more than there are");
    }
  }
}

}  // namespace cairn::detail
