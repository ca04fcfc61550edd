// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/losses.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {

void log_remark(const LogSink& log, std::string_view name, std::string_view text, RemarkKind kind) {
  if (log) log({fmt::format("{}: {}", name, text), kind});
}

std::string far_landmarks_text(std::size_t count, std::size_t of) {
  return fmt::format("{} of {} landmarks left out: a coordinate is not finite or beyond {:g}",
                     count, of, kLargestCoordinate);
}

LandmarkMap imported_map(MapTables tables, const std::string& name, const LogSink& log,
                         const EntryPlace& place) {
  const std::size_t count = tables.landmarks.positions.size();
  if (const auto dropped = drop_far_landmarks(tables); !dropped.empty()) {
    log_remark(log, name, far_landmarks_text(dropped.size(), count), RemarkKind::kLoss);
  }
  return LandmarkMap(
      std::move(tables), place ? place : [&](MapColumn, std::size_t) { return name; });
}

std::vector<std::string> losses(const LandmarkMap& map, const Holdings& holdings) {
  std::vector<std::string> lost;
  const auto add = [&](bool is_lost, std::string what) {
    if (is_lost) lost.push_back(std::move(what));
  };
  const FrameTable& frames = map.frames();
  const LandmarkTable& landmarks = map.landmarks();
  const ObservationTable& observations = map.observations();
  add(map.info().length_unit == LengthUnit::kMetres && !holdings.length_unit,
      "unit of length (metres)");
  add(map.info().world_frame.has_value(), "name of the world frame");
  add(map.info().gravity.has_value(), "direction of gravity");
  add(map.info().georeference.has_value() && !holdings.georeference, "georeference");
  add(!map.info().control_points.empty() && !holdings.control_points,
      fmt::format("{} control points", map.info().control_points.size()));
  add(map.info().uuid.has_value(), "UUID");
  add(!map.info().provenance.empty(), "provenance");
  add(!holdings.frames && map.frame_count() > 0, fmt::format("{} frames", map.frame_count()));
  add(!holdings.cameras && !map.cameras().empty(), fmt::format("{} cameras", map.cameras().size()));
  add(!map.rigs().empty() && !holdings.rigs && holdings.frames,
      fmt::format("{} rigs", map.rigs().size()));
  add(!frames.timestamps_s.empty() && !holdings.timestamps, "timestamps");
  add(!frames.image_names.empty() && !holdings.image_names, "names of images");
  add(!frames.gnss.empty() && !holdings.gnss, "GNSS positions");
  add(!frames.pose_covariances.empty(), "covariances of poses");
  add(!landmarks.covariances.empty() && !holdings.covariances, "covariances");
  add(!landmarks.colors.empty() && !holdings.colors, "colours");
  if (landmarks.descriptors && holdings.descriptors != "*" &&
      holdings.descriptors != landmarks.descriptors->kind) {
    lost.push_back("descriptors " + printable(landmarks.descriptors->kind));
  } else if (landmarks.descriptors && landmarks.descriptors->has_further()) {
    add(!holdings.further_descriptors, "further descriptors of a landmark");
  }
  for (const NamedColumn& column : landmarks.columns) {
    const bool held = std::find(holdings.columns.begin(), holdings.columns.end(), column.name) !=
                      holdings.columns.end();
    add(!held, "column " + printable(column.name));
  }
  add(!holdings.observations && map.observation_count() > 0,
      fmt::format("{} observations", map.observation_count()));
  if (holdings.observations) {
    add(!observations.keypoints.empty() && !holdings.keypoints, "indices of keypoints");
    add(!observations.depths.empty() && !holdings.depths, "depths of observations");
    add(!observations.octaves.empty() && !holdings.octaves, "octaves of observations");
    const bool measured = !observations.sources.empty() || !observations.sigmas_px.empty();
    add(measured && !holdings.measured, "how observations were measured");
  }
  return lost;
}

void log_losses(const LogSink& log, const LandmarkMap& map, const Holdings& holdings,
                std::string_view format, std::string_view path) {
  if (!log) return;
  const std::vector<std::string> lost = losses(map, holdings);
  std::string remark;
  if (!lost.empty()) {
    remark = fmt::format("{} has no place for: {}; left out", format, fmt::join(lost, ", "));
  }
  const bool has_sizes = holdings.frames && holdings.cameras && holdings.image_sizes;
  if (has_sizes && !states_image_sizes(map.info())) {
    remark += remark.empty() ? std::string(format) + ": " : ". ";
    remark += "The sizes of images are invented, because the file that was read states none";
  }
  if (remark.empty()) return;
  log({path.empty() ? remark : fmt::format("{}: {}", path, remark), RemarkKind::kLoss});
}

}  // namespace cairn::detail
