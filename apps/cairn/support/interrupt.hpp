// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>

namespace cairn::cli {

/// From now on, Ctrl-C (SIGINT) and SIGTERM ask long work to stop instead of ending the program at once, so
/// that half-written files are removed. If the work does not stop within 0.4 seconds, or after a second Ctrl-C,
/// the program ends nevertheless. Call once, before any thread starts.
void catch_interrupts();

/// A token that requests a stop when the user interrupts the program.
std::stop_token interrupt_requests();

/// Prints that the program was interrupted, if stderr takes the message within 0.1 seconds. Then ends the
/// program by the signal that interrupted it, as shells expect: exit code 130 for Ctrl-C.
[[noreturn]] void end_by_interrupt();

}  // namespace cairn::cli
