// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace cairn {

/// What went wrong, as far as a caller has to tell apart.
enum class ErrorKind {
  kMisuse,     ///< an argument or option outside what the function states
  kInput,      ///< data that cannot be read or does not say what it must
  kStorage,    ///< the operating system refused to write
  kCancelled,  ///< the caller asked to stop
};

/// The one exception of the library: misuse and unreadable input. An expected failure (no overlap,
/// no convergence) is never an exception but a status in the result.
class Error : public std::runtime_error {
 public:
  /// @param where    file and line or byte, or the option, e.g. "desk.map:12: field 3 (x)"
  /// @param what     what was found, e.g. "'abc' is not a number"
  /// @param expected what would have been right, without "expected"; may be empty
  Error(ErrorKind kind, std::string_view where, std::string_view what, std::string_view expected);

  ErrorKind kind() const noexcept { return kind_; }

 private:
  ErrorKind kind_;
};

/// `text` in single quotes, cut at a readable length, with control and non-ASCII bytes as `\xNN`: for
/// messages about input that may be anything.
std::string printable(std::string_view text);

}  // namespace cairn
