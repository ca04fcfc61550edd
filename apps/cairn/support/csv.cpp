// SPDX-License-Identifier: BSD-3-Clause
#include "support/csv.hpp"

#include "cairn/core/number_text.hpp"

namespace cairn::cli {

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

}  // namespace cairn::cli
