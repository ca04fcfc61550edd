// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/colmap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/database_formats.hpp"
#include "cairn/formats/detail/foreign/is_file.hpp"
#include "cairn/formats/detail/foreign/pixel_centre.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/losses.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using detail::BinaryRecords;
using detail::kPixelCentre;
using detail::ReadingProgress;
using detail::TextRecords;

constexpr std::uint64_t kNoPoint = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t kMostRecords = std::numeric_limits<std::uint32_t>::max();
constexpr std::string_view kErrorColumn = "reprojection_error";  // of a 3D point, in pixels

struct ColmapModel {
  std::string_view name;
  std::size_t parameters;
};

// In the order of COLMAP's model ids, from 0.
constexpr std::array<ColmapModel, 18> kModels = {{{"SIMPLE_PINHOLE", 3},
                                                  {"PINHOLE", 4},
                                                  {"SIMPLE_RADIAL", 4},
                                                  {"RADIAL", 5},
                                                  {"OPENCV", 8},
                                                  {"OPENCV_FISHEYE", 8},
                                                  {"FULL_OPENCV", 12},
                                                  {"FOV", 5},
                                                  {"SIMPLE_RADIAL_FISHEYE", 4},
                                                  {"RADIAL_FISHEYE", 5},
                                                  {"THIN_PRISM_FISHEYE", 12},
                                                  {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                  {"SIMPLE_DIVISION", 4},
                                                  {"DIVISION", 5},
                                                  {"SIMPLE_FISHEYE", 3},
                                                  {"FISHEYE", 4},
                                                  {"EUCM", 6},
                                                  {"EQUIRECTANGULAR", 2}}};

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

// Builds a map from a model.
class Builder {
 public:
  Builder(const ColmapSources& sources, const MapReadOptions& options)
      : sources_(sources), options_(options) {}

  void add_camera(std::uint64_t id, std::string model, std::uint64_t width, std::uint64_t height,
                  std::vector<double> parameters) {
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
    Camera camera{CameraId{id}, std::move(model), 0, 0, std::move(parameters)};
    // A size beyond 32 bits becomes 0, which the map refuses.
    camera.width = width <= kMost ? static_cast<std::uint32_t>(width) : 0;
    camera.height = height <= kMost ? static_cast<std::uint32_t>(height) : 0;
    const std::string defect = camera_defect(camera);
    if (!defect.empty()) {
      unusable_.emplace(id, defect);
      return;
    }
    detail::shift_centre(camera, -kPixelCentre);
    camera_indices_.emplace(id, CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size())});
    tables_.cameras.push_back(std::move(camera));
  }

  // Why an image cannot be added; empty if it can.
  static std::string defect(const Image& image) {
    double squared = 0.0;
    for (const double part : image.camera_from_world) squared += part * part;
    if (!std::isfinite(squared) || squared < 1e-12 || squared > 1e12) {
      return "the quaternion has no direction";
    }
    if (!image.translation.allFinite()) return "the translation is not finite";
    return {};
  }

  void add_pixel(double x, double y, std::uint64_t point) {
    pixels_.push_back({x - kPixelCentre, y - kPixelCentre});
    if (point == kNoPoint) ++unmatched_;
  }
  std::size_t pixel_count() const { return pixels_.size(); }
  void make_room_for_pixels(std::size_t count) {
    // Grows by at least half, because reserving exactly for each image would take quadratic time.
    if (pixels_.capacity() - pixels_.size() >= count) return;
    pixels_.reserve(std::max(pixels_.size() + count, pixels_.capacity() + pixels_.capacity() / 2));
  }
  void add_image(Image image) { images_.push_back(std::move(image)); }

  void finish_images() {
    std::sort(images_.begin(), images_.end(),
              [](const Image& a, const Image& b) { return a.id < b.id; });
    FrameTable& frames = tables_.frames;
    std::size_t without_camera = 0;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      Image& image = images_[i];
      frame_indices_.emplace(image.id.value, static_cast<std::uint32_t>(i));
      const auto& q = image.camera_from_world;
      const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
      // Keeps quaternions of norm 1 unchanged.
      const double by = std::abs(norm - 1.0) <= 1e-6 ? 1.0 : 1.0 / norm;
      frames.ids.push_back(image.id);
      frames.quaternions.push_back({q[0] * by, -q[1] * by, -q[2] * by, -q[3] * by});
      const Eigen::Quaterniond world_from_camera =
          Eigen::Quaterniond(q[0], -q[1], -q[2], -q[3]).normalized();
      frames.translations.push_back(-(world_from_camera * image.translation));
      const auto camera = camera_indices_.find(image.camera);
      frames.cameras.push_back(camera == camera_indices_.end()
                                   ? std::nullopt
                                   : std::optional<CameraIndex>(camera->second));
      without_camera += camera == camera_indices_.end() ? 1 : 0;
      frames.image_names.push_back(std::move(image.name));
    }
    for (const auto& [id, defect] : unusable_) {
      lost(fmt::format("camera {} is unknown to the map: {}", id, defect));
    }
    if (without_camera > 0) {
      remark(fmt::format("{} of {} frames have no known camera", without_camera, images_.size()));
    }
    if (unmatched_ > 0) {
      lost(fmt::format("{} of {} keypoints belong to no 3D point; left out", unmatched_,
                       pixels_.size()));
    }
    if (sources_.images != nullptr) tables_.observations.offsets.push_back(0);
  }

  bool knows_observations() const { return !tables_.observations.offsets.empty(); }

  void make_room_for_points(std::size_t count) {
    tables_.landmarks.ids.reserve(count);
    tables_.landmarks.positions.reserve(count);
    tables_.landmarks.colors.reserve(count);
    errors_.reserve(count);
    if (knows_observations()) tables_.observations.offsets.reserve(count + 1);
  }

  // Adds an observation. @return why it cannot be added; empty if it was
  std::string add_observation(std::uint64_t image, std::uint64_t keypoint) {
    if (!knows_observations()) return {};
    const auto frame = frame_indices_.find(image);
    if (frame == frame_indices_.end()) {
      return fmt::format("image {} is not among the images", image);
    }
    const Image& seen = images_[frame->second];
    if (keypoint >= seen.pixels) {
      return fmt::format("keypoint {} of image {}, which has {}", keypoint, image, seen.pixels);
    }
    tables_.observations.frames.push_back(FrameIndex{frame->second});
    tables_.observations.pixels.push_back(pixels_[seen.first_pixel + keypoint]);
    tables_.observations.keypoints.emplace_back(static_cast<std::uint32_t>(keypoint));
    return {};
  }

  // Call after adding its observations.
  void add_point(std::uint64_t id, const Eigen::Vector3d& position, Color color, double error) {
    ObservationTable& observations = tables_.observations;
    if (!position.allFinite()) {
      ++without_position_;
      if (knows_observations()) {
        observations.frames.resize(observations.offsets.back());
        observations.pixels.resize(observations.offsets.back());
        observations.keypoints.resize(observations.offsets.back());
      }
      return;
    }
    LandmarkTable& landmarks = tables_.landmarks;
    landmarks.ids.push_back(LandmarkId{id});
    landmarks.positions.push_back(position);
    landmarks.colors.emplace_back(color);
    errors_.push_back(
        error >= 0.0 && std::isfinite(error) ? error : std::numeric_limits<double>::quiet_NaN());
    if (knows_observations()) observations.offsets.push_back(observations.frames.size());
  }

  void note_rigs(std::size_t of_several_sensors) {
    if (of_several_sensors == 0) return;
    lost(fmt::format("{} rigs of several sensors: dropped, each image is a frame of its own",
                     of_several_sensors));
  }

  LandmarkMap finish() && {
    if (without_position_ > 0) {
      lost(fmt::format("{} points without a finite position; left out", without_position_));
    }
    if (sources_.images == nullptr) {
      remark(
          "there is no file of images: frames, cameras and observations are unknown, points are "
          "used");
      tables_.cameras.clear();
    } else if (sources_.cameras == nullptr) {
      remark("there is no file of cameras: the frames have none");
    }
    if (knows_observations() && tables_.observations.frames.empty()) {
      tables_.observations.offsets = {};
      if (!tables_.landmarks.ids.empty()) {
        remark("no point has a track: which image observed which point is unknown");
      }
    }
    images_ = {};
    pixels_ = {};
    frame_indices_ = {};
    sort_landmarks();
    const bool any_error =
        std::any_of(errors_.begin(), errors_.end(), [](double e) { return !std::isnan(e); });
    if (any_error) {
      tables_.landmarks.columns.push_back({std::string(kErrorColumn), std::move(errors_)});
    }
    tables_.info.length_unit = LengthUnit::kFree;
    const auto place = [&](MapColumn column, std::size_t) {
      const ByteSource* source = sources_.points;
      if (column == MapColumn::kCameras && sources_.cameras != nullptr) source = sources_.cameras;
      const bool of_frames = column >= MapColumn::kFrameIds && column <= MapColumn::kImageNames;
      if ((of_frames || column == MapColumn::kPixels) && sources_.images != nullptr) {
        source = sources_.images;
      }
      return source->name();
    };
    return detail::imported_map(std::move(tables_), sources_.points->name(), options_.log, place);
  }

 private:
  void remark(const std::string& text) const {
    detail::log_remark(options_.log, sources_.points->name(), text);
  }
  void lost(const std::string& text) const {
    detail::log_remark(options_.log, sources_.points->name(), text, RemarkKind::kLoss);
  }

  // The order in files is that of the writer's hash table.
  void sort_landmarks() {
    LandmarkTable& landmarks = tables_.landmarks;
    if (std::is_sorted(landmarks.ids.begin(), landmarks.ids.end())) return;
    std::vector<std::uint32_t> order(landmarks.ids.size());
    std::iota(order.begin(), order.end(), 0U);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return landmarks.ids[a] < landmarks.ids[b];
    });
    const auto reorder = [&](auto& column) {
      std::remove_reference_t<decltype(column)> sorted;
      sorted.reserve(column.size());
      for (const std::uint32_t row : order) sorted.push_back(column[row]);
      column = std::move(sorted);
    };
    reorder(landmarks.ids);
    reorder(landmarks.positions);
    reorder(landmarks.colors);
    reorder(errors_);
    if (!knows_observations()) return;
    ObservationTable& observations = tables_.observations;
    const auto reorder_observations = [&](auto& column) {
      std::remove_reference_t<decltype(column)> sorted;
      sorted.reserve(column.size());
      for (const std::uint32_t row : order) {
        for (std::uint64_t i = observations.offsets[row]; i < observations.offsets[row + 1]; ++i) {
          sorted.push_back(column[i]);
        }
      }
      column = std::move(sorted);
    };
    reorder_observations(observations.frames);
    reorder_observations(observations.pixels);
    reorder_observations(observations.keypoints);
    std::vector<std::uint64_t> offsets = {0};
    offsets.reserve(observations.offsets.size());
    for (const std::uint32_t row : order) {
      offsets.push_back(offsets.back() + observations.offsets[row + 1] - observations.offsets[row]);
    }
    observations.offsets = std::move(offsets);
  }

  const ColmapSources& sources_;
  const MapReadOptions& options_;
  MapTables tables_;
  std::unordered_map<std::uint64_t, CameraIndex> camera_indices_;
  std::map<std::uint64_t, std::string> unusable_;  // cameras, by id, and why
  std::vector<Image> images_;
  std::vector<Pixel> pixels_;  // of all images
  std::unordered_map<std::uint64_t, std::uint32_t> frame_indices_;
  std::vector<double> errors_;
  std::size_t unmatched_ = 0;
  std::size_t without_position_ = 0;
};

