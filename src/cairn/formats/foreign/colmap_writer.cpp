// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/output_folder.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/foreign/colmap_model.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

// The mean distance in pixels between a landmark's projections and its observations; -1 if unknown.
double reprojection_error(const LandmarkMap& map, LandmarkIndex landmark) {
  const auto frames = map.observing_frames(landmark);
  const auto pixels = map.observed_pixels(landmark);
  double sum = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Eigen::Vector3d x =
        map.world_from_camera(frames[i]).inverse() * map.landmarks().positions[landmark.value];
    const auto error = reprojection(camera_of(map, frames[i]), x, pixels[i]);
    if (!error) return -1.0;
    sum += error->norm();
  }
  return frames.empty() ? -1.0 : sum / static_cast<double>(frames.size());
}

// Writes a model's records in either form.
class ColmapOutput : public TextOutput {
 public:
  ColmapOutput(const ByteSink& sink, ColmapForm form)
      : TextOutput(sink), is_text_(form == ColmapForm::kText) {}

  bool is_text() const { return is_text_; }
  template <class Number>
  void binary(Number number) {
    raw({reinterpret_cast<const char*>(&number), sizeof number});
  }
  // Writes a number in both forms.
  template <class Number>
  void both(Number number) {
    is_text_ ? words(number) : binary(number);
  }

 private:
  bool is_text_;
};

constexpr std::uint64_t kMostSmall = std::numeric_limits<std::uint32_t>::max() - 1;

// The rigs of a map as COLMAP has them: each camera is in a rig, whose frame of reference is that of its first camera,
// and each image in a frame.
struct ColmapRigs {
  struct Frame {
    FrameId id;
    std::vector<std::uint32_t> images;
  };

  explicit ColmapRigs(const LandmarkMap& map) {
    if (map.rigs().empty()) return;
    set_rigs(map);
    set_frames(map);
  }

  std::vector<Rig> all;
  std::unordered_map<CameraIndex, RigId> of_camera;
  std::unordered_map<CameraIndex, Rigid3> camera_from_rig;
  std::vector<Frame> frames;
  std::optional<RigInstants> instants;

 private:
  // Gives entries behind the first `named` the ids that follow, and all other ids if these do not fit.
  template <class Entry>
  static void number(std::vector<Entry>& entries, std::size_t named) {
    std::uint64_t last = 0;
    std::vector<FrameId> ids;
    for (std::size_t i = 0; i < entries.size(); ++i) {
      ids.push_back(FrameId{i < named ? entries[i].id.value : last + 1});
      last = std::max(last, ids.back().value);
    }
    const std::vector<std::uint64_t> fitting = fitting_ids(ids, kMostSmall, 1);
    for (std::size_t i = 0; i < entries.size(); ++i) entries[i].id.value = fitting[i];
  }

  void set_rigs(const LandmarkMap& map) {
    all.assign(map.rigs().begin(), map.rigs().end());
    for (Rig& rig : all) refer_to_first(rig);
    camera_from_rig = cameras_from_rigs(all);
    for (std::uint32_t i = 0; i < map.cameras().size(); ++i) {
      if (camera_from_rig.emplace(CameraIndex{i}, Rigid3()).second) {
        all.push_back({RigId{}, {{.camera = CameraIndex{i}}}});
      }
    }
    number(all, map.rigs().size());
    for (const Rig& rig : all) {
      for (const Rig::Mount& mount : rig.mounts) of_camera.emplace(mount.camera, rig.id);
    }
  }

  static void refer_to_first(Rig& rig) {
    const Rig::Mount first = rig.mounts.front();
    if (first == Rig::Mount{.camera = first.camera}) return;  // keeps all digits
    for (Rig::Mount& mount : rig.mounts) {
      const Rigid3 pose = mount.camera_from_rig() * first.camera_from_rig().inverse();
      const Eigen::Quaterniond q = pose.quaternion();
      mount = {mount.camera, {q.w(), q.x(), q.y(), q.z()}, pose.translation()};
    }
    rig.mounts.front() = {.camera = first.camera};
  }

  void set_frames(const LandmarkMap& map) {
    instants.emplace(map);
    for (const auto& [instant, together] : instants->together) {
      std::vector<std::uint32_t> images = together;
      std::ranges::sort(images, {},
                        [&](std::uint32_t i) { return map.frames().cameras[i]->value; });
      frames.push_back({FrameId{instant.value}, std::move(images)});
    }
    for (const std::uint32_t image : instants->alone) frames.push_back({FrameId{}, {image}});
    number(frames, instants->together.size());
  }
};

