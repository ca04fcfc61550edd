// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/own/numbered_fields.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

class NativeWriter {
 public:
  NativeWriter(const LandmarkMap& map, const ByteSink& sink) : map_(map), out_(sink) {}

  void write(int version, const Progress& progress) {
    if (version >= 2) write_head(version);
    for (std::size_t i = 0; i < map_.frame_count(); ++i) {
      write_frame(i);
      if (version >= 2) write_frame_extras(i);
    }
    for (std::size_t i = 0; i < map_.landmark_count(); ++i) {
      write_landmark(i);
      if (version >= 2) write_landmark_extras(i);
      constexpr std::size_t kReportEvery = 1 << 16;
      if (progress && i % kReportEvery == 0) {
        progress(static_cast<double>(i) / static_cast<double>(map_.landmark_count()));
      }
    }
    out_.flush();
  }

 private:
  // A line of these words.
  template <class... Values>
  void line(const Values&... values) {
    out_.words(values...);
    out_.line();
  }

  void write_control_point(const ControlPoint& point) {
    out_.words("META", "control_point", point.latitude_deg, point.longitude_deg);
    if (point.altitude_m) {
      out_.words(*point.altitude_m);
    } else {
      out_.words("-");
    }
    out_.words(detail::escaped(point.name));
    out_.line();
    for (const ControlPoint::View& view : point.views) {
      line("META", "control_view", view.pixel.u, view.pixel.v, detail::escaped(view.image_name));
    }
  }

  void write_head(int version) {
    line("CAIRN", version);
    const MapInfo& info = map_.info();
    if (info.length_unit == LengthUnit::kFree) line("META", "length_unit", "free");
    const auto text = [&](std::string_view key, const std::string& value) {
      line("META", key, detail::escaped(value));
    };
    if (info.world_frame) text("world_frame", *info.world_frame);
    if (info.gravity) {
      line("META", "gravity", info.gravity->x(), info.gravity->y(), info.gravity->z());
    }
    if (const auto& georeference = info.georeference) {
      const auto& q = georeference->quaternion;
      const Eigen::Vector3d& t = georeference->translation;
      out_.words("META", "georeference");
      geodetic(georeference->origin);
      out_.words(georeference->scale, q[0], q[1], q[2], q[3], t.x(), t.y(), t.z());
      out_.line();
    }
    for (const ControlPoint& point : info.control_points) write_control_point(point);
    if (info.uuid) text("uuid", *info.uuid);
    for (const std::string& step : info.provenance) text("provenance", step);
    for (const Camera& camera : map_.cameras()) {
      out_.words("CAMERA", camera.id.value, camera.model, camera.width, camera.height);
      for (const double parameter : camera.parameters) out_.words(parameter);
      out_.line();
    }
    for (const Rig& rig : map_.rigs()) {
      for (const Rig::Mount& mount : rig.mounts) {
        const auto& q = mount.quaternion;
        const Eigen::Vector3d& t = mount.translation;
        line("RIG", rig.id.value, map_.cameras()[mount.camera.value].id.value, q[0], q[1], q[2],
             q[3], t.x(), t.y(), t.z());
      }
    }
    if (const auto& descriptors = map_.landmarks().descriptors) {
      line("DESCRIPTORS", descriptors->kind, descriptors->bytes_each);
    }
    for (const NamedColumn& column : map_.landmarks().columns) line("COLUMN", column.name);
  }

  void geodetic(const GeodeticPosition& position) {
    out_.words(position.latitude_deg, position.longitude_deg, position.altitude_m);
  }

