// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "bindings/support.hpp"

/// Text between the library, where it may be any bytes, and Python.
namespace cairn::python {

/// What is no UTF-8 becomes surrogates, as in os.fsdecode(): paths, and names of maps.
py::str decoded(const std::string& text);
/// The other way round.
/// @throws TypeError naming the argument, for what is no text
std::string encoded(py::handle text, const std::string& name);

/// Remarks of the library (LogSink) as Python warnings, at the line that called.
void warn(const std::vector<std::string>& remarks);

}  // namespace cairn::python
