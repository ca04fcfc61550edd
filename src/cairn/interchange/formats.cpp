// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/formats.hpp"

#include <iterator>
#include <utility>
#include <vector>

#include "cairn/interchange/alicevision.hpp"
#include "cairn/interchange/bundle_files.hpp"
#include "cairn/interchange/colmap.hpp"
#include "cairn/interchange/detail/database_formats.hpp"
#include "cairn/interchange/kapture.hpp"
#include "cairn/interchange/mcap.hpp"
#include "cairn/interchange/nerfstudio.hpp"
#include "cairn/interchange/openmvg.hpp"
#include "cairn/interchange/opensfm.hpp"
#include "cairn/interchange/plain_points.hpp"
#include "cairn/interchange/stella.hpp"

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
