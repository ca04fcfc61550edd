// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/bytes/scalars.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeader = "# kapture format:";
constexpr std::uint64_t kMostOfKapture = std::numeric_limits<std::uint32_t>::max();

// Paths of kapture's files.
constexpr const char* kSensors = "sensors/sensors.txt";
constexpr const char* kRigs = "sensors/rigs.txt";
constexpr const char* kTrajectories = "sensors/trajectories.txt";
constexpr const char* kImages = "sensors/records_camera.txt";
constexpr const char* kGnss = "sensors/records_gnss.txt";
constexpr const char* kPoints = "reconstruction/points3d.txt";
constexpr const char* kObservations = "reconstruction/observations.txt";

// A type of numbers in a binary file: NumPy's name, or Python's.
std::optional<ScalarType> number_type(std::string_view name) {
  if (name == "float") return ScalarType::kFloat64;
  if (name == "int") return ScalarType::kInt64;
  const auto found = std::find_if(kScalars.begin(), kScalars.end(),
                                  [&](const Scalar& scalar) { return scalar.name == name; });
  return found == kScalars.end() ? std::nullopt : std::optional(found->type);
}

// Content of keypoints.txt or descriptors.txt, which describes the files beside it.
struct FeatureType {
  std::string folder;  // where they lie
  std::string name;
  ScalarType type = ScalarType::kFloat32;
  std::size_t numbers = 0;  // of each feature
  std::string keypoints_type;
  std::string metric;
};

// The rows of such a file.
struct Features {
  std::string bytes;
  std::size_t row_size = 0;

  std::size_t rows() const { return bytes.size() / row_size; }
  const char* row(std::size_t i) const { return bytes.data() + i * row_size; }
};

class KaptureReader {
 public:
  KaptureReader(const KaptureFiles& files, const Execution& execution)
      : files_(files), progress_(execution, 0), out_(files.name, execution, kPixelCentre) {}

  LandmarkMap read() && {
    read_sensors();
    read_poses();
    read_images();
    read_gnss();
    read_points();
    read_observations();
    remark_rest();
    const auto place = [&](MapColumn column, std::size_t) {
      const bool of_frames = column <= MapColumn::kImageNames || column == MapColumn::kInstants;
      return files_.name + "/" +
             (column == MapColumn::kRigs ? kRigs
              : of_frames                ? kTrajectories
                                         : kPoints);
    };
    return std::move(out_).finish(
        {.lost_observations = "observations of points without a finite position are left out",
         .place = place});
  }

 private:
  struct DevicePose {
    Rigid3 device_from_world;
    const std::string* rig = nullptr;  // from whose pose this follows
    Rigid3 rig_from_world;
  };
  struct Image {
    std::int64_t timestamp;
    std::string path;
    std::optional<CameraIndex> camera;
    DevicePose pose;
  };
  // An observation whose keypoint is not yet read.
  struct Seen {
    std::uint64_t point;
    FrameIndex frame;
    std::uint32_t feature;
  };

  // Calls `take` at each record of a file. @return false if there is no such file
  template <class Take>
  bool read_records(const std::string& path, const Take& take) {
    const std::unique_ptr<ByteSource> source = files_.open(path);
    if (!source) return false;
    TextRecords in(*source, progress_, Separator::kComma, false);
    while (in.next_record()) {
      // Without a last newline, a number may be truncated. Only the sensors' file is written without one.
      if (!in.was_terminated() && path != kSensors) {
        throw Error(ErrorKind::kInput, in.place(),
                    "the last line does not end with a newline and may be cut off",
                    "a newline at the end of the file");
      }
      take(in);
    }
    read_bytes_ += source->size().value_or(0);
    return true;
  }

  // ---- sensors

