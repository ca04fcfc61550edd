// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/msgpack.hpp"

#include <bit>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
MsgpackReader::Head MsgpackReader::sized(Kind kind, std::uint64_t size, std::string_view field) {
  // Each value takes a byte at least, each pair two.
  const std::uint64_t least = kind == Kind::kMap ? 2 : 1;
  if (const auto left = in_.bytes_left(); left && size > *left / least) {
    in_.refuse(field, fmt::format("states a size of {}, but {} bytes are left", size, *left),
               "no more than there are");
  }
  return {kind, size};
}

MsgpackReader::Head MsgpackReader::next(std::string_view field) {
  const std::uint8_t head = in_.u8(field);
  const auto big_endian = [&](int bytes) {
    std::uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value = value << 8 | in_.u8(field);
    return value;
  };
  const auto is_in = [&](unsigned first, unsigned last) { return head >= first && head <= last; };
  // Of the heads of a kind, each states twice as many bytes as the one before.
  const auto after = [&](unsigned head_of_one_byte) {
    return big_endian(1 << (head - head_of_one_byte));
  };
  const auto whole = [](std::int64_t value) {
    return Head{Kind::kWhole, 0, static_cast<double>(value), value};
  };
  if (is_in(0x00, 0x7f) || is_in(0xe0, 0xff)) return whole(static_cast<std::int8_t>(head));
  if (is_in(0x80, 0x8f)) return sized(Kind::kMap, head & 0x0fU, field);
  if (is_in(0x90, 0x9f)) return sized(Kind::kArray, head & 0x0fU, field);
  if (is_in(0xa0, 0xbf)) return sized(Kind::kText, head & 0x1fU, field);
  if (head == 0xc0) return {};
  if (is_in(0xc2, 0xc3)) return {Kind::kBool};
  if (is_in(0xc4, 0xc6)) return sized(Kind::kBytes, after(0xc4), field);
  // Extensions have their type before their bytes.
  if (is_in(0xc7, 0xc9)) return sized(Kind::kBytes, after(0xc7) + 1, field);
  if (is_in(0xd4, 0xd8)) return sized(Kind::kBytes, (1U << (head - 0xd4U)) + 1, field);
  if (head == 0xca) {
    return {Kind::kNumber, 0, std::bit_cast<float>(static_cast<std::uint32_t>(big_endian(4)))};
  }
  if (head == 0xcb) return {Kind::kNumber, 0, std::bit_cast<double>(big_endian(8))};
  if (is_in(0xcc, 0xcf)) {
    const std::uint64_t value = after(0xcc);
    if (std::in_range<std::int64_t>(value)) return whole(static_cast<std::int64_t>(value));
    in_.refuse(field, fmt::format("{} is too large", value), "a number of 63 bits");
  }
  if (is_in(0xd0, 0xd3)) {
    const int unused = 64 - (8 << (head - 0xd0));
    return whole(static_cast<std::int64_t>(after(0xd0) << unused) >> unused);
  }
  if (is_in(0xd9, 0xdb)) return sized(Kind::kText, after(0xd9), field);
  if (is_in(0xdc, 0xdd)) return sized(Kind::kArray, after(0xdb), field);
  if (is_in(0xde, 0xdf)) return sized(Kind::kMap, after(0xdd), field);
  in_.refuse(field, fmt::format("byte {:#04x} begins no value", head), "MessagePack");
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
