// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// NOLINTBEGIN(readability-identifier-naming): named by libFuzzer
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);
// NOLINTEND(readability-identifier-naming)

namespace cairn::testing {

/// What numbers of a text go wrong with.
constexpr std::array<std::string_view, 26> kInterestingTokens = {
    "0",          "1",
    "2",          "-1",
    "-0",         "-",
    "nan",        "inf",
    "1e400",      "1e-400",
    "1e308",      "5e-324",
    "0.5",        "1e-5",
    "255",        "256",
    "4096",       "65536",
    "2147483647", "4294967295",
    "4294967296", "1e20",
    "9999999",    "1000",
    "100000",     "18446744073709551615"};

/// Mutates text by its tokens and lines, so that a single number of a record that is otherwise
/// right takes an extreme value; byte by byte that hardly ever happens.
inline std::size_t mutate_tokens(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                 unsigned int seed) {
  std::minstd_rand random(seed);
  const auto below = [&](std::size_t count) { return random() % count; };
  std::string text(reinterpret_cast<const char*>(data), size);
  std::vector<std::pair<std::size_t, std::size_t>> tokens;  // begin, size
  std::vector<std::pair<std::size_t, std::size_t>> lines;   // the same, with the end of line
  for (std::size_t i = 0, token = 0, line = 0; i < size; ++i) {
    const bool blank = text[i] == ' ' || text[i] == '\t' || text[i] == '\r' || text[i] == '\n';
    if (blank) token = i + 1;
    if (!blank && (i + 1 == size || std::strchr(" \t\r\n", text[i + 1]) != nullptr)) {
      tokens.emplace_back(token, i + 1 - token);
    }
    if (text[i] == '\n' || i + 1 == size) {
      lines.emplace_back(line, i + 1 - line);
      line = i + 1;
    }
  }
  const std::size_t kind = below(6);
  if (tokens.empty() || kind < 2) return LLVMFuzzerMutate(data, size, max_size);
  const auto [token_begin, token_size] = tokens[below(tokens.size())];
  const auto [line_begin, line_size] = lines[below(lines.size())];
  if (kind == 2) {
    text.replace(token_begin, token_size, kInterestingTokens[below(kInterestingTokens.size())]);
  } else if (kind == 3) {
    const auto [other_begin, other_size] = tokens[below(tokens.size())];
    text.replace(token_begin, token_size, text.substr(other_begin, other_size));
  } else if (kind == 4) {
    text.erase(line_begin, line_size);
  } else {
    text.insert(lines[below(lines.size())].first, text.substr(line_begin, line_size));
  }
  const std::size_t new_size = std::min(text.size(), max_size);
  std::copy_n(text.data(), new_size, data);
  return new_size;
}

}  // namespace cairn::testing

// Named by libFuzzer; this header is for the one source of a target.
// NOLINTBEGIN(readability-identifier-naming,misc-definitions-in-headers)
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned int seed) {
  return cairn::testing::mutate_tokens(data, size, max_size, seed);
}
// NOLINTEND(readability-identifier-naming,misc-definitions-in-headers)