// The reader is a template of the form, which reads the records.
class BinaryForm {
 public:
  static void cameras(BinaryRecords& in, Builder& out) {
    const std::uint64_t count = in.count("number of cameras", 24);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint32_t id = in.u32("camera id");
      const std::int32_t model = in.i32("camera model");
      if (model < 0 || static_cast<std::size_t>(model) >= kModels.size()) {
        in.refuse("camera model", fmt::format("{} is no model of COLMAP", model),
                  fmt::format("0 to {}", kModels.size() - 1));
      }
      const ColmapModel& known = kModels.at(static_cast<std::size_t>(model));
      const std::uint64_t width = in.u64("width");
      const std::uint64_t height = in.u64("height");
      std::vector<double> parameters;
      for (std::size_t j = 0; j < known.parameters; ++j) {
        parameters.push_back(in.f64("camera parameter"));
      }
      out.add_camera(id, std::string(known.name), width, height, std::move(parameters));
    }
    in.expect_end();
  }

  static void images(BinaryRecords& in, Builder& out) {
    const std::uint64_t count = in.count("number of images", 73);
    refuse_too_many(in, "number of images", count);
    for (std::uint64_t i = 0; i < count; ++i) {
      Image image;
      image.id = FrameId{in.u32("image id")};
      for (double& part : image.camera_from_world) part = in.f64("quaternion");
      for (int j = 0; j < 3; ++j) image.translation[j] = in.f64("translation");
      if (const auto defect = Builder::defect(image); !defect.empty()) {
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
      out.add_image(std::move(image));
    }
    in.expect_end();
  }

  static void points(BinaryRecords& in, Builder& out) {
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
        const auto defect = out.add_observation(image, in.u32("keypoint of the track"));
        if (!defect.empty()) {
          in.refuse(fmt::format("track of point {}", id), defect, "a keypoint of an image");
        }
      }
      out.add_point(id, position, color, error);
    }
    in.expect_end();
  }

  static void rigs(BinaryRecords& in, Builder& out) {
    const std::uint64_t count = in.count("number of rigs", 8);
    std::size_t of_several = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      in.u32("rig id");
      const std::uint32_t sensors = in.u32("number of sensors");
      of_several += sensors > 1 ? 1 : 0;
      for (std::uint32_t j = 0; j < sensors; ++j) {
        in.i32("type of sensor");
        in.u32("sensor id");
        if (j == 0 || in.u8("whether the sensor has a pose") == 0) continue;
        for (int k = 0; k < 7; ++k) in.f64("pose of the sensor");
      }
    }
    in.expect_end();
    out.note_rigs(of_several);
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
  static void cameras(TextRecords& in, Builder& out) {
    while (in.next_record()) {
      const std::uint64_t id = in.unsigned_number("camera id", kMostRecords);
      std::string model(in.word("camera model"));
      const std::uint64_t width = in.unsigned_number("width");
      const std::uint64_t height = in.unsigned_number("height");
      std::vector<double> parameters;
      while (in.has_word()) parameters.push_back(in.number("camera parameter"));
      const auto known = std::find_if(kModels.begin(), kModels.end(),
                                      [&](const ColmapModel& m) { return m.name == model; });
      if (known != kModels.end() && known->parameters != parameters.size() &&
          known->name != "EQUIRECTANGULAR") {
        in.refuse("camera parameters", fmt::format("{} of them", parameters.size()),
                  fmt::format("{}, as {} has", known->parameters, model));
      }
      out.add_camera(id, std::move(model), width, height, std::move(parameters));
    }
  }

  static void images(TextRecords& in, Builder& out) {
    while (in.next_record()) {
      Image image;
      image.id = FrameId{in.unsigned_number("image id", kMostRecords)};
      for (double& part : image.camera_from_world) part = in.number("quaternion");
      for (int i = 0; i < 3; ++i) image.translation[i] = in.number("translation");
      if (const auto defect = Builder::defect(image); !defect.empty()) {
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
      out.add_image(std::move(image));
    }
  }

  static void points(TextRecords& in, Builder& out) {
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
        const auto defect =
            out.add_observation(image, in.unsigned_number("keypoint of the track", kMostRecords));
        if (!defect.empty()) {
          in.refuse(fmt::format("track of point {}", id), defect, "a keypoint of an image");
        }
      }
      out.add_point(id, position, color, error);
    }
  }

  static void rigs(TextRecords& in, Builder& out) {
    std::size_t of_several = 0;
    while (in.next_record()) {
      in.unsigned_number("rig id");
      of_several += in.unsigned_number("number of sensors") > 1 ? 1 : 0;
    }
    out.note_rigs(of_several);
  }
};

