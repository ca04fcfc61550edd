// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <functional>
#include <string_view>

namespace cairn {

enum class RemarkKind {
  kInformation,  ///< how the input was interpreted; no data is missing
  kLoss,         ///< data omitted because the result cannot hold it, or possibly truncated data
};

/// A message of the library in addition to its result.
struct Remark {
  // A text is a remark:
  template <std::convertible_to<std::string_view> Text>
  Remark(const Text& said, RemarkKind of_kind = RemarkKind::kInformation)  // NOLINT(*-explicit-*)
      : text(said), kind(of_kind) {}

  std::string_view text;
  RemarkKind kind;

  // NOLINTNEXTLINE(google-explicit-constructor): for callers that ignore the kind
  operator std::string_view() const { return text; }
};

/// Receives remarks, e.g. the omitted records with the reason. The library never prints; without a
/// sink, it drops remarks. Any callable that accepts a std::string_view is a LogSink.
using LogSink = std::function<void(const Remark& remark)>;

}  // namespace cairn
