// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

namespace cairn {

/// Most lists and objects within each other in JSON that is read. Values are copied, compared and printed
/// by recursion, so that the depth of a document takes stack.
inline constexpr std::size_t kDeepestJson = 100;

/// @throws Error (input) naming `name` and the byte where a list or object lies deeper than kDeepestJson
void check_json_depth(std::string_view text, std::string_view name);

/// The one way to read JSON: whatever the text, it takes no more than a little stack.
/// @tparam Json nlohmann::json or nlohmann::ordered_json, which the headers of this library leave out
/// @param name what to call the text in a message, e.g. a file's path
/// @return std::nullopt if the text is no JSON
/// @throws Error (input) if it is nested deeper than kDeepestJson
template <class Json>
std::optional<Json> parse_json(std::string_view text, std::string_view name) {
  check_json_depth(text, name);
  Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) return std::nullopt;
  return std::optional<Json>(std::in_place, std::move(json));
}

}  // namespace cairn
