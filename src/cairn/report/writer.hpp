// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {

/// Writes a report as one self-contained HTML page (docs/report_format.md). The same report and page give
/// the same bytes.
/// @param page the viewer: HTML that contains `<!--CAIRN:TITLE-->` and `<!--CAIRN:DATA-->` once each
/// @throws Error (input) if the page lacks a mark; (misuse) naming the part of the report that is invalid
///        by report.hpp: ids, sizes, maps named by scenes
void write_report(const Report& report, std::string_view page, const ByteSink& sink);

/// Writes a report with this build's viewer to a file, atomically.
/// @throws Error (misuse) if this build has no viewer; also as write_report and write_file
void save_report(const Report& report, const std::filesystem::path& path);

/// Whether this build contains the viewer (CMake option CAIRN_WITH_VIEWER), which reports need.
bool has_viewer();

/// The viewer's page, for write_report().
/// @throws Error (misuse) if this build has none
std::string_view viewer_page();

/// The machine that runs this program; texts are empty if the system does not provide them.
/// @param threads available to the work
Machine this_machine(unsigned threads);

}  // namespace cairn::report
