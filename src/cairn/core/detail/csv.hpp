// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cairn::detail {

/// A table as comma-separated values (RFC 4180, lines end with LF): a header and rows. Numbers are the
/// shortest decimals that parse back; unknown values are empty.
class Csv {
 public:
  /// Rows of a table whose header is elsewhere.
  Csv() = default;
  Csv(std::initializer_list<std::string_view> header);

  /// Appends a cell to the current row.
  Csv& operator<<(std::string_view text);
  Csv& operator<<(double number);
  Csv& operator<<(std::uint64_t number);
  template <class Value>
  Csv& operator<<(const std::optional<Value>& value) {
    return value ? *this << *value : *this << std::string_view();
  }
  void end_row();

  const std::string& text() const { return text_; }

 private:
  void separate();

  std::string text_;
  bool row_begins_ = true;
};

/// One row of a parsed table.
struct CsvRow {
  std::vector<std::string> cells;
  std::uint64_t line = 0;  ///< number of the row's first line, from 1
  std::size_t end = 0;     ///< bytes of the text up to and including the row's line end
};

/// The rows of a text, including its header; leaves out a last row without line end, which may be
/// truncated.
/// @param name name of the text in messages
/// @throws Error (input) naming the line of a quote that is misplaced or not closed, unless the text ends
///        within it
std::vector<CsvRow> parse_csv(std::string_view text, std::string_view name);

}  // namespace cairn::detail
