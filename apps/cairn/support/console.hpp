// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"

namespace cairn::cli {

/// Writes to stdout. The end of the program checks the stream and reports a failure.
void print_raw(std::string_view text);
/// Writes to stderr as far as that is possible.
void print_error(std::string_view text);

/// Where output goes: answers to stdout, remarks and progress to stderr.
class Console {
 public:
  /// Where text for people goes.
  enum class Answer {
    kToStdout,
    kToStderr,  ///< stdout carries a map or a pose
    kNowhere,   ///< stdout carries a document, which says the same
  };
  /// @param quiet  no remarks, no progress
  /// @param answer where text for people goes
  Console(bool quiet, Answer answer);

  /// Prints a part of the answer, unchanged.
  void print(std::string_view text) const;
  template <class... Args>
    requires(sizeof...(Args) > 0)
  void print(fmt::format_string<Args...> text, Args&&... args) const {
    print(fmt::format(text, std::forward<Args>(args)...));
  }
  /// Prints a remark of one line.
  void remark(std::string_view text) const;
  template <class... Args>
    requires(sizeof...(Args) > 0)
  void remark(fmt::format_string<Args...> text, Args&&... args) const {
    remark(fmt::format(text, std::forward<Args>(args)...));
  }
  LogSink log() const;

  /// A progress bar on a terminal, shown when the work has taken more than a second. The bar clears
  /// itself.
  Progress progress(const std::string& label) const;
  /// The same, with text after the bar.
  std::function<void(double share, const std::string& detail)> detailed_progress(
      const std::string& label) const;

 private:
  bool quiet_;
  Answer answer_;
};

/// Measures the time since its construction.
class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// The number with `digits` digits after the point; never "-0.000".
std::string fixed(double value, int digits);

/// A table for people: the first column flush left, all others flush right.
class Table {
 public:
  explicit Table(std::vector<std::string> header);

  /// Adds a row with one cell per column.
  void add_row(std::vector<std::string> cells);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace cairn::cli
