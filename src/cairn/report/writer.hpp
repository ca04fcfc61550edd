// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {

/// Writes a report as one HTML page that needs nothing else (docs/report_format.md). Same report and
/// page, same bytes.
/// @param page the viewer: HTML in which `<!--CAIRN:TITLE-->` and `<!--CAIRN:DATA-->` each stand once
/// @throws Error (input) if the page's marks are not there; (misuse) naming the part of the report that
///         breaks what report.hpp states: ids, sizes, maps that scenes name
void write_report(const Report& report, std::string_view page, const ByteSink& sink);

/// Writes a report with this build's viewer as a file: the whole of it, or nothing.
/// @throws Error (misuse) if this build has no viewer; also as write_report and write_file
void save_report(const Report& report, const std::filesystem::path& path);

}  // namespace cairn::report
