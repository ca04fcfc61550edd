// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/alignment/document.hpp"

#include "bindings/support.hpp"

namespace cairn::python {

/// An alignment and how it was asked for.
struct AlignmentResult {
  AlignmentRecord record;
  std::uint64_t seed = 0;
  std::string options_json = "{}";  ///< the keywords that were given
  Rigid3 initial;                   ///< that the method started from
  PointSetOptions points;

  const Alignment& alignment() const { return record.alignment; }
};

using SharedAlignment = std::shared_ptr<AlignmentResult>;

}  // namespace cairn::python