template <class Form, class Records>
LandmarkMap read_form(const ColmapSources& sources, const MapReadOptions& options) {
  std::uint64_t total = 0;
  for (const ByteSource* source : {sources.cameras, sources.images, sources.points, sources.rigs}) {
    if (source != nullptr) total += source->size().value_or(0);
  }
  ReadingProgress progress(options, total);
  Builder builder(sources, options);
  const auto read = [&](ByteSource* source, void (*records)(Records&, Builder&)) {
    if (source == nullptr) return;
    Records in(*source, progress);
    records(in, builder);
  };
  read(sources.rigs, &Form::rigs);
  read(sources.cameras, &Form::cameras);
  read(sources.images, &Form::images);
  builder.finish_images();
  read(sources.points, &Form::points);
  return std::move(builder).finish();
}

std::string file_name(std::string_view stem, ColmapForm form) {
  return std::string(stem) + (form == ColmapForm::kBinary ? ".bin" : ".txt");
}

// --- Writing --------------------------------------------------------------------------------------

// The ids if all are at most `most`; otherwise numbers from 1.
template <class Id>
std::vector<std::uint64_t> fitting_ids(const std::vector<Id>& ids, std::uint64_t most) {
  std::vector<std::uint64_t> result;
  result.reserve(ids.size());
  const bool fit = std::all_of(ids.begin(), ids.end(), [&](Id id) { return id.value <= most; });
  for (std::size_t i = 0; i < ids.size(); ++i) result.push_back(fit ? ids[i].value : i + 1);
  return result;
}

