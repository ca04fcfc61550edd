// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/alarm.hpp"

#include <condition_variable>
#include <mutex>
#include <utility>

namespace cairn {

Alarm::Alarm(std::chrono::steady_clock::time_point at, std::stop_token caller)
    : passed_on_(std::move(caller), [stop = stop_]() mutable { stop.request_stop(); }),
      clock_([stop = stop_, at](const std::stop_token& ended) mutable {
        std::mutex mutex;
        std::condition_variable_any early;
        std::unique_lock lock(mutex);
        early.wait_until(lock, ended, at, [] { return false; });
        if (!ended.stop_requested()) stop.request_stop();
      }) {}

}  // namespace cairn
