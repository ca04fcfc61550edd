// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/text.hpp"

namespace cairn::python {
namespace {

const char* name_of(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::kMisuse:
      return "misuse";
    case ErrorKind::kInput:
      return "input";
    case ErrorKind::kStorage:
      return "storage";
    case ErrorKind::kCancelled:
      return "cancelled";
  }
  return "input";
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): the signature that pybind11 requires
void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const Error& error) {
    const py::object made = py::module_::import("cairn._errors")
                                .attr("made")(name_of(error.kind()), decoded(error.what()));
    PyErr_SetObject(py::type::handle_of(made).ptr(), made.ptr());
  } catch (const py::cast_error&) {
    PyErr_SetString(PyExc_TypeError, "an argument, or something in it, is of the wrong type");
  }
}

}  // namespace

void bind_errors(py::module_& /*module*/) {
  // For the functions of this module only: errors of other modules' are theirs to translate.
  py::register_local_exception_translator(&translate);
}

}  // namespace cairn::python
