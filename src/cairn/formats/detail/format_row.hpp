// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"

// Helpers for the rows of the table of formats.
namespace cairn::detail {

/// The next bytes of a source, as many as the recognition of formats uses.
std::string first_bytes_of(ByteSource& source);

/// Whether a file with these first bytes is a Git LFS pointer: a small text in place of the file.
bool is_lfs_pointer(std::string_view first_bytes);

/// MapFormat::recognises for files that begin with one of the texts.
template <class... Texts>
auto begins_with(Texts... texts) {
  return [texts...](const MapInput& input) {
    return (input.first_bytes.starts_with(std::string_view(texts)) || ...);
  };
}

/// MapFormat::read for a function that takes a source, or a path.
template <auto kRead>
LandmarkMap read_source(const MapInput& input, const Execution& execution) {
  return kRead(*input.source, execution);
}
template <auto kRead>
LandmarkMap read_path(const MapInput& input, const Execution& execution) {
  return kRead(input.path, execution);
}

/// MapFormat::write_to or write for a function without options.
template <auto kWrite>
inline constexpr auto written_by =
    [](const LandmarkMap& map, const auto& place, const MapWriteOptions& /*options*/,
       const Execution& execution) { kWrite(map, place, execution); };

}  // namespace cairn::detail
