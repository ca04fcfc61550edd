// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "cairn/map/optional_column.hpp"

#include "bindings/support.hpp"

/// Conversion of columns with unknown entries. Only this header depends on how a map stores them.
namespace cairn::python {

inline bool all_known(std::span<const std::uint8_t> known) {
  return std::find(known.begin(), known.end(), 0) == known.end();
}

/// None if the column is absent; a view if all entries are known; otherwise a copy with NaN for unknown
/// entries.
/// @param owner the map, which the view keeps alive
inline py::object with_nan(const OptionalColumn<double>& column, py::handle owner) {
  if (column.empty()) return py::none();
  if (all_known(column.known())) {
    return view(column.values().data(), {static_cast<py::ssize_t>(column.size())}, owner);
  }
  std::vector<double> values;
  values.reserve(column.size());
  for (const std::optional<double> entry : column) {
    values.push_back(entry.value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  py::array array = copied(values);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// None if the column is absent; otherwise a masked array (numpy.ma) that views the column's values and masks
/// unknown entries.
/// @param owner the map, which the array keeps alive
template <class Scalar, class Entry>
py::object masked(const OptionalColumn<Entry>& column, py::handle owner) {
  static_assert(sizeof(Entry) % sizeof(Scalar) == 0 && std::is_trivially_copyable_v<Entry>);
  constexpr auto kWidth = static_cast<py::ssize_t>(sizeof(Entry) / sizeof(Scalar));
  if (column.empty()) return py::none();
  std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(column.size())};
  if (kWidth > 1) shape.push_back(kWidth);
  std::vector<std::uint8_t> unknown;
  unknown.reserve(column.size() * static_cast<std::size_t>(kWidth));
  for (const std::uint8_t known : column.known()) {
    unknown.insert(unknown.end(), static_cast<std::size_t>(kWidth), known == 0 ? 1 : 0);
  }
  const py::array mask = copied(unknown, shape).attr("view")("bool");
  return py::module_::import("numpy.ma")
      .attr("MaskedArray")(
          view(reinterpret_cast<const Scalar*>(column.values().data()), shape, owner),
          py::arg("mask") = mask);
}

/// Entries of an array, which may be masked.
template <class Entry, class Scalar, class Get>
OptionalColumn<Entry> from_masked(py::handle given, const py::array_t<Scalar>& values,
                                  const Get& get) {
  OptionalColumn<Entry> column(static_cast<std::size_t>(values.shape(0)));
  const std::vector<std::uint8_t> known = known_rows(given, column.size());
  const auto width = static_cast<std::size_t>(values.ndim() > 1 ? values.shape(1) : 1);
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (known[i] != 0) column[i] = get(values.data() + i * width, i);
  }
  return column;
}

/// From numbers with NaN for unknown entries.
inline OptionalColumn<double> from_nan(const py::array_t<double>& values) {
  OptionalColumn<double> column(static_cast<std::size_t>(values.size()));
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (!std::isnan(values.data()[i])) column[i] = values.data()[i];
  }
  return column;
}

}  // namespace cairn::python
