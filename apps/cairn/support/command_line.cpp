// SPDX-License-Identifier: BSD-3-Clause
#include "support/command_line.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/detail/files_read.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

#include "support/arguments.hpp"

namespace cairn::cli {
namespace {

/// A path as a word of the command line gives it.
struct NamedPath {
  std::string option;  ///< "--output", or the name of a positional argument
  std::string path;
  bool one_of_several = false;  ///< the option takes any number of paths
};

namespace fs = std::filesystem;

// Whether both name one file, which need not exist yet. Devices and pipes may be named twice.
bool are_one_file(const std::string& a, const std::string& b) {
  std::error_code error;
  const bool exist = fs::exists(a, error) && fs::exists(b, error);
  if (exist) {
    const bool special = fs::is_other(a, error);
    return !special && fs::equivalent(a, b, error) && !error;
  }
  if (fs::exists(a, error) || fs::exists(b, error)) return false;
  const fs::path first = fs::weakly_canonical(fs::absolute(a, error), error);
  if (error) return a == b;
  const fs::path second = fs::weakly_canonical(fs::absolute(b, error), error);
  return error ? a == b : first == second;
}

// Refuses a command line whose output is also an input or another output, be it through links: the one
// would be lost to the other. An input that the command line does not name is refused when it is read: see
// refuse_to_read.
// @throws Error (misuse) naming both
void require_distinct_files(const std::vector<NamedPath>& inputs,
                            const std::vector<NamedPath>& outputs) {
  const auto refuse_one_file = [](const NamedPath& output, const NamedPath& other,
                                  std::string_view role) {
    if (!are_one_file(output.path, other.path)) return;
    // A positional argument is named by its role: "the input".
    const bool positional = !other.option.starts_with("--");
    throw Error(
        ErrorKind::kMisuse, output.option,
        fmt::format("{} is {} too", output.path,
                    positional ? (other.one_of_several ? "one of the " : "the ") + other.option
                               : fmt::format("{} {}", role, other.option)),
        "a file of its own");
  };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (const NamedPath& input : inputs) refuse_one_file(outputs[i], input, "the input");
    for (std::size_t j = 0; j < i; ++j) refuse_one_file(outputs[i], outputs[j], "the output");
  }
  // Inputs that no word names: those that lie in a folder, or that a list or an earlier result names.
  std::vector<detail::NamedOutput> written;
  for (const NamedPath& output : outputs) written.push_back({output.option, output.path});
  detail::refuse_to_read(written);
}

std::vector<std::string>& words_of_program() {
  static std::vector<std::string> kept = {"cairn"};
  return kept;
}

// --- Help --------------------------------------------------------------------------------------------

constexpr std::size_t kLineWidth = 96;
constexpr std::size_t kIndent = 28;  // of descriptions

std::string entry(const std::string& name, const std::string& description) {
  std::string text = fmt::format("  {:<{}}", name, kIndent - 2);
  if (name.size() + 4 > kIndent) text += fmt::format("\n{:{}}", "", kIndent);
  std::size_t column = kIndent;
  std::istringstream words(description);
  for (std::string word; words >> word;) {
    if (column > kIndent && column + 1 + word.size() > kLineWidth) {
      text += fmt::format("\n{:{}}", "", kIndent);
      column = kIndent;
    }
    if (column > kIndent) {
      text += ' ';
      ++column;
    }
    text += word;
    column += word.size();
  }
  return text + "\n";
}

// Help that fits a terminal: descriptions wrapped, defaults at their end.
class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter() {
    label("OPTIONS", "options");
    label("SUBCOMMAND", "<verb>");
    label("Positionals", "Arguments");
  }

  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override {
    const std::string text = make_description(app) + make_usage(app, std::move(name)) +
                             make_positionals(app) + options_text(app, mode) +
                             make_subcommands(app, CLI::AppFormatMode::Normal) + "\n" +
                             make_footer(app);
    return CLI::detail::find_and_replace(text, "\n\n\n", "\n\n");
  }

  std::string make_description(const CLI::App* app) const override {
    return app->get_description() + "\n\n";
  }

  std::string make_subcommand(const CLI::App* verb) const override {
    return entry(verb->get_name(), verb->get_description());
  }

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string name =
        CLI::detail::find_and_replace(make_option_name(option, is_positional), ",", ", ");
    name = CLI::detail::find_and_replace(name, "{false}", "");  // of the flag that says no
    if (!is_positional && option->get_type_size() != 0) name += " " + option->get_type_name();
    std::string description = option->get_description();
    if (!option->get_default_str().empty())
      description += " (default " + option->get_default_str() + ")";
    return entry(name, description);
  }

 private:
  // The headings of what few callers need come last, and only if all help is asked for.
  std::string options_text(const CLI::App* app, CLI::AppFormatMode mode) const {
    std::string text;
    std::string rare;
    std::vector<std::string> left_out;
    for (const std::string& heading : app->get_groups()) {
      const auto options = app->get_options([&](const CLI::Option* option) {
        return option->nonpositional() && option->get_group() == heading;
      });
      if (options.empty()) continue;
      const bool is_usual = heading == "Options" || heading == kCommonOptions;
      (is_usual ? text : rare) += make_group(heading, false, options) + "\n";
      if (!is_usual) left_out.push_back(heading);
    }
    if (mode == CLI::AppFormatMode::All) return text + rare;
    if (left_out.empty()) return text;
    return text +
           fmt::format("More options, which --help-all lists: {}\n\n", fmt::join(left_out, ", "));
  }
};

