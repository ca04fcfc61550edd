// SPDX-License-Identifier: BSD-3-Clause
#include "support/help.hpp"

#include <sstream>
#include <utility>

#include <fmt/format.h>

namespace cairn::cli {
namespace {

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

}  // namespace

HelpFormatter::HelpFormatter() {
  label("OPTIONS", "options");
  label("SUBCOMMAND", "<verb>");
  label("Positionals", "Arguments");
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string name,
                                     CLI::AppFormatMode mode) const {
  const std::string text = Formatter::make_help(app, std::move(name), mode);
  return CLI::detail::find_and_replace(text, "\n\n\n", "\n\n");
}

std::string HelpFormatter::make_description(const CLI::App* app) const {
  return app->get_description() + "\n\n";
}

std::string HelpFormatter::make_subcommand(const CLI::App* verb) const {
  return entry(verb->get_name(), verb->get_description());
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  std::string name =
      CLI::detail::find_and_replace(make_option_name(option, is_positional), ",", ", ");
  name = CLI::detail::find_and_replace(name, "{false}", "");  // of the flag that says no
  if (!is_positional && option->get_type_size() != 0) name += " " + option->get_type_name();
  std::string description = option->get_description();
  if (!option->get_default_str().empty())
    description += " (default " + option->get_default_str() + ")";
  return entry(name, description);
}

}  // namespace cairn::cli
