// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/merging/changes.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// Changes as documents have them.
Json to_json(const ChangeResult& result);

/// A line of each change, for people; empty if there are none.
std::string changes_text(const ChangeResult& result, LengthUnit unit);

}  // namespace cairn::cli
