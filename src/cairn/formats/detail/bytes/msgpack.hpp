// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "cairn/formats/detail/bytes/record_reader.hpp"

// Streaming reader of MessagePack (https://msgpack.org).
namespace cairn::detail {

/// Reads the values of a document in order, so that memory does not grow with the file. The caller must know
/// the type of the next value.
/// All functions throw Error (input) naming the byte, if the next value has another type or the source ends.
class MsgpackReader {
 public:
  explicit MsgpackReader(BinaryRecords& in) : in_(in) {}

  /// Number of key-value pairs that follow.
  std::uint64_t begin_map(std::string_view field);
  /// Number of values that follow.
  std::uint64_t begin_array(std::string_view field);
  /// @throws Error (input) also if the array has another size
  void begin_array(std::string_view field, std::uint64_t size);
  std::string text(std::string_view field);
  /// A finite number.
  double number(std::string_view field);
  double number_or_nan(std::string_view field);
  std::int64_t whole(std::string_view field);
  /// Skips a value, including nested values.
  void skip();

  [[noreturn]] void refuse(std::string_view field, std::string_view what,
                           std::string_view expected) const {
    in_.refuse(field, what, expected);
  }
  std::string place() const { return in_.place(); }

 private:
  enum class Kind { kNil, kBool, kWhole, kNumber, kText, kBytes, kArray, kMap };
  struct Head {
    Kind kind = Kind::kNil;
    std::uint64_t size = 0;  // of a text, bytes, an array or a map
    double number = 0.0;
    std::int64_t whole = 0;
  };
  Head sized(Kind kind, std::uint64_t size, std::string_view field);
  // Reads a value without the content of texts, bytes, arrays and maps.
  Head next(std::string_view field);

  BinaryRecords& in_;
};

}  // namespace cairn::detail
