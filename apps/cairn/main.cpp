// SPDX-License-Identifier: BSD-3-Clause
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <string>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "cairn/core/error.hpp"
#include "cairn/core/version_number.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/command_line.hpp"
#include "support/console.hpp"
#include "support/interrupt.hpp"

namespace {

using cairn::cli::ExitCode;
using cairn::cli::print_error;

// Printed without an allocation.
constexpr const char* kOutOfMemory = "cairn: out of memory\n";

int exit_code_of(cairn::ErrorKind kind) {
  switch (kind) {
    case cairn::ErrorKind::kMisuse:
      return ExitCode::kWrongUsage;
    case cairn::ErrorKind::kInput:
      return ExitCode::kBadInput;
    case cairn::ErrorKind::kStorage:
    case cairn::ErrorKind::kCancelled:
      break;
  }
  return ExitCode::kInternalError;
}

// A file opened while a standard stream is closed would take its number, and its messages.
void occupy_standard_streams() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) < 0) ::open("/dev/null", O_RDONLY);
  }
}

int run(int argc, char** argv) {
  cairn::cli::Program program(
      "cairn", "Aligns, links and merges the landmark maps of visual SLAM.",
      std::string("cairn ") + cairn::kVersion,
      "Try 'cairn demo', then 'cairn help <verb>'.\n\n"
      "Exit codes: 0 done; 1 internal or system error; 2 wrong usage; 3 bad input;\n"
      "4 no trustworthy alignment; 130 interrupted.");
  const cairn::cli::Command verbs = program.root();
#ifdef CAIRN_QUICK_VERBS_ONLY
  cairn::cli::add_info(verbs);
  cairn::cli::add_align(verbs);
#else
  cairn::cli::add_demo(verbs);
  cairn::cli::add_info(verbs);
  cairn::cli::add_convert(verbs);
  cairn::cli::add_align(verbs);
  cairn::cli::add_evaluate(verbs);
  cairn::cli::add_experiment(verbs);
  cairn::cli::add_report(verbs);
#endif
#ifdef CAIRN_HAS_SIMULATION
  cairn::cli::add_simulate(verbs);
#endif
#ifdef CAIRN_HAS_ODOMETRY
  cairn::cli::add_map(verbs);
  cairn::cli::add_locate(verbs);
#endif
#ifdef CAIRN_HAS_MERGING
  cairn::cli::add_merge(verbs);
#endif
#ifdef CAIRN_HAS_ATLAS
  cairn::cli::add_atlas(verbs);
#endif
  return program.run(argc, argv);
}

// Whether stdout is a pipe that nobody reads any more.
bool reader_of_stdout_left() {
  pollfd stream = {STDOUT_FILENO, POLLOUT, 0};
  return ::poll(&stream, 1, 0) == 1 && (stream.revents & POLLERR) != 0;
}

// What SIGPIPE did when the program was started.
void (*on_broken_pipe)(int) = SIG_DFL;

// Ends the program as SIGPIPE does by default, if the reader of stdout left.
void end_if_reader_left() {
  if (on_broken_pipe != SIG_DFL || !reader_of_stdout_left()) return;
  std::signal(SIGPIPE, SIG_DFL);
  std::raise(SIGPIPE);
}

// The command, from its first allocation to the last byte of its answer.
int work(int argc, char** argv) {
  cairn::cli::catch_interrupts();
  cairn::cli::keep_command_line(argc, argv);
  // A reader of stdout that leaves early, as head does, must not cost the files that are yet to be written.
  on_broken_pipe = std::signal(SIGPIPE, SIG_IGN);
  const int code = run(argc, argv);
  // An answer that never reached its file is no answer.
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    end_if_reader_left();
    print_error("cairn: stdout: cannot be written\n");
    return ExitCode::kInternalError;
  }
  return code;
}

// Says what is being caught.
int explain() {
  try {
    throw;
  } catch (const cairn::Error& error) {
    if (error.kind() == cairn::ErrorKind::kCancelled) cairn::cli::end_by_interrupt();
    if (error.kind() == cairn::ErrorKind::kStorage) end_if_reader_left();
    print_error(fmt::format("cairn: {}\n", error.what()));
    return exit_code_of(error.kind());
  } catch (const std::bad_alloc&) {
    std::fputs(kOutOfMemory, stderr);
  } catch (const std::filesystem::filesystem_error& error) {
    print_error(fmt::format("cairn: {}: {}\n", error.path1().string(), error.code().message()));
  } catch (const std::exception& error) {
    print_error(fmt::format("cairn: internal error: {}\n", error.what()));
  }
  return ExitCode::kInternalError;
}

std::terminate_handler default_end = nullptr;

// Where memory runs out in a function that says it throws nothing (CLI11 and TBB have such), the command ends as it
// does elsewhere. Anything else that nobody caught is a defect, and ends as one.
void end_uncaught() {
  try {
    if (std::current_exception() != nullptr) throw;
  } catch (const std::bad_alloc&) {
    std::fputs(kOutOfMemory, stderr);
    std::_Exit(ExitCode::kInternalError);
  } catch (...) {
  }
  default_end();
}

}  // namespace

int main(int argc, char** argv) {
  default_end = std::set_terminate(end_uncaught);
  try {
    occupy_standard_streams();
    return work(argc, argv);
  } catch (...) {
    try {
      return explain();
    } catch (...) {
      // There is no memory even for the message.
      std::fputs(kOutOfMemory, stderr);
    }
  }
  return ExitCode::kInternalError;
}
