// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/json_text.hpp"

#include <array>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {

void check_json(std::string_view text, std::string_view name, std::size_t most_keys) {
  std::size_t depth = 0;
  std::array<std::size_t, kDeepestJson + 1> keys{};  // of the object at each depth
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;  // an escaped quote does not end the string
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kDeepestJson) {
        throw Error(ErrorKind::kInput, fmt::format("{}: byte {}", name, i),
                    "lists and objects are nested too deeply",
                    fmt::format("at most {} within each other", kDeepestJson));
      }
      keys[depth] = 0;
    } else if (c == ':' && depth > 0) {
      if (++keys[depth] > most_keys) {
        throw Error(ErrorKind::kInput, fmt::format("{}: byte {}", name, i),
                    "an object has too many keys", fmt::format("at most {}", most_keys));
      }
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
}

}  // namespace cairn::detail