  void write_frame(std::size_t i) {
    const FrameTable& frames = map_.frames();
    const Eigen::Vector3d& t = frames.translations[i];
    const auto& q = frames.quaternions[i];
    line("FRAME", frames.ids[i].value, t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]);
  }

  void write_frame_extras(std::size_t i) {
    const FrameTable& frames = map_.frames();
    const std::uint64_t id = frames.ids[i].value;
    if (!frames.timestamps_s.empty() && frames.timestamps_s[i]) {
      line("TIME", id, *frames.timestamps_s[i]);
    }
    if (!frames.cameras.empty() && frames.cameras[i]) {
      line("VIEW", id, map_.cameras()[frames.cameras[i]->value].id.value);
    }
    if (!frames.instants.empty() && frames.instants[i]) {
      line("INSTANT", id, frames.instants[i]->value);
    }
    if (!frames.image_names.empty() && !frames.image_names[i].empty()) {
      line("IMAGE", id, detail::escaped(frames.image_names[i]));
    }
    if (!frames.gnss.empty() && frames.gnss[i]) {
      const GnssFix fix = *frames.gnss[i];
      out_.words("GNSS", id);
      geodetic(fix.position);
      if (fix.accuracy_m) {
        out_.words(*fix.accuracy_m);
      } else {
        out_.words("-");
      }
      out_.line();
    }
    if (!frames.pose_covariances.empty() && frames.pose_covariances[i]) {
      const Matrix6d covariance = *frames.pose_covariances[i];
      out_.words("POSE_COVARIANCE", id);
      for (int row = 0; row < 6; ++row) {
        for (int column = row; column < 6; ++column) out_.words(covariance(row, column));
      }
      out_.line();
    }
  }

  void write_landmark(std::size_t i) {
    const LandmarkIndex landmark{static_cast<std::uint32_t>(i)};
    const Eigen::Vector3d& x = map_.landmarks().positions[i];
    out_.words("LANDMARK", map_.landmarks().ids[i].value, x.x(), x.y(), x.z());
    if (const auto covariance = map_.covariance(landmark)) {
      for (int k = 0; k < 9; ++k) out_.words((*covariance)(k / 3, k % 3));
    } else {
      out_.words("-");
    }
    if (map_.has_observations()) {
      const auto frames = map_.observing_frames(landmark);
      const auto pixels = map_.observed_pixels(landmark);
      out_.words(frames.size());
      for (std::size_t k = 0; k < frames.size(); ++k) {
        out_.words(map_.frames().ids[frames[k].value].value, pixels[k].u, pixels[k].v);
      }
    } else {
      out_.words("-");
    }
    out_.line();
  }

  void write_landmark_extras(std::size_t i) {
    const LandmarkTable& landmarks = map_.landmarks();
    const std::uint64_t id = landmarks.ids[i].value;
    if (!landmarks.colors.empty() && landmarks.colors[i]) {
      const Color color = *landmarks.colors[i];
      line("COLOR", id, color.red, color.green, color.blue);
    }
    if (const auto& descriptors = landmarks.descriptors) {
      std::string hex;
      for (std::size_t k = 0; k < descriptors->count(i); ++k) {
        hex.clear();
        for (const std::uint8_t byte : descriptors->descriptor(i, k)) {
          hex += {detail::kHexDigits[byte >> 4], detail::kHexDigits[byte & 15]};
        }
        line("DESCRIPTOR", id, hex);
      }
    }
    for (const NamedColumn& column : landmarks.columns) {
      if (!std::isnan(column.values[i])) line("VALUE", id, column.name, column.values[i]);
    }
    write_detail(i);
    write_measured(i);
  }

  void write_detail(std::size_t i) {
    const ObservationTable& observations = map_.observations();
    if (observations.keypoints.empty() && observations.depths.empty() &&
        observations.octaves.empty()) {
      return;
    }
    if (observations.offsets[i] == observations.offsets[i + 1]) return;
    out_.words("DETAIL", map_.landmarks().ids[i].value);
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      optional_field(observations.keypoints, k);
      optional_field(observations.depths, k);
      optional_field(observations.octaves, k);
    }
    out_.line();
  }

  void write_measured(std::size_t i) {
    const ObservationTable& observations = map_.observations();
    if (observations.sources.empty() && observations.sigmas_px.empty()) return;
    if (observations.offsets[i] == observations.offsets[i + 1]) return;
    out_.words("MEASURED", map_.landmarks().ids[i].value);
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      const bool has_source = !observations.sources.empty() && observations.sources[k];
      out_.words(has_source ? to_string(*observations.sources[k]) : "-");
      optional_field(observations.sigmas_px, k);
    }
    out_.line();
  }

  template <class Column>
  void optional_field(const Column& column, std::uint64_t k) {
    if (column.empty() || !column[k]) {
      out_.words("-");
    } else {
      out_.words(*column[k]);
    }
  }

  const LandmarkMap& map_;
  detail::TextOutput out_;
};

}  // namespace

std::optional<std::string> version_1_loss(const LandmarkMap& map) {
  const MapInfo& info = map.info();
  const FrameTable& frames = map.frames();
  const LandmarkTable& landmarks = map.landmarks();
  const ObservationTable& observations = map.observations();
  if (map.frame_count() + map.landmark_count() == 0) return "that the map is empty";
  if (info.length_unit != LengthUnit::kMetres) return "the free scale";
  if (info.world_frame) return "the name of the world frame";
  if (info.gravity) return "the direction of gravity";
  if (info.georeference) return "the georeference";
  if (!info.control_points.empty()) return "the control points";
  if (info.uuid) return "the UUID";
  if (!info.provenance.empty()) return "the provenance";
  if (!map.cameras().empty()) return "the cameras";
  if (!map.rigs().empty()) return "the rigs";
  if (!frames.timestamps_s.empty()) return "the frames' times";
  if (!frames.image_names.empty()) return "the frames' image names";
  if (!frames.gnss.empty()) return "the frames' GNSS positions";
  if (!frames.pose_covariances.empty()) return "the covariances of the frames' poses";
  if (!landmarks.colors.empty()) return "the landmarks' colours";
  if (landmarks.descriptors) return "the landmarks' descriptors";
  if (!landmarks.columns.empty()) return "the landmarks' named columns";
  if (!map.has_observations()) return "that observations are unknown";
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (!map.covariance(LandmarkIndex{i})) return "that covariances are unknown";
  }
  if (!observations.keypoints.empty() || !observations.depths.empty() ||
      !observations.octaves.empty()) {
    return "the observations' keypoints, depths and octaves";
  }
  if (!observations.sources.empty() || !observations.sigmas_px.empty()) {
    return "how the observations were measured";
  }
  return std::nullopt;
}

void write_native(const LandmarkMap& map, const ByteSink& sink, std::optional<int> version,
                  const Execution& execution) {
  const auto loss = version_1_loss(map);
  const auto& descriptors = map.landmarks().descriptors;
  const bool has_further = descriptors && descriptors->has_further();
  const bool has_pose_covariances = !map.frames().pose_covariances.empty();
  const bool needs_3 = has_further || has_pose_covariances || !map.rigs().empty();
  const int least = needs_3 ? 3 : loss ? 2 : 1;
  const int chosen = version.value_or(least);
  refuse_if(chosen < 1 || chosen > 3, "version", std::to_string(chosen), "1, 2 or 3");
  if (chosen < least) {
    throw Error(ErrorKind::kMisuse, fmt::format("version {} of the text format", chosen),
                "would lose " + (chosen == 1            ? *loss
                                 : has_further          ? "the landmarks' further descriptors"
                                 : has_pose_covariances ? "the covariances of the frames' poses"
                                                        : "the rigs"),
                fmt::format("version {}", least));
  }
  NativeWriter(map, sink).write(chosen, execution.progress);
}

}  // namespace cairn