  void read_sensors() {
    const bool is_there = read_records(kSensors, [&](TextRecords& in) {
      std::string id(in.word("sensor_device_id"));
      in.word("name");
      const std::string_view type = in.word("sensor_type");
      if (type == "camera") {
        read_camera(in, id);
      } else if (type == "gnss") {
        const std::string_view system = in.has_word() ? in.word("EPSG") : std::string_view();
        gnss_sensors_.emplace(id, system.empty() || system == "EPSG:4326");
      }
      if (!sensors_.insert(std::move(id)).second) {
        in.refuse("sensor_device_id", "occurs twice", "distinct ids");
      }
    });
    reject_if(!is_there, files_.name + "/" + kSensors, "is not there",
              "the list of sensors of a kapture folder");
    version_ = version_of(*files_.open(kSensors));
    reject_if(!version_.empty() && version_ != "1.0" && version_ != "1.1",
              files_.name + "/" + kSensors, "kapture format " + printable(version_), "1.0 or 1.1");
  }

  static std::string version_of(ByteSource& sensors) {
    LineReader lines(sensors);
    const std::string_view line = trimmed(lines.next().value_or(std::string_view()));
    return std::string(line.starts_with(kHeader) ? trimmed(line.substr(kHeader.size())) : "");
  }

  void read_camera(TextRecords& in, const std::string& id) {
    Camera camera;
    camera.id = CameraId{cameras_++};
    camera.model = in.word("model");
    camera.width = size(in, "width");
    camera.height = size(in, "height");
    while (in.has_word()) camera.parameters.push_back(in.number("model_params"));
    const bool is_known = camera.model != "UNKNOWN_CAMERA";
    if (!is_known) out_.remark(fmt::format("camera {} is unknown to kapture", printable(id)));
    out_.add_camera(printable(id), is_known ? std::optional(std::move(camera)) : std::nullopt);
  }

  // Some writers make floats of all parameters, the size too.
  static std::uint32_t size(TextRecords& in, std::string_view name) {
    const double value = in.number(name);
    if (!(value >= 0.0 && value <= static_cast<double>(kMostOfKapture)) ||
        value != std::floor(value)) {
      in.refuse(name, fmt::format("{} is no size", value), "a whole number of pixels");
    }
    return static_cast<std::uint32_t>(value);
  }

  // ---- frames

  // device_from_reference; std::nullopt if one of its numbers is missing.
  static std::optional<Rigid3> read_pose(TextRecords& in) {
    std::array<double, 7> numbers{};
    constexpr std::array<const char*, 7> kNames = {"qw", "qx", "qy", "qz", "tx", "ty", "tz"};
    bool is_known = true;
    for (std::size_t i = 0; i < 7; ++i) {
      const auto number = in.optional_number(kNames[i]);
      is_known = is_known && number.has_value();
      numbers[i] = number.value_or(0.0);
    }
    in.expect_line_end();
    if (!is_known) return std::nullopt;
    const Eigen::Quaterniond q(numbers[0], numbers[1], numbers[2], numbers[3]);
    if (!has_direction(q)) in.refuse("qw", "the quaternion has no direction", "a rotation");
    return Rigid3(q, {numbers[4], numbers[5], numbers[6]});
  }

  void read_poses() {
    read_records(kRigs, [&](TextRecords& in) {
      const std::string rig(in.word("rig_device_id"));
      const std::string sensor(in.word("sensor_device_id"));
      const auto pose = read_pose(in);
      if (!pose) return;
      auto& rigs = rigs_of_[sensor];
      // Each image of the sensor looks for a pose of each of them.
      constexpr std::size_t kMostRigs = 100;
      if (rigs.size() == kMostRigs) {
        in.refuse("sensor_device_id",
                  fmt::format("{} is in more than {} rigs", printable(sensor), kMostRigs),
                  "as a rule one");
      }
      rigs.emplace_back(rig, *pose);
    });
    const bool is_there = read_records(kTrajectories, [&](TextRecords& in) {
      const std::int64_t timestamp = in.signed_number("timestamp");
      const std::string device(in.word("device_id"));
      const auto pose = read_pose(in);
      if (pose && !poses_.emplace(std::pair(timestamp, device), *pose).second) {
        in.refuse("device_id", fmt::format("{} has two poses at {}", printable(device), timestamp),
                  "one pose for a device at a time");
      }
    });
    if (!is_there) out_.remark("there is no sensors/trajectories.txt: images have no poses");
    add_rigs();
  }

