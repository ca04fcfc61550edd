// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/result.hpp"

namespace cairn {

std::string_view to_string(StopReason reason) {
  switch (reason) {
    case StopReason::kMseChange:
      return "mse_change";
    case StopReason::kNoMotion:
      return "no_motion";
    case StopReason::kFixedPoint:
      return "fixed_point";
    case StopReason::kCycle:
      return "cycle";
    case StopReason::kIterationLimit:
      return "iteration_limit";
    case StopReason::kTimeLimit:
      return "time_limit";
    case StopReason::kTooFewMatches:
      return "too_few_matches";
    case StopReason::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

RegistrationStatus status_of(StopReason reason) {
  if (reason == StopReason::kTooFewMatches) return RegistrationStatus::kFailed;
  if (reason == StopReason::kCancelled) return RegistrationStatus::kCancelled;
  return reason == StopReason::kCycle || reason == StopReason::kIterationLimit ||
                 reason == StopReason::kTimeLimit
             ? RegistrationStatus::kStopped
             : RegistrationStatus::kConverged;
}

std::string_view to_string(RegistrationStatus status) {
  switch (status) {
    case RegistrationStatus::kConverged:
      return "converged";
    case RegistrationStatus::kStopped:
      return "stopped";
    case RegistrationStatus::kFailed:
      return "failed";
    case RegistrationStatus::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

}  // namespace cairn
