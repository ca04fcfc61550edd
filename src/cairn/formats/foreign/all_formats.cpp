// SPDX-License-Identifier: BSD-3-Clause
#include <iterator>
#include <utility>
#include <vector>

#include "cairn/formats/detail/bytes/npy_array.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/foreign/mcap.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn::detail {
namespace {

// Formats that are recognised by weak signs are first, so that they are tried last.
std::vector<MapFormat> foreign_rows() {
  return {{.name = "xyz",
           .title = "XYZ",
           .endings = {".xyz"},
           .holds_frames = false,
           .recognises = &is_points_text,
           .read = &read_source<&read_plain_points>,
           .write_to = written_by<&write_xyz_points>},
          {.name = "csv",
           .title = "CSV",
           .endings = {".csv"},
           .holds_frames = false,
           .write_to = written_by<&write_csv_points>},
          {.name = "npy",
           .title = "NumPy .npy",
           .endings = {".npy"},
           .holds_frames = false,
           .recognises = begins_with(kNpyMagic),
           .read = &read_source<&read_npy_points>,
           .write_to = written_by<&write_npy_points>},
          {.name = "npz",
           .title = "NumPy .npz",
           .endings = {".npz"},
           .holds_frames = false,
           .recognises = &is_archive_of_arrays,
           .read = &read_source<&read_npz_points>,
           .write_to = written_by<&write_npz_points>},
          // The binary form is last, so that it is tried first for a folder with both.
          colmap_format(ColmapForm::kText),
          colmap_format(ColmapForm::kBinary),
          {.name = "opensfm",
           .title = "OpenSfM",
           .endings = {"reconstruction.json"},
           .holds_several = true,
           .recognises = &is_opensfm,
           .read = &read_opensfm_files,
           .write = written_by<&write_opensfm>},
          {.name = "openmvg",
           .title = "OpenMVG",
           .endings = {"sfm_data.json"},
           .recognises = &is_openmvg,
           .read = &read_openmvg,
           .write_to = written_by<&write_openmvg>},
          {.name = "bundler",
           .title = "Bundler",
           .endings = {".out"},
           .recognises = begins_with("# Bundle file v0.3"),
           .read = &read_bundler_and_list,
           .write_to = written_by<&write_bundler>},
          {.name = "nvm",
           .title = "NVM",
           .recognises = begins_with("NVM_V3"),
           .read = &read_source<&read_nvm>},
          {.name = "stella",
           .title = "stella_vslam",
           .endings = {".msg"},
           .recognises = &is_stella,
           .read = &read_source<&read_stella>,
           .write_to = written_by<&write_stella>},
          {.name = "nerfstudio",
           .title = "nerfstudio",
           .endings = {"transforms.json"},
           .recognises = &is_nerfstudio,
           .read = &read_nerfstudio_file,
           .write = written_by<&write_nerfstudio>},
          {.name = "realitycapture",
           .title = "RealityCapture",
           .recognises = begins_with("#name,x,y,alt,"),
           .read = &read_realitycapture_file},
          {.name = "alicevision",
           .title = "AliceVision",
           .endings = {".sfm"},
           .recognises = &is_alicevision,
           .read = &read_alicevision,
           .write_to = written_by<&write_alicevision>},
          {.name = "kapture",
           .title = "kapture",
           .recognises = &is_kapture,
           .read = &read_kapture_folder},
          {.name = "mcap",
           .title = "MCAP",
           .endings = {".mcap"},
           .is_read = false,
           .write_to = [](const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions&,
                          const Execution& execution) { write_mcap(map, sink, execution); }}};
}

}  // namespace
}  // namespace cairn::detail

namespace cairn {

const FormatRegistry& all_formats() {
  static const FormatRegistry formats = [] {
    std::vector<MapFormat> more = detail::foreign_rows();
    std::vector<MapFormat> databases = detail::database_formats();
    std::move(databases.begin(), databases.end(), std::back_inserter(more));
    return native_formats().extended_by(std::move(more));
  }();
  return formats;
}

}  // namespace cairn
