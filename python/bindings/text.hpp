// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "bindings/support.hpp"

/// Conversion of text between the library, where it may contain any bytes, and Python.
namespace cairn::python {

/// For text from files, paths and names: bytes that are not UTF-8 become surrogates, as in os.fsdecode().
py::str decoded(const std::string& text);
py::list decoded(const std::vector<std::string>& texts);
/// The reverse.
/// @throws TypeError naming the argument, unless it is text
std::string encoded(py::handle text, const std::string& name);
/// Of each text of a list or another iterable.
/// @throws TypeError naming the argument, unless it is text throughout
std::vector<std::string> encoded_each(py::handle texts, const std::string& name);

/// Issues remarks of the library (LogSink) as Python warnings at the caller's line, as plain_text().
void warn(const std::vector<std::string>& remarks);

}  // namespace cairn::python
