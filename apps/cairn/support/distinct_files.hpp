// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::cli {

/// A path as a word of the command line gives it.
struct NamedPath {
  std::string option;  ///< "--output", or the name of a positional argument
  std::string path;
  bool one_of_several = false;  ///< the option takes any number of paths
};

/// Refuses a command line whose output is also an input or another output, be it through links: the one
/// would be lost to the other. An input that the command line does not name is refused when it is read: see
/// refuse_to_read.
/// @throws Error (misuse) naming both
void require_distinct_files(const std::vector<NamedPath>& inputs,
                            const std::vector<NamedPath>& outputs);

}  // namespace cairn::cli
