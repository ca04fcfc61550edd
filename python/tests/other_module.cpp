// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/pybind11.h>

// A module of pybind11 other than Cairn's, in the same process: test_other_module.py.
PYBIND11_MODULE(other_module, module) {
  module.def("fail_to_cast", [] { throw pybind11::cast_error("the other module's own words"); });
}
