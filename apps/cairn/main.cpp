// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <unistd.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/version_number.hpp"

#include "atlas_verbs.hpp"
#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/command_line.hpp"
#include "support/console.hpp"
#include "support/distinct_files.hpp"
#include "support/help.hpp"
#include "support/interrupt.hpp"
#include "support/suggestion.hpp"

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

bool asks_for_version(int argc, char** argv) {
  if (argc != 2) return false;
  const std::string_view word = argv[1];
  return word == "--version" || word == "-V";
}

#ifdef CAIRN_WHOLE_TOOL
// Whether the command needs no more than this executable, which has the quick verbs only.
bool is_quick(int argc, char** argv) {
  if (argc < 2) return false;
  const std::string_view verb = argv[1];
  return verb == "align" || verb == "info" || asks_for_version(argc, argv);
}

// Goes on as the whole tool; returns only if that cannot be started.
int become_whole_tool(char** argv) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path tool = (self.parent_path() / CAIRN_WHOLE_TOOL).lexically_normal();
  if (!error) {
    ::execv(tool.c_str(), argv);
    error = {errno, std::generic_category()};
  }
  print_error(fmt::format("cairn: {}: cannot be started: {}; it is a part of cairn\n",
                          cairn::printable(tool.string()), error.message()));
  return ExitCode::kInternalError;
}
#endif

// A file opened while a standard stream is closed would take its number, and its messages.
void occupy_standard_streams() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) < 0) ::open("/dev/null", O_RDONLY);
  }
}

// What was parsed, from the program down to the innermost verb.
std::vector<const CLI::App*> parsed_verbs(const CLI::App& program) {
  std::vector<const CLI::App*> verbs = {&program};
  while (!verbs.back()->get_subcommands().empty()) {
    verbs.push_back(verbs.back()->get_subcommands().front());
  }
  return verbs;
}

// Whether the words lead from verb to verb.
bool are_verbs(const CLI::App& program, std::span<char*> words) {
  const CLI::App* verb = &program;
  for (const std::string_view word : words) {
    const auto below = verb->get_subcommands(nullptr);
    const auto found = std::find_if(below.begin(), below.end(),
                                    [&](const CLI::App* one) { return one->get_name() == word; });
    if (found == below.end()) return false;
    verb = *found;
  }
  return true;
}

std::string did_you_mean(const std::string& word, std::span<const std::string> names) {
  const auto meant = cairn::cli::likely_meant(word, names);
  return meant ? fmt::format("; did you mean {}?", *meant) : "";
}

