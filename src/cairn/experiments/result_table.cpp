// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "cairn/core/detail/csv.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/experiments/run.hpp"

namespace cairn {
namespace {

std::string label(const ResultTable::Column& column) {
  return column.unit.empty() ? column.name : fmt::format("{} ({})", column.name, column.unit);
}

// A bar would end the cell.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '|') result += '\\';
    result += c == '\n' ? ' ' : c;
  }
  return result;
}

std::string markdown_cell(const ResultTable::Cell& cell, int digits) {
  if (const double* number = std::get_if<double>(&cell)) {
    return fmt::format("{:.{}g}", *number, digits);
  }
  if (const std::string* text = std::get_if<std::string>(&cell)) return escaped(*text);
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
  for (const Column& column : columns) text += fmt::format(" {} |", escaped(label(column)));
  text += "\n|" + fmt::format("{:-<3}|", "");
  for (std::size_t i = 1; i < columns.size(); ++i) text += "--:|";
  text += '\n';
  for (const auto& row : rows) {
    text += '|';
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += fmt::format(" {} |", markdown_cell(row[i], columns[i].digits));
    }
    text += '\n';
  }
  return text;
}

}  // namespace cairn
