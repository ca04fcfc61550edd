// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/report/report.hpp"

namespace cairn::report {

/// The machine that runs this program; texts are empty if the system does not provide them.
/// @param threads available to the work
Machine this_machine(unsigned threads);

}  // namespace cairn::report
