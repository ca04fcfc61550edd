// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/scalars.hpp"

#include <algorithm>

namespace cairn::detail {

std::optional<ScalarType> scalar_type(char kind, std::size_t size) {
  const auto found = std::find_if(kScalars.begin(), kScalars.end(), [&](const Scalar& scalar) {
    return scalar.kind == kind && scalar.size == size;
  });
  return found == kScalars.end() ? std::nullopt : std::optional(found->type);
}

double load_number(ScalarType type, const char* bytes, bool is_big_endian) {
  return with_type(type, [&]<class Number>() {
    return static_cast<double>(load_scalar<Number>(bytes, is_big_endian));
  });
}

}  // namespace cairn::detail