std::vector<std::string> option_names(const CLI::App& verb) {
  std::vector<std::string> names;
  for (const CLI::Option* option : verb.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// "output: not given; expected: Map to write", for the first argument that is missing; empty if none is.
std::string missing_argument(const CLI::App& verb) {
  for (const CLI::Option* option : verb.get_options()) {
    if (!option->get_required() || option->count() > 0) continue;
    const std::string& what = option->get_description();
    return fmt::format("{}: not given; expected: {}", option->get_name(),
                       what.substr(0, what.find_first_of(":;,(")));
  }
  return {};
}

// What is wrong with the command line, for people.
std::string complaint(const CLI::App& program, const CLI::ParseError& error) {
  const std::vector<std::string> unexpected = program.remaining(true);
  std::vector<std::string> names;
  for (const CLI::App* verb : parsed_verbs(program).back()->get_subcommands(nullptr)) {
    names.push_back(verb->get_name());
  }
  if (!names.empty()) {
    if (unexpected.empty()) {
      return fmt::format("no verb; expected one of: {}", fmt::join(names, ", "));
    }
    const std::string& word = unexpected.front();
    return fmt::format("{} is no verb; expected one of: {}{}", cairn::printable(word),
                       fmt::join(names, ", "), did_you_mean(word, names));
  }
  // An unknown option is the mistake, even if an argument is missing as well.
  for (const std::string& word : unexpected) {
    if (!word.starts_with("--")) continue;
    const std::string name = word.substr(0, word.find('='));
    return fmt::format("there is no option {}{}", cairn::printable(name),
                       did_you_mean(name, option_names(*parsed_verbs(program).back())));
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    std::string missing = missing_argument(*parsed_verbs(program).back());
    if (!missing.empty()) return missing;
  }
  if (dynamic_cast<const CLI::ExtrasError*>(&error) == nullptr) return error.what();
  const bool has_number =
      std::any_of(unexpected.begin(), unexpected.end(),
                  [](const std::string& word) { return cairn::parse_number(word).has_value(); });
  return fmt::format("not expected: {}{}", fmt::join(unexpected, " "),
                     has_number ? " (the numbers of a pose go into one quoted argument)" : "");
}

int run(int argc, char** argv) {
  // Setting up all options takes longer than the answer.
  if (asks_for_version(argc, argv)) {
    fmt::print("cairn {}\n", cairn::kVersion);
    return ExitCode::kDone;
  }
  CLI::App program("Aligns, links and merges the landmark maps of visual SLAM.", "cairn");
  program.formatter(std::make_shared<cairn::cli::HelpFormatter>());
  program.set_version_flag("-V,--version", std::string("cairn ") + cairn::kVersion,
                           "Print the version and exit");
  program.set_help_flag("-h,--help", "Print this text and exit");
  program.option_defaults()->take_last();
  program.require_subcommand(1);
  program.footer(
      "Try 'cairn demo', then 'cairn help <verb>'.\n\n"
      "Exit codes: 0 done; 1 internal or system error; 2 wrong usage; 3 bad input;\n"
      "4 no trustworthy alignment; 130 interrupted.");
  std::vector<std::pair<std::string, cairn::cli::Run>> verbs = {
#ifndef CAIRN_WHOLE_TOOL
      {"demo", cairn::cli::add_demo(program)},
#endif
      {"info", cairn::cli::add_info(program)},
#ifndef CAIRN_WHOLE_TOOL
      {"convert", cairn::cli::add_convert(program)},
#endif
      {"align", cairn::cli::add_align(program)},
#ifndef CAIRN_WHOLE_TOOL
      {"evaluate", cairn::cli::add_evaluate(program)},
      {"experiment", cairn::cli::add_experiment(program)},
      {"report", cairn::cli::add_report(program)},
#endif
  };
#ifdef CAIRN_HAS_SIMULATION
  verbs.emplace_back("simulate", cairn::cli::add_simulate(program));
#endif
#ifdef CAIRN_HAS_ODOMETRY
  verbs.emplace_back("map", cairn::cli::add_map(program));
  verbs.emplace_back("locate", cairn::cli::add_locate(program));
#endif
#ifdef CAIRN_HAS_MERGING
  verbs.emplace_back("merge", cairn::cli::add_merge(program));
#endif
#ifdef CAIRN_HAS_ATLAS
  verbs.emplace_back("atlas", cairn::cli::add_atlas(program));
#endif
  for (CLI::App* const verb : program.get_subcommands(nullptr)) verb->group("Verbs");
  if (argc < 2) {
    print_error(program.help());
    return ExitCode::kWrongUsage;
  }
  try {
    if (argc > 1 && std::string_view(argv[1]) == "help") {
      // "help align" is "align --help"; CLI11 takes the words last first. It would pass over a word that is none.
      std::vector<std::string> words;
      if (are_verbs(program, {argv + 2, argv + argc})) words.emplace_back("--help");
      for (int i = argc - 1; i > 1; --i) words.emplace_back(argv[i]);
      program.parse(std::move(words));
    } else {
      program.parse(argc, argv);
    }
  } catch (const CLI::Success& asked) {
    program.exit(asked);  // prints the help or the version
    return ExitCode::kDone;
  } catch (const CLI::ParseError& error) {
    std::string words;
    for (const CLI::App* verb : parsed_verbs(program)) words += verb->get_name() + " ";
    print_error(
        fmt::format("cairn: {}\nRun '{}--help' for help.\n", complaint(program, error), words));
    return ExitCode::kWrongUsage;
  }
  cairn::cli::require_distinct_files(*parsed_verbs(program).back());
  const std::string name = program.get_subcommands().front()->get_name();
  return std::find_if(verbs.begin(), verbs.end(),
                      [&](const auto& verb) { return verb.first == name; })
      ->second();
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
#ifdef CAIRN_WHOLE_TOOL
    if (!is_quick(argc, argv)) return become_whole_tool(argv);
#endif
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
