// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cairn::sqlite {

namespace detail {
struct Connection;
struct StatementHandle;
}  // namespace detail

enum class ColumnType { kInteger, kReal, kText, kBlob, kNull };

/// "integer" etc.
std::string_view to_string(ColumnType type);

/// A compiled statement: bind parameters, step through rows, read columns. Parameters count from 1, like
/// SQL's "?1", columns from 0.
class Statement {
 public:
  Statement(Statement&&) noexcept;
  Statement& operator=(Statement&&) noexcept;
  ~Statement();

  Statement& bind(int parameter, std::int64_t value);
  template <std::integral Integer>
  Statement& bind(int parameter, Integer value) {
    return bind(parameter, static_cast<std::int64_t>(value));
  }
  Statement& bind(int parameter, double value);
  Statement& bind(int parameter, std::string_view text);
  Statement& bind(int parameter, const char* text) {
    return bind(parameter, std::string_view(text));
  }
  Statement& bind(int parameter, const std::string& text) {
    return bind(parameter, std::string_view(text));
  }
  Statement& bind(int parameter, std::span<const std::byte> blob);
  Statement& bind(int parameter, std::nullptr_t);
  template <class Value>
  Statement& bind(int parameter, const std::optional<Value>& value) {
    return value ? bind(parameter, *value) : bind(parameter, nullptr);
  }
  /// Restarts with these as parameters 1, 2, ...; others are NULL.
  template <class... Values>
  Statement& bind_all(const Values&... values) {
    reset();
    int parameter = 0;
    (bind(++parameter, values), ...);
    return *this;
  }

  /// Moves to the next row. @return false at the end; the statement can then run again.
  bool step();
  /// Returns to before the first row and clears the parameters.
  void reset();
  /// bind_all(), then runs to the end.
  template <class... Values>
  void run(const Values&... values) {
    bind_all(values...);
    while (step()) {
    }
  }

  int column_count() const;
  /// Name of the column in the statement.
  std::string column_name(int column) const;
  ColumnType type(int column) const;
  bool is_null(int column) const { return type(column) == ColumnType::kNull; }

  // Columns of the current row. A value of another type throws Error (input) naming file, column, value and
  // constraint. Text and blobs are valid until the next step(), reset() or the end.
  std::int64_t integer(int column) const;
  /// @throws Error (input) also for an integer below 0
  std::uint64_t unsigned_integer(int column) const;
  /// Accepts an integer as a real number.
  double real(int column) const;
  std::string_view text(int column) const;
  std::span<const std::byte> blob(int column) const;

  // std::nullopt for NULL.
  std::optional<std::int64_t> optional_integer(int column) const;
  std::optional<double> optional_real(int column) const;
  std::optional<std::string_view> optional_text(int column) const;
  std::optional<std::span<const std::byte>> optional_blob(int column) const;

 private:
  friend class Database;
  Statement(detail::Connection& connection, std::string_view sql);
  void require(int column, ColumnType type) const;

  std::unique_ptr<detail::StatementHandle> handle_;
};

}  // namespace cairn::sqlite
