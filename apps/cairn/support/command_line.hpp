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

/// The heading of what every verb takes. `--help` lists the options under it and those under no heading of their own;
/// the others wait for `--help-all`.
inline constexpr const char* kCommonOptions = "Common options";

/// Keeps the words that the program was called with. To be called once, first of all.
void keep_command_line(int argc, char** argv);

/// "cairn" and the words after it.
const std::vector<std::string>& command_line();

/// "; did you mean NAME?" if one of the names is likely meant by a mistyped word, or "".
std::string did_you_mean(const std::string& word, std::span<const std::string> names);

/// "--name" of "-n,--name".
std::string long_name(const std::string& name);

/// An option or argument of a verb. Lives as long as the Program, whose parts Option and Command name; CLI11, which
/// parses, is included by the source of this header alone.
class Option {
 public:
  Option() = default;
  explicit Option(CLI::Option* option) : option_(option) {}

  Option required() const;
  Option excludes(Option other) const;
  Option needs(Option other) const;
  /// Takes exactly so many words.
  Option words(int count) const;
  /// The heading under which the help lists it.
  Option under(const std::string& heading) const;
  /// What the help shows as the default.
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

  /// Adds a verb that `run` runs once its words are parsed; its exit code is the program's.
  Command add_verb(const std::string& name, const std::string& what,
                   std::function<int()> run) const;
  /// Adds a verb that has verbs of its own, one of which must be given.
  Command add_group(const std::string& name, const std::string& what) const;
  /// Ends the help.
  void footer(const std::string& text) const;

  Option add_flag(const std::string& name, bool& given, const std::string& what) const;
  /// Adds an argument or option that takes text. Refused is empty text, as of an unset shell variable, and what must
  /// be the next option. Text that is not empty is shown as the default.
  Option add_text(const std::string& name, std::string& text, const std::string& what,
                  const std::string& type = "") const;
  /// The same for any number of words.
  Option add_words(const std::string& name, std::vector<std::string>& words,
                   const std::string& what, const std::string& type = "") const;
  /// Adds an option that takes one word, of which the last given counts; `read` may throw.
  Option add_value(const std::string& name, const std::string& what, const std::string& type,
                   std::function<void(const std::string&)> read) const;

  /// The option or argument of this name, which must exist.
  Option option(const std::string& name) const;
  bool has_option(const std::string& name) const;
  /// Lists options of this verb under a heading of their own: for what few callers need.
  void list_under(const std::string& heading, const std::vector<std::string>& names) const;

 private:
  Program* program_;
  CLI::App* app_;
};

/// Adds a verb whose arguments Arguments::add_to(const Command&) adds and Arguments::run() runs.
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

  /// Parses the words and runs the verb that they name, or prints the help that they ask for, or what is wrong with
  /// them.
  /// @return the exit code
  int run(int argc, char** argv);

 private:
  friend class Command;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn::cli
