// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/atlas/atlas.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/merging/changes.hpp"

#include "bindings/merging.hpp"

/// Classes of what the methods of an Atlas return.
namespace cairn::python {

struct HeldMap {
  AtlasNode node;
  std::optional<AtlasPose> pose;
  std::string frame;  ///< name of the map whose frame the pose is in
};

struct Route {
  AtlasRoute route;
  std::vector<std::string> maps;
  std::vector<NamedLink> links;
};

struct WorldDifference {
  ChangeResult result;
  std::string frame;  ///< name of the map whose frame the places are in
};

void bind_atlas_results(py::module_& module);

}  // namespace cairn::python
