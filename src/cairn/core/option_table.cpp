// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/option_table.hpp"

#include <cmath>
#include <string>
#include <type_traits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

std::string text_of(const OptionRange& range) {
  if (!range.expected.empty()) return std::string(range.expected);
  if (std::isinf(range.most)) return fmt::format("at least {}", range.least);
  return fmt::format("{} to {}", range.least, range.most);
}

template <class Value>
void check_field(const OptionTable& table, const OptionField& field, const Value& value) {
  if constexpr (requires { value.has_value(); }) {
    if (value) check_field(table, field, *value);
  } else if constexpr (!std::is_same_v<Value, bool>) {
    if (field.range.contains(static_cast<double>(value))) return;
    throw Error(ErrorKind::kMisuse, fmt::format("{}.{}", table.options, field.name),
                fmt::format("{}", value), text_of(field.range));
  }
}

}  // namespace

bool OptionRange::contains(double value) const {
  return (least_is == End::kIncluded ? value >= least : value > least) &&
         (most_is == End::kIncluded ? value <= most : value < most);
}

void check_options(const OptionTable& table, const void* options) {
  for (const OptionField& field : table.fields) {
    std::visit([&](const auto* value) { check_field(table, field, *value); },
               field.value(const_cast<void*>(options)));
  }
}

}  // namespace cairn
