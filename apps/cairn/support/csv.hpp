// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

namespace cairn::cli {

/// A table as comma-separated values (RFC 4180, lines end with LF): a header and rows. Numbers are
/// the shortest decimals that parse back; what is unknown is empty.
class Csv {
 public:
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

}  // namespace cairn::cli
