// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/colmap_priors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <unordered_map>
#include <vector>

#include <fmt/format.h>

#include "cairn/formats/detail/foreign/database_file.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn::detail {
namespace {

constexpr const char* kPriors = "pose_priors";

// Numbers of a column; std::nullopt if they are unknown.
template <std::size_t kNumbers>
std::optional<std::array<double, kNumbers>> prior_numbers(const sqlite::Database& database,
                                                          const sqlite::Statement& row,
                                                          int column) {
  const auto blob = row.optional_blob(column);
  if (!blob) return std::nullopt;
  std::array<double, kNumbers> numbers{};
  if (blob->size() != sizeof numbers) {
    refuse_database(database, kPriors, fmt::format("{} bytes", blob->size()),
                    fmt::format("{} numbers of 8", kNumbers));
  }
  std::memcpy(numbers.data(), blob->data(), sizeof numbers);
  const bool is_known = std::all_of(numbers.begin(), numbers.end(),
                                    [](double number) { return std::isfinite(number); });
  return is_known ? std::optional(numbers) : std::nullopt;
}

// The direction that all agree on.
std::optional<Eigen::Vector3d> common_direction(const std::vector<Eigen::Vector3d>& directions,
                                                const std::string& name, const LogSink& log) {
  if (directions.empty()) return std::nullopt;
  constexpr double kMostApart = radians(5.0);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& direction : directions) sum += direction;
  double farthest = 0.0;
  for (const Eigen::Vector3d& direction : directions) {
    farthest = std::max(farthest, std::atan2(sum.cross(direction).norm(), sum.dot(direction)));
  }
  if (farthest <= kMostApart) return sum.normalized();
  log_remark(log, name,
             fmt::format("directions of gravity of {} images differ by up to {:.0f} deg from their "
                         "mean; left out",
                         directions.size(), degrees(farthest)),
             RemarkKind::kLoss);
  return std::nullopt;
}

}  // namespace

ColmapPriors read_colmap_priors(const LandmarkMap& model, sqlite::Database& database,
                                const Execution& execution) {
  ColmapPriors result;
  const auto& names = model.frames().image_names;
  if (!database.has_table(kPriors) || names.empty()) return result;
  std::unordered_map<std::string_view, std::uint32_t> frame_of;
  for (std::uint32_t i = 0; i < names.size(); ++i) frame_of.emplace(names[i], i);
  // From version 4 on a prior is of what any sensor took, and may state gravity.
  const bool is_old = std::string_view(column_or_null(database, kPriors, "image_id")) == "image_id";
  sqlite::Statement row = database.prepare(fmt::format(
      "SELECT images.name, coordinate_system, position, {}, {} FROM pose_priors JOIN images ON "
      "images.image_id = pose_priors.{} ORDER BY images.image_id",
      column_or_null(database, kPriors, "position_covariance"),
      column_or_null(database, kPriors, "gravity"),
      is_old ? "image_id" : "corr_data_id AND corr_sensor_type = 0"));
  std::size_t elsewhere = 0;
  std::vector<Eigen::Vector3d> down;
  while (row.step()) {
    const auto found = frame_of.find(row.text(0));
    if (found == frame_of.end()) continue;
    const std::uint32_t frame = found->second;
    if (const auto gravity = prior_numbers<3>(database, row, 4)) {
      const Eigen::Vector3d in_camera(gravity->data());
      if (in_camera.norm() > 0.0) {
        down.push_back(model.world_from_camera(FrameIndex{frame}).rotation() *
                       in_camera.normalized());
      }
    }
    const auto position = prior_numbers<3>(database, row, 2);
    if (!position) continue;
    constexpr std::int64_t kWgs84 = 0;
    if (row.integer(1) != kWgs84) {
      ++elsewhere;
      continue;
    }
    GnssFix fix{{(*position)[0], (*position)[1], (*position)[2]}, std::nullopt};
    if (const std::string defect = geodetic_defect(fix.position); !defect.empty()) {
      refuse_database(database, kPriors, defect, "latitude, longitude and altitude");
    }
    if (const auto c = prior_numbers<9>(database, row, 3)) {
      const double accuracy = std::sqrt(((*c)[0] + (*c)[4] + (*c)[8]) / 3.0);
      if (accuracy > 0.0 && accuracy <= kLargestCoordinate) fix.accuracy_m = accuracy;
    }
    result.gnss.resize(model.frame_count());
    result.gnss.set(frame, fix);
  }
  result.gravity = common_direction(down, database.name(), execution.log);
  if (elsewhere > 0) {
    log_remark(execution.log, database.name(),
               fmt::format("{} positions of images are not in WGS84; left out", elsewhere),
               RemarkKind::kLoss);
  }
  return result;
}

}  // namespace cairn::detail
