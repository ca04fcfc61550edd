// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/colmap_model.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostRecords = std::numeric_limits<std::uint32_t>::max();

// --- Reading --------------------------------------------------------------------------------------

struct Image {
  FrameId id;
  std::array<double, 4> camera_from_world = {};  // qw qx qy qz
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  std::uint64_t camera = 0;
  std::string name;
  std::size_t first_pixel = 0;
  std::size_t pixels = 0;
};

struct SensorId {
  bool is_camera = true;
  std::uint64_t id = 0;
};

struct PoseNumbers {
  std::array<double, 4> quaternion = {1.0, 0.0, 0.0, 0.0};
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

// What a rig took at one instant.
struct RigFrame {
  std::uint32_t id = 0;
  std::uint64_t rig = 0;
  PoseNumbers rig_from_world;
};

// Collects the records of a model.
class ColmapReader {
 public:
  ColmapReader(const ColmapSources& sources, const Execution& execution)
      : sources_(sources), out_(sources.points->name(), execution, kPixelCentre) {
    out_.tables().landmarks.columns.push_back({std::string(kErrorColumn), {}});
  }

  void add_camera(std::uint64_t id, std::string model, std::uint64_t width, std::uint64_t height,
                  std::vector<double> parameters) {
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
    Camera camera{CameraId{id}, std::move(model), 0, 0, std::move(parameters)};
    // A size beyond 32 bits becomes 0, which the map refuses.
    camera.width = width <= kMost ? static_cast<std::uint32_t>(width) : 0;
    camera.height = height <= kMost ? static_cast<std::uint32_t>(height) : 0;
    out_.add_camera(std::to_string(id), std::move(camera));
  }

  // Why an image cannot be added; empty if it can.
  static std::string defect(const Image& image) {
    const auto& q = image.camera_from_world;
    if (!has_direction({q[0], q[1], q[2], q[3]})) return "the quaternion has no direction";
    if (!image.translation.allFinite()) return "the translation is not finite";
    return {};
  }

  void add_pixel(double x, double y, std::uint64_t point) {
    pixels_.push_back({x, y});
    if (point == kNoPoint) ++unmatched_;
  }
  std::size_t pixel_count() const { return pixels_.size(); }
  void make_room_for_pixels(std::size_t count) {
    // Grows by at least half, because reserving exactly for each image would take quadratic time.
    if (pixels_.capacity() - pixels_.size() >= count) return;
    pixels_.reserve(std::max(pixels_.size() + count, pixels_.capacity() + pixels_.capacity() / 2));
  }

  void add_image(const Image& image) {
    const auto& q = image.camera_from_world;
    const double by = to_unit(q);
    const Eigen::Quaterniond world_from_camera =
        Eigen::Quaterniond(q[0], -q[1], -q[2], -q[3]).normalized();
    const auto camera = out_.camera(std::to_string(image.camera));
    without_camera_ += camera ? 0 : 1;
    const FrameIndex frame =
        out_.add_frame({.id = image.id,
                        .world_from_camera = {q[0] * by, -q[1] * by, -q[2] * by, -q[3] * by},
                        .centre = -(world_from_camera * image.translation),
                        .camera = camera,
                        .image_name = image.name});
    images_.emplace(image.id.value, Keypoints{frame, image.first_pixel, image.pixels});
  }

  void finish_images() const {
    if (without_camera_ > 0) {
      out_.remark(
          fmt::format("{} of {} frames have no known camera", without_camera_, out_.frame_count()));
    }
    out_.lost(unmatched_,
              fmt::format("of {} keypoints belong to no 3D point; left out", pixels_.size()));
  }

  void begin_rig(std::uint64_t id, std::uint64_t sensors) {
    out_.tables().rigs.push_back({RigId{id}, {}});
    rig_ids_.insert(id);
    sensors_ = sensors;
  }
  bool has_rig(std::uint64_t id) const { return rig_ids_.contains(id); }

