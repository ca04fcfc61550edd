// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/mcap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string_view>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/foxglove_messages.hpp"
#include "cairn/formats/detail/bytes/mcap_file.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

using detail::LineType;
using detail::SceneColor;
using detail::SceneEntity;
using detail::SceneLine;

constexpr std::string_view kWorld = "world";
constexpr std::uint64_t kMadeUpStepNs = 100'000'000;  // between keyframes of a map without times
constexpr SceneColor kKeyframeColor = {0.25, 0.6, 1.0, 0.8};
constexpr SceneColor kTrajectoryColor = {1.0, 0.75, 0.2, 1.0};

// A keyframe and its time.
struct TimedFrame {
  std::uint64_t time_ns = 0;
  FrameIndex frame;
};

std::uint64_t nanoseconds(double seconds, FrameId frame) {
  constexpr double kLatest = 1.8e10;  // below 2^64 nanoseconds
  if (!(seconds >= 0.0 && seconds <= kLatest)) {
    throw Error(ErrorKind::kInput, fmt::format("keyframe {}", frame.value),
                fmt::format("is at {} s, which MCAP does not hold", seconds),
                "0 to 1.8e10 seconds");
  }
  const double whole = std::floor(seconds);
  return static_cast<std::uint64_t>(whole) * 1'000'000'000 +
         static_cast<std::uint64_t>(std::llround((seconds - whole) * 1e9));
}

bool has_times(const LandmarkMap& map) {
  return !map.frames().timestamps_s.empty();
}

// The keyframes in the order of their times; those without a time are left out if others have one.
std::vector<TimedFrame> timed_frames(const LandmarkMap& map) {
  std::vector<TimedFrame> timed;
  const FrameTable& frames = map.frames();
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    if (!has_times(map)) {
      timed.push_back({i * kMadeUpStepNs, FrameIndex{i}});
    } else if (frames.timestamps_s[i]) {
      timed.push_back({nanoseconds(*frames.timestamps_s[i], frames.ids[i]), FrameIndex{i}});
    }
  }
  std::stable_sort(timed.begin(), timed.end(),
                   [](const TimedFrame& a, const TimedFrame& b) { return a.time_ns < b.time_ns; });
  return timed;
}

Eigen::Vector3d centre_of(std::span<const Eigen::Vector3d> points) {
  if (points.empty()) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d sum =
      std::accumulate(points.begin(), points.end(), Eigen::Vector3d(Eigen::Vector3d::Zero()));
  return sum / static_cast<double>(points.size());
}

// Length of a frustum, so that it is visible but hides no landmarks: a share of the median distance of the
// landmarks from their centre; without landmarks, of the camera centres.
double frustum_depth(const LandmarkMap& map) {
  constexpr double kShare = 0.05;
  const auto& points =
      map.landmark_count() > 0 ? map.landmarks().positions : map.frames().translations;
  const Eigen::Vector3d centre = centre_of(points);
  std::vector<double> distances;
  distances.reserve(points.size());
  for (const Eigen::Vector3d& x : points) distances.push_back((x - centre).norm());
  const double median = upper_median(distances);
  return median > 0.0 ? kShare * median : kShare;
}

// All keyframes as one list of lines: the edges of each camera's frustum, without distortion, or the optical
// axis of an unknown camera.
SceneEntity keyframe_lines(const LandmarkMap& map) {
  SceneLine line{.type = LineType::kList, .points = {}, .color = kKeyframeColor};
  const double depth = frustum_depth(map);
  const auto& cameras = map.frames().cameras;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const Rigid3 world_from_camera = map.world_from_camera(FrameIndex{i});
    const auto first = static_cast<std::uint32_t>(line.points.size());
    const auto add = [&](double x, double y) {
      line.points.push_back(world_from_camera * Eigen::Vector3d(depth * x, depth * y, depth));
    };
    line.points.push_back(world_from_camera.translation());
    if (cameras.empty() || !cameras[i]) {
      add(0.0, 0.0);
      line.indices.insert(line.indices.end(), {first, first + 1});
      continue;
    }
    const Camera& camera = map.cameras()[cameras[i]->value];
    const Intrinsics k = intrinsics(camera);
    const double left = (-0.5 - k.cx) / k.fx;
    const double right = (camera.width - 0.5 - k.cx) / k.fx;
    const double top = (-0.5 - k.cy) / k.fy;
    const double bottom = (camera.height - 0.5 - k.cy) / k.fy;
    add(left, top);
    add(right, top);
    add(right, bottom);
    add(left, bottom);
    for (std::uint32_t corner = 0; corner < 4; ++corner) {
      const std::uint32_t here = first + 1 + corner;
      const std::uint32_t next = first + 1 + (corner + 1) % 4;
      line.indices.insert(line.indices.end(), {first, here, here, next});
    }
  }
  return {.id = "keyframes", .lines = {std::move(line)}};
}

