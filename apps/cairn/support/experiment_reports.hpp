// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/experiments/paper.hpp"
#include "cairn/report/report.hpp"

#include "support/arguments.hpp"

namespace cairn::cli {

/// Writes each section that is a chart as figures/ID.svg.
void write_figures(const std::string& folder, const std::vector<report::Section>& sections);

/// Writes the paper's Figure 2 as figures/figure2.svg: the clouds where they fit best, and where they
/// fit worst.
void write_clouds(const std::string& folder, const MapPair& pair, const PaperResults& results,
                  const PointSetOptions& point_options);

/// Writes the paper's Figure 1 as figures/figure1.png: an image of each sequence, of those two keyframes
/// that have the most landmarks in common at the pose of the run with the lowest score.
/// @returns a sentence that says which images these are, or why there are none
/// @throws Error (misuse) where the tool was built without OpenCV; (input) for unreadable images
std::string write_common_view(const std::string& folder, const MapPair& pair,
                              const PaperResults& results, const std::string& source_sequence,
                              const std::string& target_sequence);

}  // namespace cairn::cli