// --- What is wrong with a command line ---------------------------------------------------------------

// Optimal string alignment: Levenshtein's distance with swaps of neighbours.
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before;
  std::vector<std::size_t> above;
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before = std::exchange(above, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] =
          std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
  }
  return row.back();
}

// The candidate that a mistyped word is likely to mean.
std::optional<std::string> likely_meant(std::string_view word,
                                        std::span<const std::string> candidates) {
  const std::size_t most = std::max<std::size_t>(1, word.size() / 3);
  // Names in help are short: nobody means one of them by a page of text.
  constexpr std::size_t kLongest = 64;
  if (word.size() > kLongest) return std::nullopt;
  std::optional<std::string> best;
  std::size_t fewest = most + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t edits = edits_between(word, candidate);
    if (edits >= fewest) continue;
    fewest = edits;
    best = candidate;
  }
  return best;
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
    return fmt::format("{} is no verb; expected one of: {}{}", printable(word),
                       fmt::join(names, ", "), did_you_mean(word, names));
  }
  // An unknown option is the mistake, even if an argument is missing as well.
  for (const std::string& word : unexpected) {
    if (!word.starts_with("--")) continue;
    const std::string name = word.substr(0, word.find('='));
    return fmt::format("there is no option {}{}", printable(name),
                       did_you_mean(name, option_names(*parsed_verbs(program).back())));
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    std::string missing = missing_argument(*parsed_verbs(program).back());
    if (!missing.empty()) return missing;
  }
  if (dynamic_cast<const CLI::ExtrasError*>(&error) == nullptr) return error.what();
  const bool has_number =
      std::any_of(unexpected.begin(), unexpected.end(),
                  [](const std::string& word) { return parse_number(word).has_value(); });
  std::string hint;
  if (has_number) {
    hint = " (the numbers of a pose go into one quoted argument)";
  } else if (parsed_verbs(program).back()->get_option_no_throw("--atlas") != nullptr) {
    hint = " (the atlas is named by --atlas)";
  }
  return fmt::format("not expected: {}{}", fmt::join(unexpected, " "), hint);
}

// "--output", or the name of a positional argument.
std::string plain_name(const CLI::Option& option) {
  if (option.get_positional()) return option.get_name(true, false);
  const auto& names = option.get_lnames();
  return names.empty() ? option.get_name() : "--" + names.front();
}

bool is_output(const CLI::App& verb, std::string_view name) {
  constexpr std::array<std::string_view, 8> kOutputs = {"--json",        "--csv",        "--report",
                                                        "--output",      "--trajectory", "--pose",
                                                        "--write-truth", "output"};
  if (name == "--pose" && verb.get_name() == "link") return false;  // 'atlas link' reads a pose
  return std::find(kOutputs.begin(), kOutputs.end(), name) != kOutputs.end();
}

bool may_name_files(const CLI::Option& option) {
  if (option.get_positional()) return true;
  const std::string type = option.get_type_name();
  return type.find("FILE") != std::string::npos || type == "MAP" || type == "CAMERA";
}

void check_files(const CLI::App& verb) {
  std::vector<NamedPath> inputs;
  std::vector<NamedPath> outputs;
  for (const CLI::Option* const option : verb.get_options()) {
    const std::string name = plain_name(*option);
    const bool written = is_output(verb, name);
    if (!written && !may_name_files(*option)) continue;
    for (const std::string& word : option->results()) {
      if (word.empty() || word == "-") continue;
      (written ? outputs : inputs).push_back({name, word, option->get_expected_max() > 1});
    }
  }
  require_distinct_files(inputs, outputs);
}

// A check of CLI11's: refuses what is no value.
auto refuse_none(const std::string& name) {
  return [option = long_name(name)](const std::string& word) {
    refuse_if(word.empty() || word.starts_with("--"), option, printable(word), "a value");
    return std::string();
  };
}

}  // namespace

std::string did_you_mean(const std::string& word, std::span<const std::string> names) {
  const auto meant = likely_meant(word, names);
  return meant ? fmt::format("; did you mean {}?", *meant) : "";
}

void keep_command_line(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) words_of_program().push_back(without_password(argv[i]));
}

