// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <system_error>

#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/format_row.hpp"
#include "cairn/formats/detail/own/ply_header.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

// Enough bytes for the first keys of a JSON file, which identify the system.
constexpr std::size_t kProbedBytes = 4096;

// ---- advice

constexpr std::string_view kLfs = "the file itself: run 'git lfs pull' where it was cloned";
constexpr std::string_view kRecording =
    "a map: 'cairn map' makes one of RGB-D or stereo images in a recording, whose topics 'cairn "
    "info' lists (docs/from_bags.md)";
constexpr std::string_view kPictures =
    "a map that COLMAP, OpenSfM or a SLAM system made of such images (docs/from_colmap.md and "
    "others); 'cairn map' makes maps of RGB-D and stereo images only";
constexpr std::string_view kImage =
    "a map; 'cairn locate' takes a map and an image, COLMAP and OpenSfM make maps of images, "
    "'cairn map' of RGB-D and stereo sequences";
constexpr std::string_view kStereo =
    "a map that ORB-SLAM3, stella_vslam or COLMAP made of it (docs/from_orbslam3.md and others): "
    "Cairn itself maps RGB-D sequences, and stereo ones in the layouts of KITTI odometry and EuRoC";
constexpr std::string_view kCloud =
    "a cloud in PLY, PCD, .xyz, .csv or .npy, to which CloudCompare and PDAL convert it";
constexpr std::string_view kMesh =
    "a cloud in PLY, PCD, .xyz, .csv or .npy, to which CloudCompare and MeshLab convert it";
constexpr std::string_view kUnpacked = "the file or folder in it: unpack it";
constexpr std::string_view kOrbslam3 =
    "a map that the header for ORB-SLAM3 writes (docs/from_orbslam3.md)";
constexpr std::string_view kExported =
    "its cameras and points in another format, such as Bundler's .out";
constexpr std::string_view kGraph =
    "maps with landmarks, which 'cairn merge' and 'cairn atlas' align: it has poses only";
constexpr std::string_view kMapped = "a map: 'cairn map' makes one of it";
constexpr std::string_view kLists =
    "rgb.txt and depth.txt with a line 'time file' an image, as in TUM layout, for 'cairn map'";

// ---- files

struct Sign {
  std::string_view bytes;
  std::size_t offset;
  std::string_view what;
  std::string_view advice;
};

constexpr std::string_view kLfsPointer = "version https://git-lfs.github.com/spec/";

