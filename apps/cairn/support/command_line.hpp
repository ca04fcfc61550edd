// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace cairn::cli {

/// Heading of the options that every verb takes. `--help` lists the options under this heading and those without a
/// heading of their own; only `--help-all` lists the others.
inline constexpr const char* kCommonOptions = "Common options";

/// Stores the words that the program was called with. Call once, before anything else.
void keep_command_line(int argc, char** argv);

/// "cairn" and the words after it.
const std::vector<std::string>& command_line();

/// "; did you mean NAME?" if a mistyped word probably means one of the names; otherwise "".
std::string did_you_mean(const std::string& word, std::span<const std::string> names);

/// "--name" of "-n,--name".
std::string long_name(const std::string& name);

/// An option or argument of a verb. Option and Command refer to parts of the Program and are valid as long as it
/// lives. Only the source of this header includes the parser, CLI11.
class Option {
 public:
  Option() = default;
  explicit Option(CLI::Option* option) : option_(option) {}

  Option required() const;
  Option excludes(Option other) const;
  Option needs(Option other) const;
  /// Requires exactly this number of words.
  Option words(int count) const;
  /// Lists the option under this heading of the help.
  Option under(const std::string& heading) const;
  /// Shows this text as the default in the help.
  Option shows(const std::string& text) const;

  bool given() const;
  std::string name() const;

 private:
  CLI::Option* option_ = nullptr;
};

class Program;

/// A verb of the program, or the program itself.
class Command {
 public:
  Command(Program& program, CLI::App& app) : program_(&program), app_(&app) {}

  /// Adds a verb. `run` is called after the verb's words are parsed, and returns the program's exit code.
  Command add_verb(const std::string& name, const std::string& what,
                   std::function<int()> run) const;
  /// Adds a verb that has verbs of its own, one of which must be given.
  Command add_group(const std::string& name, const std::string& what) const;
  /// Sets the text at the end of the help.
  void footer(const std::string& text) const;

  Option add_flag(const std::string& name, bool& given, const std::string& what) const;
  /// Adds an argument or option that takes text. Refuses empty text, e.g. of an unset shell variable, and a word that
  /// must be the next option. If `text` is not empty, the help shows it as the default.
  Option add_text(const std::string& name, std::string& text, const std::string& what,
                  const std::string& type = "") const;
  /// The same for any number of words.
  Option add_words(const std::string& name, std::vector<std::string>& words,
                   const std::string& what, const std::string& type = "") const;
  /// Adds an option that takes one word. If it is given several times, the last word counts. `read` may throw.
  Option add_value(const std::string& name, const std::string& what, const std::string& type,
                   std::function<void(const std::string&)> read) const;

  /// The option or argument of this name, which must exist.
  Option option(const std::string& name) const;
  bool has_option(const std::string& name) const;
  /// Lists options of this verb under a heading of their own, for options that few callers need.
  void list_under(const std::string& heading, const std::vector<std::string>& names) const;

 private:
  Program* program_;
  CLI::App* app_;
};

/// Adds a verb: Arguments::add_to(const Command&) adds its arguments, and Arguments::run() runs it.
template <class Arguments>
Command add_verb(const Command& parent, const std::string& name, const std::string& what) {
  auto arguments = std::make_shared<Arguments>();
  const Command verb = parent.add_verb(name, what, [arguments] { return arguments->run(); });
  arguments->add_to(verb);
  return verb;
}

/// The whole command line.
class Program {
 public:
  Program(const std::string& name, const std::string& what, const std::string& version,
          const std::string& footer);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  Command root();

  /// Parses the words. Then runs the verb that they name, prints the requested help, or prints what is wrong with the
  /// words.
  /// @return the exit code
  int run(int argc, char** argv);

 private:
  friend class Command;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn::cli