const std::vector<std::string>& command_line() {
  return words_of_program();
}

std::string long_name(const std::string& name) {
  return name.substr(name.find_last_of(',') + 1);
}

Option Option::required() const {
  option_->required();
  return *this;
}

Option Option::excludes(Option other) const {
  option_->excludes(other.option_);
  return *this;
}

Option Option::needs(Option other) const {
  option_->needs(other.option_);
  return *this;
}

Option Option::words(int count) const {
  option_->expected(count)->take_last();
  return *this;
}

Option Option::under(const std::string& heading) const {
  option_->group(heading);
  return *this;
}

Option Option::shows(const std::string& text) const {
  option_->default_str(text);
  return *this;
}

bool Option::given() const {
  return option_->count() > 0;
}

std::string Option::name() const {
  return option_->get_name();
}

struct Program::State {
  CLI::App app;
  std::vector<std::pair<const CLI::App*, std::function<int()>>> runs;  // of the innermost verbs
};

Command Command::add_verb(const std::string& name, const std::string& what,
                          std::function<int()> run) const {
  CLI::App* const verb = app_->add_subcommand(name, what)->group("Verbs");
  program_->state_->runs.emplace_back(verb, std::move(run));
  return {*program_, *verb};
}

Command Command::add_group(const std::string& name, const std::string& what) const {
  CLI::App* const verb = app_->add_subcommand(name, what)->group("Verbs")->require_subcommand(1);
  return {*program_, *verb};
}

void Command::footer(const std::string& text) const {
  app_->footer(text);
}

Option Command::add_flag(const std::string& name, bool& given, const std::string& what) const {
  return Option(app_->add_flag(name, given, what));
}

Option Command::add_text(const std::string& name, std::string& text, const std::string& what,
                         const std::string& type) const {
  CLI::Option* const added =
      app_->add_option(name, text, what)->type_name(type)->check(refuse_none(name));
  if (!text.empty()) added->capture_default_str();
  return Option(added);
}

Option Command::add_words(const std::string& name, std::vector<std::string>& words,
                          const std::string& what, const std::string& type) const {
  return Option(
      app_->add_option(name, words, what)->type_name(type)->take_all()->check(refuse_none(name)));
}

Option Command::add_value(const std::string& name, const std::string& what, const std::string& type,
                          std::function<void(const std::string&)> read) const {
  const auto parse = [read = std::move(read)](const CLI::results_t& words) {
    read(words.back());
    return true;
  };
  return Option(app_->add_option(name, parse, what)->type_name(type));
}

Option Command::option(const std::string& name) const {
  return Option(app_->get_option(name));
}

bool Command::has_option(const std::string& name) const {
  return app_->get_option_no_throw(name) != nullptr;
}

void Command::list_under(const std::string& heading, const std::vector<std::string>& names) const {
  for (const std::string& name : names) option(name).under(heading);
}

Program::Program(const std::string& name, const std::string& what, const std::string& version,
                 const std::string& footer)
    : state_(std::make_unique<State>()) {
  CLI::App& app = state_->app;
  app.name(name)->description(what)->footer(footer);
  app.formatter(std::make_shared<HelpFormatter>());
  app.set_version_flag("-V,--version", version, "Print the version and exit");
  app.set_help_flag("-h,--help", "Print this text and exit");
  app.set_help_all_flag("--help-all", "Print it with every option and exit");
  app.option_defaults()->take_last();
  app.require_subcommand(1);
}

Program::~Program() = default;

Command Program::root() {
  return {*this, state_->app};
}

int Program::run(int argc, char** argv) {
  CLI::App& app = state_->app;
  if (argc < 2) {
    print_error(app.help());
    return ExitCode::kWrongUsage;
  }
  try {
    if (std::string_view(argv[1]) == "help") {
      // "help align" is "align --help"; CLI11 takes the words last first. It would pass over a word that is none.
      std::vector<std::string> words;
      if (are_verbs(app, {argv + 2, argv + argc})) words.emplace_back("--help");
      for (int i = argc - 1; i > 1; --i) words.emplace_back(argv[i]);
      app.parse(std::move(words));
    } else {
      app.parse(argc, argv);
    }
  } catch (const CLI::Success& asked) {
    app.exit(asked);  // prints the help or the version
    return ExitCode::kDone;
  } catch (const CLI::ParseError& error) {
    std::string words;
    for (const CLI::App* verb : parsed_verbs(app)) words += verb->get_name() + " ";
    print_error(fmt::format("cairn: {}\nRun '{}--help' for help.\n", complaint(app, error), words));
    return ExitCode::kWrongUsage;
  }
  const CLI::App* const verb = parsed_verbs(app).back();
  check_files(*verb);
  return std::find_if(state_->runs.begin(), state_->runs.end(),
                      [&](const auto& one) { return one.first == verb; })
      ->second();
}

}  // namespace cairn::cli
