// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/csv.hpp"

#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn::detail {

Csv::Csv(std::initializer_list<std::string_view> header) {
  for (const std::string_view name : header) *this << name;
  end_row();
}

Csv& Csv::operator<<(std::string_view text) {
  separate();
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) {
    text_ += text;
    return *this;
  }
  text_ += '"';
  for (const char c : text) {
    if (c == '"') text_ += '"';
    text_ += c;
  }
  text_ += '"';
  return *this;
}

Csv& Csv::operator<<(double number) {
  separate();
  append_number(text_, number);
  return *this;
}

Csv& Csv::operator<<(std::uint64_t number) {
  separate();
  append_number(text_, number);
  return *this;
}

void Csv::end_row() {
  text_ += '\n';
  row_begins_ = true;
}

void Csv::separate() {
  if (!row_begins_) text_ += ',';
  row_begins_ = false;
}

std::vector<CsvRow> parse_csv(std::string_view text, std::string_view name) {
  std::vector<CsvRow> rows;
  CsvRow row;
  std::string cell;
  std::uint64_t line = 1;
  row.line = line;
  const auto refuse = [&](std::string_view what, std::string_view expected) {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", name, line), what, expected);
  };
  enum class State { kCellBegins, kPlain, kQuoted, kQuoteClosed } state = State::kCellBegins;
  const std::size_t first = text.size() - without_byte_order_mark(text).size();
  for (std::size_t i = first; i < text.size(); ++i) {
    const char c = text[i];
    if (state == State::kQuoted) {
      if (c == '"' && i + 1 < text.size() && text[i + 1] == '"') {
        cell += '"';
        ++i;
      } else if (c == '"') {
        state = State::kQuoteClosed;
      } else {
        if (c == '\n') ++line;
        cell += c;
      }
      continue;
    }
    if (c == '"') {
      if (state != State::kCellBegins) refuse("a quote within a cell", "a cell all in quotes");
      state = State::kQuoted;
    } else if (c == ',') {
      row.cells.push_back(std::exchange(cell, {}));
      state = State::kCellBegins;
    } else if (c == '\n') {
      row.cells.push_back(std::exchange(cell, {}));
      row.end = i + 1;
      rows.push_back(std::exchange(row, {}));
      row.line = ++line;
      state = State::kCellBegins;
    } else if (c == '\r' && i + 1 < text.size() && text[i + 1] == '\n') {
      continue;
    } else {
      if (state == State::kQuoteClosed) refuse("text after a closing quote", "a comma");
      cell += c;
      state = State::kPlain;
    }
  }
  return rows;
}

}  // namespace cairn::detail