  // A camera is in one rig of a map: the first.
  void add_rigs() {
    std::map<std::string, Rig> rigs;
    std::size_t in_several = 0;
    for (const std::string& sensor : sensors_) {
      const auto found = rigs_of_.find(sensor);
      const auto camera = out_.camera(printable(sensor));
      if (found == rigs_of_.end() || !camera) continue;
      in_several += found->second.size() > 1 ? 1 : 0;
      const auto& [name, pose] = found->second.front();
      const Eigen::Quaterniond q = pose.quaternion();
      rigs[name].mounts.push_back({*camera, {q.w(), q.x(), q.y(), q.z()}, pose.translation()});
    }
    for (auto& [name, rig] : rigs) {
      rig.id = RigId{out_.tables().rigs.size()};
      out_.tables().rigs.push_back(std::move(rig));
    }
    out_.lost(in_several, "cameras are in several rigs, of which the first is kept");
  }

  // Of a sensor itself, or of a rig that it is mounted on.
  std::optional<DevicePose> device_pose(std::int64_t timestamp, const std::string& device) const {
    const auto own = poses_.find({timestamp, device});
    if (own != poses_.end()) return DevicePose{own->second, nullptr, {}};
    const auto rigs = rigs_of_.find(device);
    if (rigs == rigs_of_.end()) return std::nullopt;
    for (const auto& [rig, device_from_rig] : rigs->second) {
      const auto pose = poses_.find({timestamp, rig});
      if (pose == poses_.end()) continue;
      const bool is_kept = &rig == &rigs->second.front().first;
      return DevicePose{device_from_rig * pose->second, is_kept ? &rig : nullptr, pose->second};
    }
    return std::nullopt;
  }

  void read_images() {
    std::vector<Image> images;
    std::size_t without_pose = 0;
    const bool is_there = read_records(kImages, [&](TextRecords& in) {
      const std::int64_t timestamp = in.signed_number("timestamp");
      const std::string device(in.word("device_id"));
      std::string path(in.word("image_path"));
      in.expect_line_end();
      require_inside(in, "image_path", path);
      if (!out_.has_camera(printable(device))) {
        in.refuse("device_id", printable(device) + " is no camera of sensors.txt",
                  "the id of a camera");
      }
      if (const auto pose = device_pose(timestamp, device)) {
        images.push_back({timestamp, std::move(path), out_.camera(printable(device)), *pose});
      } else {
        ++without_pose;
      }
    });
    if (!is_there) out_.remark("there is no sensors/records_camera.txt: the map has no frames");
    out_.lost(without_pose, "images without a pose are left out");
    std::sort(images.begin(), images.end(), [](const Image& a, const Image& b) {
      return std::tie(a.timestamp, a.path) < std::tie(b.timestamp, b.path);
    });
    const bool are_ids = std::adjacent_find(images.begin(), images.end(),
                                            [](const Image& a, const Image& b) {
                                              return a.timestamp == b.timestamp;
                                            }) == images.end() &&
                         (images.empty() || images.front().timestamp >= 0);
    if (!are_ids) out_.lost("timestamps are not distinct or negative: frames are numbered from 0");
    std::map<std::pair<std::int64_t, std::string>, InstantId> instants;
    for (Image& image : images) {
      const std::size_t i = out_.frame_count();
      if (!frame_of_.emplace(image.path, FrameIndex{static_cast<std::uint32_t>(i)}).second) {
        throw Error(ErrorKind::kInput, files_.name + "/" + kImages,
                    "the image " + printable(image.path) + " stands there twice",
                    "distinct images");
      }
      const Rigid3 world_from_camera = image.pose.device_from_world.inverse();
      timestamps_.push_back(image.timestamp);
      if (image.pose.rig != nullptr) {
        const InstantId next{static_cast<std::uint32_t>(instants.size())};
        const auto instant =
            instants.emplace(std::pair(image.timestamp, *image.pose.rig), next).first;
        out_.add_to_instant(instant->second, FrameIndex{static_cast<std::uint32_t>(i)},
                            image.pose.rig_from_world);
      }
      out_.add_frame({.id = FrameId{are_ids ? static_cast<std::uint64_t>(image.timestamp) : i},
                      .world_from_camera = world_from_camera.quaternion(),
                      .centre = world_from_camera.translation(),
                      .camera = image.camera,
                      .image_name = std::move(image.path)});
    }
  }

