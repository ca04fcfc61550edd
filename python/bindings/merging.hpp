// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/merging/merge.hpp"

#include "bindings/support.hpp"

namespace cairn::python {

/// A merged map and the names of the maps, to which the indices in result.maps and the links refer.
struct Merged {
  MergeResult result;  ///< its map is in `map`
  std::vector<std::string> names;
  SharedMap map;  ///< null if no two maps were placed
};

struct NamedLink {
  std::string source;
  std::string target;
  Link link;
  bool used = false;
};

}  // namespace cairn::python
