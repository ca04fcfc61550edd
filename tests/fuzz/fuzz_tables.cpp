// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string>

#include "cairn/core/detail/csv.hpp"
#include "cairn/experiments/detail/runs_file.hpp"
#include "cairn/experiments/run.hpp"

#include "fuzz/imported.hpp"

// Tables as CSV: any, and the runs of a study.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = cairn::testing::text_of(data, size);
  cairn::testing::expect_read_or_refused([&] {
    for (const cairn::detail::CsvRow& row : cairn::detail::parse_csv(text, "input")) {
      cairn::detail::Csv csv;
      for (const std::string& cell : row.cells) csv << cell;
      csv.end_row();
      // Not first, where a byte order mark would be no part of it.
      const std::vector<cairn::detail::CsvRow> again =
          cairn::detail::parse_csv("header\n" + csv.text(), "written");
      if (again.size() != 2 || again[1].cells != row.cells) {
        cairn::testing::abort_because("a row written and read back differs");
      }
    }
  });
  // With their right checksums, which no mutation finds.
  std::string table = cairn::runs_header();
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string row = std::string(text.substr(begin, end - begin)) + ",";
    table += row + cairn::detail::row_checksum(row) + "\n";
    begin = end + 1;
  }
  cairn::testing::expect_read_or_refused([&] { cairn::parse_runs(text, "input"); });
  cairn::testing::expect_read_or_refused(
      [&] { cairn::detail::sound_size(text, cairn::runs_header(), "input"); });
  cairn::testing::expect_read_or_refused([&] {
    std::string once = cairn::runs_header();
    for (const cairn::TrialResult& run : cairn::parse_runs(table, "input")) {
      once += cairn::runs_row(run);
    }
    std::string twice = cairn::runs_header();
    for (const cairn::TrialResult& run : cairn::parse_runs(once, "written")) {
      twice += cairn::runs_row(run);
    }
    if (once != twice) cairn::testing::abort_because("runs written twice differ");
  });
  return 0;
}
