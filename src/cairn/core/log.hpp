// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <functional>
#include <string_view>

namespace cairn {

enum class RemarkKind {
  kInformation,  ///< says how something was understood; nothing is missing for it
  kLoss,         ///< something of a file or map was left out, because there is no place for it
};

/// What the library has to remark beside its result. Text is information unless it is said to be a loss.
struct Remark {
  // NOLINTNEXTLINE(google-explicit-constructor): a text is a remark
  template <std::convertible_to<std::string_view> Text>
  Remark(const Text& said, RemarkKind of_kind = RemarkKind::kInformation)
      : text(said), kind(of_kind) {}

  std::string_view text;
  RemarkKind kind;

  // NOLINTNEXTLINE(google-explicit-constructor): who does not care for kinds takes the text
  operator std::string_view() const { return text; }
};

/// Receives remarks, e.g. records that were left out and why. The library never prints; without a sink remarks
/// are dropped. Any function of a string_view is one.
using LogSink = std::function<void(const Remark& remark)>;

}  // namespace cairn
