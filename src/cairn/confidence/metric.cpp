// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/confidence/metric.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/camera.hpp"

namespace cairn {
namespace {

[[noreturn]] void fail_missing(std::string_view metric, std::string_view missing) {
  throw Error(ErrorKind::kInput, fmt::format("confidence metric {}", metric),
              fmt::format("the map has no {}", missing), "a map that has, or another metric");
}

void require_observations(const LandmarkMap& map, std::string_view metric) {
  if (!map.has_observations()) fail_missing(metric, "observations");
}

// One value per landmark.
template <class Function>
std::vector<double> for_each_landmark(const LandmarkMap& map, Function&& value) {
  std::vector<double> values(map.landmark_count());
  for (std::uint32_t i = 0; i < values.size(); ++i) values[i] = value(LandmarkIndex{i});
  return values;
}

// Mean of Eq. 4.
double mean_distance(const LandmarkMap& map, LandmarkIndex landmark) {
  const Eigen::Vector3d& position = map.landmarks().positions[landmark.value];
  const auto frames = map.observing_frames(landmark);
  double sum = 0.0;
  for (const FrameIndex frame : frames) {
    sum += (position - map.frames().translations[frame.value]).norm();
  }
  return sum / static_cast<double>(frames.size());
}

double largest_viewing_angle(const LandmarkMap& map, LandmarkIndex landmark) {
  const Eigen::Vector3d& position = map.landmarks().positions[landmark.value];
  const auto frames = map.observing_frames(landmark);
  // Pairs of some, evenly spaced, if there are more.
  const std::size_t count = std::min(frames.size(), kMostViewingRays);
  const auto ray = [&](std::size_t i) -> Eigen::Vector3d {
    return position -
           map.frames().translations[frames[i * (frames.size() - 1) / (count - 1)].value];
  };
  double largest = 0.0;
  for (std::size_t i = 1; i < count; ++i) {
    const Eigen::Vector3d a = ray(i);
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Vector3d b = ray(j);
      // atan2 keeps small angles exact, where acos would not.
      largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  }
  return largest;
}

// Mean reprojection error in pixels over observations in frames with a known camera; negative if there is no
// such observation, or the landmark is behind such a camera.
double mean_reprojection_error(const LandmarkMap& map, const std::vector<Rigid3>& camera_from_world,
                               LandmarkIndex landmark) {
  const auto frames = map.observing_frames(landmark);
  const auto pixels = map.observed_pixels(landmark);
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto camera = map.frames().cameras[frames[i].value];
    if (!camera) continue;
    const auto error = reprojection(
        map.cameras()[camera->value],
        camera_from_world[frames[i].value] * map.landmarks().positions[landmark.value], pixels[i]);
    if (!error) return -1.0;
    sum += error->norm();
    ++count;
  }
  return count > 0 ? sum / count : -1.0;
}

Metric single_metric(std::string_view name) {
  constexpr std::string_view kColumnPrefix = "column:";
  if (name.starts_with(kColumnPrefix) && name.size() > kColumnPrefix.size()) {
    return column_metric(std::string(name.substr(kColumnPrefix.size())));
  }
  if (name == "covariance") return covariance_metric();
  if (name == "covariance:spectral") return covariance_metric(CovarianceNorm::kSpectral);
  if (name == "observations") return observations_metric();
  if (name == "distance") return distance_metric();
  if (name == "parallax") return parallax_metric();
  if (name == "reprojection") return reprojection_metric();
  throw Error(ErrorKind::kMisuse, "confidence",
              fmt::format("{} is no confidence metric", printable(name)),
              fmt::format("{}, or several joined by '*'", fmt::join(metric_names(), ", ")));
}

}  // namespace

Metric covariance_metric(CovarianceNorm norm) {
  const std::string name =
      norm == CovarianceNorm::kFrobenius ? "covariance" : "covariance:spectral";
  return {name, [name, norm](const LandmarkMap& map) {
            if (!map.has_covariances() && map.landmark_count() > 0) {
              fail_missing(name, "landmark covariances");
            }
            return for_each_landmark(map, [&](LandmarkIndex landmark) {
              const auto covariance = map.covariance(landmark);
              if (!covariance) return 0.0;
              return 1.0 /
                     (1.0 + (norm == CovarianceNorm::kFrobenius ? covariance->norm()
                                                                : spectral_norm(*covariance)));
            });
          }};
}

Metric observations_metric() {
  return {"observations", [](const LandmarkMap& map) {
            require_observations(map, "observations");
            return for_each_landmark(map, [&](LandmarkIndex landmark) {
              return static_cast<double>(map.observation_count(landmark));
            });
          }};
}

Metric distance_metric() {
  return {"distance", [](const LandmarkMap& map) {
            require_observations(map, "distance");
            return for_each_landmark(map, [&](LandmarkIndex landmark) {
              if (map.observation_count(landmark) == 0) return 0.0;
              return 1.0 / (1.0 + mean_distance(map, landmark));
            });
          }};
}

Metric parallax_metric() {
  return {"parallax", [](const LandmarkMap& map) {
            require_observations(map, "parallax");
            return for_each_landmark(
                map, [&](LandmarkIndex landmark) { return largest_viewing_angle(map, landmark); });
          }};
}

Metric reprojection_metric() {
  return {"reprojection", [](const LandmarkMap& map) {
            require_observations(map, "reprojection");
            if (map.frames().cameras.empty() && map.landmark_count() > 0) {
              fail_missing("reprojection", "cameras of its frames");
            }
            std::vector<Rigid3> camera_from_world(map.frame_count());
            for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
              camera_from_world[i] = map.world_from_camera(FrameIndex{i}).inverse();
            }
            return for_each_landmark(map, [&](LandmarkIndex landmark) {
              const double error = mean_reprojection_error(map, camera_from_world, landmark);
              return error < 0.0 ? 0.0 : 1.0 / (1.0 + error);
            });
          }};
}

Metric column_metric(const std::string& column) {
  return {"column:" + column, [column](const LandmarkMap& map) {
            const NamedColumn* const found = map.column(column);
            if (found == nullptr) fail_missing("column:" + column, "column " + printable(column));
            std::vector<double> values(found->values.begin(), found->values.end());
            std::replace_if(
                values.begin(), values.end(), [](double value) { return std::isnan(value); }, 0.0);
            return values;
          }};
}

Metric product_metric(std::vector<Metric> factors) {
  refuse_if(factors.empty(), "product_metric", "no factors", "at least one");
  std::vector<std::string> names;
  names.reserve(factors.size());
  for (const Metric& factor : factors) names.push_back(factor.name);
  return {fmt::format("{}", fmt::join(names, "*")),
          [factors = std::move(factors)](const LandmarkMap& map) {
            std::vector<double> values = factors.front().evaluate(map);
            for (std::size_t i = 1; i < factors.size(); ++i) {
              const std::vector<double> more = factors[i].evaluate(map);
              for (std::size_t j = 0; j < values.size(); ++j) values[j] *= more[j];
            }
            return values;
          }};
}

Metric metric_named(std::string_view name) {
  std::vector<Metric> factors;
  std::size_t begin = 0;
  for (;;) {
    const std::size_t end = name.find('*', begin);
    factors.push_back(single_metric(name.substr(begin, end - begin)));
    if (end == std::string_view::npos) break;
    begin = end + 1;
  }
  return product_metric(std::move(factors));
}

std::vector<std::string> metric_names() {
  return {"covariance", "covariance:spectral", "observations", "distance",
          "parallax",   "reprojection",        "column:NAME"};
}

}  // namespace cairn
