// SPDX-License-Identifier: BSD-3-Clause
#include "support/json.hpp"

#include <algorithm>
#include <type_traits>

#include <nlohmann/json.hpp>

#include "cairn/core/detail/json_text.hpp"

namespace cairn::cli {

Json::Json() = default;
Json::Json(const Json&) = default;
Json::Json(Json&&) noexcept = default;
Json& Json::operator=(const Json&) = default;
Json& Json::operator=(Json&&) noexcept = default;
Json::~Json() = default;

Json::Json(std::initializer_list<Json> values) {
  const bool is_object = std::all_of(values.begin(), values.end(), [](const Json& value) {
    const Array* const pair = std::get_if<Array>(&value.value_);
    return pair != nullptr && pair->size() == 2 && pair->front().text() != nullptr;
  });
  if (!is_object) {
    value_ = Array(values);
    return;
  }
  Object& members = value_.emplace<Object>();
  for (const Json& value : values) {
    const Array& pair = std::get<Array>(value.value_);
    members.emplace_back(*pair[0].text(), pair[1]);
  }
}

Json::Json(const nlohmann::ordered_json& json) {
  if (json.is_object()) {
    Object& members = value_.emplace<Object>();
    for (const auto& [name, member] : json.items()) members.emplace_back(name, Json(member));
  } else if (json.is_array()) {
    Array& values = value_.emplace<Array>();
    for (const auto& value : json) values.push_back(Json(value));
  } else if (json.is_string()) {
    value_ = json.get<std::string>();
  } else if (json.is_boolean()) {
    value_ = json.get<bool>();
  } else if (json.is_number_unsigned()) {
    value_ = json.get<std::uint64_t>();
  } else if (json.is_number_integer()) {
    value_ = json.get<std::int64_t>();
  } else if (json.is_number()) {
    value_ = json.get<double>();
  }
}

Json Json::object() {
  Json json;
  json.value_ = Object();
  return json;
}

std::optional<Json> Json::parse(std::string_view text, std::string_view name) {
  const auto json = detail::parse_json<nlohmann::ordered_json>(text, name);
  return json ? std::optional(Json(*json)) : std::nullopt;
}

Json& Json::operator[](std::string_view name) {
  if (is_null()) value_ = Object();
  if (const Json* const found = find(name)) return const_cast<Json&>(*found);
  return std::get<Object>(value_).emplace_back(name, Json()).second;
}

const Json& Json::at(std::string_view name) const {
  static const Json absent;
  const Json* const found = find(name);
  return found == nullptr ? absent : *found;
}

void Json::push_back(Json value) {
  std::get<Array>(value_).push_back(std::move(value));
}

Json& Json::back() {
  return std::get<Array>(value_).back();
}

void Json::erase(std::string_view name) {
  std::erase_if(std::get<Object>(value_), [&](const auto& member) { return member.first == name; });
}

void Json::update(const Json& other) {
  for (const auto& [name, value] : other.members()) (*this)[name] = value;
}

const Json::Object& Json::members() const {
  static const Object none;
  const Object* const members = std::get_if<Object>(&value_);
  return members == nullptr ? none : *members;
}

std::size_t Json::size() const {
  const Array* const values = std::get_if<Array>(&value_);
  return values == nullptr ? members().size() : values->size();
}

std::string Json::dump(int indent) const {
  return to_nlohmann().dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

const Json* Json::find(std::string_view name) const {
  for (const auto& [member, value] : members()) {
    if (member == name) return &value;
  }
  return nullptr;
}

nlohmann::ordered_json Json::to_nlohmann() const {
  return std::visit(
      [](const auto& value) -> nlohmann::ordered_json {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, Array>) {
          auto json = nlohmann::ordered_json::array();
          for (const Json& one : value) json.push_back(one.to_nlohmann());
          return json;
        } else if constexpr (std::is_same_v<Value, Object>) {
          auto json = nlohmann::ordered_json::object();
          // Not through operator[], which compares each name with all before it.
          auto& members = json.template get_ref<nlohmann::ordered_json::object_t&>();
          for (const auto& [name, one] : value) members.emplace_back(name, one.to_nlohmann());
          return json;
        } else {
          return value;
        }
      },
      value_);
}

}  // namespace cairn::cli
