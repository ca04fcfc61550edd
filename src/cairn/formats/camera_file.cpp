// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/camera_file.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"

namespace cairn {
namespace {

// The values of a YAML file of scalars and lists of numbers. A key within another is `outer.inner`.
class CameraYaml {
 public:
  explicit CameraYaml(ByteSource& source);

  bool has(std::string_view key) const { return values_.contains(key); }
  std::string place(std::string_view key) const {
    const auto found = values_.find(key);
    if (found == values_.end()) return fmt::format("{}: {}", name_, key);
    return fmt::format("{}:{}: {}", name_, found->second.line, key);
  }
  const std::string& text(std::string_view key) const {
    const auto found = values_.find(key);
    reject_if(found == values_.end(), name_, fmt::format("{} is missing", key),
              "a camera as Cairn, ROS, EuRoC, Kalibr, OpenCV, ORB-SLAM or stella_vslam writes it");
    return found->second.text;
  }
  double number(std::string_view key) const {
    const auto number = parse_number(text(key));
    reject_if(!number, place(key), printable(text(key)) + " is not a number", "a number");
    return *number;
  }
  double positive(std::string_view key) const {
    const auto number = parse_number(text(key));
    reject_if(!number || *number <= 0.0, place(key),
              printable(text(key)) + " is not a positive number", "a positive number");
    return *number;
  }
  std::uint32_t image_size(std::string_view key) const { return image_size(key, text(key)); }
  // Of a list of width and height.
  std::pair<std::uint32_t, std::uint32_t> image_sizes(std::string_view key) const {
    const std::vector<double> sizes = numbers(key, 2);
    return {image_size(key, fmt::format("{}", sizes[0])),
            image_size(key, fmt::format("{}", sizes[1]))};
  }
  // Rows in brackets, or items, come one after the other.
  std::vector<double> numbers(std::string_view key) const;
  std::vector<double> numbers(std::string_view key, std::size_t count) const {
    std::vector<double> all = numbers(key);
    reject_if(all.size() != count, place(key), fmt::format("{} numbers", all.size()),
              fmt::format("{}", count));
    return all;
  }
  template <std::size_t kCount>
  std::array<double, kCount> matrix(std::string_view key) const {
    std::array<double, kCount> all;
    std::ranges::copy(numbers(key, kCount), all.begin());
    return all;
  }
  Rigid3 pose(std::string_view key, const std::array<double, 16>& rows) const {
    try {
      return Rigid3::from_matrix(
          Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data()));
    } catch (const Error& error) {
      throw Error(ErrorKind::kInput, place(key), error.what(), "");
    }
  }
  void refuse_other_keys(std::span<const std::string_view> known) const {
    for (const auto& [key, value] : values_) {
      reject_if(std::ranges::find(known, key) == known.end(),
                fmt::format("{}:{}", name_, value.line), printable(key) + " is no key",
                fmt::format("{}", fmt::join(known, ", ")));
    }
  }
  const std::string& name() const { return name_; }

 private:
  struct Value {
    std::string text;
    std::uint64_t line;
  };

  std::uint32_t image_size(std::string_view key, const std::string& word) const {
    constexpr std::uint64_t kLargest = 1 << 16;
    const auto number = parse_unsigned(word);
    reject_if(!number || *number == 0 || *number > kLargest, place(key),
              printable(word) + " is no image size", "1 to 65536 pixels");
    return static_cast<std::uint32_t>(*number);
  }

