// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace cairn {

/// Kinds of errors that callers distinguish.
enum class ErrorKind {
  kMisuse,     ///< an invalid argument or option
  kInput,      ///< data that cannot be read or is invalid
  kStorage,    ///< the operating system refused to write
  kCancelled,  ///< the caller asked to stop
};

/// The library's only exception: misuse, invalid input, failed storage or cancellation. An expected
/// failure (no overlap, no convergence) is a status in the result.
class Error : public std::runtime_error {
 public:
  /// @param where file and line or byte, or the option, e.g. "desk.map:12: field 3 (x)"
  /// @param what the defect, e.g. "'abc' is not a number"
  /// @param expected the constraint, without "expected"; may be empty
  Error(ErrorKind kind, std::string_view where, std::string_view what, std::string_view expected);

  ErrorKind kind() const noexcept { return kind_; }

 private:
  ErrorKind kind_;
};

/// Refuses an invalid argument or option. Not for inner loops: the caller builds the texts even if
/// the value is valid.
/// @throws Error (misuse) if `wrong`
inline void refuse_if(bool wrong, std::string_view where, std::string_view what,
                      std::string_view expected) {
  if (wrong) throw Error(ErrorKind::kMisuse, where, what, expected);
}

/// Rejects invalid input data, as refuse_if().
/// @throws Error (input) if `wrong`
inline void reject_if(bool wrong, std::string_view where, std::string_view what,
                      std::string_view expected) {
  if (wrong) throw Error(ErrorKind::kInput, where, what, expected);
}

/// `text` in single quotes, truncated, with control and non-ASCII bytes as `\xNN`: for messages about
/// arbitrary input.
std::string printable(std::string_view text);

}  // namespace cairn
