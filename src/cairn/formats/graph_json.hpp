// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// A graph as JSON: schema cairn.pose_graph, version 1 (docs/formats.md).
std::string pose_graph_text(const PoseGraph& graph);

/// Whether a text is such a document, by its first kilobyte.
bool is_pose_graph_text(std::string_view beginning);

/// Reads such a document. Normalises quaternions, which may change their last digit; all else is as
/// written.
/// @throws Error (input) naming source, the place in the document, value and constraint
PoseGraph read_pose_graph(ByteSource& source);

}  // namespace cairn