  // Paths of images name files in other folders of the same shape.
  static void require_inside(const TextRecords& in, std::string_view field, std::string_view path) {
    const fs::path parts(path);
    const bool leads_out =
        parts.is_absolute() || std::find(parts.begin(), parts.end(), fs::path("..")) != parts.end();
    if (path.empty() || leads_out || path.find('\0') != std::string_view::npos) {
      in.refuse(field, printable(path) + " leads out of the folder", "a path below records_data");
    }
  }

  void read_gnss() {
    std::map<std::int64_t, GeodeticPosition> fixes;
    std::size_t in_other_systems = 0;
    std::size_t left_out = 0;
    read_records(kGnss, [&](TextRecords& in) {
      const std::int64_t timestamp = in.signed_number("timestamp");
      const auto sensor = gnss_sensors_.find(std::string(in.word("device_id")));
      if (sensor == gnss_sensors_.end()) {
        in.refuse("device_id", "is no GNSS receiver of sensors.txt", "the id of one");
      }
      const double x = in.number("x");
      const double y = in.number("y");
      const double z = in.number("z");
      const GeodeticPosition position{y, x, z};
      if (!sensor->second) {
        ++in_other_systems;
      } else if (const std::string defect = geodetic_defect(position); !defect.empty()) {
        in.refuse("x", defect, "longitude, latitude in degrees, altitude in metres");
      } else if (!fixes.emplace(timestamp, position).second) {
        ++left_out;
      }
    });
    out_.lost(in_other_systems, "GNSS positions are not in EPSG:4326; left out");
    std::set<std::int64_t> used;
    for (std::size_t i = 0; i < timestamps_.size(); ++i) {
      const auto fix = fixes.find(timestamps_[i]);
      if (fix == fixes.end()) continue;
      used.insert(timestamps_[i]);
      out_.tables().frames.gnss.set(i, GnssFix{fix->second, std::nullopt});
    }
    out_.lost(left_out + fixes.size() - used.size(), "GNSS positions belong to no frame; left out");
  }

  // ---- landmarks

  void read_points() {
    std::size_t not_finite = 0;
    const bool is_there = read_records(kPoints, [&](TextRecords& in) {
      Eigen::Vector3d position;
      constexpr std::array<const char*, 3> kNames = {"X", "Y", "Z"};
      for (int i = 0; i < 3; ++i) {
        position[i] = in.number_or_nan(kNames[static_cast<std::size_t>(i)]);
      }
      std::optional<Color> color;
      if (in.has_word()) {
        const std::uint8_t red = channel(in, "R");
        const std::uint8_t green = channel(in, "G");
        const std::uint8_t blue = channel(in, "B");
        color = Color{red, green, blue};
        in.expect_line_end();
      }
      if (point_count_ == kMostOfKapture) in.refuse("X", "too many points", "fewer than 2^32");
      const std::uint64_t id = point_count_++;
      if (position.allFinite()) {
        out_.add_landmark(id, position, color);
      } else {
        ++not_finite;
      }
    });
    if (!is_there) out_.remark("there is no reconstruction/points3d.txt: the map has no landmarks");
    out_.lost(not_finite, "points without a finite position; left out");
  }

  // np.savetxt writes them as floats.
  static std::uint8_t channel(TextRecords& in, std::string_view name) {
    const double value = in.number(name);
    if (!(value >= 0.0 && value <= 255.0)) {
      in.refuse(name, fmt::format("{} is no colour", value), "0 to 255");
    }
    return static_cast<std::uint8_t>(std::lround(value));
  }

  // ---- observations

  bool has_types() const { return version_ == "1.1"; }

