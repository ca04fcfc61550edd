// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"

namespace cairn::detail {

/// Keeps the order in which fields are set.
using Json = nlohmann::ordered_json;

/// A value of a JSON document with its file and path, which every error names. The document must outlive the
/// field. An absent member reads as null.
class JsonField {
 public:
  JsonField(const Json& value, std::string file, std::string path)
      : value_(&value), file_(std::move(file)), path_(std::move(path)) {}

  /// @throws Error (input) that names file, path and value
  [[noreturn]] void refuse(std::string_view expected) const {
    throw Error(ErrorKind::kInput, file_, fmt::format("{} is {}", path_, shown()), expected);
  }

  JsonField operator[](const char* name) const {
    static const Json absent;
    const bool present = value_->is_object() && value_->contains(name);
    return {present ? value_->at(name) : absent, file_, path_.empty() ? name : path_ + "." + name};
  }

  std::vector<JsonField> items() const {
    if (!value_->is_array()) refuse("a list");
    std::vector<JsonField> fields;
    for (std::size_t i = 0; i < value_->size(); ++i) {
      fields.push_back({(*value_)[i], file_, fmt::format("{}[{}]", path_, i)});
    }
    return fields;
  }

  bool is_null() const { return value_->is_null(); }
  const Json& json() const { return *value_; }
  const std::string& file() const { return file_; }
  const std::string& path() const { return path_; }

  double number() const {
    if (!value_->is_number()) refuse("a number");
    return value_->get<double>();
  }
  std::size_t whole(std::uint64_t most) const {
    if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() > most) {
      refuse(fmt::format("a whole number of at most {}", most));
    }
    return value_->get<std::size_t>();
  }
  std::string text() const {
    if (!value_->is_string()) refuse("text");
    return value_->get<std::string>();
  }
  bool truth() const {
    if (!value_->is_boolean()) refuse("true or false");
    return value_->get<bool>();
  }
  /// Rows of equally many numbers, row-major.
  template <std::size_t kRows, std::size_t kColumns>
  std::array<double, kRows * kColumns> rows() const {
    const std::string expected = fmt::format("{} rows of {} numbers", kRows, kColumns);
    if (!value_->is_array() || value_->size() != kRows) refuse(expected);
    std::array<double, kRows * kColumns> numbers;
    std::size_t next = 0;
    for (const Json& row : *value_) {
      if (!row.is_array() || row.size() != kColumns) refuse(expected);
      for (const Json& entry : row) {
        if (!entry.is_number()) refuse(expected);
        numbers[next++] = entry.get<double>();
      }
    }
    return numbers;
  }
  template <std::size_t kCount>
  std::array<double, kCount> numbers() const {
    const std::string expected = fmt::format("{} numbers", kCount);
    if (!value_->is_array() || value_->size() != kCount) refuse(expected);
    std::array<double, kCount> numbers;
    for (std::size_t i = 0; i < kCount; ++i) {
      if (!(*value_)[i].is_number()) refuse(expected);
      numbers[i] = (*value_)[i].get<double>();
    }
    return numbers;
  }

  std::optional<double> optional_number() const {
    return is_null() ? std::nullopt : std::optional(number());
  }
  std::optional<std::string> optional_text() const {
    return is_null() ? std::nullopt : std::optional(text());
  }

  /// The element of `values` whose to_string() equals this text.
  template <class Value, std::size_t kCount>
  Value one_of(const std::array<Value, kCount>& values) const {
    const std::string name = text();
    std::string names;
    for (const Value value : values) {
      if (to_string(value) == name) return value;
      names += fmt::format("{}{}", names.empty() ? "" : ", ", to_string(value));
    }
    refuse("one of " + names);
  }

 private:
  std::string shown() const {
    constexpr std::size_t kLongest = 40;
    std::string text = value_->dump(-1, ' ', true, Json::error_handler_t::replace);
    if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
    return text;
  }

  const Json* value_;
  std::string file_;
  std::string path_;
};

}  // namespace cairn::detail
