// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string_view>

#include "cairn/core/file.hpp"

namespace cairn::report::detail {

/// Compresses its input (gzip without a time, so that equal input gives equal bytes) and passes it on as
/// base64, in one line, in pieces.
class GzipBase64 {
 public:
  /// @param sink must outlive this
  explicit GzipBase64(const ByteSink& sink);
  ~GzipBase64();
  GzipBase64(const GzipBase64&) = delete;
  GzipBase64& operator=(const GzipBase64&) = delete;

  void write(std::string_view bytes);
  /// Passes on the rest. Call once, at the end.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn::report::detail