  std::string name_;
  std::map<std::string, Value, std::less<>> values_;
};

CameraYaml::CameraYaml(ByteSource& source) : name_(source.name()) {
  LineReader lines(source);
  std::vector<std::pair<std::size_t, std::string>> outer;  // indents and keys
  std::string* list = nullptr;                             // of the last key
  std::ptrdiff_t open_brackets = 0;
  while (const auto line = lines.next()) {
    const std::string_view text = trimmed(line->substr(0, line->find('#')));
    if (text.empty() || text.starts_with('%') || text == "---" || text == "...") continue;
    const bool is_item = text == "-" || text.starts_with("- ");
    const bool begins_list = list != nullptr && list->empty() && text.starts_with('[');
    if (list != nullptr && (open_brackets > 0 || is_item || begins_list)) {
      list->append(1, ' ').append(text);
    } else {
      const std::string place = fmt::format("{}:{}", name_, lines.line_number());
      const std::size_t colon = text.find(':');
      reject_if(colon == std::string_view::npos, place, printable(text) + " is no key",
                "lines of key: value");
      const std::size_t indent = line->find_first_not_of(kBlanks);
      while (!outer.empty() && outer.back().first >= indent) outer.pop_back();
      std::string key(trimmed(text.substr(0, colon)));
      if (!outer.empty()) key = outer.back().second + "." + key;
      std::string_view value = trimmed(text.substr(colon + 1));
      if (value.starts_with("!!"))
        value = trimmed(value.substr(std::min(value.find(' '), value.size())));
      const bool is_quoted =
          value.size() >= 2 && value.front() == value.back() && value.find_first_of("\"'") == 0;
      if (is_quoted) value = value.substr(1, value.size() - 2);
      const auto [entry, is_new] =
          values_.try_emplace(key, Value{std::string(value), lines.line_number()});
      reject_if(!is_new, place, printable(key) + " stands above already", "each key once");
      list = &entry->second.text;
      outer.emplace_back(indent, std::move(key));
    }
    open_brackets += std::ranges::count(text, '[') - std::ranges::count(text, ']');
  }
}

std::vector<double> CameraYaml::numbers(std::string_view key) const {
  std::string list = text(key);
  list.erase(0, list.find_first_not_of(' '));
  const bool is_list = list.starts_with('[') ? list.ends_with(']') : list.starts_with("- ");
  reject_if(!is_list, place(key), "no list in brackets", "[number, number, ...]");
  std::vector<double> numbers;
  std::ranges::replace_if(
      list, [](char c) { return c == '[' || c == ']' || c == ','; }, ' ');
  for (const std::string_view word : detail::words_of(list)) {
    if (word == "-") continue;  // of an item
    const auto number = parse_number(word);
    reject_if(!number, place(key), printable(word) + " is not a number", "[number, number, ...]");
    numbers.push_back(*number);
  }
  return numbers;
}

// Kalibr's and EuRoC's form.
CameraCalibration listed_calibration(const CameraYaml& yaml, const std::string& within,
                                     const std::string& coefficients) {
  const std::string& model = yaml.text(within + "camera_model");
  reject_if(model != "pinhole", yaml.place(within + "camera_model"), printable(model), "pinhole");
  const std::vector<double> k = yaml.numbers(within + "intrinsics", 4);
  CameraCalibration stated;
  std::tie(stated.width, stated.height) = yaml.image_sizes(within + "resolution");
  stated.distortion_model = yaml.text(within + "distortion_model");
  if (stated.distortion_model != "none") stated.distortion = yaml.numbers(coefficients, 4);
  stated.intrinsics = {k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1};
  return stated;
}

// ROS's and OpenCV's form, without the size.
CameraCalibration calibration_of_matrices(const CameraYaml& yaml, const std::string& camera_matrix,
                                          const std::string& coefficients) {
  CameraCalibration stated;
  const auto& k = stated.intrinsics = yaml.matrix<9>(camera_matrix);
  reject_if(k[1] != 0.0 || k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0,
            yaml.place(camera_matrix), "no camera matrix without skew",
            "fx, 0, cx, 0, fy, cy, 0, 0, 1");
  stated.distortion = yaml.numbers(coefficients);
  if (yaml.has("distortion_model")) {
    stated.distortion_model = yaml.text("distortion_model");
  } else if (yaml.has("fisheye_model") && yaml.text("fisheye_model") == "1") {
    stated.distortion_model = "equidistant";
  } else {
    reject_if(stated.distortion.size() == 4 && !yaml.has("fisheye_model"), yaml.place(coefficients),
              "4 coefficients, which may be a fisheye's",
              "a line 'distortion_model: plumb_bob' or 'distortion_model: equidistant'");
    stated.distortion_model = "rational_polynomial";
  }
  return stated;
}

// One camera, and where it is, of EuRoC or ROS.
struct StatedCamera {
  CameraCalibration calibration;
  std::optional<Rigid3> body_from_camera = {};
};

StatedCamera read_stated_camera(const CameraYaml& yaml) {
  if (yaml.has("intrinsics")) {
    StatedCamera camera{listed_calibration(yaml, "", "distortion_coefficients")};
    if (yaml.has("T_BS.data"))
      camera.body_from_camera = yaml.pose("T_BS.data", yaml.matrix<16>("T_BS.data"));
    return camera;
  }
  CameraCalibration stated =
      yaml.has("K.data")
          ? calibration_of_matrices(yaml, "K.data", "D.data")
          : calibration_of_matrices(yaml, "camera_matrix.data", "distortion_coefficients.data");
  stated.width = yaml.image_size("image_width");
  stated.height = yaml.image_size("image_height");
  if (yaml.has("rectification_matrix.data"))
    stated.rectification = yaml.matrix<9>("rectification_matrix.data");
  if (yaml.has("projection_matrix.data"))
    stated.projection = yaml.matrix<12>("projection_matrix.data");
  return {stated};
}

// Between the cameras; or by where each is on an IMU, as Kalibr (T_cam_imu) or OpenVINS (T_imu_cam) state it.
Rigid3 right_from_left(const CameraYaml& yaml) {
  const auto both = [&](const std::string& key) {
    return yaml.has("cam0." + key) && yaml.has("cam1." + key);
  };
  const auto pose = [&](const std::string& key) { return yaml.pose(key, yaml.matrix<16>(key)); };
  constexpr const char* kPose = "cam1.T_cn_cnm1";
  if (!yaml.has(kPose) && both("T_cam_imu")) {
    return pose("cam1.T_cam_imu") * pose("cam0.T_cam_imu").inverse();
  }
  if (!yaml.has(kPose) && both("T_imu_cam")) {
    return pose("cam1.T_imu_cam").inverse() * pose("cam0.T_imu_cam");
  }
  return pose(kPose);
}

StereoRig read_kalibr_chain(const CameraYaml& yaml) {
  reject_if(yaml.has("cam2.intrinsics"), yaml.place("cam2.intrinsics"), "a third camera",
            "cam0 and cam1 alone");
  const auto camera = [&](const std::string& name) {
    return camera_of(listed_calibration(yaml, name + ".", name + ".distortion_coeffs"), false,
                     yaml.place(name));
  };
  return {camera("cam0"), camera("cam1"), right_from_left(yaml).inverse()};
}

StereoRig read_opencv_pair(const CameraYaml& yaml, const std::string& matrix) {
  const bool has_size = yaml.has("image_width");
  const auto camera = [&](const std::string& number) {
    CameraCalibration stated =
        calibration_of_matrices(yaml, matrix + number + ".data", "D" + number + ".data");
    stated.width = has_size ? yaml.image_size("image_width") : 1;
    stated.height = has_size ? yaml.image_size("image_height") : 1;
    Camera made = camera_of(stated, false, yaml.place(matrix + number));
    if (!has_size) made.width = made.height = 0;
    return made;
  };
  reject_if(!yaml.has("R.data") || !yaml.has("T.data"), yaml.name(), "R or T is missing",
            "the extrinsics of stereo_calib in the same file: append them");
  const auto r = yaml.matrix<9>("R.data");
  const auto t = yaml.matrix<3>("T.data");
  const Rigid3 right_from_left = yaml.pose("R.data", {r[0], r[1], r[2], t[0], r[3], r[4], r[5],
                                                      t[1], r[6], r[7], r[8], t[2], 0, 0, 0, 1});
  return {camera("1"), camera("2"), right_from_left.inverse()};
}

// The settings of ORB-SLAM2, ORB-SLAM3 and stella_vslam. stella_vslam nests the keys that ORB-SLAM writes with dots.

bool are_slam_settings(const CameraYaml& yaml) {
  return yaml.has("Camera.fx") || yaml.has("Camera1.fx") || yaml.has("Camera.model") ||
         yaml.has("Camera.type");
}

bool is_fisheye(const CameraYaml& yaml, const std::string& key) {
  if (!yaml.has(key)) return false;
  const std::string& model = yaml.text(key);
  constexpr std::string_view kPinholes[] = {"PinHole", "Pinhole", "Rectified", "perspective"};
  if (model == "KannalaBrandt8" || model == "fisheye") return true;
  reject_if(std::ranges::find(kPinholes, model) == std::end(kPinholes), yaml.place(key),
            printable(model), "PinHole, Rectified, KannalaBrandt8, perspective or fisheye");
  return false;
}

// @param within of the camera's keys
CameraCalibration settings_calibration(const CameraYaml& yaml, const std::string& within) {
  const bool fisheye = is_fisheye(yaml, yaml.has("Camera.model") ? "Camera.model" : "Camera.type");
  const auto number = [&](const std::string& key) { return yaml.number(within + key); };
  CameraCalibration stated;
  stated.width = yaml.image_size(yaml.has("Camera.cols") ? "Camera.cols" : "Camera.width");
  stated.height = yaml.image_size(yaml.has("Camera.rows") ? "Camera.rows" : "Camera.height");
  stated.intrinsics = {number("fx"), 0, number("cx"), 0, number("fy"), number("cy"), 0, 0, 1};
  stated.distortion_model = fisheye ? "equidistant" : "plumb_bob";
  constexpr std::string_view kPinhole[] = {"k1", "k2", "p1", "p2", "k3"};
  constexpr std::string_view kFisheye[] = {"k1", "k2", "k3", "k4"};
  using Keys = std::span<const std::string_view>;
  for (const std::string_view name : fisheye ? Keys(kFisheye) : Keys(kPinhole)) {
    const std::string key(name);
    stated.distortion.push_back(yaml.has(within + key) ? number(key) : 0.0);
  }
  return stated;
}

// A pair by the images as taken, which the program rectifies: matrices, and the baseline of rectified images.
StereoRig unrectified_pair(const CameraYaml& yaml, const CameraCalibration& rectified,
                           double baseline) {
  const bool is_stella = yaml.has("StereoRectifier.K_left");
  const bool fisheye = is_fisheye(yaml, "StereoRectifier.model");
  const auto camera = [&](std::string_view side, std::string_view in_capitals) {
    const auto key = [&](char matrix) {
      return is_stella ? fmt::format("StereoRectifier.{}_{}", matrix, side)
                       : fmt::format("{}.{}.data", in_capitals, matrix);
    };
    CameraCalibration stated = rectified;
    stated.intrinsics = yaml.matrix<9>(key('K'));
    stated.distortion = yaml.numbers(key('D'));
    stated.distortion_model = fisheye ? "equidistant" : "plumb_bob";
    stated.rectification = yaml.matrix<9>(key('R'));
    const auto& k = rectified.intrinsics;
    const double right = side == "right" ? -k[0] * baseline : 0.0;
    stated.projection = {k[0], 0, k[2], right, 0, k[4], k[5], 0, 0, 0, 1, 0};
    return stated;
  };
  const CameraCalibration left = camera("left", "LEFT");
  const CameraCalibration right = camera("right", "RIGHT");
  const auto pose = left_from_right(left, right, false, yaml.name());
  reject_if(!pose, yaml.name(), "the baseline is 0", "a positive number");
  return {camera_of(left, false, yaml.name()), camera_of(right, false, yaml.name()), *pose};
}

CameraFile read_slam_settings(const CameraYaml& yaml) {
  const std::string first = yaml.has("Camera1.fx") ? "Camera1." : "Camera.";
  const CameraCalibration stated = settings_calibration(yaml, first);
  const Camera camera = camera_of(stated, false, yaml.place(first + "fx"));
  for (const char* const key : {"DepthMapFactor", "RGBD.DepthMapFactor", "depthmap_factor",
                                "Preprocessing.depthmap_factor"}) {
    // A baseline beside it is not that of a pair of images.
    if (yaml.has(key)) return {camera, yaml.positive(key), {}, {}};
  }
  if (yaml.has("Camera2.fx")) {
    constexpr const char* kPose = "Stereo.T_c1_c2.data";
    const CameraCalibration second = settings_calibration(yaml, "Camera2.");
    return {camera,
            {},
            {},
            StereoRig{camera, camera_of(second, false, yaml.place("Camera2.fx")),
                      yaml.pose(kPose, yaml.matrix<16>(kPose))}};
  }
  const bool is_single = yaml.has("Camera.setup") && yaml.text("Camera.setup") != "stereo";
  std::optional<double> baseline;
  if (yaml.has("Stereo.b")) baseline = yaml.positive("Stereo.b");
  for (const char* const key : {"Camera.bf", "Camera.focal_x_baseline"}) {
    if (yaml.has(key)) baseline = yaml.positive(key) / stated.intrinsics[0];
  }
  if (!baseline || is_single) return {camera, {}, {}, {}};
  const StereoRig rig =
      yaml.has("LEFT.K.data") || yaml.has("StereoRectifier.K_left")
          ? unrectified_pair(yaml, stated, *baseline)
          : StereoRig{camera, camera,
                      Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(*baseline, 0, 0))};
  return {rig.left, {}, {}, rig};
}

