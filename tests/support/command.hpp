// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/temporary_folder.hpp"

namespace cairn::testing {

struct CommandOptions {
  std::filesystem::path folder = {};  ///< to run in; empty: this program's
  std::string input = {};  ///< what its standard input holds, at most one pipe buffer (64 KiB)
  bool input_stays_open = false;  ///< until wait(): the program waits for more; see feed()
  std::filesystem::path output_to =
      {};                           ///< where standard output goes instead of CommandResult::output
  std::chrono::seconds limit{600};  ///< after which the program is killed and wait() throws
};

struct CommandResult {
  int exit_code = 0;  ///< 128 + signal if one ended the program, as a shell has it
  std::string output;
  std::string errors;
};

/// A program run without a shell, with the default reaction to signals.
class Command {
 public:
  explicit Command(const std::vector<std::string>& words, CommandOptions options = {})
      : options_(std::move(options)) {
    ::signal(SIGPIPE, SIG_IGN);  // feed() may find the program gone
    int input[2];
    check(::pipe2(input, O_CLOEXEC), "pipe2");
    input_ = input[1];
    const std::string output =
        options_.output_to.empty() ? (files_ / "output").string() : options_.output_to.string();
    const std::string errors = (files_ / "errors").string();

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input[0], 0);
    posix_spawn_file_actions_addopen(&actions, 1, output.c_str(), O_WRONLY | O_CREAT, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, errors.c_str(), O_WRONLY | O_CREAT, 0600);
    if (!options_.folder.empty()) {
      posix_spawn_file_actions_addchdir_np(&actions, options_.folder.c_str());
    }
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t reset;
    ::sigemptyset(&reset);
    posix_spawnattr_setsigmask(&attributes, &reset);
    for (const int signal : {SIGINT, SIGTERM, SIGPIPE}) ::sigaddset(&reset, signal);
    posix_spawnattr_setsigdefault(&attributes, &reset);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);

    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const int error =
        ::posix_spawn(&process_, arguments[0], &actions, &attributes, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    ::close(input[0]);
    if (error != 0) {
      ::close(input_);
      throw std::system_error(error, std::generic_category(), words[0]);
    }
    feed(options_.input);
    if (!options_.input_stays_open) close_input();
  }

  ~Command() {
    close_input();
    if (running_) {
      ::kill(process_, SIGKILL);
      ::waitpid(process_, nullptr, 0);
    }
  }

  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  /// Writes to its standard input; waits while the program does not read.
  /// @returns false if the program reads no more
  bool feed(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t written = ::write(input_, text.data(), text.size());
      if (written < 0 && errno == EPIPE) return false;
      if (written < 0) check(-1, "write");
      text.remove_prefix(static_cast<std::size_t>(written));
    }
    return true;
  }

  void send(int signal) const { check(::kill(process_, signal), "kill"); }

  CommandResult wait() {
    const auto deadline = std::chrono::steady_clock::now() + options_.limit;
    int status = 0;
    for (;;) {
      const pid_t ended = ::waitpid(process_, &status, WNOHANG);
      check(ended, "waitpid");
      if (ended == process_) break;
      if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error("time is over");
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    running_ = false;
    const int code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    return {code, options_.output_to.empty() ? read_text(files_ / "output") : std::string(),
            read_text(files_ / "errors")};
  }

 private:
  static void check(int result, const char* call) {
    if (result < 0) throw std::system_error(errno, std::generic_category(), call);
  }
  void close_input() {
    if (input_ >= 0) ::close(std::exchange(input_, -1));
  }

  CommandOptions options_;
  TemporaryFolder files_;
  int input_ = -1;
  pid_t process_ = 0;
  bool running_ = true;
};

inline CommandResult run_command(const std::vector<std::string>& words,
                                 const CommandOptions& options = {}) {
  return Command(words, options).wait();
}

}  // namespace cairn::testing
