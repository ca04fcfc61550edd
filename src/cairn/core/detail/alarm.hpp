// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <thread>

namespace cairn::detail {

/// Requests a stop at a given time, or earlier if the caller's token requests one.
class Alarm {
 public:
  /// @param caller its stop requests are passed on
  Alarm(std::chrono::steady_clock::time_point at, std::stop_token caller);

  std::stop_token token() const { return stop_.get_token(); }

 private:
  std::stop_source stop_;
  std::stop_callback<std::function<void()>> passed_on_;
  std::jthread clock_;
};

}  // namespace cairn::detail
