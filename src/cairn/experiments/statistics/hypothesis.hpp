// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn {

/// What a test sets against its null hypothesis of no difference.
enum class Alternative {
  kTwoSided,  ///< a difference either way
  kGreater,   ///< the first tends to be greater: the differences lie above 0
  kLess,      ///< the first tends to be less: the differences lie below 0
};

/// How a test gets its p-value.
enum class PValueMethod {
  kAutomatic,   ///< exactly where the function says it can, else by the approximation
  kExact,       ///< from the null distribution given the ranks, ties and all
  kAsymptotic,  ///< by the approximation for large samples
};

}  // namespace cairn