// The mean distance in pixels between a landmark's projections and its observations; -1 if unknown.
double reprojection_error(const LandmarkMap& map, LandmarkIndex landmark) {
  const auto frames = map.observing_frames(landmark);
  const auto pixels = map.observed_pixels(landmark);
  double sum = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const CameraIndex camera = *map.frames().cameras[frames[i].value];
    const Eigen::Vector3d x =
        map.world_from_camera(frames[i]).inverse() * map.landmarks().positions[landmark.value];
    const auto pixel = project(map.cameras()[camera.value], x);
    if (!pixel) return -1.0;
    sum += std::hypot(pixel->u - pixels[i].u, pixel->v - pixels[i].v);
  }
  return frames.empty() ? -1.0 : sum / static_cast<double>(frames.size());
}

// Writes a model's records in either form.
class Output {
 public:
  Output(const ByteSink& sink, ColmapForm form)
      : sink_(sink), is_text_(form == ColmapForm::kText) {}
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  bool is_text() const { return is_text_; }
  template <class Number>
  void binary(Number number) {
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof number);
    flush_if_large();
  }
  // Writes a number in both forms.
  template <class Number>
  void both(Number number) {
    if (!is_text_) return binary(number);
    separate();
    if constexpr (std::is_floating_point_v<Number>) {
      append_number(bytes_, number);
    } else {
      append_number(bytes_, static_cast<std::uint64_t>(number));
    }
    flush_if_large();
  }
  void word(std::string_view text) {
    separate();
    bytes_ += text;
  }
  void raw(std::string_view text) { bytes_ += text; }
  void end_line() {
    bytes_ += '\n';
    line_begins_ = true;
    flush_if_large();
  }
  void finish() {
    sink_(bytes_);
    bytes_.clear();
  }

 private:
  void separate() {
    if (!line_begins_) bytes_ += ' ';
    line_begins_ = false;
  }
  void flush_if_large() {
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (bytes_.size() >= kLarge) finish();
  }

  const ByteSink& sink_;
  bool is_text_;
  bool line_begins_ = true;
  std::string bytes_;
};

