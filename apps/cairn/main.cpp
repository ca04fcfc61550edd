// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <exception>
#include <map>
#include <new>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/version_number.hpp"
#include "commands.hpp"
#include "support/arguments.hpp"

namespace {

using cairn::cli::ExitCode;

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

int run(int argc, char** argv) {
  CLI::App program("Aligns, links and merges the landmark maps of visual SLAM.", "cairn");
  program.set_version_flag("--version", std::string("cairn ") + cairn::kVersion);
  program.require_subcommand(1);
  program.get_formatter()->column_width(34);
  program.footer("Try 'cairn demo', then 'cairn VERB --help'.\n"
                 "Exit codes: 0 done, 1 internal or system error, 2 wrong usage, 3 bad input,\n"
                 "4 no trustworthy alignment.");
  const std::map<std::string, cairn::cli::Run> verbs = {
      {"align", cairn::cli::add_align(program)},
      {"convert", cairn::cli::add_convert(program)},
      {"demo", cairn::cli::add_demo(program)},
      {"info", cairn::cli::add_info(program)},
  };
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool asked = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
    program.exit(error);
    return asked ? ExitCode::kDone : ExitCode::kWrongUsage;
  }
  return verbs.at(program.get_subcommands().front()->get_name())();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const int code = run(argc, argv);
    // An answer that never reached its file is no answer.
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
      fmt::print(stderr, "cairn: stdout: cannot be written\n");
      return ExitCode::kInternalError;
    }
    return code;
  } catch (const cairn::Error& error) {
    fmt::print(stderr, "cairn: {}\n", error.what());
    return exit_code_of(error.kind());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "cairn: out of memory\n");
  } catch (const std::exception& error) {
    fmt::print(stderr, "cairn: internal error: {}\n", error.what());
  }
  return ExitCode::kInternalError;
}