CameraFile read_own_camera(const CameraYaml& yaml) {
  constexpr std::string_view kKeys[] = {"model",      "width",     "height",
                                        "parameters", "readout_s", "depth_units_per_metre"};
  yaml.refuse_other_keys(kKeys);
  CameraFile result;
  if (yaml.has("model")) result.camera.model = yaml.text("model");
  if (yaml.has("width")) result.camera.width = yaml.image_size("width");
  if (yaml.has("height")) result.camera.height = yaml.image_size("height");
  if (yaml.has("parameters")) result.camera.parameters = yaml.numbers("parameters");
  if (yaml.has("depth_units_per_metre"))
    result.depth_units_per_metre = yaml.positive("depth_units_per_metre");
  if (yaml.has("readout_s")) result.readout_s = yaml.positive("readout_s");
  const std::string defect = camera_defect(result.camera);
  reject_if(!defect.empty(), yaml.name(), defect, "a usable camera");
  return result;
}

}  // namespace

Camera tum_camera(const std::string& name) {
  // CameraCalibration published with the benchmark; the images of fr3 are already undistorted.
  const auto camera = [](std::vector<double> parameters) {
    return Camera{CameraId{0}, "FULL_OPENCV", 640, 480, std::move(parameters)};
  };
  if (name == "fr1") {
    return camera({517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358,
                   0.002628, 1.163314, 0.0, 0.0, 0.0});
  }
  if (name == "fr2") {
    return camera({520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257,
                   -0.000105, 0.917205, 0.0, 0.0, 0.0});
  }
  if (name == "fr3") return Camera{CameraId{0}, "PINHOLE", 640, 480, {535.4, 539.2, 320.1, 247.6}};
  throw Error(ErrorKind::kMisuse, "camera", printable(name) + " is no camera of the TUM benchmark",
              "fr1, fr2 or fr3");
}

