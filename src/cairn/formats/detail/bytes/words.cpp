// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/words.hpp"

#include <algorithm>

#include "cairn/core/text.hpp"

namespace cairn::detail {

void split_words(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    const std::size_t end = std::min(line.find_first_of(kBlanks), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  split_words(line, words);
  return words;
}

}  // namespace cairn::detail