// The first one that fits. Formats that are read are not here.
constexpr Sign kSigns[] = {
    {kLfsPointer, 0, "is a Git LFS pointer, not the file itself", kLfs},
    {"#ROSBAG V", 0, "is a ROS bag", kRecording},
    {"\x89MCAP0\r\n", 0, "is an MCAP recording", kRecording},
    {"CRNA", 68, "is an atlas of maps, not a map",
     "one of its maps: cairn atlas export --map NAME -o NAME.map --atlas, then its name"},
    {"SQLite format 3", 0, "is an SQLite database, but no map in a known format", ""},
    {"LASF", 0, "is a LAS or LAZ point cloud", kCloud},
    {"ASTM-E57", 0, "is an E57 point cloud", kCloud},
    {"OFF\n", 0, "is an OFF mesh", kMesh},
    {"OFF\r", 0, "is an OFF mesh", kMesh},
    {"OFF ", 0, "is an OFF mesh", kMesh},
    {"COFF", 0, "is an OFF mesh", kMesh},
    {"NOFF", 0, "is an OFF mesh", kMesh},
    {"glTF", 0, "is a glTF scene", kMesh},
    {"solid ", 0, "is an STL mesh", kMesh},
    {"Kaydara FBX", 0, "is an FBX scene", kMesh},
    {"DRACO", 0, "is a Draco point cloud or mesh", kMesh},
    {"# vtk DataFile", 0, "is a VTK file", kMesh},
    {"VERTEX_", 0, "is a pose graph in g2o format", kGraph},
    {"EDGE_", 0, "is a pose graph in g2o format", kGraph},
    {"FIX ", 0, "is a pose graph in g2o format", kGraph},
    {"VERTEX2 ", 0, "is a pose graph in TORO format", kGraph},
    {"VERTEX3 ", 0, "is a pose graph in TORO format", kGraph},
    {"Ogawa", 0, "is an Alembic scene, as Meshroom's sfm.abc",
     "the scene as .sfm in JSON, which Meshroom's node ConvertSfMFormat writes"},
    {"\x01\x03\0\0\0\0\0\0\0"
     "0."sv,
     0, "is OpenMVG's sfm_data.bin",
     "sfm_data.json, which openMVG_main_ConvertSfM_DataFormat writes of it"},
    {"serialization::archive", 8, "is an atlas of ORB-SLAM3 (.osa)", kOrbslam3},
    {"22 serialization::archive", 0, "is an atlas of ORB-SLAM3 (.osa)", kOrbslam3},
    {"#name,x,y,alt,heading", 0, "is a table of camera poses by RealityCapture", kExported},
    {"%YAML", 0, "is a YAML file, such as settings of a camera", "a map; --camera takes cameras"},
    {"%PDF", 0, "is a PDF document", "a map"},
    {"\x89HDF\r\n", 0, "is an HDF5 file",
     "its points as .npy or .npz, which h5py and NumPy write; features of hloc belong to a model "
     "(docs/from_colmap.md)"},
    {"\x89PNG", 0, "is an image", kImage},
    {"\xff\xd8\xff", 0, "is an image", kImage},
    {"GIF8", 0, "is an image", kImage},
    {"II*\0"sv, 0, "is an image", kImage},
    {"MM\0*"sv, 0, "is an image", kImage},
    {"WEBP", 8, "is an image", kImage},
    {"ftypheic", 4, "is an image", kImage},
    {"ftypmif1", 4, "is an image", kImage},
    {"ftypavif", 4, "is an image", kImage},
    {"v/1\x01", 0, "is an image", kImage},
    {"P5\n", 0, "is an image", kImage},
    {"P6\n", 0, "is an image", kImage},
    {"ftyp", 4, "is a video", kPictures},
    {"moov", 4, "is a video", kPictures},
    {"mdat", 4, "is a video", kPictures},
    {"wide", 4, "is a video", kPictures},
    {"\x1a\x45\xdf\xa3", 0, "is a video", kPictures},
    {"AVI ", 8, "is a video", kPictures},
    {"\0\0\1\xba"sv, 0, "is a video", kPictures},
    {"\xd4\xc3\xb2\xa1", 0, "is a capture of network packets, as lidars send them", kRecording},
    {"PK\x03\x04", 0, "is a ZIP archive without NumPy arrays", kUnpacked},
    {"\x1f\x8b", 0, "is compressed by gzip", kUnpacked},
    {"BZh", 0, "is compressed by bzip2", kUnpacked},
    {"\xfd"
     "7zXZ",
     0, "is compressed by xz", kUnpacked},
    {"\x28\xb5\x2f\xfd", 0, "is compressed by zstd", kUnpacked},
    {"7z\xbc\xaf", 0, "is a 7z archive", kUnpacked},
    {"Rar!", 0, "is a RAR archive", kUnpacked},
    {"ustar", 257, "is a tar archive", kUnpacked},
    {"\xff\xfe", 0, "is text in UTF-16, as PowerShell writes it", "text in UTF-8"},
    {"\xfe\xff", 0, "is text in UTF-16", "text in UTF-8"},
};

// Texts that only more than their first bytes tell apart: the first one that occurs.
constexpr Sign kXmlSigns[] = {
    {"<chunk ", 0, "is a document of Metashape (XML)", kExported},
    {"<VTKFile", 0, "is a VTK file", kMesh},
    {"<COLLADA", 0, "is a COLLADA scene", kMesh},
    {"<xcr:", 0, "is metadata of an image by RealityCapture (XMP)", kExported},
    {"<?xpacket", 0, "is metadata of an image (XMP)", kPictures},
    {"<html", 0, "is a web page, perhaps in place of a download", "the file itself"},
    {"<HTML", 0, "is a web page, perhaps in place of a download", "the file itself"},
    {"<!doctype html", 0, "is a web page, perhaps in place of a download", "the file itself"},
    {"<!DOCTYPE html", 0, "is a web page, perhaps in place of a download", "the file itself"},
    {"<", 0, "is an XML document, which no map format is", kExported},
};

std::string lower_extension(const fs::path& path) {
  return lower_case(path.extension().string());
}

