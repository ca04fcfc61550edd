// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/result.hpp"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(RegistrationStatus, SaysWhatAReasonToStopComesTo) {
  for (const StopReason reason :
       {StopReason::kMseChange, StopReason::kNoMotion, StopReason::kFixedPoint}) {
    EXPECT_EQ(status_of(reason), RegistrationStatus::kConverged) << to_string(reason);
  }
  for (const StopReason reason :
       {StopReason::kCycle, StopReason::kIterationLimit, StopReason::kTimeLimit}) {
    EXPECT_EQ(status_of(reason), RegistrationStatus::kStopped) << to_string(reason);
  }
  EXPECT_EQ(status_of(StopReason::kTooFewMatches), RegistrationStatus::kFailed);
  EXPECT_EQ(status_of(StopReason::kCancelled), RegistrationStatus::kCancelled);
}

}  // namespace
}  // namespace cairn
