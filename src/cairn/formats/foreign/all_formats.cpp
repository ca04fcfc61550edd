// SPDX-License-Identifier: BSD-3-Clause
#include <iterator>
#include <utility>
#include <vector>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/foreign/mcap.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {

const FormatRegistry& all_formats() {
  static const FormatRegistry formats = [] {
    std::vector<MapFormat> more;
    // Formats that are recognised by weak signs are first, so that they are tried last.
    for (std::vector<MapFormat> some :
         {detail::plain_points_formats(), detail::colmap_formats(), detail::opensfm_formats(),
          detail::openmvg_formats(), detail::bundle_file_formats(), detail::stella_formats(),
          detail::nerfstudio_formats(), detail::alicevision_formats(), detail::kapture_formats(),
          detail::mcap_formats(), detail::database_formats()}) {
      std::move(some.begin(), some.end(), std::back_inserter(more));
    }
    return native_formats().extended_by(std::move(more));
  }();
  return formats;
}

}  // namespace cairn
