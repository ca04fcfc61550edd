// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/sequence_layouts.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <span>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/camera_file.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

bool exists_in(const fs::path& folder, const fs::path& name) {
  std::error_code ignored;
  return fs::exists(folder / name, ignored);
}

std::vector<double> numbers_in(std::string_view text, const std::string& place) {
  std::vector<double> numbers;
  while (!(text = trimmed(text)).empty()) {
    const std::size_t end = std::min(text.find_first_of(" \t\r\n,"), text.size());
    const auto number = parse_number(text.substr(0, end));
    reject_if(!number, place, printable(text.substr(0, end)) + " is not a number", "numbers");
    numbers.push_back(*number);
    text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n,", end), text.size()));
  }
  return numbers;
}

// ---- TUM RGB-D

SequenceLists read_tum(const fs::path& folder, bool, const LogSink& log) {
  const auto list = [&](const char* name) {
    FileReader reader(folder / name);
    return read_image_list(reader, log);
  };
  return {list("rgb.txt"), list("depth.txt"), std::nullopt, {}};
}

// ---- ICL-NUIM

// Each image after its time in the lines of associations.txt, in either order.
SequenceLists read_icl(const fs::path& folder, bool, const LogSink& log) {
  const std::string name = (folder / "associations.txt").string();
  std::array<std::string, 2> lists;  // of images and depth, as TUM's, line for line
  bool are_numbered = true;
  FileReader reader(name);
  LineReader lines(reader, log);
  while (const auto line = lines.next()) {
    std::istringstream words{std::string(line->substr(0, line->find('#')))};
    for (std::string time, file; words >> time >> file;) {
      are_numbered = are_numbered && fs::path(file).stem() == time && parse_unsigned(time);
      lists[file.starts_with("depth") ? 1 : 0] += time + " " + file;
    }
    for (std::string& list : lists) list += '\n';
  }
  const auto list = [&](const std::string& text) {
    MemoryReader in_memory(text, name);
    return read_image_list(in_memory, log);
  };
  SequenceLists result{list(lists[0]), list(lists[1]), std::nullopt, {}};
  // Recorded sequences have such lists too.
  if (are_numbered) {
    result.camera = Camera{CameraId{0}, "PINHOLE", 640, 480, {481.2, 480.0, 319.5, 239.5}};
  }
  return result;
}

// ---- 7-Scenes

SequenceLists read_7_scenes(const fs::path& folder, bool, const LogSink& log) {
  SequenceLists lists;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    constexpr std::string_view kBefore = "frame-";
    if (!name.starts_with(kBefore)) continue;
    const std::size_t digits = name.find('.') - kBefore.size();
    const auto number = parse_unsigned(std::string_view(name).substr(kBefore.size(), digits));
    if (!number) continue;
    const ImageEntry image{static_cast<double>(*number), name};
    if (name.ends_with(".color.png")) lists.images.push_back(image);
    if (name.ends_with(".depth.png")) lists.partners.push_back(image);
  }
  for (auto* const images : {&lists.images, &lists.partners}) {
    std::ranges::sort(*images, {}, &ImageEntry::timestamp_s);
  }
  lists.camera = Camera{CameraId{0}, "PINHOLE", 640, 480, {585.0, 585.0, 320.0, 240.0}};
  lists.depth_units_per_metre = 1000.0;
  lists.unknown_depth = 65535;
  if (log) {
    log(folder.string() +
        ": 7-Scenes is not calibrated: unless a camera is given, it is taken to be the Kinect's "
        "usual "
        "one (585, 585, 320, 240), and depth to be of the same pixels as colour");
  }
  return lists;
}

// ---- KITTI odometry

// Lines `name: 12 numbers`, of 3 x 4 projection matrices.
using ProjectionMatrices = std::map<std::string, std::vector<double>, std::less<>>;

ProjectionMatrices read_projections(const fs::path& file) {
  ProjectionMatrices projections;
  FileReader reader(file);
  LineReader lines(reader);
  while (const auto line = lines.next()) {
    const std::size_t colon = line->find(':');
    const std::string name(trimmed(line->substr(0, colon)));
    if (colon == std::string_view::npos || !name.starts_with('P')) continue;
    const std::string place = fmt::format("{}:{}: {}", file.string(), lines.line_number(), name);
    std::vector<double> numbers = numbers_in(line->substr(colon + 1), place);
    reject_if(numbers.size() != 12, place, fmt::format("{} numbers", numbers.size()),
              "the 12 of a 3 x 4 projection matrix");
    projections.insert_or_assign(name, std::move(numbers));
  }
  return projections;
}

