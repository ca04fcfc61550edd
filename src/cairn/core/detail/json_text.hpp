// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

namespace cairn::detail {

/// Largest nesting depth of JSON that is read. Values are copied, compared and printed by recursion, which
/// needs stack for each level.
inline constexpr std::size_t kDeepestJson = 100;

/// Largest number of keys in an object of ordered JSON, which compares each new key with all earlier keys.
inline constexpr std::size_t kMostOrderedJsonKeys = 1000;

/// Checks JSON before it is parsed.
/// @param most_keys largest number of keys of an object
/// @throws Error (input) naming `name` and the byte, if a list or object is nested deeper than kDeepestJson,
///         or if an object has more keys
void check_json(std::string_view text, std::string_view name, std::size_t most_keys);

/// Parses JSON with bounded stack. All JSON must be read with this function.
/// @tparam Json nlohmann::json or nlohmann::ordered_json, which this header does not include
/// @param name name of the text in messages, e.g. a file's path
/// @return std::nullopt if the text is not JSON
/// @throws Error (input) if the text is nested deeper than kDeepestJson, or if an object of ordered_json has
///         more than kMostOrderedJsonKeys keys
template <class Json>
std::optional<Json> parse_json(std::string_view text, std::string_view name) {
  // Only ordered_json keeps its objects in a vector.
  constexpr bool kIsOrdered = requires(typename Json::object_t object) { object.capacity(); };
  check_json(text, name,
             kIsOrdered ? kMostOrderedJsonKeys : std::numeric_limits<std::size_t>::max());
  Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) return std::nullopt;
  return std::optional<Json>(std::in_place, std::move(json));
}

}  // namespace cairn::detail