  void read_observations() {
    // By type of keypoint; version 1.0 has one, without a name.
    std::map<std::string, std::vector<Seen>, std::less<>> seen;
    std::size_t unposed = 0;
    const bool is_there = read_records(kObservations, [&](TextRecords& in) {
      const std::uint64_t point = in.unsigned_number("point3d_id", kMostOfKapture);
      if (point >= point_count_) {
        in.refuse("point3d_id", fmt::format("{} of {} points", point, point_count_),
                  "the place of a point in points3d.txt, from 0");
      }
      const std::string type(has_types() ? in.word("keypoints_type") : std::string_view());
      if (has_types()) require_inside(in, "keypoints_type", type);
      std::vector<Seen>& of_type = seen[type];
      while (in.has_word()) {
        const auto frame = frame_of_.find(std::string(in.word("image_path")));
        const auto feature =
            static_cast<std::uint32_t>(in.unsigned_number("feature_id", kMostOfKapture));
        if (frame == frame_of_.end()) {
          ++unposed;
        } else {
          of_type.push_back({point, frame->second, feature});
        }
      }
    });
    if (!is_there) {
      if (point_count_ > 0) {
        out_.remark("there is no reconstruction/observations.txt: observations are unknown");
      }
      return;
    }
    out_.lost(unposed, "observations by images without a pose are left out");
    // A landmark of several types would be observed twice by one image.
    std::size_t others = 0;
    const auto most = std::max_element(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
      return a.second.size() < b.second.size();
    });
    for (const auto& [type, list] : seen) others += list.size();
    if (most == seen.end()) {
      out_.remark(
          "reconstruction/observations.txt holds none that can be used: observations are unknown");
      return;
    }
    others -= most->second.size();
    out_.lost(others, fmt::format("observations of other keypoints than {} are left out",
                                  printable(most->first)));
    take_observations(most->first, std::move(most->second));
  }

  static std::string folder_of(const char* kind, const std::string& type) {
    return fmt::format("reconstruction/{}{}{}", kind, type.empty() ? "" : "/", type);
  }

  std::optional<FeatureType> feature_type(const std::string& folder, const char* file,
                                          bool names_keypoints) {
    std::optional<FeatureType> result;
    read_records(folder + "/" + file, [&](TextRecords& in) {
      if (result) in.refuse("name", "a second line", "one line");
      FeatureType& made = result.emplace();
      made.folder = folder;
      made.name = in.word("name");
      const std::string_view type = in.word("dtype");
      const auto known = number_type(type);
      if (!known)
        in.refuse("dtype", printable(type) + " is no known type", "e.g. float32 or uint8");
      made.type = *known;
      constexpr std::uint64_t kMostNumbers = 65536;
      made.numbers = in.unsigned_number("dsize", kMostNumbers);
      if (made.numbers == 0) in.refuse("dsize", "is 0", "1 or more");
      if (!names_keypoints) return;
      made.keypoints_type = in.word("keypoints_type");
      if (in.has_word()) made.metric = in.word("metric_type");
    });
    return result;
  }

  // All features of an image; std::nullopt if it has no file of them.
  std::optional<Features> features(const FeatureType& type, const std::string& image,
                                   const char* ending) {
    const std::string path = fmt::format("{}/{}.{}", type.folder, image, ending);
    const std::unique_ptr<ByteSource> source = files_.open(path);
    if (!source) return std::nullopt;
    Features result{read_all(*source), type.numbers * size_of(type.type)};
    read_bytes_ += result.bytes.size();
    progress_.advance(result.bytes.size(), source->name());
    reject_if(result.bytes.size() % result.row_size != 0, source->name(),
              fmt::format("{} bytes are no whole number of features", result.bytes.size()),
              fmt::format("{} bytes for each", result.row_size));
    return result;
  }

  void take_observations(const std::string& type, std::vector<Seen> seen) {
    const std::string folder = folder_of("keypoints", type);
    const auto keypoints = feature_type(folder, "keypoints.txt", false);
    if (!keypoints) {
      out_.lost(fmt::format("there is no {}/keypoints.txt: where {} observations are is unknown",
                            folder, seen.size()));
      return;
    }
    reject_if(keypoints->numbers < 2, files_.name + "/" + folder + "/keypoints.txt",
              "keypoints of one number", "x, y and what else there is");
    const auto described = descriptor_type(type);
    if (described) {
      const bool is_binary = is_binary_descriptor(*described);
      out_.set_descriptors(kind_of(*described), described->numbers,
                           is_binary ? DescriptorNorm::kHamming : DescriptorNorm::kSquared);
    }
    // By frame, so that each file of features is read once.
    std::stable_sort(seen.begin(), seen.end(),
                     [](const Seen& a, const Seen& b) { return a.frame < b.frame; });
    const auto& images = out_.tables().frames.image_names;
    std::size_t without_file = 0;
    for (auto begin = seen.begin(); begin != seen.end();) {
      const FrameIndex frame = begin->frame;
      const auto end =
          std::find_if(begin, seen.end(), [&](const Seen& s) { return s.frame != frame; });
      const std::string& image = images[frame.value];
      const auto points = features(*keypoints, image, "kpt");
      if (!points) {
        without_file += static_cast<std::size_t>(end - begin);
        begin = end;
        continue;
      }
      const auto descriptors = described ? features(*described, image, "desc") : std::nullopt;
      for (; begin != end; ++begin) {
        add(*begin, *keypoints, *points, described, descriptors);
        require_budget(out_.descriptor_bytes());
      }
    }
    require_budget(out_.descriptor_bytes_to_finish());
    out_.lost(without_file,
              fmt::format("observations by images without keypoints are left out{}",
                          files_.open(folder + "/keypoints.tar")
                              ? "; those in " + folder + "/keypoints.tar are not read: unpack it"
                              : ""));
  }

  void require_budget(std::uint64_t descriptor_bytes) const {
    require_descriptor_budget(descriptor_bytes, read_bytes_, files_.name);
  }

  void add(const Seen& seen, const FeatureType& keypoints, const Features& points,
           const std::optional<FeatureType>& described,
           const std::optional<Features>& descriptors) {
    const std::string& image = out_.tables().frames.image_names[seen.frame.value];
    if (seen.feature >= points.rows()) {
      throw Error(ErrorKind::kInput, files_.name + "/" + kObservations,
                  fmt::format("feature {} of {}, which has {}", seen.feature, printable(image),
                              points.rows()),
                  "the place of a keypoint in its file, from 0");
    }
    const char* const row = points.row(seen.feature);
    const double x = load_number(keypoints.type, row);
    const double y = load_number(keypoints.type, row + size_of(keypoints.type));
    if (!std::isfinite(x) || !std::isfinite(y)) {
      throw Error(ErrorKind::kInput,
                  fmt::format("{}/{}/{}.kpt", files_.name, keypoints.folder, image),
                  fmt::format("keypoint {} is not finite", seen.feature), "numbers");
    }
    std::vector<std::uint8_t> descriptor;
    if (descriptors && seen.feature < descriptors->rows()) {
      descriptor = bytes_of(*described, descriptors->row(seen.feature));
    }
    out_.add_observation({.landmark_id = seen.point,
                          .frame = seen.frame,
                          .pixel = {x, y},
                          .keypoint = seen.feature,
                          .descriptor = descriptor});
  }

  // ---- descriptors

  // The descriptors of the keypoints. Of several, takes the first by name. std::nullopt if a map can hold none of them.
  std::optional<FeatureType> descriptor_type(const std::string& keypoints) {
    std::vector<std::string> folders;
    if (has_types()) {
      for (const std::string& type : files_.list("reconstruction/descriptors")) {
        folders.push_back(folder_of("descriptors", type));
      }
    } else {
      folders.push_back(folder_of("descriptors", ""));
    }
    std::optional<FeatureType> result;
    std::vector<std::string> others;
    for (const std::string& folder : folders) {
      auto found = feature_type(folder, "descriptors.txt", has_types());
      if (!found) continue;
      const bool fits = (!has_types() || found->keypoints_type == keypoints) &&
                        found->numbers <= kMostDescriptorBytes &&
                        (!is_integer(found->type) || size_of(found->type) == 1);
      if (fits && !result) {
        result = std::move(found);
      } else {
        others.push_back(folder);
      }
    }
    if (!others.empty()) out_.lost(fmt::format("not read: {}", fmt::join(others, ", ")));
    return result;
  }

  static bool is_binary_descriptor(const FeatureType& type) {
    const std::string text = lower_case(type.metric + " " + type.name);
    return size_of(type.type) == 1 &&
           (text.find("hamming") != std::string::npos || text.find("orb") != std::string::npos);
  }

  // A word, as kinds of descriptors are.
  static std::string kind_of(const FeatureType& type) {
    std::string kind = type.name.empty() ? "kapture" : type.name;
    std::replace_if(
        kind.begin(), kind.end(), [](char c) { return !is_visible(c); }, '_');
    return kind;
  }

  static std::vector<std::uint8_t> bytes_of(const FeatureType& type, const char* row) {
    std::vector<std::uint8_t> bytes(type.numbers);
    if (size_of(type.type) == 1) {
      std::memcpy(bytes.data(), row, bytes.size());
      return bytes;
    }
    std::vector<double> values(type.numbers);
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = load_number(type.type, row + i * size_of(type.type));
    }
    to_bytes<double>(values, bytes);
    return bytes;
  }

  // ---- the rest

  void remark_rest() const {
    static const std::set<std::string_view> read_by_name = {
        "sensors.txt",      "rigs.txt",     "trajectories.txt", "records_camera.txt",
        "records_gnss.txt", "records_data", "points3d.txt",     "observations.txt",
        "keypoints",        "descriptors"};
    std::vector<std::string> others;
    for (const char* folder : {"sensors", "reconstruction"}) {
      for (const std::string& name : files_.list(folder)) {
        if (!read_by_name.contains(name))
          others.push_back(printable(fmt::format("{}/{}", folder, name)));
      }
    }
    if (!others.empty()) out_.lost(fmt::format("not read: {}", fmt::join(others, ", ")));
  }

  const KaptureFiles& files_;
  ReadingProgress progress_;
  SfmBuilder out_;
  std::string version_;
  std::uint64_t read_bytes_ = 0;
  std::set<std::string> sensors_;
  std::uint64_t cameras_ = 0;                           // known or not
  std::unordered_map<std::string, bool> gnss_sensors_;  // whether in EPSG:4326
  std::unordered_map<std::string, std::vector<std::pair<std::string, Rigid3>>> rigs_of_;
  std::map<std::pair<std::int64_t, std::string>, Rigid3> poses_;
  std::unordered_map<std::string, FrameIndex> frame_of_;
  std::vector<std::int64_t> timestamps_;  // of frames
  std::uint64_t point_count_ = 0;
};

