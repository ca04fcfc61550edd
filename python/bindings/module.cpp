// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/version_number.hpp"

#include "bindings/support.hpp"

PYBIND11_MODULE(_cairn, module) {
  namespace python = cairn::python;
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
