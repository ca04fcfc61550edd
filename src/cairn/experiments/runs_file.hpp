// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/experiments/run.hpp"

namespace cairn {

/// Runs as rows of two tables (docs/experiments.md): `runs.csv`, which is reproducible, and `timings.csv`
/// with the same keys and the durations.
///
/// Rows end with a checksum and LF. Without LF a row is incomplete; with another checksum it is damaged.
std::string runs_header();
std::string runs_row(const TrialResult& run);
std::string timings_header();
std::string timings_row(const TrialResult& run);

/// The cell that ends a row: the first 8 hexadecimal digits of the 128-bit XXH3 hash of the row's text before
/// it, which ends with a comma.
std::string row_checksum(std::string_view before);

/// Bytes of a table up to its first incomplete or damaged row; 0 if the header is incomplete, or zeros stand in it, as
/// they do where the power failed while it was written.
/// @throws Error (input) if it begins otherwise than with the header
std::size_t sound_size(std::string_view table, std::string_view header, std::string_view name);

/// The runs of a `runs.csv`, without durations. Leaves out a truncated last row.
/// @throws Error (input) naming line, column and constraint, or the line of a damaged row
std::vector<TrialResult> parse_runs(std::string_view text, std::string_view name);

}  // namespace cairn