std::optional<double> tum_readout_s(const std::string& name) {
  if (name == "fr1") return 0.026;
  return std::nullopt;
}

CameraFile read_calibration_file(ByteSource& source) {
  const CameraYaml yaml(source);
  const auto pair = [](StereoRig rig) { return CameraFile{rig.left, {}, {}, rig}; };
  const auto single = [&](const CameraCalibration& stated) {
    return CameraFile{camera_of(stated, false, yaml.name()), {}, {}, {}};
  };
  if (are_slam_settings(yaml)) return read_slam_settings(yaml);
  if (yaml.has("cam1.intrinsics")) return pair(read_kalibr_chain(yaml));
  if (yaml.has("cam0.intrinsics"))
    return single(listed_calibration(yaml, "cam0.", "cam0.distortion_coeffs"));
  for (const char* const matrix : {"M", "K"}) {
    if (yaml.has(matrix + std::string("1.data"))) return pair(read_opencv_pair(yaml, matrix));
  }
  const bool is_others =
      yaml.has("intrinsics") || yaml.has("camera_matrix.data") || yaml.has("K.data");
  return is_others ? single(read_stated_camera(yaml).calibration) : read_own_camera(yaml);
}

CameraFile read_camera_file(ByteSource& source) {
  CameraFile file = read_calibration_file(source);
  reject_if(file.rig.has_value(), source.name(), "holds a stereo pair", "one camera");
  return file;
}