class ModelWriter {
 public:
  ModelWriter(const LandmarkMap& map, const fs::path& folder, ColmapForm form,
              const MapWriteOptions& options)
      : map_(map),
        folder_(folder),
        form_(form),
        options_(options),
        image_names_(detail::image_names(map)) {
    check_frames();
    constexpr std::uint64_t kMostSmall = std::numeric_limits<std::uint32_t>::max() - 1;
    std::vector<CameraId> camera_ids;
    for (const Camera& camera : map.cameras()) camera_ids.push_back(camera.id);
    camera_ids_ = fitting_ids(camera_ids, kMostSmall);
    image_ids_ = fitting_ids(map.frames().ids, kMostSmall);
    point_ids_ = fitting_ids(map.landmarks().ids, kNoPoint >> 1);
    list_keypoints();
  }

  void remark() const {
    if (!options_.log) return;
    static constexpr std::array<std::string_view, 1> kColumns = {kErrorColumn};
    const std::string lost =
        detail::loss_remark(map_, {.columns = kColumns}, folder_.string(), "COLMAP");
    if (!lost.empty()) options_.log({lost, RemarkKind::kLoss});
    const auto note = [&](bool renumbered, std::string_view what) {
      if (renumbered) {
        options_.log({fmt::format("{}: ids of {} are too large for COLMAP: numbered from 1",
                                  folder_.string(), what),
                      RemarkKind::kLoss});
      }
    };
    note(!image_ids_.empty() && image_ids_[0] != map_.frames().ids[0].value, "frames");
    note(!point_ids_.empty() && point_ids_[0] != map_.landmarks().ids[0].value, "landmarks");
    note(!camera_ids_.empty() && camera_ids_[0] != map_.cameras()[0].id.value, "cameras");
  }

