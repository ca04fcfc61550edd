// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/alignment/align.hpp"

#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {

/// `align --pairs`: aligns each pair of a list, reading and preparing each map once as long as it is in use.
/// @param list a CSV file with columns source and target, or "-"
/// @param options of all pairs; `scale` also for maps of free scale
/// @param gravity whether the maps know where down is
/// @param recorded what the document says of the options
/// @return exit code: kDone if all pairs are aligned
int align_pairs(const std::string& list, const AlignOptions& options, bool gravity,
                const Json& recorded, const CommonArguments& common);

}  // namespace cairn::cli