class ColmapWriter {
 public:
  ColmapWriter(const LandmarkMap& map, const fs::path& folder, ColmapForm form,
               const Execution& execution)
      : map_(map),
        folder_(folder),
        form_(form),
        execution_(execution),
        image_names_(image_names(map)),
        ids_(map, kMostSmall, kNoPoint >> 1, 1),
        observations_(map),
        rigs_(map) {
    check_frames();
    keypoint_of_observation_.resize(map.observation_count());
    for (const auto& of_frame : observations_.of_frame) {
      for (std::uint32_t k = 0; k < of_frame.size(); ++k) keypoint_of_observation_[of_frame[k]] = k;
    }
  }

  void remark() const {
    if (!execution_.log) return;
    static constexpr std::array<std::string_view, 1> kColumns = {kErrorColumn};
    log_losses(execution_.log, map_, {.rigs = true, .columns = kColumns}, "COLMAP",
               folder_.string());
    if (!map_.rigs().empty()) {
      execution_.log(fmt::format(
          "{}: has rigs, which COLMAP reads from 3.12 on; before, it reads the images' poses only",
          folder_.string()));
    }
    if (rigs_.instants) rigs_.instants->log_elsewhere(execution_.log, folder_.string());
    ids_.log_replaced(execution_.log, map_, "COLMAP", folder_.string());
  }

  void write_cameras(const ByteSink& sink) const {
    ColmapOutput out(sink, form_);
    header(out, map_.cameras().size(),
           "# Cameras, one a line: CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n");
    for (std::size_t i = 0; i < map_.cameras().size(); ++i) {
      Camera camera = map_.cameras()[i];
      shift_centre(camera, kPixelCentre);
      out.both(static_cast<std::uint32_t>(ids_.cameras[i]));
      if (out.is_text()) {
        out.words(camera.model);
      } else {
        out.binary(static_cast<std::int32_t>(camera_model(camera.model) - camera_models().data()));
      }
      out.both(std::uint64_t{camera.width});
      out.both(std::uint64_t{camera.height});
      for (const double parameter : camera.parameters) out.both(parameter);
      if (out.is_text()) out.line();
    }
    out.flush();
  }

