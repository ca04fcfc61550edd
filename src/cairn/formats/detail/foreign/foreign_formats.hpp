// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/detail/format_row.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"

// The readers and writers of other systems' formats, which all_formats() lists. docs/formats.md describes them.
namespace cairn::detail {

enum class ColmapForm { kBinary, kText };

/// The files of a COLMAP model; null if missing.
struct ColmapSources {
  ByteSource* cameras = nullptr;
  ByteSource* images = nullptr;
  ByteSource* points = nullptr;  ///< required
  ByteSource* rigs = nullptr;
  ByteSource* frames = nullptr;  ///< which images a rig took at one instant
};

/// Reads a COLMAP model (docs/formats.md): images become frames, 3D points landmarks of free scale, both
/// sorted by id.
/// @throws Error (input) naming source, line or byte, field, value and constraint
LandmarkMap read_colmap(const ColmapSources& sources, ColmapForm form,
                        const Execution& execution = {});

/// Reads the model in a folder.
LandmarkMap read_colmap(const std::filesystem::path& folder, ColmapForm form,
                        const Execution& execution = {});

/// Writes a COLMAP model, with rigs and frames if the map has rigs. COLMAP before version 3.12 does not read rigs and
/// frames.
/// @param folder must be new or empty
/// @throws Error (input) if a frame has no camera, or a name that the form cannot represent, (storage)
void write_colmap(const LandmarkMap& map, const std::filesystem::path& folder, ColmapForm form,
                  const Execution& execution = {});

/// A COLMAP model with SIFT descriptors from COLMAP's database: for each landmark, the medoid of its first
/// eight observations' descriptors. Images are matched by name.
/// @param model from read_colmap, whose observations state their keypoint index
/// @throws Error (input) naming the database, if it is not one of COLMAP's
LandmarkMap with_colmap_descriptors(LandmarkMap model, const std::filesystem::path& database,
                                    const Execution& execution = {});

/// The files of an OpenSfM data set.
struct OpenSfmSources {
  ByteSource* reconstruction = nullptr;  ///< required
  ByteSource* tracks = nullptr;          ///< tracks.csv, the observations; null if missing
  ByteSource* control_points = nullptr;  ///< ground_control_points.json; null if missing
  ByteSource* control_list = nullptr;    ///< gcp_list.txt, more control points; null if missing
  ByteSource* reference = nullptr;       ///< reference_lla.json; null if missing
  ByteSource* overrides = nullptr;       ///< exif_overrides.json; null if missing
};

/// Reads a reconstruction of an OpenSfM file (docs/formats.md): shots become frames, numbered from 0 in the
/// order of their names; points become landmarks of free scale.
/// @param part index of the reconstruction, from 0; std::nullopt: the first
/// @throws Error (input) naming source, line or place, value and constraint
LandmarkMap read_opensfm(const OpenSfmSources& sources, const std::optional<std::string>& part = {},
                         const Execution& execution = {});

/// Writes a reconstruction and, if the map has any, its observations and control points in the same folder, as
/// tracks.csv and ground_control_points.json.
/// @throws Error (input) naming a frame without a camera, duplicate image names, or a camera model that
///        OpenSfM lacks, (storage) if tracks.csv exists, or ground_control_points.json that would be written
void write_opensfm(const LandmarkMap& map, const std::filesystem::path& path,
                   const Execution& execution = {});

/// Both coordinates of the centre of the top-left pixel in OpenMVG's spherical images, where coordinates are
/// proportional to the angles. In OpenMVG's other images, both coordinates are 0.
inline constexpr double kOpenMvgPanorama = 0.5;

/// Reads sfm_data.json of OpenMVG (docs/formats.md). Views with a pose become frames, and the points of the structure
/// become landmarks; the scale is free. Descriptors come from the feature files in the folder of sfm_data.json, in its
/// subfolder "matches", or in a folder "matches" next to it.
/// @throws Error (input) naming source, place, value and constraint
LandmarkMap read_openmvg(const MapInput& input, const Execution& execution = {});

/// Writes sfm_data.json, version 0.3.
/// @throws Error (input) naming a frame without a camera, or a camera model that OpenMVG lacks
void write_openmvg(const LandmarkMap& map, const ByteSink& sink, const Execution& execution = {});

/// Reads an .sfm file of AliceVision in JSON (docs/formats.md): views with a pose become frames, the structure
/// landmarks of free scale. Descriptors come from the feature files in the folders that the .sfm file names, or beside
/// it.
/// @throws Error (input) naming source, place, value and constraint
LandmarkMap read_alicevision(const MapInput& input, const Execution& execution = {});

/// Writes an .sfm file of AliceVision in JSON, version 1.2.6.
/// @throws Error (input) naming a frame without a camera, or a camera model that AliceVision lacks
void write_alicevision(const LandmarkMap& map, const ByteSink& sink,
                       const Execution& execution = {});

/// Reads transforms.json of nerfstudio or instant-ngp (docs/formats.md): frames and cameras, numbered from
/// 0. The points of "ply_file_path" become landmarks.
/// @param folder to which the file's paths are relative
/// @throws Error (input) naming source, place, value and constraint
LandmarkMap read_nerfstudio(ByteSource& source, const std::filesystem::path& folder,
                            const Execution& execution = {});

/// Writes transforms.json, and the landmarks as sparse_pc.ply in the same folder.
/// @throws Error (input) naming a frame without a camera, or a camera model that nerfstudio lacks,
///        (storage) if sparse_pc.ply exists
void write_nerfstudio(const LandmarkMap& map, const std::filesystem::path& path,
                      const Execution& execution = {});

/// Reads a CSV file of camera registrations of RealityCapture (docs/formats.md): frames, numbered from 0, and the
/// cameras of those frames whose image files exist.
/// @param folder to which names of images are relative
/// @throws Error (input) naming source, line, field, value and constraint
LandmarkMap read_realitycapture(ByteSource& source, const std::filesystem::path& folder,
                                const Execution& execution = {});

/// The files of a kapture folder, by their paths below it, e.g. "sensors/sensors.txt".
struct KaptureFiles {
  std::string name;  ///< name of the folder in messages
  /// A file; null where there is none.
  std::function<std::unique_ptr<ByteSource>(const std::string& path)> open;
  /// Sorted names of the entries of a folder below it; empty if there is no such folder.
  std::function<std::vector<std::string>(const std::string& path)> list;
};

/// Reads a kapture folder of version 1.0 or 1.1 (docs/formats.md): images with a pose become frames, 3D points
/// landmarks of free scale.
/// @throws Error (input) naming file, line, field, what was found and what was expected
LandmarkMap read_kapture(const KaptureFiles& files, const Execution& execution = {});
LandmarkMap read_kapture(const std::filesystem::path& folder, const Execution& execution = {});

/// Reads a Bundler file, version 0.3: cameras become frames, numbered from 0. Images have no names; the format "bundler"
/// takes them from a list.txt.
/// @throws Error (input) naming source, line, field, value and constraint
LandmarkMap read_bundler(ByteSource& source, const Execution& execution = {});

/// Reads the first model of an NVM file of VisualSFM, version 3.
/// @throws Error (input) as read_bundler
LandmarkMap read_nvm(ByteSource& source, const Execution& execution = {});

/// Writes a Bundler file, version 0.3. Undistorts observations of cameras that are not RADIAL.
/// @throws Error (input) naming a frame without a camera
void write_bundler(const LandmarkMap& map, const ByteSink& sink, const Execution& execution = {});

/// Reads a map of stella_vslam or OpenVSLAM in MessagePack (docs/formats.md): keyframes become frames,
/// sorted by id like the landmarks. Undistorted keypoints are distorted to pixels of the image.
/// @throws Error (input) naming source, byte, field, value and constraint
LandmarkMap read_stella(ByteSource& source, const Execution& execution = {});

/// Writes a map of stella_vslam in MessagePack, with only the keypoints of landmarks.
/// @throws Error (input) if a frame has no camera, or one whose model stella_vslam lacks
void write_stella(const LandmarkMap& map, const ByteSink& sink, const Execution& execution = {});

/// Reads an SQLite map of stella_vslam, with the same content as its maps in MessagePack.
/// @throws Error (input) naming file, table, row, value and constraint
LandmarkMap read_stella_database(const std::filesystem::path& path,
                                 const Execution& execution = {});

/// Reads a database of RTAB-Map (docs/formats.md): nodes become frames, in metres. RTAB-Map has no
/// landmarks; features of one visual word in linked nodes become a landmark if their geometry agrees.
/// @throws Error (input) naming file, table, row, value and constraint
LandmarkMap read_rtabmap(const std::filesystem::path& path, const Execution& execution = {});

/// Reads text points, one per line, with numbers separated by blanks, commas or semicolons. A first line or a comment
/// with names identifies the columns, which are read like PLY's properties (docs/formats.md). Without names, three
/// columns are x, y and z. Of more columns, the first three are x, y and z if the numbers or the file's name indicate it.
/// Reads a pipe into memory.
/// @throws Error (input) naming source, line, field, value and constraint, or what the text holds instead of points
LandmarkMap read_plain_points(ByteSource& source, const Execution& execution = {});

/// Reads a NumPy array, version 1 to 3 of the .npy format: N x 3 float32 or float64, row-major.
/// @throws Error (input) naming source, byte, value and constraint
LandmarkMap read_npy_points(ByteSource& source, const Execution& execution = {});

/// Reads an archive of arrays from numpy.savez or savez_compressed: positions, and arrays with one entry
/// per point.
/// @throws Error (input) naming source, array, value and constraint
LandmarkMap read_npz_points(ByteSource& source, const Execution& execution = {});

/// Writes positions only, one point per line.
void write_xyz_points(const LandmarkMap& map, const ByteSink& sink,
                      const Execution& execution = {});
/// Writes a line of names, then a line per landmark, comma-separated, with the same fields as PLY.
/// @throws Error (misuse) for a named column whose name has another meaning
void write_csv_points(const LandmarkMap& map, const ByteSink& sink,
                      const Execution& execution = {});
/// Writes positions as N x 3 float64.
void write_npy_points(const LandmarkMap& map, const ByteSink& sink,
                      const Execution& execution = {});
/// Writes positions, ids, covariances, colours, descriptors, named columns and observation counts.
void write_npz_points(const LandmarkMap& map, const ByteSink& sink,
                      const Execution& execution = {});

/// Whether a file or folder has the format, as MapFormat::recognises.
bool is_alicevision(const MapInput& input);
bool is_kapture(const MapInput& input);
bool is_nerfstudio(const MapInput& input);
bool is_openmvg(const MapInput& input);
bool is_opensfm(const MapInput& input);
bool is_stella(const MapInput& input);
/// Whether a text begins like text points: with three numbers, or with column names that include those of x, y and z.
bool is_points_text(const MapInput& input);
/// Whether a ZIP archive begins with a member that is an array. Other programs use such archives too.
bool is_archive_of_arrays(const MapInput& input);

/// Reads a file and the files beside it that belong to it.
LandmarkMap read_bundler_and_list(const MapInput& input, const Execution& execution);
LandmarkMap read_kapture_folder(const MapInput& input, const Execution& execution);
LandmarkMap read_nerfstudio_file(const MapInput& input, const Execution& execution);
LandmarkMap read_realitycapture_file(const MapInput& input, const Execution& execution);
LandmarkMap read_opensfm_files(const MapInput& input, const Execution& execution);

/// The table row for one form of COLMAP's models.
MapFormat colmap_format(ColmapForm form);
/// The formats that need SQLite. A build without it recognises databases and refuses them.
std::vector<MapFormat> database_formats();

/// Adds descriptors to a COLMAP model from a database in the model's folder or in one of the two parent folders: from
/// database.db there, or else from the only database of COLMAP. Returns the model unchanged if there is none.
LandmarkMap with_database_beside(LandmarkMap model, const std::filesystem::path& folder,
                                 const Execution& execution);

}  // namespace cairn::detail
