// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace cairn::cli {

/// A JSON value to write. Its objects keep the order in which their members were set. The notation is that of
/// nlohmann-json, which would cost seconds in every source that includes it: {{"name", value}, ...} is an object,
/// {value, ...} an array.
class Json {
 public:
  using Array = std::vector<Json>;
  using Object = std::vector<std::pair<std::string, Json>>;

  Json();
  // Not inlined: a document is built by hundreds of them.
  [[gnu::noinline]] Json(const Json&);
  [[gnu::noinline]] Json(Json&&) noexcept;
  [[gnu::noinline]] Json& operator=(const Json&);
  [[gnu::noinline]] Json& operator=(Json&&) noexcept;
  [[gnu::noinline]] ~Json();
  Json(std::nullptr_t) {}
  Json(bool value) : value_(value) {}
  template <std::unsigned_integral Number>
  Json(Number value) : value_(std::uint64_t{value}) {}
  template <std::signed_integral Number>
  Json(Number value) : value_(std::int64_t{value}) {}
  Json(double value) : value_(value) {}
  Json(std::string value) : value_(std::move(value)) {}
  Json(std::string_view value) : value_(std::string(value)) {}
  Json(const char* value) : value_(std::string(value)) {}
  template <class Value>
  Json(const std::vector<Value>& values) : value_(Array(values.begin(), values.end())) {}
  Json(std::initializer_list<Json> values);
  explicit Json(const nlohmann::ordered_json& json);

  static Json array(std::initializer_list<Json> values = {}) { return Json(Array(values)); }
  static Json object();
  /// @return std::nullopt if `text` is no JSON
  /// @throws Error (input) naming `name` if it is nested too deep; see parse_json()
  static std::optional<Json> parse(std::string_view text, std::string_view name);

  /// The member of this name; null if it did not exist. The value must be an object, or null, which becomes an object.
  Json& operator[](std::string_view name);
  /// The member, or null.
  const Json& at(std::string_view name) const;
  bool contains(std::string_view name) const { return find(name) != nullptr; }
  void erase(std::string_view name);
  /// Sets all members of another object.
  void update(const Json& other);
  /// Appends to an array.
  void push_back(Json value);

  /// The last value of an array that is not empty.
  Json& back();

  bool is_null() const { return std::holds_alternative<std::nullptr_t>(value_); }
  /// Members of an object; empty for another value.
  const Object& members() const;
  /// Number of members of an object, or of values of an array.
  std::size_t size() const;
  bool empty() const { return size() == 0; }
  /// Text; nullptr for other values.
  const std::string* text() const { return std::get_if<std::string>(&value_); }

  /// The value as text. Bytes that are not UTF-8 are replaced.
  /// @param indent of each level; negative: all on one line
  std::string dump(int indent) const;

 private:
  const Json* find(std::string_view name) const;
  nlohmann::ordered_json to_nlohmann() const;

  std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double, std::string, Array,
               Object>
      value_ = nullptr;
};

}  // namespace cairn::cli
