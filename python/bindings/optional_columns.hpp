// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "bindings/support.hpp"

/// Columns with an entry that may be unknown: the one place that knows how a map stores them.
namespace cairn::python {

/// None if the column is absent; else a copy in which NaN stands for unknown.
inline py::object with_nan(const std::vector<std::optional<double>>& column) {
  if (column.empty()) return py::none();
  std::vector<double> values;
  values.reserve(column.size());
  for (const auto& entry : column) {
    values.push_back(entry.value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  py::array array = copied(values);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// None if the column is absent; else a masked copy (numpy.ma), in which unknown entries are masked.
/// @param width how many numbers an entry is; 1: the array has one dimension
/// @param put   writes the numbers of an entry
template <class Scalar, class Entry, class Put>
py::object masked(const std::vector<std::optional<Entry>>& column, py::ssize_t width,
                  const Put& put) {
  if (column.empty()) return py::none();
  const auto size = static_cast<py::ssize_t>(column.size());
  std::vector<Scalar> values(column.size() * static_cast<std::size_t>(width), Scalar{});
  std::vector<std::uint8_t> unknown(values.size(), 0);
  for (std::size_t i = 0; i < column.size(); ++i) {
    const std::size_t at = i * static_cast<std::size_t>(width);
    if (column[i]) {
      put(*column[i], &values[at]);
    } else {
      std::fill_n(&unknown[at], width, std::uint8_t{1});
    }
  }
  std::vector<py::ssize_t> shape = {size};
  if (width > 1) shape.push_back(width);
  const py::array mask = copied(unknown, shape).attr("view")("bool");
  return py::module_::import("numpy.ma")
      .attr("MaskedArray")(copied(values, shape), py::arg("mask") = mask);
}

template <class Integer>
py::object masked(const std::vector<std::optional<Integer>>& column) {
  return masked<Integer>(column, 1, [](Integer value, Integer* out) { *out = value; });
}

/// The entries of an array that may be masked.
template <class Entry, class Scalar, class Get>
std::vector<std::optional<Entry>> from_masked(py::handle given, const py::array_t<Scalar>& values,
                                              const Get& get) {
  std::vector<std::optional<Entry>> column(static_cast<std::size_t>(values.shape(0)));
  const auto mask = py::cast<py::array_t<bool, py::array::c_style | py::array::forcecast>>(
      py::module_::import("numpy.ma").attr("getmaskarray")(given));
  const py::ssize_t width = values.ndim() > 1 ? values.shape(1) : 1;
  for (std::size_t i = 0; i < column.size(); ++i) {
    const std::size_t at = i * static_cast<std::size_t>(width);
    bool known = true;
    for (py::ssize_t j = 0; j < width; ++j)
      known = known && !mask.data()[at + static_cast<std::size_t>(j)];
    if (known) column[i] = get(values.data() + at, i);
  }
  return column;
}

/// Numbers of which NaN is unknown.
inline std::vector<std::optional<double>> from_nan(const py::array_t<double>& values) {
  std::vector<std::optional<double>> column(static_cast<std::size_t>(values.size()));
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (!std::isnan(values.data()[i])) column[i] = values.data()[i];
  }
  return column;
}

}  // namespace cairn::python
