// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn::detail {

/// The fields of a line, one after another. Errors name the line and the number of the field. Inline, because maps have
/// millions of fields.
class NumberedFields {
 public:
  NumberedFields(std::string_view line, const std::string& source, std::uint64_t line_number)
      : next_(line.data()),
        end_(line.data() + line.size()),
        source_(source),
        line_number_(line_number) {
    while (end_ != next_ && is_blank(end_[-1])) --end_;
    skip_blanks();
  }

  bool at_end() const { return next_ == end_; }

  std::string_view word(const char* name) {
    begin_field(name);
    const char* const begin = next_;
    while (next_ != end_ && !is_blank(*next_)) ++next_;
    const std::string_view text(begin, static_cast<std::size_t>(next_ - begin));
    skip_blanks();
    return text;
  }

  /// Takes the next field if it is a lone '-'.
  bool take_unknown() {
    if (next_ == end_ || *next_ != '-' || (next_ + 1 != end_ && !is_blank(next_[1]))) return false;
    ++field_;
    ++next_;
    skip_blanks();
    return true;
  }

  double number(const char* name) {
    begin_field(name);
    double value = 0.0;
    const char* const stop = read_six_decimals(next_, end_, value);
    if (stop == nullptr || !is_blank(*stop)) return any_number();
    next_ = stop;
    skip_blanks();
    return value;
  }

  /// A number within the limits of coordinates.
  double coordinate(const char* name) {
    const double value = number(name);
    if (std::abs(value) > kLargestCoordinate) {
      refuse(fmt::format("{:g} is beyond the limit", value), kExpectedCoordinates);
    }
    return value;
  }

  template <class Integer>
  Integer integer(const char* name, const char* expected) {
    begin_field(name);
    Integer value = 0;
    const auto [stop, error] = std::from_chars(next_, end_, value);
    if (error != std::errc{} || (stop != end_ && !is_blank(*stop))) {
      refuse_field("is not one", expected);
    }
    next_ = stop;
    skip_blanks();
    return value;
  }

  std::uint64_t unsigned_integer(const char* name) {
    return integer<std::uint64_t>(name, "an unsigned integer of at most 64 bits");
  }

  std::string_view rest(const char* name) {
    begin_field(name);
    const std::string_view text(next_, static_cast<std::size_t>(end_ - next_));
    next_ = end_;
    return text;
  }

  void expect_end(std::string_view record) {
    if (at_end()) return;
    ++field_;
    name_ = nullptr;
    refuse_field("is too much", fmt::format("the {} record to end here", record));
  }

  /// Refuses the last field taken.
  [[noreturn]] void refuse(std::string_view what, std::string_view expected) const {
    throw Error(ErrorKind::kInput, where(), what, expected);
  }

  /// Refuses the whole line.
  [[noreturn]] void refuse_line(std::string_view what, std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", source_, line_number_), what, expected);
  }

 private:
  void skip_blanks() {
    while (next_ != end_ && is_blank(*next_)) ++next_;
  }

  void begin_field(const char* name) {
    ++field_;
    name_ = name;
    if (next_ == end_) refuse("missing", "more fields on this line");
  }

  // The number that starts at next_, in any notation.
  double any_number() {
    double value = 0.0;
    const char* const begin = next_ + (*next_ == '+' ? 1 : 0);
    const auto [stop, error] = std::from_chars(begin, end_, value);
    const bool whole = error == std::errc{} && (stop == end_ || is_blank(*stop));
    if (!whole || !std::isfinite(value) || (begin != next_ && *begin == '-')) {
      refuse_field("is not a number", "a finite decimal number");
    }
    next_ = stop;
    skip_blanks();
    return value;
  }

  // The field that starts at next_.
  [[noreturn]] void refuse_field(std::string_view what, std::string_view expected) const {
    const char* stop = next_;
    while (stop != end_ && !is_blank(*stop)) ++stop;
    refuse(fmt::format("{} {}", printable({next_, static_cast<std::size_t>(stop - next_)}), what),
           expected);
  }

  std::string where() const {
    return name_ == nullptr
               ? fmt::format("{}:{}: field {}", source_, line_number_, field_)
               : fmt::format("{}:{}: field {} ({})", source_, line_number_, field_, name_);
  }

  const char* next_;
  const char* end_;
  const std::string& source_;
  std::uint64_t line_number_;
  int field_ = 0;
  const char* name_ = nullptr;
};

inline constexpr char kHexDigits[] = "0123456789abcdef";

/// The value of a hexadecimal digit; -1 for another character.
int hex_value(char c);

/// A text in which %NN replaces what would break a line, and blanks at its ends.
std::string escaped(std::string_view text);
/// The text that was escaped. @throws Error (input) for the last field taken
std::string unescaped(std::string_view text, const NumberedFields& fields);

}  // namespace cairn::detail