SceneEntity trajectory_line(const LandmarkMap& map, std::span<const TimedFrame> frames) {
  SceneLine line{.thickness_px = 2.0, .points = {}, .color = kTrajectoryColor};
  for (const TimedFrame& timed : frames) {
    line.points.push_back(map.frames().translations[timed.frame.value]);
  }
  return {.id = "trajectory", .lines = {std::move(line)}};
}

// Name of a keyframe's frame: that of its camera if there are several.
std::string camera_frame(const LandmarkMap& map, FrameIndex frame) {
  const auto& cameras = map.frames().cameras;
  if (map.cameras().size() < 2 || cameras.empty() || !cameras[frame.value]) return "camera";
  return fmt::format("camera/{}", map.cameras()[cameras[frame.value]->value].id.value);
}

// From red over yellow to green.
SceneColor color_of(const McapLink& link) {
  if (!link.agrees) return {1.0, 0.0, 1.0, 1.0};
  if (!link.probability) return {0.6, 0.6, 0.6, 1.0};
  const double p = std::clamp(*link.probability, 0.0, 1.0);
  return {std::min(1.0, 2.0 - 2.0 * p), std::min(1.0, 2.0 * p), 0.0, 1.0};
}

// A recording of Foxglove's messages.
class Recording {
 public:
  explicit Recording(const ByteSink& sink)
      : file_(sink),
        clouds_(schema(detail::kPointCloudSchema)),
        transforms_(schema(detail::kFrameTransformSchema)),
        scenes_(schema(detail::kSceneUpdateSchema)) {}

  using Metadata = detail::McapWriter::Metadata;

  void add_cloud(const LandmarkMap& map, const std::string& topic, std::string_view frame,
                 std::uint64_t time_ns) {
    const detail::PointRows rows(map, detail::PointFormat::kFoxglove,
                                 detail::is_rounded_by_floats(map.landmarks().positions)
                                     ? detail::ScalarType::kFloat64
                                     : detail::ScalarType::kFloat32);
    std::string data;
    rows.write({}, false, [&](std::string_view bytes) { data += bytes; });
    const bool is_metric = map.info().length_unit == LengthUnit::kMetres;
    add(channel(clouds_, topic, {{"length_unit", is_metric ? "metres" : "free"}}), time_ns,
        detail::point_cloud_message(time_ns, frame, rows.fields(), data));
  }

  void add_scene(const std::string& topic, std::string_view frame, std::uint64_t time_ns,
                 std::span<const SceneEntity> entities) {
    add(channel(scenes_, topic), time_ns, detail::scene_update_message(time_ns, frame, entities));
  }

  // Adds the landmarks and keyframes below `topic`.
  void add_map(const LandmarkMap& map, std::span<const TimedFrame> frames, const std::string& topic,
               std::string_view frame, std::uint64_t time_ns) {
    add_cloud(map, topic + "/landmarks", frame, time_ns);
    if (map.frame_count() > 0) {
      add_scene(topic + "/keyframes", frame, time_ns, std::array{keyframe_lines(map)});
    }
    if (frames.size() > 1) {
      add_scene(topic + "/trajectory", frame, time_ns, std::array{trajectory_line(map, frames)});
    }
  }

  std::uint16_t transform_channel(const Metadata& metadata = {}) {
    return channel(transforms_, "/tf", metadata);
  }

  void add_transform(std::uint16_t channel, std::uint64_t time_ns, std::string_view child,
                     const Rigid3& world_from_child) {
    add(channel, time_ns,
        detail::frame_transform_message(time_ns, kWorld, child, world_from_child));
  }

  void finish() { file_.finish(); }

 private:
  std::uint16_t schema(std::string_view name) {
    return file_.add_schema(name, "protobuf", detail::foxglove_descriptors());
  }
  std::uint16_t channel(std::uint16_t schema, const std::string& topic,
                        const Metadata& metadata = {}) {
    return file_.add_channel(schema, topic, "protobuf", metadata);
  }
  void add(std::uint16_t channel, std::uint64_t time_ns, const std::string& message) {
    file_.add_message(channel, time_ns, message);
  }

