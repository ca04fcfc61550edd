// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::cli {

/// With so many digits behind the point; never "-0.000".
std::string fixed(double value, int digits);

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
