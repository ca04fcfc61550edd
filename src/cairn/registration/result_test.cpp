// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/registration/result.hpp"

#include <array>
#include <set>

#include <gtest/gtest.h>

namespace cairn {
namespace {

// Documents name them, and are read back by their names.
TEST(RegistrationStatus, HasANameOfItsOwnAsHasEachReasonToStop) {
  const std::array statuses = {RegistrationStatus::kConverged, RegistrationStatus::kStopped,
                               RegistrationStatus::kFailed, RegistrationStatus::kCancelled};
  const std::array reasons = {StopReason::kMseChange,      StopReason::kNoMotion,
                              StopReason::kFixedPoint,     StopReason::kCycle,
                              StopReason::kIterationLimit, StopReason::kTimeLimit,
                              StopReason::kTooFewMatches,  StopReason::kCancelled};
  std::set<std::string_view> names;
  for (const RegistrationStatus status : statuses) names.insert(to_string(status));
  EXPECT_EQ(names.size(), statuses.size());
  names.clear();
  for (const StopReason reason : reasons) names.insert(to_string(reason));
  EXPECT_EQ(names.size(), reasons.size());
  EXPECT_FALSE(names.contains("unknown"));
  EXPECT_EQ(to_string(RegistrationStatus::kConverged), "converged");
  EXPECT_EQ(to_string(StopReason::kIterationLimit), "iteration_limit");
}

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
