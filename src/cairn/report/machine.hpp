// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/report/report.hpp"

namespace cairn::report {

/// What this program runs on; texts are empty where the system does not tell.
/// @param threads that the work could use
Machine this_machine(unsigned threads);

}  // namespace cairn::report