  void write_cameras(const ByteSink& sink) const {
    Output out(sink, form_);
    header(out, map_.cameras().size(),
           "# Cameras, one a line: CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n");
    for (std::size_t i = 0; i < map_.cameras().size(); ++i) {
      Camera camera = map_.cameras()[i];
      detail::shift_centre(camera, kPixelCentre);
      out.both(static_cast<std::uint32_t>(camera_ids_[i]));
      if (out.is_text()) {
        out.word(camera.model);
      } else {
        const auto model = std::find_if(kModels.begin(), kModels.end(), [&](const ColmapModel& m) {
          return m.name == camera.model;
        });
        out.binary(static_cast<std::int32_t>(model - kModels.begin()));
      }
      out.both(std::uint64_t{camera.width});
      out.both(std::uint64_t{camera.height});
      for (const double parameter : camera.parameters) out.both(parameter);
      if (out.is_text()) out.end_line();
    }
    out.finish();
  }

  void write_images(const ByteSink& sink) const {
    Output out(sink, form_);
    header(out, map_.frame_count(),
           "# Images, two lines each: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n"
           "# and (X Y POINT3D_ID) of each keypoint\n");
    const FrameTable& frames = map_.frames();
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      const auto& q = frames.quaternions[i];
      const Eigen::Vector3d t =
          map_.world_from_camera(FrameIndex{i}).inverse() * Eigen::Vector3d::Zero();
      out.both(static_cast<std::uint32_t>(image_ids_[i]));
      out.both(q[0]);
      for (std::size_t j = 1; j < 4; ++j) out.both(-q[j]);
      for (int j = 0; j < 3; ++j) out.both(t[j]);
      out.both(static_cast<std::uint32_t>(camera_ids_[frames.cameras[i]->value]));
      const std::string& name = image_names_[i];
      if (out.is_text()) {
        out.word(name);
        out.end_line();
      } else {
        out.raw(name);
        out.binary('\0');
        out.binary(std::uint64_t{first_keypoints_[i + 1] - first_keypoints_[i]});
      }
      for (std::uint64_t k = first_keypoints_[i]; k < first_keypoints_[i + 1]; ++k) {
        const std::uint64_t observation = observation_of_keypoint_[k];
        const Pixel& pixel = map_.observations().pixels[observation];
        out.both(pixel.u + kPixelCentre);
        out.both(pixel.v + kPixelCentre);
        out.both(point_ids_[landmark_of(observation)]);
      }
      if (out.is_text()) out.end_line();
    }
    out.finish();
  }

  void write_points(const ByteSink& sink) const {
    Output out(sink, form_);
    header(out, map_.landmark_count(),
           "# 3D points, one a line: POINT3D_ID X Y Z R G B ERROR and (IMAGE_ID POINT2D_INDEX) of "
           "each\n# observation\n");
    const LandmarkTable& landmarks = map_.landmarks();
    const NamedColumn* const errors = map_.column(kErrorColumn);
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      out.both(point_ids_[i]);
      for (int j = 0; j < 3; ++j) out.both(landmarks.positions[i][j]);
      const Color color =
          landmarks.colors.empty() ? Color{} : landmarks.colors[i].value_or(Color{});
      out.both(color.red);
      out.both(color.green);
      out.both(color.blue);
      double error =
          errors == nullptr ? reprojection_error(map_, LandmarkIndex{i}) : errors->values[i];
      if (std::isnan(error)) error = -1.0;
      out.both(error);
      const auto frames = map_.observing_frames(LandmarkIndex{i});
      if (!out.is_text()) out.binary(std::uint64_t{frames.size()});
      const std::uint64_t first =
          map_.observations().offsets.empty() ? 0 : map_.observations().offsets[i];
      for (std::size_t j = 0; j < frames.size(); ++j) {
        out.both(static_cast<std::uint32_t>(image_ids_[frames[j].value]));
        out.both(keypoint_of_observation_[first + j]);
      }
      if (out.is_text()) out.end_line();
      report(i);
    }
    out.finish();
  }

 private:
  void check_frames() const {
    const FrameTable& frames = map_.frames();
    for (std::size_t i = 0; i < map_.frame_count(); ++i) {
      const auto refuse = [&](std::string_view what, std::string_view expected) {
        throw Error(ErrorKind::kInput,
                    fmt::format("{}: frame {}", folder_.string(), frames.ids[i].value), what,
                    expected);
      };
      if (frames.cameras.empty() || !frames.cameras[i]) {
        refuse("has no camera, and an image of COLMAP needs one", "a camera for every frame");
      }
      const std::string& name = image_names_[i];
      const bool is_bad =
          form_ == ColmapForm::kText
              ? name.find_first_of("\n\r") != std::string::npos || name.front() == ' '
              : name.find('\0') != std::string::npos;
      if (is_bad) refuse("image name " + printable(name), "a name of one line");
    }
  }

  // COLMAP lists all keypoints of an image. Lists those that observe a landmark, by index, or without indices
  // in the order of the landmarks.
  void list_keypoints() {
    const ObservationTable& observations = map_.observations();
    const std::size_t count = observations.frames.size();
    first_keypoints_.assign(map_.frame_count() + 1, 0);
    for (const FrameIndex frame : observations.frames) ++first_keypoints_[frame.value + 1];
    std::partial_sum(first_keypoints_.begin(), first_keypoints_.end(), first_keypoints_.begin());
    std::vector<std::uint64_t> next(first_keypoints_.begin(), first_keypoints_.end() - 1);
    observation_of_keypoint_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      observation_of_keypoint_[next[observations.frames[i].value]++] = i;
    }
    keypoint_of_observation_.resize(count);
    const auto key = [&](std::uint64_t i) {
      const auto& keypoints = observations.keypoints;
      return std::pair(keypoints.empty() || !keypoints[i] ? kNoPoint : std::uint64_t{*keypoints[i]},
                       i);
    };
    for (std::size_t frame = 0; frame < map_.frame_count(); ++frame) {
      const auto begin = observation_of_keypoint_.begin();
      std::sort(begin + static_cast<std::ptrdiff_t>(first_keypoints_[frame]),
                begin + static_cast<std::ptrdiff_t>(first_keypoints_[frame + 1]),
                [&](std::uint64_t a, std::uint64_t b) { return key(a) < key(b); });
      for (std::uint64_t k = first_keypoints_[frame]; k < first_keypoints_[frame + 1]; ++k) {
        keypoint_of_observation_[observation_of_keypoint_[k]] =
            static_cast<std::uint32_t>(k - first_keypoints_[frame]);
      }
    }
  }

  std::size_t landmark_of(std::uint64_t observation) const {
    const auto& offsets = map_.observations().offsets;
    return static_cast<std::size_t>(std::upper_bound(offsets.begin(), offsets.end(), observation) -
                                    offsets.begin()) -
           1;
  }

  static void header(Output& out, std::size_t count, std::string_view text) {
    if (out.is_text()) {
      out.raw(text);
    } else {
      out.binary(std::uint64_t{count});
    }
  }

  void report(std::uint32_t row) const {
    constexpr std::uint32_t kRows = 65536;
    if (options_.progress && row % kRows == 0) {
      options_.progress(static_cast<double>(row) / static_cast<double>(map_.landmark_count()));
    }
  }

  const LandmarkMap& map_;
  const fs::path& folder_;
  ColmapForm form_;
  const MapWriteOptions& options_;
  std::vector<std::string> image_names_;
  std::vector<std::uint64_t> camera_ids_;
  std::vector<std::uint64_t> image_ids_;
  std::vector<std::uint64_t> point_ids_;
  std::vector<std::uint64_t> first_keypoints_;  // of each frame, and their number
  std::vector<std::uint64_t> observation_of_keypoint_;
  std::vector<std::uint32_t> keypoint_of_observation_;
};