  // @param pose camera_from_rig; std::nullopt if unknown
  void add_mount(const SensorId& sensor, const std::optional<PoseNumbers>& pose) {
    const auto camera = sensor.is_camera ? out_.camera(std::to_string(sensor.id)) : std::nullopt;
    if (!camera || !pose) {
      unmounted_ += sensors_ > 1 ? 1 : 0;
      return;
    }
    const auto& q = pose->quaternion;
    const double by = to_unit(q);
    out_.tables().rigs.back().mounts.push_back(
        {*camera, {q[0] * by, q[1] * by, q[2] * by, q[3] * by}, pose->translation});
  }

  // Adds what a sensor took at one instant. @return false if the image is of another camera
  bool add_to_frame(const RigFrame& frame, const SensorId& sensor, std::uint64_t data) {
    const auto image = sensor.is_camera ? images_.find(data) : images_.end();
    if (image == images_.end()) {
      ++not_there_;
      return true;
    }
    const FrameIndex index = image->second.frame;
    if (out_.tables().frames.cameras[index.value] != out_.camera(std::to_string(sensor.id))) {
      return false;
    }
    const auto& [q, t] = frame.rig_from_world;
    out_.add_to_instant(InstantId{frame.id}, index,
                        Rigid3(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), t));
    return true;
  }

  void finish_rigs() {
    std::erase_if(out_.tables().rigs, [](const Rig& rig) { return rig.mounts.empty(); });
    out_.lost(unmounted_,
              "sensors of rigs are left out: no cameras, unknown to the map, or without a pose");
    out_.lost(not_there_, "data of rigs are left out: of other sensors, or of unknown images");
  }

  void make_room_for_points(std::size_t count) { out_.reserve(count); }

  // Adds an observation. @return why it cannot be added; empty if it was
  std::string add_observation(std::uint64_t point, std::uint64_t image, std::uint64_t keypoint) {
    if (sources_.images == nullptr) return {};
    const auto found = images_.find(image);
    if (found == images_.end()) return fmt::format("image {} is not among the images", image);
    const Keypoints& seen = found->second;
    if (keypoint >= seen.count) {
      return fmt::format("keypoint {} of image {}, which has {}", keypoint, image, seen.count);
    }
    out_.add_observation({.landmark_id = point,
                          .frame = seen.frame,
                          .pixel = pixels_[seen.first + keypoint],
                          .keypoint = static_cast<std::uint32_t>(keypoint)});
    return {};
  }

  void add_point(std::uint64_t id, const Eigen::Vector3d& position, Color color, double error) {
    if (!position.allFinite()) {
      ++without_position_;
      return;
    }
    out_.add_landmark(id, position, color);
    const bool is_known = error >= 0.0 && std::isfinite(error);
    errors().push_back(is_known ? error : std::numeric_limits<double>::quiet_NaN());
  }

  LandmarkMap finish() && {
    out_.lost(without_position_, "points without a finite position; left out");
    MapTables& tables = out_.tables();
    if (sources_.images == nullptr) {
      out_.remark(
          "there is no file of images: frames, cameras and observations are unknown, points are "
          "used");
      tables.cameras.clear();
      tables.rigs.clear();
    } else if (sources_.cameras == nullptr) {
      out_.remark("there is no file of cameras: the frames have none");
    }
    if (sources_.images != nullptr && out_.observed_ids().empty() && out_.landmark_count() > 0) {
      out_.remark("no point has a track: which image observed which point is unknown");
    }
    images_ = {};
    pixels_ = {};
    if (std::all_of(errors().begin(), errors().end(), [](double e) { return std::isnan(e); })) {
      tables.landmarks.columns.clear();
    }
    const auto place = [&](MapColumn column, std::size_t) {
      const ByteSource* source = sources_.points;
      if (column == MapColumn::kCameras && sources_.cameras != nullptr) source = sources_.cameras;
      const bool of_frames = column >= MapColumn::kFrameIds && column <= MapColumn::kImageNames;
      if ((of_frames || column == MapColumn::kPixels) && sources_.images != nullptr) {
        source = sources_.images;
      }
      if (column == MapColumn::kRigs) source = sources_.rigs;
      if (column == MapColumn::kInstants) source = sources_.frames;
      return source->name();
    };
    // The order in files is that of the writer's hash table.
    return std::move(out_).finish({.sort_by_id = true, .place = place});
  }

