// SPDX-License-Identifier: BSD-3-Clause
#include "support/interrupt.hpp"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <string_view>
#include <system_error>
#include <thread>

#include <poll.h>
#include <unistd.h>

namespace cairn::cli {
namespace {

std::stop_source& requests() {
  static std::stop_source source;
  return source;
}

std::atomic<int> received = SIGINT;

// A program started with a signal ignored (nohup, a script's background job) goes on ignoring it.
bool is_ignored(int signal) {
  struct sigaction action = {};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

// Nobody may read stderr, so that writing to it would take for ever; and a thread that waits there holds the lock
// of stdio's stream.
void say_interrupted() {
  constexpr std::string_view kMessage = "cairn: interrupted\n";
  constexpr int kPatienceMs = 100;
  pollfd stream = {STDERR_FILENO, POLLOUT, 0};
  if (::poll(&stream, 1, kPatienceMs) != 1 || (stream.revents & POLLOUT) == 0) return;
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kMessage.data(), kMessage.size());
}

}  // namespace

void catch_interrupts() {
  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM}) {
    if (!is_ignored(signal)) ::sigaddset(&signals, signal);
  }
  // All threads inherit the mask: the signals reach nobody but the thread that waits for them,
  // where anything may be called, unlike in a signal handler.
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  requests();
  try {
    std::thread([signals] {
      int signal = SIGINT;
      if (::sigwait(&signals, &signal) != 0) return;
      received = signal;
      requests().request_stop();
      // Work that asks seldom is not waited for: write_file copes with what is left of its files.
      constexpr timespec kPatience = {0, 400'000'000};
      ::sigtimedwait(&signals, nullptr, &kPatience);
      end_by_interrupt();
    }).detach();
  } catch (const std::system_error&) {
    // No thread can be started: the signals end the process, as they do by default.
    ::pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  }
}

std::stop_token interrupt_requests() {
  return requests().get_token();
}

void end_by_interrupt() {
  const int signal = received;
  std::signal(signal, SIG_DFL);
  // Both the work and the thread that lost patience with it may come here.
  static std::atomic_flag said;
  if (!said.test_and_set()) say_interrupted();
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, signal);
  ::pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  ::raise(signal);
  std::_Exit(128 + signal);
}

}  // namespace cairn::cli