// --- The formats ----------------------------------------------------------------------------------

constexpr std::array<std::string_view, 5> kStems = {"cameras", "images", "points3D", "rigs",
                                                    "frames"};

bool is_model(const fs::path& folder, ColmapForm form) {
  return detail::is_file(folder / file_name("points3D", form)) ||
         detail::is_file(folder / file_name("images", form));
}

// The folder of a model, which is named itself or by one of its files.
std::optional<fs::path> model_folder(const MapInput& input, ColmapForm form) {
  if (input.source == nullptr)
    return is_model(input.path, form) ? std::optional(input.path) : std::nullopt;
  const std::string name = input.path.filename().string();
  const bool is_file_of_model =
      std::any_of(kStems.begin(), kStems.end(),
                  [&](std::string_view stem) { return name == file_name(stem, form); });
  const fs::path folder = input.path.parent_path();
  const bool beside = detail::is_file(folder / file_name("points3D", form));
  return is_file_of_model && beside ? std::optional(folder) : std::nullopt;
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
          [form](const MapInput& input, const MapReadOptions& options) {
            const fs::path folder = *model_folder(input, form);
            return detail::with_database_beside(read_colmap(folder, form, options), folder,
                                                options);
          },
      .write = [form](const LandmarkMap& map, const fs::path& path,
                      const MapWriteOptions& options) { write_colmap(map, path, form, options); }};
}

}  // namespace