// What the first sign says for which `is_there`.
template <class Signs, class IsThere>
std::optional<ForeignContent> first_sign(const Signs& signs, const IsThere& is_there) {
  const auto sign = std::find_if(std::begin(signs), std::end(signs), is_there);
  if (sign == std::end(signs)) return std::nullopt;
  return ForeignContent{sign->what, sign->advice};
}

// The words of the first lines that are neither blank nor comments.
std::vector<std::vector<std::string_view>> first_lines(std::string_view bytes, std::size_t most) {
  std::vector<std::vector<std::string_view>> lines;
  while (!bytes.empty() && lines.size() < most) {
    const std::size_t end = std::min(bytes.find('\n'), bytes.size());
    const std::string_view line = trimmed(bytes.substr(0, end));
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    if (line.empty() || line.starts_with('#')) continue;
    lines.push_back(detail::words_of(line));
  }
  return lines;
}

// KITTI's scans are x y z and reflectance as float32, without a header.
bool looks_like_kitti_scan(const MapInput& input) {
  constexpr std::size_t kPoint = 4 * sizeof(float);
  const auto size = input.source->size();
  if (lower_extension(input.path) != ".bin" || !size || *size % kPoint != 0) return false;
  const std::string_view bytes = input.first_bytes;
  for (std::size_t i = 0; i + kPoint <= bytes.size(); i += kPoint) {
    std::array<float, 4> point{};
    std::memcpy(point.data(), bytes.data() + i, kPoint);
    constexpr float kFarthest = 1e4F;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!(std::abs(point[k]) < kFarthest)) return false;
    }
    if (!(point[3] >= 0.0F && point[3] <= 255.0F)) return false;
  }
  return bytes.size() >= kPoint;
}

std::optional<ForeignContent> by_lines(std::string_view bytes) {
  const auto lines = first_lines(bytes, 4);
  if (lines.size() < 2) return std::nullopt;
  const auto is_count = [&](std::size_t line) {
    return lines[line].size() == 1 && parse_unsigned(lines[line][0]);
  };
  if (lines.size() == 4 && is_count(0) && is_count(1) && lines[2].size() == 3) {
    return ForeignContent{"is a PTX scan", kCloud};
  }
  if (is_count(0) && lines[1].size() >= 3 && parse_number(lines[1][0])) {
    return ForeignContent{"is a PTS point cloud: a text whose first line is the number of points",
                          "the same without its first line, which is read as text"};
  }
  constexpr std::array<std::string_view, 8> kObj = {"v", "vn", "vt",     "f",
                                                    "o", "g",  "mtllib", "usemtl"};
  const bool is_obj = std::all_of(lines.begin(), lines.end(), [&](const auto& words) {
    return std::find(kObj.begin(), kObj.end(), words[0]) != kObj.end();
  });
  return is_obj ? std::optional(ForeignContent{"is an OBJ mesh", kMesh}) : std::nullopt;
}

std::optional<ForeignContent> foreign_file(const MapInput& input) {
  const std::string_view bytes = input.first_bytes;
  const std::string extension = lower_extension(input.path);
  for (const std::string_view splats : {".splat", ".spz", ".ksplat", ".sog"}) {
    if (extension != splats) continue;
    return ForeignContent{"is a compressed file of Gaussian splats", detail::kExpectedSplats};
  }
  if (extension == ".sens") return ForeignContent{"is an RGB-D recording of ScanNet", kLists};
  if (const auto known = first_sign(kSigns, [&](const Sign& sign) {
        return bytes.size() > sign.offset && bytes.substr(sign.offset).starts_with(sign.bytes);
      })) {
    return known;
  }
  const std::size_t first = bytes.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return std::nullopt;
  if (bytes[first] == '<') {
    return first_sign(kXmlSigns, [&](const Sign& sign) {
      return bytes.find(sign.bytes) != std::string_view::npos;
    });
  }
  if (bytes[first] == '{' || bytes[first] == '[') {
    if (bytes.find("\"cairn.") != std::string_view::npos) {
      return ForeignContent{"is a result of Cairn, not a map",
                            "a map; 'cairn report' shows results"};
    }
    return ForeignContent{"is JSON, but no map in a known format", ""};
  }
  if (looks_like_kitti_scan(input)) {
    return ForeignContent{
        "looks like a lidar scan as KITTI has them: x y z and reflectance as float32",
        "its positions as .npy: numpy.save('scan.npy', numpy.fromfile('scan.bin', "
        "'float32').reshape(-1, 4)[:, :3])"};
  }
  if (auto known = by_lines(bytes)) return known;
  if (bytes.find('\0') != std::string_view::npos) {
    return ForeignContent{"is a binary file of no known format", ""};
  }
  return std::nullopt;
}

