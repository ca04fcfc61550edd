// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/formats.hpp"

#include "cairn/interchange/colmap.hpp"

namespace cairn {

const FormatRegistry& all_formats() {
  static const FormatRegistry formats = native_formats().extended_by(colmap_formats());
  return formats;
}

}  // namespace cairn