 private:
  struct Keypoints {
    FrameIndex frame;
    std::size_t first = 0;  // in pixels_
    std::size_t count = 0;
  };

  // By what a quaternion is multiplied; those of norm 1 stay unchanged.
  static double to_unit(const std::array<double, 4>& q) {
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    return std::abs(norm - 1.0) <= 1e-6 ? 1.0 : 1.0 / norm;
  }

  ColumnValues& errors() { return out_.tables().landmarks.columns.front().values; }

  const ColmapSources& sources_;
  SfmBuilder out_;
  std::unordered_map<std::uint64_t, Keypoints> images_;
  std::vector<Pixel> pixels_;  // of all images
  std::size_t without_camera_ = 0;
  std::size_t unmatched_ = 0;
  std::size_t without_position_ = 0;
  std::unordered_set<std::uint64_t> rig_ids_;
  std::uint64_t sensors_ = 0;  // of the last rig
  std::size_t unmounted_ = 0;
  std::size_t not_there_ = 0;
};

// Numbers of rigs and frames in either form.
double rig_number(BinaryRecords& in, std::string_view field) {
  return in.f64(field);
}
double rig_number(TextRecords& in, std::string_view field) {
  return in.number(field);
}
std::uint32_t rig_integer(BinaryRecords& in, std::string_view field) {
  return in.u32(field);
}
std::uint32_t rig_integer(TextRecords& in, std::string_view field) {
  return static_cast<std::uint32_t>(in.unsigned_number(field, kMostRecords));
}
SensorId sensor_id(BinaryRecords& in) {
  const bool is_camera = in.i32("type of sensor") == 0;
  return {is_camera, in.u32("sensor id")};
}
SensorId sensor_id(TextRecords& in) {
  const bool is_camera = in.word("type of sensor") == "CAMERA";
  return {is_camera, rig_integer(in, "sensor id")};
}
bool has_pose(BinaryRecords& in) {
  return in.u8("whether the sensor has a pose") != 0;
}
bool has_pose(TextRecords& in) {
  return in.unsigned_number("whether the sensor has a pose", 1) != 0;
}
std::uint64_t data_id(BinaryRecords& in) {
  return in.u64("data id");
}
std::uint64_t data_id(TextRecords& in) {
  return in.unsigned_number("data id");
}

template <class Records>
PoseNumbers pose_numbers(Records& in) {
  PoseNumbers pose;
  auto& q = pose.quaternion;
  for (double& part : q) part = rig_number(in, "quaternion");
  for (double& part : pose.translation) part = rig_number(in, "translation");
  if (!has_direction({q[0], q[1], q[2], q[3]})) {
    in.refuse("quaternion", "has no direction", "a rotation");
  }
  return pose;
}

template <class Records>
void read_rig(Records& in, ColmapReader& out) {
  const std::uint32_t id = rig_integer(in, "rig id");
  const std::uint32_t sensors = rig_integer(in, "number of sensors");
  out.begin_rig(id, sensors);
  for (std::uint32_t i = 0; i < sensors; ++i) {
    const SensorId sensor = sensor_id(in);
    std::optional<PoseNumbers> pose;
    if (i == 0) {
      pose.emplace();  // the rig's own
    } else if (has_pose(in)) {
      pose = pose_numbers(in);
    }
    out.add_mount(sensor, pose);
  }
}

