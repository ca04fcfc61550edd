// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

namespace cairn {

/// Largest nesting depth of JSON that is read. Values are copied, compared and printed by recursion, which
/// needs stack for each level.
inline constexpr std::size_t kDeepestJson = 100;

/// @throws Error (input) naming `name` and the byte if a list or object is nested deeper than kDeepestJson
void check_json_depth(std::string_view text, std::string_view name);

/// Reads JSON with bounded stack; all JSON must be read with it.
/// @tparam Json nlohmann::json or nlohmann::ordered_json, which this header does not include
/// @param name name of the text in messages, e.g. a file's path
/// @return std::nullopt if the text is not JSON
/// @throws Error (input) if it is nested deeper than kDeepestJson
template <class Json>
std::optional<Json> parse_json(std::string_view text, std::string_view name) {
  check_json_depth(text, name);
  Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) return std::nullopt;
  return std::optional<Json>(std::in_place, std::move(json));
}

}  // namespace cairn