// The kapture folder that a path is, or is a file of.
std::optional<fs::path> kapture_folder(const MapInput& input) {
  if (input.source == nullptr) {
    if (is_file(input.path / kSensors)) return input.path;
    return std::nullopt;
  }
  if (!input.first_bytes.starts_with(kHeader)) return std::nullopt;
  std::error_code ignored;
  const fs::path folder = fs::absolute(input.path, ignored).parent_path().parent_path();
  if (!is_file(folder / kSensors)) return std::nullopt;
  return folder;
}

}  // namespace

LandmarkMap read_kapture(const KaptureFiles& files, const Execution& execution) {
  return KaptureReader(files, execution).read();
}

LandmarkMap read_kapture(const fs::path& folder, const Execution& execution) {
  const KaptureFiles files{folder.string(),
                           [&](const std::string& path) -> std::unique_ptr<ByteSource> {
                             if (!is_file(folder / path)) return nullptr;
                             return std::make_unique<FileReader>(folder / path);
                           },
                           [&](const std::string& path) {
                             std::vector<std::string> names;
                             std::error_code error;
                             for (fs::directory_iterator entry(folder / path, error), end;
                                  !error && entry != end; entry.increment(error)) {
                               names.push_back(entry->path().filename().string());
                             }
                             std::sort(names.begin(), names.end());
                             return names;
                           }};
  return read_kapture(files, execution);
}

bool is_kapture(const MapInput& input) {
  return kapture_folder(input).has_value();
}

LandmarkMap read_kapture_folder(const MapInput& input, const Execution& execution) {
  return read_kapture(*kapture_folder(input), execution);
}

}  // namespace cairn::detail