template <class Records>
void read_rig_frame(Records& in, ColmapReader& out) {
  RigFrame frame;
  frame.id = rig_integer(in, "frame id");
  frame.rig = rig_integer(in, "rig id");
  if (!out.has_rig(frame.rig)) {
    in.refuse("rig id", fmt::format("rig {} is not among the rigs", frame.rig), "the id of a rig");
  }
  frame.rig_from_world = pose_numbers(in);
  for (std::uint32_t left = rig_integer(in, "number of data"); left > 0; --left) {
    const SensorId sensor = sensor_id(in);
    const std::uint64_t image = data_id(in);
    if (!out.add_to_frame(frame, sensor, image)) {
      in.refuse("data id", fmt::format("image {} is not of camera {}", image, sensor.id),
                "the image's camera");
    }
  }
}

// The reader is a template of the form, which reads the records.
class BinaryForm {
 public:
  static void cameras(BinaryRecords& in, ColmapReader& out) {
    const std::uint64_t count = in.count("number of cameras", 24);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint32_t id = in.u32("camera id");
      const std::int32_t model = in.i32("camera model");
      if (model < 0 || static_cast<std::size_t>(model) >= camera_models().size()) {
        in.refuse("camera model", fmt::format("{} is no model of COLMAP", model),
                  fmt::format("0 to {}", camera_models().size() - 1));
      }
      const CameraModel& known = camera_models()[static_cast<std::size_t>(model)];
      const std::uint64_t width = in.u64("width");
      const std::uint64_t height = in.u64("height");
      std::vector<double> parameters;
      for (std::size_t j = 0; j < known.parameters.size(); ++j) {
        parameters.push_back(in.f64("camera parameter"));
      }
      out.add_camera(id, std::string(known.name), width, height, std::move(parameters));
    }
    in.expect_end();
  }

  static void images(BinaryRecords& in, ColmapReader& out) {
    const std::uint64_t count = in.count("number of images", 73);
    refuse_too_many(in, "number of images", count);
    for (std::uint64_t i = 0; i < count; ++i) {
      Image image;
      image.id = FrameId{in.u32("image id")};
      for (double& part : image.camera_from_world) part = in.f64("quaternion");
      for (int j = 0; j < 3; ++j) image.translation[j] = in.f64("translation");
      if (const auto defect = ColmapReader::defect(image); !defect.empty()) {
        in.refuse("pose", fmt::format("image {}: {}", image.id.value, defect), "a pose");
      }
      image.camera = in.u32("camera id");
      image.name = in.text("image name");
      image.pixels = in.count("number of keypoints", 24);
      image.first_pixel = out.pixel_count();
      out.make_room_for_pixels(in.room_for(image.pixels));
      for (std::uint64_t j = 0; j < image.pixels; ++j) {
        const double x = in.f64("keypoint x");
        const double y = in.f64("keypoint y");
        if (!std::isfinite(x) || !std::isfinite(y)) {
          in.refuse("keypoint", fmt::format("({}, {}) is not finite", x, y), "numbers");
        }
        out.add_pixel(x, y, in.u64("keypoint's point id"));
      }
      out.add_image(image);
    }
    in.expect_end();
  }

  static void points(BinaryRecords& in, ColmapReader& out) {
    const std::uint64_t count = in.count("number of points", 51);
    refuse_too_many(in, "number of points", count);
    out.make_room_for_points(in.room_for(count));
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t id = in.u64("point id");
      Eigen::Vector3d position;
      for (int j = 0; j < 3; ++j) position[j] = in.f64("position");
      Color color;
      color.red = in.u8("red");
      color.green = in.u8("green");
      color.blue = in.u8("blue");
      const double error = in.f64("error");
      const std::uint64_t length = in.count("track length", 8);
      for (std::uint64_t j = 0; j < length; ++j) {
        const std::uint32_t image = in.u32("image of the track");
        const auto defect = out.add_observation(id, image, in.u32("keypoint of the track"));
        if (!defect.empty()) {
          in.refuse(fmt::format("track of point {}", id), defect, "a keypoint of an image");
        }
      }
      out.add_point(id, position, color, error);
    }
    in.expect_end();
  }

  static void rigs(BinaryRecords& in, ColmapReader& out) {
    for (std::uint64_t left = in.count("number of rigs", 8); left > 0; --left) read_rig(in, out);
    in.expect_end();
  }

  static void frames(BinaryRecords& in, ColmapReader& out) {
    for (std::uint64_t left = in.count("number of frames", 68); left > 0; --left) {
      read_rig_frame(in, out);
    }
    in.expect_end();
  }

 private:
  static void refuse_too_many(const BinaryRecords& in, std::string_view field,
                              std::uint64_t count) {
    if (count >= kMostRecords) {
      in.refuse(field, fmt::format("{} of them", count), "fewer than 2^32");
    }
  }
};

