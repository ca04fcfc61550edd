// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"

// Readers of binary and text records, shared by the importers.
namespace cairn::detail {

/// Progress over several files that are read one after another.
class ReadingProgress {
 public:
  ReadingProgress(const Execution& execution, std::uint64_t total_bytes)
      : execution_(execution), total_(total_bytes) {}

  /// @param bytes number of bytes read since the last call
  /// @throws Error (cancelled) naming the source, if the caller requested a stop
  void advance(std::uint64_t bytes, const std::string& source);

  const LogSink& log() const { return execution_.log; }

 private:
  const Execution& execution_;
  std::uint64_t total_;
  std::uint64_t read_ = 0;
};

/// Reads little-endian binary records through a buffer of bounded size.
class BinaryRecords {
 public:
  BinaryRecords(ByteSource& source, ReadingProgress& progress);

  std::uint8_t u8(std::string_view field) { return number<std::uint8_t>(field); }
  std::uint32_t u32(std::string_view field) { return number<std::uint32_t>(field); }
  std::int32_t i32(std::string_view field) { return number<std::int32_t>(field); }
  std::uint64_t u64(std::string_view field) { return number<std::uint64_t>(field); }
  float f32(std::string_view field) { return number<float>(field); }
  double f64(std::string_view field) { return number<double>(field); }
  /// The bytes up to a terminating zero, which is skipped.
  std::string text(std::string_view field);

  /// Reads the number of records that follow, each at least `least_bytes` long.
  /// @throws Error (input) if the rest of the source is too short for these records
  std::uint64_t count(std::string_view field, std::uint64_t least_bytes);
  /// Number of records to reserve memory for: `count` if the source has a size, because count() has then
  /// checked it; otherwise 0.
  std::size_t room_for(std::uint64_t count) const;

  /// Number of unread bytes; std::nullopt if the source has no known size.
  std::optional<std::uint64_t> bytes_left() const;
  /// @throws Error (input) if bytes are left
  void expect_end();
  /// "file: byte N" of the last field read.
  std::string place() const;
  /// @throws Error (input) at place()
  [[noreturn]] void refuse(std::string_view field, std::string_view what,
                           std::string_view expected) const;

 private:
  template <class Number>
  Number number(std::string_view field);
  /// Reads until the buffer has at least `least` bytes, or the source ends.
  bool fill(std::size_t least);

  ByteSource& source_;
  ReadingProgress& progress_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t offset_ = 0;  // of begin_ in the source
  std::uint64_t field_offset_ = 0;
};

/// What separates the words of a line.
enum class Separator : char {
  kBlanks = ' ',
  kComma = ',',  ///< words lose their blanks at either end, and may be empty
  kTab = '\t',   ///< words may be empty
};

/// Reads lines of words.
class TextRecords {
 public:
  /// @param logs_cut_line whether a last line without line end is logged as a loss
  TextRecords(ByteSource& source, ReadingProgress& progress,
              Separator separator = Separator::kBlanks, bool logs_cut_line = true);

  /// Moves to the next line, whatever its content. @return false at the end
  bool next_line();
  /// Moves to the next line that is neither blank nor a comment (starting with '#').
  bool next_record();
  std::uint64_t line_number() const { return lines_.line_number(); }
  /// Whether the line has a line end; a last line that was cut off has none.
  bool was_terminated() const { return lines_.line_was_terminated(); }

  /// The next word of the line.
  /// @throws Error (input) if there is none
  std::string_view word(std::string_view field);
  bool has_word();
  /// Takes the rest of the line, without blanks at either end.
  std::string_view rest();
  double number(std::string_view field);
  /// std::nullopt for an empty word.
  std::optional<double> optional_number(std::string_view field);
  /// Like number(), but "nan" and "inf" give NaN.
  double number_or_nan(std::string_view field);
  std::uint64_t unsigned_number(std::string_view field, std::uint64_t most = ~std::uint64_t{0});
  std::int64_t signed_number(std::string_view field);
  /// @throws Error (input) if the line has more words
  void expect_line_end();

  /// "file:line".
  std::string place() const;
  [[noreturn]] void refuse(std::string_view field, std::string_view what,
                           std::string_view expected) const;

 private:
  ByteSource& source_;
  ReadingProgress& progress_;
  LineReader lines_;
  Separator separator_;
  std::string_view line_;  // unread rest of the line
  bool at_end_ = true;     // whether a line with commas or tabs is at its end
  std::uint64_t reported_ = 0;
};

}  // namespace cairn::detail
