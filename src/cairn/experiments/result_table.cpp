// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/detail/csv.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/experiments/run.hpp"

namespace cairn {
namespace {

std::string label(const ResultTable::Column& column) {
  return column.unit.empty() ? column.name : fmt::format("{} ({})", column.name, column.unit);
}

// Without what would end a cell.
std::string escaped(std::string_view text, std::string_view special) {
  std::string result;
  for (const char c : text) {
    if (special.find(c) != std::string_view::npos) result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result;
}

constexpr std::string_view kMarkdown = "|";
constexpr std::string_view kLatex = "&%$#_{}";

// "10^-3 m^2" with raised exponents; the only use of '^'.
std::string latex_unit(const std::string& unit) {
  std::string result;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    if (unit[i] != '^') {
      result += escaped(unit.substr(i, 1), kLatex);
      continue;
    }
    const std::size_t end = std::min(unit.find(' ', i), unit.size());
    result += "$^{" + unit.substr(i + 1, end - i - 1) + "}$";
    i = end - 1;
  }
  return result;
}

std::string rounded_cell(const ResultTable::Cell& cell, int digits, std::string_view special) {
  if (const double* number = std::get_if<double>(&cell)) {
    return fmt::format("{:.{}g}", *number, digits);
  }
  if (const std::string* text = std::get_if<std::string>(&cell)) return escaped(*text, special);
  return "-";
}

}  // namespace

void ResultTable::round() {
  for (auto& row : rows) {
    for (Cell& cell : row) {
      double* const number = std::get_if<double>(&cell);
      if (number != nullptr)
        *number = parse_number(fmt::format("{:.15g}", *number)).value_or(*number);
    }
  }
}

std::string ResultTable::csv() const {
  detail::Csv csv;
  for (const Column& column : columns) csv << label(column);
  csv.end_row();
  for (const auto& row : rows) {
    for (const Cell& cell : row) {
      if (const double* number = std::get_if<double>(&cell)) {
        csv << *number;
      } else if (const std::string* text = std::get_if<std::string>(&cell)) {
        csv << *text;
      } else {
        csv << "";
      }
    }
    csv.end_row();
  }
  return csv.text();
}

std::string ResultTable::markdown() const {
  std::string text = "|";
  for (const Column& column : columns)
    text += fmt::format(" {} |", escaped(label(column), kMarkdown));
  text += "\n|" + fmt::format("{:-<3}|", "");
  for (std::size_t i = 1; i < columns.size(); ++i) text += "--:|";
  text += '\n';
  for (const auto& row : rows) {
    text += '|';
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += fmt::format(" {} |", rounded_cell(row[i], columns[i].digits, kMarkdown));
    }
    text += '\n';
  }
  return text;
}

std::string ResultTable::latex() const {
  std::string names;
  std::string units;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string_view before = i == 0 ? "" : " & ";
    names += fmt::format("{}{}", before, escaped(columns[i].name, kLatex));
    units += fmt::format("{}{}", before, latex_unit(columns[i].unit));
  }
  std::string text = fmt::format("\\begin{{tabular}}{{l{}}}\n\\toprule\n{} \\\\\n",
                                 std::string(columns.size() - 1, 'r'), names);
  const bool has_units = std::any_of(columns.begin(), columns.end(),
                                     [](const Column& column) { return !column.unit.empty(); });
  if (has_units) text += units + " \\\\\n";
  text += "\\midrule\n";
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += (i == 0 ? "" : " & ") + rounded_cell(row[i], columns[i].digits, kLatex);
    }
    text += " \\\\\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

}  // namespace cairn
