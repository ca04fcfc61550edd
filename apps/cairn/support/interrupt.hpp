// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

namespace cairn::cli {

/// From now on Ctrl-C (SIGINT) and SIGTERM ask long work to stop instead of ending the program at
/// once, so that half-written files are removed. Work that does not heed it within 0.4 seconds,
/// or a second Ctrl-C, ends the program after all. To be called once, before any thread starts.
void catch_interrupts();

/// Stop is requested when the user interrupts.
std::stop_token interrupt_requests();

/// Says so, if stderr takes the message within 0.1 seconds, and ends the program by the signal that interrupted
/// it, as shells expect: exit code 130 for Ctrl-C.
[[noreturn]] void end_by_interrupt();

}  // namespace cairn::cli