// The camera of a matrix fx 0 cx tx, 0 fy cy 0, 0 0 1 0, without its size, and the place of its centre on the common x
// axis.
std::pair<Camera, double> projection_camera(const ProjectionMatrices& projections,
                                            const std::string& name, const fs::path& file) {
  const auto found = projections.find(name);
  reject_if(found == projections.end(), file.string(), name + " is missing",
            "a line '" + name + ": ' and 12 numbers");
  const std::vector<double>& p = found->second;
  reject_if(!(p[0] > 0.0), fmt::format("{}: {}", file.string(), name),
            fmt::format("a focal length of {}", p[0]), "a positive number of pixels");
  return {Camera{CameraId{0}, "PINHOLE", 0, 0, {p[0], p[5], p[2], p[6]}}, -p[3] / p[0]};
}

StereoRig read_kitti_rig(const fs::path& file, int left) {
  const ProjectionMatrices projections = read_projections(file);
  const auto [left_camera, left_x] = projection_camera(projections, fmt::format("P{}", left), file);
  const auto [right_camera, right_x] =
      projection_camera(projections, fmt::format("P{}", left + 1), file);
  return {left_camera, right_camera,
          Rigid3(Eigen::Quaterniond::Identity(), {right_x - left_x, 0.0, 0.0})};
}

template <int kLeft>
SequenceLists read_kitti(const fs::path& folder, bool needs_rig, const LogSink& log) {
  const fs::path left = fmt::format("image_{}", kLeft);
  const fs::path right = fmt::format("image_{}", kLeft + 1);
  const fs::path calibration = folder / "calib.txt";
  const fs::path times = folder / "times.txt";
  FileReader reader(times);
  LineReader lines(reader);
  const char* const ending = exists_in(folder, left / "000000.png") ? ".png" : ".jpg";
  SequenceLists lists;
  const auto file_at = [&](std::size_t number) { return fmt::format("{:06}{}", number, ending); };
  while (const auto line = lines.next()) {
    if (trimmed(*line).empty()) continue;
    const std::string place = fmt::format("{}:{}", times.string(), lines.line_number());
    const auto time = parse_number(trimmed(*line));
    reject_if(!time, place, printable(trimmed(*line)) + " is not a number", "seconds");
    reject_if(!lists.images.empty() && *time <= lists.images.back().timestamp_s, place,
              fmt::format("{} s is not later than the time before", *time), "ascending times");
    const std::string name = file_at(lists.images.size());
    if (exists_in(folder, right / name)) lists.partners.push_back({*time, right / name});
    lists.images.push_back({*time, left / name});
  }
  reject_if(lists.images.empty(), times.string(), "no times", "a line for each image");
  reject_if(exists_in(folder, left / file_at(lists.images.size())), times.string(),
            fmt::format("{} times for more images", lists.images.size()), "a line for each image");
  if (needs_rig) lists.rig = read_kitti_rig(calibration, kLeft);
  lists.calibration = calibration;
  if (log && lists.partners.size() < lists.images.size()) {
    log(fmt::format("{}: {} of {} images are missing", (folder / right).string(),
                    lists.images.size() - lists.partners.size(), lists.images.size()));
  }
  return lists;
}

// ---- EuRoC

// Lines `nanoseconds,file`.
std::vector<ImageEntry> read_euroc_list(const fs::path& folder, const std::string& camera) {
  const fs::path file = folder / camera / "data.csv";
  std::vector<ImageEntry> entries;
  FileReader reader(file);
  LineReader lines(reader);
  while (const auto line = lines.next()) {
    const std::string_view text = trimmed(*line);
    if (text.empty() || text.front() == '#') continue;
    const std::string place = fmt::format("{}:{}", file.string(), lines.line_number());
    const std::size_t comma = text.find(',');
    const auto time = parse_unsigned(trimmed(text.substr(0, comma)));
    reject_if(!time, place + ": field 1 (timestamp)",
              printable(text.substr(0, comma)) + " is no whole number", "nanoseconds");
    const std::string name(comma == std::string_view::npos ? std::string_view()
                                                           : trimmed(text.substr(comma + 1)));
    constexpr std::uint64_t kSecond = 1'000'000'000;
    // Nanoseconds since 1970 have more digits than a double.
    const double seconds =
        static_cast<double>(*time / kSecond) + 1e-9 * static_cast<double>(*time % kSecond);
    reject_if(!entries.empty() && seconds <= entries.back().timestamp_s,
              place + ": field 1 (timestamp)",
              fmt::format("{} ns is not later than the time before", *time), "ascending times");
    entries.push_back({seconds, camera + "/data/" + file_inside(name, place)});
  }
  reject_if(entries.empty(), file.string(), "no images", "lines of nanoseconds and file");
  return entries;
}

