// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/map_file.hpp"

namespace cairn {

LandmarkMap read_map(const std::filesystem::path& path, const MapReadOptions& options) {
  return native_formats().read(path, options);
}

void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options) {
  native_formats().write(map, path, options);
}

}  // namespace cairn
