// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/pose_graph/pose_graph.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// Adds the pose of a link, its scale and its covariance; each is null if the link has none.
inline void add_pose(const Link& link, Json& json) {
  json["target_from_source"] = nullptr;
  json["scale"] = nullptr;
  json["covariance"] = nullptr;
  if (!link.target_from_source) return;
  json["target_from_source"] = to_json(link.target_from_source->matrix());
  json["scale"] = link.target_from_source->scale();
  if (link.covariance_with_scale) {
    json["covariance"] = to_json(*link.covariance_with_scale);
  } else if (link.covariance) {
    json["covariance"] = to_json(*link.covariance);
  }
}

}  // namespace cairn::cli