class TextForm {
 public:
  static void cameras(TextRecords& in, ColmapReader& out) {
    while (in.next_record()) {
      const std::uint64_t id = in.unsigned_number("camera id", kMostRecords);
      std::string model(in.word("camera model"));
      const std::uint64_t width = in.unsigned_number("width");
      const std::uint64_t height = in.unsigned_number("height");
      std::vector<double> parameters;
      while (in.has_word()) parameters.push_back(in.number("camera parameter"));
      const CameraModel* const known = camera_model(model);
      if (known != nullptr && known->parameters.size() != parameters.size()) {
        in.refuse("camera parameters", fmt::format("{} of them", parameters.size()),
                  fmt::format("{}, as {} has", known->parameters.size(), model));
      }
      out.add_camera(id, std::move(model), width, height, std::move(parameters));
    }
  }

  static void images(TextRecords& in, ColmapReader& out) {
    while (in.next_record()) {
      Image image;
      image.id = FrameId{in.unsigned_number("image id", kMostRecords)};
      for (double& part : image.camera_from_world) part = in.number("quaternion");
      for (int i = 0; i < 3; ++i) image.translation[i] = in.number("translation");
      if (const auto defect = ColmapReader::defect(image); !defect.empty()) {
        in.refuse("pose", fmt::format("image {}: {}", image.id.value, defect), "a pose");
      }
      image.camera = in.unsigned_number("camera id", kMostRecords);
      image.name = in.rest();
      image.first_pixel = out.pixel_count();
      if (!in.next_line()) {
        in.refuse(fmt::format("keypoints of image {}", image.id.value), "the file ends before them",
                  "a second line for each image, which may be empty");
      }
      while (in.has_word()) {
        const double x = in.number("keypoint x");
        const double y = in.number("keypoint y");
        const std::int64_t point = in.signed_number("keypoint's point id");
        out.add_pixel(x, y, point < 0 ? kNoPoint : static_cast<std::uint64_t>(point));
      }
      image.pixels = out.pixel_count() - image.first_pixel;
      out.add_image(image);
    }
  }

  static void points(TextRecords& in, ColmapReader& out) {
    while (in.next_record()) {
      const std::uint64_t id = in.unsigned_number("point id");
      Eigen::Vector3d position;
      for (int i = 0; i < 3; ++i) position[i] = in.number_or_nan("position");
      Color color;
      color.red = static_cast<std::uint8_t>(in.unsigned_number("red", 255));
      color.green = static_cast<std::uint8_t>(in.unsigned_number("green", 255));
      color.blue = static_cast<std::uint8_t>(in.unsigned_number("blue", 255));
      const double error = in.number_or_nan("error");
      while (in.has_word()) {
        const std::uint64_t image = in.unsigned_number("image of the track", kMostRecords);
        const auto defect = out.add_observation(
            id, image, in.unsigned_number("keypoint of the track", kMostRecords));
        if (!defect.empty()) {
          in.refuse(fmt::format("track of point {}", id), defect, "a keypoint of an image");
        }
      }
      out.add_point(id, position, color, error);
    }
  }

  static void rigs(TextRecords& in, ColmapReader& out) {
    while (in.next_record()) read_rig(in, out);
  }

  static void frames(TextRecords& in, ColmapReader& out) {
    while (in.next_record()) read_rig_frame(in, out);
  }
};

