// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace cairn {

/// A table for display: as CSV in full, or as Markdown with rounded numbers.
struct ResultTable {
  struct Column {
    std::string name;
    std::string unit = {};  ///< empty: none
    int digits = 4;         ///< significant, of numbers in Markdown
  };
  using Cell = std::variant<std::monostate, double, std::string>;  ///< unknown, number, text

  std::string name;   ///< of its file, e.g. "table1_scores"
  std::string title;  ///< a sentence
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows;

  /// Rounds numbers to 15 digits: what a conversion of units added in the last digit, such as 4.5849899999999995, goes.
  void round();

  std::string csv() const;
  std::string markdown() const;
};

}  // namespace cairn
