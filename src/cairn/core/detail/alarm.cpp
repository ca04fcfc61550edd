// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/alarm.hpp"

#include <condition_variable>
#include <mutex>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {

Alarm::Alarm(std::chrono::steady_clock::time_point at, std::stop_token caller)
    : passed_on_(std::move(caller), [stop = stop_]() mutable { stop.request_stop(); }) {
  try {
    clock_ = std::jthread([stop = stop_, at](const std::stop_token& ended) mutable {
      std::mutex mutex;
      std::condition_variable_any early;
      std::unique_lock lock(mutex);
      early.wait_until(lock, ended, at, [] { return false; });
      if (!ended.stop_requested()) stop.request_stop();
    });
  } catch (const std::system_error& error) {
    throw Error(ErrorKind::kStorage, "time limit",
                fmt::format("the operating system cannot start its thread ({})", error.what()), "");
  }
}

}  // namespace cairn::detail
