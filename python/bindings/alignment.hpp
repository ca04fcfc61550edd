// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "cairn/alignment/document.hpp"

#include "bindings/support.hpp"

namespace cairn::python {

/// An alignment and its options.
struct AlignmentResult {
  AlignmentRecord record;
  std::uint64_t seed = 0;
  std::string options_json = "{}";  ///< the given keywords
  Rigid3 initial;                   ///< initial pose of the method
  PointSetOptions points;

  const Alignment& alignment() const { return record.alignment; }
};

using SharedAlignment = std::shared_ptr<AlignmentResult>;

}  // namespace cairn::python