LandmarkMap read_colmap(const ColmapSources& sources, ColmapForm form,
                        const MapReadOptions& options) {
  if (sources.points == nullptr) {
    throw Error(ErrorKind::kMisuse, "sources.points", "is missing", "the points of the model");
  }
  return form == ColmapForm::kText ? read_form<TextForm, TextRecords>(sources, options)
                                   : read_form<BinaryForm, BinaryRecords>(sources, options);
}

LandmarkMap read_colmap(const fs::path& folder, ColmapForm form, const MapReadOptions& options) {
  std::vector<std::unique_ptr<FileReader>> files;
  const auto open = [&](std::string_view stem, bool is_required) -> ByteSource* {
    const fs::path path = folder / file_name(stem, form);
    if (!is_required && !detail::is_file(path)) return nullptr;
    return files.emplace_back(std::make_unique<FileReader>(path)).get();
  };
  ColmapSources sources;
  sources.points = open("points3D", true);
  sources.cameras = open("cameras", false);
  sources.images = open("images", false);
  sources.rigs = open("rigs", false);
  return read_colmap(sources, form, options);
}

void write_colmap(const LandmarkMap& map, const fs::path& folder, ColmapForm form,
                  const MapWriteOptions& options) {
  const ModelWriter writer(map, folder, form, options);
  writer.remark();  // before writing, because the caller may refuse the loss
  detail::OutputFolder output(folder);
  const auto write = [&](std::string_view stem,
                         void (ModelWriter::*produce)(const ByteSink&) const) {
    write_file(output.unfinished() / file_name(stem, form),
               [&](const ByteSink& sink) { (writer.*produce)(sink); });
  };
  write("cameras", &ModelWriter::write_cameras);
  write("images", &ModelWriter::write_images);
  write("points3D", &ModelWriter::write_points);
  output.commit();
}

std::vector<MapFormat> colmap_formats() {
  // The binary form is last, so that it is tried first for a folder with both.
  return {colmap_format(ColmapForm::kText), colmap_format(ColmapForm::kBinary)};
}

}  // namespace cairn
