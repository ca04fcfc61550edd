// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/json_document.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/detail/json_text.hpp"
#include "cairn/core/error.hpp"

namespace cairn::detail {

nlohmann::json read_json(ByteSource& source) {
  const std::string text = read_all(source);
  detail::check_json(text, source.name(), std::numeric_limits<std::size_t>::max());
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    throw Error(ErrorKind::kInput, fmt::format("{}: byte {}", source.name(), error.byte),
                "is not JSON", "a JSON document");
  } catch (const nlohmann::json::exception&) {  // a number beyond the range of a double
    throw Error(ErrorKind::kInput, source.name(), "holds a number out of range", "numbers");
  }
}

bool begins_json(const MapInput& input, char bracket,
                 std::initializer_list<std::string_view> texts) {
  const std::size_t first = input.first_bytes.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && input.first_bytes[first] == bracket &&
         std::any_of(texts.begin(), texts.end(), [&](std::string_view text) {
           return input.first_bytes.find(text) != std::string_view::npos;
         });
}

JsonValue JsonValue::at(const std::string& key) const {
  object();
  const auto found = json_->find(key);
  if (found == json_->end()) refuse("has no " + printable(key), "an object with " + printable(key));
  const bool is_plain =
      std::all_of(key.begin(), key.end(), [](char c) { return c >= ' ' && c < 127; });
  return {*found, place_ + "/" + (is_plain ? key : printable(key))};
}

JsonValue JsonValue::at(std::size_t index) const {
  array();
  if (index >= json_->size()) {
    refuse(fmt::format("has {} entries", json_->size()), fmt::format("at least {}", index + 1));
  }
  return {(*json_)[index], fmt::format("{}/{}", place_, index)};
}

const JsonValue& JsonValue::object() const {
  if (!json_->is_object()) refuse(std::string("is of type ") + json_->type_name(), "an object");
  return *this;
}

const JsonValue& JsonValue::array() const {
  if (!json_->is_array()) refuse(std::string("is of type ") + json_->type_name(), "an array");
  return *this;
}

double JsonValue::number() const {
  if (!json_->is_number()) refuse(std::string("is of type ") + json_->type_name(), "a number");
  const double value = json_->get<double>();
  if (!std::isfinite(value)) refuse("is not finite", "a number");
  return value;
}

double JsonValue::number_or(const char* key, double absent) const {
  return has(key) ? at(key).number() : absent;
}

std::uint64_t JsonValue::unsigned_number(std::uint64_t most) const {
  const bool is_whole = json_->is_number_unsigned() && json_->get<std::uint64_t>() <= most;
  if (!is_whole) refuse("is no whole number", fmt::format("a whole number from 0 to {}", most));
  return json_->get<std::uint64_t>();
}

const std::string& JsonValue::text() const {
  if (!json_->is_string()) refuse(std::string("is of type ") + json_->type_name(), "a text");
  return json_->get_ref<const std::string&>();
}

std::vector<double> JsonValue::numbers(std::size_t count) const {
  if (size() != count) {
    refuse(fmt::format("has {} entries", size()), fmt::format("{} numbers", count));
  }
  std::vector<double> numbers;
  each([&](const JsonValue& value) { numbers.push_back(value.number()); });
  return numbers;
}

Eigen::Vector3d JsonValue::vector3() const {
  return Eigen::Map<const Eigen::Vector3d>(numbers(3).data());
}

void JsonValue::refuse(std::string_view what, std::string_view expected) const {
  throw Error(ErrorKind::kInput, place_, what, expected);
}

void JsonMembers::begin(std::string_view key) {
  text_ += is_first_ ? "{\n" : ",\n";
  is_first_ = false;
  text_ += nlohmann::ordered_json(key).dump() + ": ";
}

void JsonMembers::member(std::string_view key, const nlohmann::ordered_json& value) {
  begin(key);
  text_ += value.dump();
}

void JsonMembers::flush() {
  constexpr std::size_t kLarge = std::size_t{1} << 20;
  if (text_.size() < kLarge) return;
  sink_(text_);
  text_.clear();
}

void JsonMembers::finish() {
  text_ += "\n}\n";
  sink_(text_);
}

}  // namespace cairn::detail
