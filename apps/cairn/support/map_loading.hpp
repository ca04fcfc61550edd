// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/core/log.hpp"

#include "support/documents.hpp"

namespace cairn::cli {

/// How `load_map` treats a file.
struct MapLoading {
  /// Whose conventions hold where a file breaks those of its format: "data" or "format".
  std::string convention = "data";
  /// What is left out is an error, not a remark.
  bool strict = false;

  /// Adds --convention.
  void add_to(const Command& command);
  /// @throws Error (misuse) naming --convention
  void validate() const;
};

/// load_map, where a verb lets people choose. By default it is this.
LoadedMap load_map(const std::string& path, const CommonArguments& common,
                   const MapLoading& loading, bool with_hash = false);

/// A log that throws the first loss as an Error (input) if `strict`, and hands on all else.
LogSink strict_log(LogSink log, bool strict);

}  // namespace cairn::cli
