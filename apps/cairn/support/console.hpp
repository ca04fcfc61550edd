// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "cairn/core/execution.hpp"
#include "cairn/core/log.hpp"

namespace cairn::cli {

/// Writes to stdout. A failure shows at the end of the program, which checks the stream.
void print_raw(std::string_view text);
/// Writes to stderr as far as that is possible.
void print_error(std::string_view text);

/// Where output goes: answers to stdout, remarks and progress to stderr.
class Console {
 public:
  /// @param quiet  no remarks, no progress
  /// @param answer where text for people goes
  enum class Answer {
    kToStdout,
    kToStderr,  ///< stdout carries a map or a pose
    kNowhere,   ///< stdout carries a document, which says the same
  };
  Console(bool quiet, Answer answer);

  /// Part of the answer, as is.
  void print(std::string_view text) const;
  /// A remark, one line.
  void remark(std::string_view text) const;
  LogSink log() const;

  /// A bar on a terminal, once the work has taken over a second; it clears itself.
  Progress progress(const std::string& label) const;
  /// The same, with words behind the bar.
  std::function<void(double share, const std::string& detail)> detailed_progress(
      const std::string& label) const;

 private:
  bool quiet_;
  Answer answer_;
};

}  // namespace cairn::cli
