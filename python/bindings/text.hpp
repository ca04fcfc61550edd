// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "bindings/support.hpp"

/// Conversion of text between the library, where it may contain any bytes, and Python.
namespace cairn::python {

/// For paths and names of maps: bytes that are not UTF-8 become surrogates, as in os.fsdecode().
py::str decoded(const std::string& text);
/// The reverse.
/// @throws TypeError naming the argument, unless it is text
std::string encoded(py::handle text, const std::string& name);

/// Issues remarks of the library (LogSink) as Python warnings at the caller's line.
void warn(const std::vector<std::string>& remarks);

}  // namespace cairn::python
