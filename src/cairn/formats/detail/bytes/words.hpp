// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"

namespace cairn::detail {

/// The words of a line, separated by blanks, as views of the argument.
std::vector<std::string_view> words_of(std::string_view line);
/// The same, into a vector whose memory is reused.
void split_words(std::string_view line, std::vector<std::string_view>& words);

/// Writes lines of words, separated by a space, in large pieces.
class TextOutput {
 public:
  explicit TextOutput(const ByteSink& sink) : sink_(sink) {}
  TextOutput(const TextOutput&) = delete;
  TextOutput& operator=(const TextOutput&) = delete;

  /// Writes words: numbers as the shortest decimals that parse back, texts unchanged.
  template <class... Values>
  void words(const Values&... values) {
    (word(values), ...);
  }
  /// Appends this text and ends the line.
  void line(std::string_view text = {}) {
    text_ += text;
    text_ += '\n';
    begins_ = true;
    flush_if_large();
  }
  /// Appends bytes as they are.
  void raw(std::string_view bytes) {
    text_ += bytes;
    flush_if_large();
  }
  /// Call at the end.
  void flush() {
    sink_(text_);
    text_.clear();
  }

 private:
  void flush_if_large() {
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (text_.size() >= kLarge) flush();
  }
  void separate() {
    if (!begins_) text_ += ' ';
    begins_ = false;
  }
  void word(std::string_view text) {
    separate();
    text_ += text;
  }
  void word(double value) {
    separate();
    append_number(text_, value);
  }
  void word(std::unsigned_integral auto value) {
    separate();
    append_number(text_, std::uint64_t{value});
  }
  void word(std::signed_integral auto value) { word(std::string_view(std::to_string(value))); }

  const ByteSink& sink_;
  std::string text_;
  bool begins_ = true;
};

}  // namespace cairn::detail
