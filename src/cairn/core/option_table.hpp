// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <variant>

namespace cairn {

/// Pointer to a field of an options struct.
using OptionValue = std::variant<bool*, int*, unsigned*, unsigned long*, unsigned long long*,
                                 double*, std::optional<double>*, std::optional<unsigned long>*>;

/// Permitted values of a numeric option. NaN is never permitted, std::nullopt always.
struct OptionRange {
  enum class End { kIncluded, kExcluded };

  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  std::string_view expected = {};  ///< range in words, for messages; empty: derived from both ends
  End least_is = End::kIncluded;
  End most_is = End::kIncluded;

  bool contains(double value) const;
};

inline constexpr OptionRange kAny = {};  ///< also for switches
inline constexpr OptionRange kPositive = {
    .least = 0.0, .expected = "a positive number", .least_is = OptionRange::End::kExcluded};
inline constexpr OptionRange kFinitePositive = {.least = 0.0,
                                                .expected = "a positive number",
                                                .least_is = OptionRange::End::kExcluded,
                                                .most_is = OptionRange::End::kExcluded};
inline constexpr OptionRange kNotNegative = {.least = 0.0, .expected = "0 or a positive number"};
inline constexpr OptionRange kAtLeastOne = {.least = 1.0};
constexpr OptionRange within(double least, double most) {
  return {.least = least, .most = most};
}
inline constexpr OptionRange kProbability = {.least = 0.5,
                                             .most = 1.0,
                                             .expected = "at least 0.5 and below 1",
                                             .most_is = OptionRange::End::kExcluded};

/// One field of an options struct. Checks, command line, JSON and Python keywords derive from the
/// field. Its default is the initial value of the struct's member.
struct OptionField {
  std::string_view name;        ///< in messages, JSON and Python
  OptionValue (*value)(void*);  ///< see option_at
  OptionRange range = {};       ///< for numeric fields
  std::string_view flag =
      {};  ///< e.g. "-k,--neighbors"; with "!" before it: sets a switch to false; empty: none
  std::string_view help = {};  ///< help text of the flag
};

namespace detail {
/// @cond
template <class Struct, class Member>
Struct struct_of(Member Struct::*);
/// @endcond
}  // namespace detail

/// Pointer to a field: option_at<&AlignOptions::effort>; to a field of a nested struct:
/// option_at<&AlignOptions::icp, &IcpOptions::k>.
template <auto kFirst, auto... kRest>
OptionValue option_at(void* options) {
  auto& first = static_cast<decltype(detail::struct_of(kFirst))*>(options)->*kFirst;
  if constexpr (sizeof...(kRest) == 0) {
    return &first;
  } else {
    return option_at<kRest...>(&first);
  }
}

/// Fields of an options struct, stored as its `static const OptionTable table`.
struct OptionTable {
  std::string_view options;  ///< name of the struct, e.g. "AlignOptions"
  std::span<const OptionField> fields;
};

/// @throws Error (misuse) naming the first field that is out of range, its value and the range
void check_options(const OptionTable& table, const void* options);
template <class Options>
void check_options(const Options& options) {
  check_options(Options::table, &options);
}

}  // namespace cairn
