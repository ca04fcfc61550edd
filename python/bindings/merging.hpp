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

/// Keywords of functions that merge placed maps.
/// @param placed returns a reference to the options' MergePlacedOptions
template <class Options, class Placed>
void add_merge_placed_to(Keywords<Options>& keywords, const Placed& placed) {
  keywords
      .add("fusion_probability",
           [placed](auto& o) -> auto& { return placed(o).fusion.min_probability; })
      .add("straighten", [placed](auto& o) -> auto& { return placed(o).straighten; })
      .add("adjust", [placed](auto& o) -> auto& { return placed(o).adjust; })
      .add("refine_intrinsics",
           [placed](auto& o) -> auto& { return placed(o).adjustment.refine_intrinsics; })
      .add("matching_rounds", [placed](auto& o) -> auto& { return placed(o).matching_rounds; });
}

struct NamedLink {
  std::string source;
  std::string target;
  Link link;
  bool used = false;
};

}  // namespace cairn::python