  detail::McapWriter file_;
  std::uint16_t clouds_;
  std::uint16_t transforms_;
  std::uint16_t scenes_;
};

void remark_losses(const LandmarkMap& map, const Execution& execution) {
  if (!execution.log) return;
  const LandmarkTable& landmarks = map.landmarks();
  const bool all_colored = std::all_of(landmarks.colors.begin(), landmarks.colors.end(),
                                       [](const auto& color) { return color.has_value(); });
  const std::vector<std::string_view> columns = column_names(landmarks.columns);
  const detail::Holdings holdings = {.observations = false,
                                     .cameras = false,
                                     .image_names = false,
                                     .timestamps = true,
                                     .colors = all_colored,
                                     .covariances = true,
                                     .length_unit = true,
                                     .columns = columns};
  std::vector<std::string> lost = detail::losses(map, holdings);
  const bool has_large_ids = std::any_of(
      landmarks.ids.begin(), landmarks.ids.end(),
      [](LandmarkId id) { return id.value > std::numeric_limits<std::uint32_t>::max(); });
  if (has_large_ids) lost.emplace_back("ids of landmarks, of which some exceed 32 bits");
  if (has_times(map)) {
    const auto known = map.frames().timestamps_s.known();
    const auto timeless = std::count(known.begin(), known.end(), 0);
    if (timeless > 0) lost.push_back(fmt::format("poses of {} frames without a time", timeless));
  }
  if (lost.empty()) return;
  execution.log({fmt::format("MCAP has no place for: {}; left out", fmt::join(lost, ", ")),
                 RemarkKind::kLoss});
}

}  // namespace

void write_mcap(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  // Before writing, because the caller may refuse the loss.
  remark_losses(map, execution);
  const std::vector<TimedFrame> frames = timed_frames(map);
  const std::uint64_t start = frames.empty() ? 0 : frames.front().time_ns;
  Recording recording(sink);
  recording.add_map(map, frames, "", kWorld, start);
  if (execution.progress) execution.progress(0.5);
  if (!frames.empty()) {
    Recording::Metadata metadata;
    if (!has_times(map)) metadata = {{"times", "made up, 0.1 s apart: the map states none"}};
    const std::uint16_t channel = recording.transform_channel(metadata);
    for (const TimedFrame& timed : frames) {
      recording.add_transform(channel, timed.time_ns, camera_frame(map, timed.frame),
                              map.world_from_camera(timed.frame));
    }
  }
  recording.finish();
  if (execution.progress) execution.progress(1.0);
}

void write_mcap(std::span<const McapMap> maps, std::span<const McapLink> links,
                const ByteSink& sink) {
  constexpr std::uint64_t kTime = 0;
  Recording recording(sink);
  const std::uint16_t transforms = recording.transform_channel();
  std::vector<Eigen::Vector3d> centres;  // in the world
  std::vector<SceneEntity> names;
  for (const McapMap& map : maps) {
    const std::string name = "map/" + plain_text(map.name);
    const Similarity3& pose = map.world_from_map;
    recording.add_transform(transforms, kTime, name, pose.rigid());
    const Similarity3 scale(pose.scale(), Rigid3());
    const LandmarkMap scaled = transformed(map.read(), scale);
    recording.add_map(scaled, timed_frames(scaled), "/" + name, name, kTime);
    centres.push_back(pose.rigid() * centre_of(scaled.landmarks().positions));
    names.push_back({.id = name, .texts = {{centres.back(), plain_text(map.name)}}});
  }
  std::vector<SceneEntity> lines;
  for (const McapLink& link : links) {
    SceneEntity entity{.id = fmt::format("link/{}", lines.size())};
    entity.metadata = {
        {"target", plain_text(maps[link.target].name)},
        {"source", plain_text(maps[link.source].name)},
        {"kind", link.kind},
        {"probability", link.probability ? fmt::format("{}", *link.probability) : "unknown"},
        {"poses", link.agrees ? "agree" : "contradict it"}};
    entity.lines.push_back({.thickness_px = 3.0,
                            .points = {centres[link.target], centres[link.source]},
                            .color = color_of(link)});
    lines.push_back(std::move(entity));
  }
  recording.add_scene("/names", kWorld, kTime, names);
  recording.add_scene("/links", kWorld, kTime, lines);
  recording.finish();
}

}  // namespace cairn
