// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/text.hpp"

#include <fmt/format.h>

#include "cairn/core/text.hpp"

namespace cairn::python {

py::str decoded(const std::string& text) {
  auto result = py::reinterpret_steal<py::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "surrogateescape"));
  if (!result) throw py::error_already_set();
  return result;
}

py::list decoded(const std::vector<std::string>& texts) {
  py::list list;
  for (const std::string& text : texts) list.append(decoded(text));
  return list;
}

std::string encoded(py::handle text, const std::string& name) {
  if (!py::isinstance<py::str>(text)) {
    throw py::type_error(
        fmt::format("{}: {}; expected text", name,
                    py::str(py::type::handle_of(text).attr("__name__")).cast<std::string>()));
  }
  const auto bytes = py::reinterpret_steal<py::bytes>(
      PyUnicode_AsEncodedString(text.ptr(), "utf-8", "surrogateescape"));
  if (!bytes) throw py::error_already_set();
  return bytes;
}

std::vector<std::string> encoded_each(py::handle texts, const std::string& name) {
  // A text is itself an iterable of texts.
  if (py::isinstance<py::str>(texts) || !py::isinstance<py::iterable>(texts)) {
    throw py::type_error(
        fmt::format("{}: {}; expected a list of text", name,
                    py::str(py::type::handle_of(texts).attr("__name__")).cast<std::string>()));
  }
  std::vector<std::string> result;
  for (const py::handle text : py::iter(texts)) {
    result.push_back(encoded(text, fmt::format("{}[{}]", name, result.size())));
  }
  return result;
}

void warn(const std::vector<std::string>& remarks) {
  for (const std::string& remark : remarks) {
    if (PyErr_WarnEx(PyExc_UserWarning, plain_text(remark).c_str(), 1) != 0)
      throw py::error_already_set();
  }
}

}  // namespace cairn::python
