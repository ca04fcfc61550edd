// SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "cairn/core/version_number.hpp"

#include "bindings/support.hpp"

namespace cairn::python {
namespace {

/// pybind11 before 2.12 reads NumPy's types in the layout of NumPy 1, and makes wrong arrays with NumPy 2.
/// @throws std::runtime_error, of which pybind11 makes an ImportError
void check_numpy() {
#if PYBIND11_VERSION_HEX < 0x020C0000
  const auto version = py::module_::import("numpy").attr("__version__").cast<std::string>();
  if (std::stoi(version) < 2) return;
  throw std::runtime_error(
      fmt::format("NumPy {}; expected NumPy below 2, because this cairn was built with pybind11 "
                  "{}.{}: install 'numpy<2', or build cairn with pybind11 2.12 or later",
                  version, PYBIND11_VERSION_MAJOR, PYBIND11_VERSION_MINOR));
#endif
}

}  // namespace
}  // namespace cairn::python

PYBIND11_MODULE(_cairn, module) {
  namespace python = cairn::python;
  python::check_numpy();
  // The docstrings contain the signatures, in the form that inspect reads.
  pybind11::options options;
  options.disable_function_signatures();
  module.attr("__version__") = cairn::kVersion;
  module.attr("__name__") = "cairn";  // the classes' module, for unpickling
  python::bind_errors(module);
  python::bind_maps(module);
  python::bind_alignment(module);
#ifdef CAIRN_HAS_MERGING
  python::bind_merging(module);
#endif
#ifdef CAIRN_HAS_ATLAS
  python::bind_atlas(module);
#endif
  python::bind_evaluation(module);
  python::bind_experiments(module);
  python::bind_report(module);
#ifdef CAIRN_HAS_SIMULATION
  python::bind_simulation(module);
#endif
#ifdef CAIRN_HAS_ODOMETRY
  python::bind_localization(module);
  python::bind_odometry(module);
#endif
  python::seal(module);
}
