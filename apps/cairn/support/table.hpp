// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::cli {

/// A table for people: the first column flush left, all others flush right.
class Table {
 public:
  explicit Table(std::vector<std::string> header);

  /// One cell a column.
  void add_row(std::vector<std::string> cells);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace cairn::cli
