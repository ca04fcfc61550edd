// SPDX-License-Identifier: BSD-3-Clause
#include <string_view>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/pose_graph_file.hpp"

namespace cairn {

PoseGraph read_rtabmap_graph(const std::filesystem::path& path, const Execution&) {
  throw Error(ErrorKind::kInput, path.string(),
              "is an SQLite database, and this Cairn was built without SQLite",
              "a build with CAIRN_WITH_SQLITE=ON");
}

}  // namespace cairn

namespace cairn::detail {

std::vector<MapFormat> database_formats() {
  return {{.name = "database",
           .title = "SQLite database",
           .recognises =
               [](const MapInput& input) {
                 return input.first_bytes.starts_with(std::string_view("SQLite format 3\0", 16));
               },
           .read = [](const MapInput& input, const Execution&) -> LandmarkMap {
             throw Error(ErrorKind::kInput, input.path.string(),
                         "is an SQLite database, and this Cairn was built without SQLite",
                         "a build with CAIRN_WITH_SQLITE=ON");
           }}};
}

LandmarkMap with_database_beside(LandmarkMap model, const std::filesystem::path&,
                                 const Execution&) {
  return model;
}

}  // namespace cairn::detail