StereoRig read_stereo_files(ByteSource& left, ByteSource& right) {
  const StatedCamera first = read_stated_camera(CameraYaml(left));
  const StatedCamera second = read_stated_camera(CameraYaml(right));
  const std::optional<Rigid3> pose =
      first.body_from_camera && second.body_from_camera
          ? first.body_from_camera->inverse() * *second.body_from_camera
          : left_from_right(first.calibration, second.calibration, false, right.name());
  reject_if(!pose, right.name(), "does not say where the right camera is",
            "T_BS in both files, or a baseline in projection_matrix");
  return {camera_of(first.calibration, false, left.name()),
          camera_of(second.calibration, false, right.name()), *pose};
}

std::string camera_file_text(const CameraFile& file) {
  std::string text = fmt::format(
      "# Pixels: the centre of the top-left pixel is (0, 0).\n"
      "model: {}\nwidth: {}\nheight: {}\nparameters: [",
      file.camera.model, file.camera.width, file.camera.height);
  for (std::size_t i = 0; i < file.camera.parameters.size(); ++i) {
    if (i > 0) text += ", ";
    append_number(text, file.camera.parameters[i]);
  }
  text += "]\n";
  if (file.depth_units_per_metre) {
    text += "depth_units_per_metre: ";
    append_number(text, *file.depth_units_per_metre);
    text += '\n';
  }
  if (file.readout_s) {
    text += "readout_s: ";
    append_number(text, *file.readout_s);
    text += '\n';
  }
  return text;
}

}  // namespace cairn
