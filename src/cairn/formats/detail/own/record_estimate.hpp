// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "cairn/core/file.hpp"

namespace cairn::detail {

struct RecordCounts {
  std::uint64_t frames = 0;
  std::uint64_t landmarks = 0;
  std::uint64_t observations = 0;
};

/// Estimates the records of a text map from its bytes alone, so that columns grow without copying. Exact if every record
/// starts a line; always bounded by the number of bytes. Rewinds the source.
RecordCounts estimate_records(ByteSource& source);

}  // namespace cairn::detail