SequenceLists read_euroc_in(const fs::path& part, const fs::path& folder, bool needs_rig) {
  SequenceLists lists;
  lists.calibration = folder / part / "cam1" / "sensor.yaml";
  if (needs_rig) {
    FileReader left(folder / part / "cam0" / "sensor.yaml");
    FileReader right(lists.calibration);
    lists.rig = read_stereo_files(left, right);
  }
  lists.images = read_euroc_list(folder, (part / "cam0").string());
  lists.partners = read_euroc_list(folder, (part / "cam1").string());
  return lists;
}

SequenceLists read_euroc(const fs::path& folder, bool needs_rig, const LogSink&) {
  return read_euroc_in("mav0", folder, needs_rig);
}

SequenceLists read_mav0(const fs::path& folder, bool needs_rig, const LogSink&) {
  return read_euroc_in("", folder, needs_rig);
}

// ---- all

struct Layout {
  std::string_view name;
  std::vector<const char*> files;
  std::vector<const char*> calibration;  // not needed where a rig is given
  SequenceLists (*read)(const fs::path& folder, bool needs_rig, const LogSink& log);
};

const std::array kLayouts = {
    Layout{"TUM RGB-D", {"rgb.txt", "depth.txt"}, {}, &read_tum},
    Layout{"ICL-NUIM", {"associations.txt", "rgb", "depth"}, {}, &read_icl},
    Layout{"7-Scenes", {"frame-000000.color.png", "frame-000000.depth.png"}, {}, &read_7_scenes},
    Layout{"KITTI odometry", {"image_0", "image_1", "times.txt"}, {"calib.txt"}, &read_kitti<0>},
    Layout{"KITTI odometry in colour",
           {"image_2", "image_3", "times.txt"},
           {"calib.txt"},
           &read_kitti<2>},
    Layout{"EuRoC",
           {"mav0/cam0/data.csv", "mav0/cam1/data.csv"},
           {"mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"},
           &read_euroc},
    Layout{"EuRoC's mav0",
           {"cam0/data.csv", "cam1/data.csv"},
           {"cam0/sensor.yaml", "cam1/sensor.yaml"},
           &read_mav0}};

}  // namespace

std::string euroc_camera_text(const Camera& camera, const Rigid3& body_from_camera) {
  const std::string_view distortion = camera.model == "PINHOLE"          ? "none"
                                      : camera.model == "OPENCV"         ? "radial-tangential"
                                      : camera.model == "OPENCV_FISHEYE" ? "equidistant"
                                                                         : "";
  refuse_if(distortion.empty(), "camera", printable(camera.model) + " in EuRoC's layout",
            "PINHOLE, OPENCV or OPENCV_FISHEYE");
  const Matrix4d pose = body_from_camera.matrix();
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = pose;
  const std::span numbers(camera.parameters);
  return fmt::format(
      "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\nresolution: [{}, {}]\n"
      "camera_model: pinhole\nintrinsics: [{}]\ndistortion_model: {}\n"
      "distortion_coefficients: [{}]\n",
      fmt::join(rows.data(), rows.data() + 16, ", "), camera.width, camera.height,
      fmt::join(numbers.first(4), ", "), distortion, fmt::join(numbers.subspan(4), ", "));
}

bool has_sequence_files(const fs::path& folder) {
  return std::any_of(kLayouts.begin(), kLayouts.end(), [&](const Layout& layout) {
    return std::any_of(layout.files.begin(), layout.files.end(),
                       [&](const char* file) { return exists_in(folder, file); });
  });
}

SequenceLists read_sequence_lists(const fs::path& folder, bool needs_rig, const LogSink& log) {
  std::string layouts;
  std::string missing;
  std::size_t most = 0;
  for (const Layout& layout : kLayouts) {
    std::vector<const char*> files = layout.files;
    if (needs_rig) files.insert(files.end(), layout.calibration.begin(), layout.calibration.end());
    std::vector<std::string_view> absent;
    for (const char* const file : files) {
      if (!exists_in(folder, file)) absent.push_back(file);
    }
    if (absent.empty()) return layout.read(folder, needs_rig, log);
    // The layout of which most is there is the one that was meant.
    if (files.size() - absent.size() > most) {
      most = files.size() - absent.size();
      missing = fmt::format("{} is missing of a sequence in the layout of {}", absent.front(),
                            layout.name);
    }
    layouts += fmt::format("{}{} ({})", layouts.empty() ? "" : "; or ", layout.name,
                           fmt::join(files, ", "));
  }
  // A name that the system refuses is another mistake than a folder without a sequence.
  std::error_code refused;
  static_cast<void>(fs::status(folder, refused));
  const bool is_known = !refused || refused == std::errc::no_such_file_or_directory;
  if (!is_known) missing = refused.message();
  throw Error(ErrorKind::kInput, folder.string(),
              most > 0 || !is_known ? missing : "holds no sequence",
              "a folder in the layout of " + layouts);
}

}  // namespace cairn::detail
