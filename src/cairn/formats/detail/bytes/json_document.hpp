// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"

// Other systems' JSON files, with errors that name the place.
namespace cairn::detail {

/// Parses a whole source.
/// @throws Error (input) naming the byte that is not JSON or is nested more than 64 levels deep
nlohmann::json read_json(ByteSource& source);

/// Whether a file begins as JSON with this bracket, and one of the texts is among its first bytes.
bool begins_json(const MapInput& input, char bracket,
                 std::initializer_list<std::string_view> texts);

/// A value with its place, e.g. "reconstruction.json: 0/shots/a.jpg".
class JsonValue {
 public:
  JsonValue(const nlohmann::json& json, std::string place)
      : json_(&json), place_(std::move(place)) {}

  const nlohmann::json& json() const { return *json_; }
  const std::string& place() const { return place_; }
  bool has(const char* key) const { return json_->is_object() && json_->contains(key); }

  /// @throws Error (input) unless it is an object with this key
  JsonValue at(const std::string& key) const;
  /// @throws Error (input) unless it is an array with this index
  JsonValue at(std::size_t index) const;
  /// This value. @throws Error (input) unless it is an object or an array, respectively
  const JsonValue& object() const;
  const JsonValue& array() const;
  /// Number of entries. @throws Error (input) unless it is an array
  std::size_t size() const { return array().json_->size(); }
  /// Calls `take` with each entry. @throws Error (input) unless it is an array
  template <class Take>
  void each(const Take& take) const {
    for (std::size_t i = 0; i < size(); ++i) take(at(i));
  }

  /// @throws Error (input) unless it is a finite number
  double number() const;
  /// The number under `key`; `absent` if there is none.
  double number_or(const char* key, double absent) const;
  std::uint64_t unsigned_number(std::uint64_t most) const;
  const std::string& text() const;
  /// An array of `count` numbers.
  std::vector<double> numbers(std::size_t count) const;
  /// A vector from an array of three numbers.
  Eigen::Vector3d vector3() const;

  [[noreturn]] void refuse(std::string_view what, std::string_view expected) const;

 private:
  const nlohmann::json* json_;
  std::string place_;
};

/// Writes a JSON object member by member, and its arrays entry by entry, so that only one entry is in
/// memory.
class JsonMembers {
 public:
  explicit JsonMembers(const ByteSink& sink) : sink_(sink) {}

  void member(std::string_view key, const nlohmann::ordered_json& value);
  /// @param entry returns the value for an index
  template <class Entry>
  void array(std::string_view key, std::size_t count, const Entry& entry) {
    begin(key);
    text_ += '[';
    for (std::size_t i = 0; i < count; ++i) {
      text_ += i == 0 ? "\n" : ",\n";
      text_ += nlohmann::ordered_json(entry(i)).dump();
      flush();
    }
    text_ += ']';
  }
  /// Ends the object.
  void finish();

 private:
  void begin(std::string_view key);
  void flush();

  const ByteSink& sink_;
  std::string text_;
  bool is_first_ = true;
};

}  // namespace cairn::detail