// ---- folders

struct FolderSign {
  std::array<std::string_view, 3> entries;  // all there; empty ones are not asked for
  std::string_view what;
  std::string_view advice;
};

// The first one that fits.
constexpr FolderSign kFolderSigns[] = {
    {{"rgb.txt", "depth.txt"}, "is an RGB-D sequence in TUM layout", kMapped},
    {{"rgb.mp4", "odometry.csv"}, "is an RGB-D recording of a phone (Stray Scanner)", kLists},
    {{"color", "depth", "pose"}, "is an RGB-D sequence in ScanNet's layout", kLists},
    {{"frame-000000.color.png"}, "is an RGB-D sequence in the layout of 7-Scenes", kLists},
    {{"results", "traj.txt"}, "is an RGB-D sequence in Replica's layout", kLists},
    {{"rgb", "depth"}, "is an RGB-D sequence without the lists of its images", kLists},
    {{"color", "depth"}, "is an RGB-D sequence without the lists of its images", kLists},
    {{"mav0"}, "is a sequence in EuRoC's layout", kMapped},
    {{"cam0", "imu0"}, "is a sequence in EuRoC's layout", kMapped},
    {{"image_0", "image_1"}, "is a stereo sequence in KITTI's layout", kMapped},
    {{"image_2", "image_3"}, "is a stereo sequence in KITTI's layout", kMapped},
    {{"image_0", "times.txt"}, "is a sequence in KITTI's layout", kStereo},
    {{"image_2", "times.txt"}, "is a sequence in KITTI's layout", kStereo},
    {{"image_00", "image_01"}, "is a stereo sequence in KITTI's raw layout", kStereo},
    {{"velodyne"}, "is a folder of lidar scans in KITTI's layout", kStereo},
    {{"sequences", "poses"}, "is a folder of sequences in KITTI's layout", kStereo},
};

std::optional<ForeignContent> foreign_folder(const fs::path& folder) {
  std::error_code error;
  if (const auto known = first_sign(kFolderSigns, [&](const FolderSign& sign) {
        return std::all_of(sign.entries.begin(), sign.entries.end(), [&](std::string_view entry) {
          return entry.empty() || fs::exists(folder / entry, error);
        });
      })) {
    return known;
  }
  constexpr std::array<std::string_view, 5> kImages = {".jpg", ".jpeg", ".png", ".heic", ".tif"};
  std::size_t images = 0;
  std::size_t others = 0;
  bool has_metadata = false;
  bool has_recording = false;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string extension = lower_extension(entry->path());
    const bool is_image = std::find(kImages.begin(), kImages.end(), extension) != kImages.end();
    ++(is_image ? images : others);
    has_metadata = has_metadata || entry->path().filename() == "metadata.yaml";
    has_recording = has_recording || extension == ".db3" || extension == ".mcap";
  }
  if (has_metadata && has_recording) return ForeignContent{"is a ROS 2 bag", kRecording};
  if (images > 0 && images >= others) return ForeignContent{"is a folder of images", kPictures};
  return std::nullopt;
}

}  // namespace

std::optional<ForeignContent> foreign_content(const MapInput& input) {
  return input.source == nullptr ? foreign_folder(input.path) : foreign_file(input);
}

std::optional<ForeignContent> foreign_content(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return foreign_folder(path);
  FileReader file(path);
  const std::string first = detail::first_bytes_of(file);
  return foreign_file({.path = path, .first_bytes = first, .source = &file});
}

std::string detail::first_bytes_of(ByteSource& source) {
  std::string bytes(kProbedBytes, '\0');
  std::size_t count = 0;
  while (count < bytes.size()) {
    const std::size_t more = source.read(bytes.data() + count, bytes.size() - count);
    if (more == 0) break;
    count += more;
  }
  bytes.resize(count);
  return bytes;
}

bool detail::is_lfs_pointer(std::string_view first_bytes) {
  return first_bytes.starts_with(kLfsPointer);
}

}  // namespace cairn
