// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/alarm.hpp"

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

using std::chrono::steady_clock;
using namespace std::chrono_literals;

void wait_for(const std::stop_token& token) {
  while (!token.stop_requested()) std::this_thread::sleep_for(1ms);
}

TEST(Alarm, AsksToStopWhenItsTimeHasComeAndNotBefore) {
  const auto at = steady_clock::now() + 50ms;
  const Alarm alarm(at, {});
  wait_for(alarm.token());
  EXPECT_GE(steady_clock::now(), at);
}

TEST(Alarm, PassesOnThatItsCallerAsks) {
  std::stop_source caller;
  const Alarm alarm(steady_clock::now() + 1h, caller.get_token());
  EXPECT_FALSE(alarm.token().stop_requested());
  caller.request_stop();
  EXPECT_TRUE(alarm.token().stop_requested());

  const Alarm late(steady_clock::now() + 1h, caller.get_token());
  EXPECT_TRUE(late.token().stop_requested());
}

TEST(Alarm, DoesNotAskOnceItIsGone) {
  std::stop_token token;
  {
    const Alarm alarm(steady_clock::now() + 1h, {});
    token = alarm.token();
  }
  EXPECT_FALSE(token.stop_requested());
}

}  // namespace
}  // namespace cairn::detail