  void write_images(const ByteSink& sink) const {
    ColmapOutput out(sink, form_);
    header(out, map_.frame_count(),
           "# Images, two lines each: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n"
           "# and (X Y POINT3D_ID) of each keypoint\n");
    const FrameTable& frames = map_.frames();
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      const auto& q = frames.quaternions[i];
      const Eigen::Vector3d t =
          map_.world_from_camera(FrameIndex{i}).inverse() * Eigen::Vector3d::Zero();
      out.both(static_cast<std::uint32_t>(ids_.frames[i]));
      out.both(q[0]);
      for (std::size_t j = 1; j < 4; ++j) out.both(-q[j]);
      for (int j = 0; j < 3; ++j) out.both(t[j]);
      out.both(static_cast<std::uint32_t>(ids_.cameras[frames.cameras[i]->value]));
      const std::string& name = image_names_[i];
      if (out.is_text()) {
        out.words(name);
        out.line();
      } else {
        out.raw(name);
        out.binary('\0');
        out.binary(std::uint64_t{observations_.of_frame[i].size()});
      }
      // COLMAP lists all keypoints of an image; a map has those that observe a landmark.
      for (const std::uint64_t observation : observations_.of_frame[i]) {
        const Pixel& pixel = map_.observations().pixels[observation];
        out.both(pixel.u + kPixelCentre);
        out.both(pixel.v + kPixelCentre);
        out.both(ids_.landmarks[observations_.landmark_of[observation]]);
      }
      if (out.is_text()) out.line();
    }
    out.flush();
  }

  void write_points(const ByteSink& sink) const {
    ColmapOutput out(sink, form_);
    header(out, map_.landmark_count(),
           "# 3D points, one a line: POINT3D_ID X Y Z R G B ERROR and (IMAGE_ID POINT2D_INDEX) of "
           "each\n# observation\n");
    const LandmarkTable& landmarks = map_.landmarks();
    const NamedColumn* const errors = map_.column(kErrorColumn);
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      out.both(ids_.landmarks[i]);
      for (int j = 0; j < 3; ++j) out.both(landmarks.positions[i][j]);
      const Color color = color_of(map_, i);
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
        out.both(static_cast<std::uint32_t>(ids_.frames[frames[j].value]));
        out.both(keypoint_of_observation_[first + j]);
      }
      if (out.is_text()) out.line();
      report(i);
    }
    out.flush();
  }

  void write_rigs(const ByteSink& sink) const {
    ColmapOutput out(sink, form_);
    header(
        out, rigs_.all.size(),
        "# Rigs, one a line: RIG_ID NUM_SENSORS, the reference sensor (TYPE ID) and of each other "
        "(TYPE\n# ID HAS_POSE QW QX QY QZ TX TY TZ)\n");
    for (const Rig& rig : rigs_.all) {
      out.both(static_cast<std::uint32_t>(rig.id.value));
      out.both(static_cast<std::uint32_t>(rig.mounts.size()));
      for (const Rig::Mount& mount : rig.mounts) {
        sensor(out, mount.camera);
        if (&mount == &rig.mounts.front()) continue;
        out.both(std::uint8_t{1});
        for (const double part : mount.quaternion) out.both(part);
        for (const double part : mount.translation) out.both(part);
      }
      if (out.is_text()) out.line();
    }
    out.flush();
  }

  void write_frames(const ByteSink& sink) const {
    ColmapOutput out(sink, form_);
    header(out, rigs_.frames.size(),
           "# Frames, one a line: FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA_IDS and (TYPE\n"
           "# SENSOR_ID DATA_ID) of each image\n");
    const FrameTable& frames = map_.frames();
    for (const auto& [id, images] : rigs_.frames) {
      const CameraIndex camera = *frames.cameras[images.front()];
      const Rigid3 rig_from_world = rigs_.camera_from_rig.at(camera).inverse() *
                                    map_.world_from_camera(FrameIndex{images.front()}).inverse();
      out.both(static_cast<std::uint32_t>(id.value));
      out.both(static_cast<std::uint32_t>(rigs_.of_camera.at(camera).value));
      const Eigen::Quaterniond q = rig_from_world.quaternion();
      for (const double part : {q.w(), q.x(), q.y(), q.z()}) out.both(part);
      for (const double part : rig_from_world.translation()) out.both(part);
      out.both(static_cast<std::uint32_t>(images.size()));
      for (const std::uint32_t image : images) {
        sensor(out, *frames.cameras[image]);
        out.both(ids_.frames[image]);
      }
      if (out.is_text()) out.line();
    }
    out.flush();
  }

 private:
  void sensor(ColmapOutput& out, CameraIndex camera) const {
    if (out.is_text()) {
      out.words("CAMERA");
    } else {
      out.binary(std::int32_t{0});
    }
    out.both(static_cast<std::uint32_t>(ids_.cameras[camera.value]));
  }

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
      const bool is_bad = form_ == ColmapForm::kText
                              ? name.find_first_of(" \t\n\v\f\r") != std::string::npos
                              : name.find('\0') != std::string::npos;
      if (!is_bad) continue;
      refuse("image name " + printable(name),
             form_ == ColmapForm::kText
                 ? "a name without blanks, where COLMAP ends it; the binary form may have them"
                 : "a name without bytes of zero");
    }
  }

  static void header(ColmapOutput& out, std::size_t count, std::string_view text) {
    if (out.is_text()) {
      out.raw(text);
    } else {
      out.binary(std::uint64_t{count});
    }
  }

  void report(std::uint32_t row) const {
    constexpr std::uint32_t kRows = 65536;
    if (execution_.progress && row % kRows == 0) {
      execution_.progress(static_cast<double>(row) / static_cast<double>(map_.landmark_count()));
    }
  }

  const LandmarkMap& map_;
  const fs::path& folder_;
  ColmapForm form_;
  const Execution& execution_;
  std::vector<std::string> image_names_;
  WrittenIds ids_;
  FrameObservations observations_;
  std::vector<std::uint32_t> keypoint_of_observation_;
  ColmapRigs rigs_;
};

}  // namespace

void write_colmap(const LandmarkMap& map, const fs::path& folder, ColmapForm form,
                  const Execution& execution) {
  const ColmapWriter writer(map, folder, form, execution);
  writer.remark();  // before writing, because the caller may refuse the loss
  OutputFolder output(folder);
  const auto write = [&](std::string_view stem,
                         void (ColmapWriter::*produce)(const ByteSink&) const) {
    write_file(output.unfinished() / colmap_file_name(stem, form),
               [&](const ByteSink& sink) { (writer.*produce)(sink); });
  };
  write("cameras", &ColmapWriter::write_cameras);
  write("images", &ColmapWriter::write_images);
  write("points3D", &ColmapWriter::write_points);
  if (!map.rigs().empty()) {
    write("rigs", &ColmapWriter::write_rigs);
    write("frames", &ColmapWriter::write_frames);
  }
  output.commit();
}

}  // namespace cairn::detail
