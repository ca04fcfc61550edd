// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/merging/merge.hpp"

#include "bindings/support.hpp"

namespace cairn::python {

/// A merged map and the names of its parts, which result.maps and the links' indices refer to.
struct Merged {
  MergeResult result;  ///< its map is in `map`
  std::vector<std::string> names;
  SharedMap map;  ///< null if no two maps were placed
};

struct Link {
  std::string source;
  std::string target;
  MapLink link;
  bool used = false;
};

}  // namespace cairn::python
