// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/all_formats.hpp"

#include <iterator>
#include <utility>
#include <vector>

#include "cairn/formats/detail/foreign/database_formats.hpp"
#include "cairn/formats/foreign/alicevision.hpp"
#include "cairn/formats/foreign/bundle_files.hpp"
#include "cairn/formats/foreign/colmap.hpp"
#include "cairn/formats/foreign/kapture.hpp"
#include "cairn/formats/foreign/mcap.hpp"
#include "cairn/formats/foreign/nerfstudio.hpp"
#include "cairn/formats/foreign/openmvg.hpp"
#include "cairn/formats/foreign/opensfm.hpp"
#include "cairn/formats/foreign/plain_points.hpp"
#include "cairn/formats/foreign/stella.hpp"

namespace cairn {

const FormatRegistry& all_formats() {
  static const FormatRegistry formats = [] {
    std::vector<MapFormat> more;
    // Formats that are recognised by weak signs are first, so that they are tried last.
    for (std::vector<MapFormat> some :
         {plain_points_formats(), colmap_formats(), opensfm_formats(), openmvg_formats(),
          bundle_file_formats(), stella_formats(), nerfstudio_formats(), alicevision_formats(),
          kapture_formats(), mcap_formats(), detail::database_formats()}) {
      std::move(some.begin(), some.end(), std::back_inserter(more));
    }
    return native_formats().extended_by(std::move(more));
  }();
  return formats;
}

}  // namespace cairn