template <class Form, class Records>
LandmarkMap read_form(const ColmapSources& sources, const Execution& execution) {
  std::uint64_t total = 0;
  for (const ByteSource* source :
       {sources.cameras, sources.images, sources.points, sources.rigs, sources.frames}) {
    if (source != nullptr) total += source->size().value_or(0);
  }
  ReadingProgress progress(execution, total);
  ColmapReader builder(sources, execution);
  const auto read = [&](ByteSource* source, void (*records)(Records&, ColmapReader&)) {
    if (source == nullptr) return;
    Records in(*source, progress);
    records(in, builder);
  };
  read(sources.cameras, &Form::cameras);
  read(sources.rigs, &Form::rigs);
  read(sources.images, &Form::images);
  builder.finish_images();
  if (sources.images != nullptr && sources.rigs != nullptr) read(sources.frames, &Form::frames);
  builder.finish_rigs();
  read(sources.points, &Form::points);
  return std::move(builder).finish();
}

// --- The formats ----------------------------------------------------------------------------------

constexpr std::array<std::string_view, 5> kStems = {"cameras", "images", "points3D", "rigs",
                                                    "frames"};

bool is_model(const fs::path& folder, ColmapForm form) {
  return is_file(folder / colmap_file_name("points3D", form)) ||
         is_file(folder / colmap_file_name("images", form));
}

// The folder of a model, which is named itself or by one of its files.
std::optional<fs::path> model_folder(const MapInput& input, ColmapForm form) {
  if (input.source == nullptr)
    return is_model(input.path, form) ? std::optional(input.path) : std::nullopt;
  const std::string name = input.path.filename().string();
  const bool is_file_of_model =
      std::any_of(kStems.begin(), kStems.end(),
                  [&](std::string_view stem) { return name == colmap_file_name(stem, form); });
  const fs::path folder = input.path.parent_path();
  const bool beside = is_file(folder / colmap_file_name("points3D", form));
  return is_file_of_model && beside ? std::optional(folder) : std::nullopt;
}

}  // namespace

LandmarkMap read_colmap(const ColmapSources& sources, ColmapForm form, const Execution& execution) {
  refuse_if(sources.points == nullptr, "sources.points", "is missing", "the points of the model");
  return form == ColmapForm::kText ? read_form<TextForm, TextRecords>(sources, execution)
                                   : read_form<BinaryForm, BinaryRecords>(sources, execution);
}

LandmarkMap read_colmap(const fs::path& folder, ColmapForm form, const Execution& execution) {
  std::vector<std::unique_ptr<FileReader>> files;
  const auto open = [&](std::string_view stem, bool is_required) -> ByteSource* {
    const fs::path path = folder / colmap_file_name(stem, form);
    if (!is_required && !is_file(path)) return nullptr;
    return files.emplace_back(std::make_unique<FileReader>(path)).get();
  };
  ColmapSources sources;
  sources.points = open("points3D", true);
  sources.cameras = open("cameras", false);
  sources.images = open("images", false);
  sources.rigs = open("rigs", false);
  sources.frames = open("frames", false);
  return read_colmap(sources, form, execution);
}

MapFormat colmap_format(ColmapForm form) {
  const bool is_text = form == ColmapForm::kText;
  return {
      .name = is_text ? "colmap-text" : "colmap",
      .title = is_text ? "COLMAP text" : "COLMAP",
      .endings = is_text ? std::vector<std::string>{} : std::vector<std::string>{"/"},
      .is_folder = true,
      .recognises = [form](const MapInput& input) { return model_folder(input, form).has_value(); },
      .read =
          [form](const MapInput& input, const Execution& execution) {
            const fs::path folder = *model_folder(input, form);
            return with_database_beside(read_colmap(folder, form, execution), folder, execution);
          },
      .write = [form](const LandmarkMap& map, const fs::path& path, const MapWriteOptions&,
                      const Execution& execution) { write_colmap(map, path, form, execution); }};
}

}  // namespace cairn::detail
