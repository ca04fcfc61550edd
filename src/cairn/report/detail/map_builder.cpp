// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/map_builder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "cairn/confidence/metric.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/splats.hpp"

namespace cairn::report::detail {
namespace {

constexpr std::size_t kLarge = 100000;  // landmarks beyond which numbers are quantised to 16 bits
constexpr double kCoarsest = 1e-3;      // step of 16 bits, as a share of the central extent
constexpr double kCentral = 0.9;        // share of the landmarks that the central extent holds
constexpr std::uint8_t kUnknownColor = 128;
constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

// Evenly spaced numbers from `low` to `high`.
struct Quantisation {
  double low = 0.0;
  double step = 1.0;

  template <class Stored>
  static Quantisation over(double low, double high) {
    constexpr double kSteps = std::numeric_limits<Stored>::max();
    // Divided first, for the difference of two finite numbers may be infinite.
    const double step = high / kSteps - low / kSteps;
    return {low, step > 0.0 ? step : 1.0};
  }
  template <class Stored>
  Stored stored(double value) const {
    constexpr double kSteps = std::numeric_limits<Stored>::max();
    const double difference = value - low;
    const double steps = std::isfinite(difference) ? difference / step : value / step - low / step;
    return static_cast<Stored>(std::clamp(std::round(steps), 0.0, kSteps));
  }
};

std::vector<LandmarkIndex> all_landmarks(const LandmarkMap& map) {
  std::vector<LandmarkIndex> all(map.landmark_count());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = LandmarkIndex{i};
  return all;
}

// The central extent of the landmarks along one axis.
double central_extent(std::vector<double> coordinates) {
  return lower_quantile(coordinates, 0.5 + 0.5 * kCentral) -
         lower_quantile(coordinates, 0.5 - 0.5 * kCentral);
}

template <class Stored>
void quantise(const std::vector<Eigen::Vector3d>& positions, const Eigen::Vector3d& low,
              const Eigen::Vector3d& high, Map& map) {
  std::vector<Stored> stored(3 * positions.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    const auto quantisation = Quantisation::over<Stored>(low[i], high[i]);
    map.origin[axis] = quantisation.low;
    map.step[axis] = quantisation.step;
    for (std::size_t k = 0; k < positions.size(); ++k) {
      stored[3 * k + axis] = quantisation.template stored<Stored>(positions[k][i]);
    }
  }
  map.positions = std::move(stored);
}

void set_positions(const std::vector<Eigen::Vector3d>& positions, Map& map) {
  if (positions.empty()) return;
  Eigen::Vector3d low = positions.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& position : positions) {
    low = low.cwiseMin(position);
    high = high.cwiseMax(position);
  }
  bool fine = false;
  if (positions.size() > kLarge) {
    double extent = 0.0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      std::vector<double> coordinates;
      coordinates.reserve(positions.size());
      for (const Eigen::Vector3d& position : positions) coordinates.push_back(position[axis]);
      extent = std::max(extent, central_extent(std::move(coordinates)));
    }
    fine =
        (high - low).maxCoeff() / std::numeric_limits<std::uint16_t>::max() <= kCoarsest * extent;
  }
  if (fine) {
    quantise<std::uint16_t>(positions, low, high, map);
  } else {
    quantise<std::uint32_t>(positions, low, high, map);
  }
}

// Whole numbers in the smallest type that holds all of them.
Buffer counts(const std::vector<double>& values) {
  const double most = values.empty() ? 0.0 : *std::max_element(values.begin(), values.end());
  if (most <= std::numeric_limits<std::uint8_t>::max()) {
    return std::vector<std::uint8_t>(values.begin(), values.end());
  }
  if (most <= std::numeric_limits<std::uint16_t>::max()) {
    return std::vector<std::uint16_t>(values.begin(), values.end());
  }
  return std::vector<float>(values.begin(), values.end());
}

Column column_of(std::string name, std::string label, std::optional<std::string> unit,
                 const std::vector<double>& values) {
  Column column{std::move(name), std::move(label), std::move(unit), {}, 1.0, 0.0};
  const bool all_known = std::none_of(values.begin(), values.end(),
                                      [](double value) { return !std::isfinite(value); });
  if (values.size() > kLarge && all_known) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const auto quantisation = Quantisation::over<std::uint16_t>(*low, *high);
    std::vector<std::uint16_t> stored;
    stored.reserve(values.size());
    for (const double value : values) stored.push_back(quantisation.stored<std::uint16_t>(value));
    column.values = std::move(stored);
    column.scale = quantisation.step;
    column.offset = quantisation.low;
  } else {
    column.values = std::vector<float>(values.begin(), values.end());
  }
  return column;
}

class ColumnBuilder {
 public:
  ColumnBuilder(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks)
      : map_(map), landmarks_(landmarks) {}

  std::vector<Column> build() const {
    const std::string length = map_.info().length_unit == LengthUnit::kMetres ? "m" : "mapunits";
    std::vector<Column> columns;
    const bool observed = map_.has_observations();
    const auto observations =
        observed ? shown(observations_metric().evaluate(map_)) : std::vector<double>();
    // A metric is 0 if its value for the landmark is unknown.
    const auto distance =
        observed ? shown(distance_metric().evaluate(map_)) : std::vector<double>();
    const auto covariance =
        map_.has_covariances() ? shown(covariance_metric().evaluate(map_)) : std::vector<double>();
    if (observed) {
      columns.push_back({"observations", "Observations", std::nullopt, counts(observations)});
    }
    if (map_.has_covariances()) {
      columns.push_back(column_of("sigma", "Largest standard deviation", length, sigmas()));
    }
    if (observed) {
      std::vector<double> metres = distance;
      for (double& value : metres) value = value > 0.0 ? 1.0 / value - 1.0 : kNoValue;
      columns.push_back(column_of("distance", "Mean distance of the cameras", length, metres));
    }
    if (map_.has_covariances()) {
      columns.push_back(
          column_of("covariance_confidence", "Confidence by covariance", std::nullopt, covariance));
    }
    if (observed) {
      columns.push_back({"observations_confidence", "Confidence by observations", std::nullopt,
                         counts(observations)});
      columns.push_back(
          column_of("distance_confidence", "Confidence by distance", std::nullopt, distance));
    }
    return columns;
  }

 private:
  std::vector<double> shown(const std::vector<double>& all) const {
    std::vector<double> values;
    values.reserve(landmarks_.size());
    for (const LandmarkIndex landmark : landmarks_) values.push_back(all[landmark.value]);
    return values;
  }

  std::vector<double> sigmas() const {
    std::vector<double> values;
    values.reserve(landmarks_.size());
    for (const LandmarkIndex landmark : landmarks_) {
      const auto covariance = map_.covariance(landmark);
      values.push_back(covariance ? std::sqrt(spectral_norm(*covariance)) : kNoValue);
    }
    return values;
  }

  const LandmarkMap& map_;
  std::span<const LandmarkIndex> landmarks_;
};

std::vector<std::uint8_t> colors_of(const LandmarkMap& map,
                                    std::span<const LandmarkIndex> landmarks) {
  std::vector<std::uint8_t> colors;
  if (map.landmarks().colors.empty()) return colors;
  colors.reserve(3 * landmarks.size());
  for (const LandmarkIndex landmark : landmarks) {
    const Color color = map.landmarks().colors[landmark.value].value_or(
        Color{kUnknownColor, kUnknownColor, kUnknownColor});
    colors.insert(colors.end(), {color.red, color.green, color.blue});
  }
  return colors;
}

// std::nullopt for a map without Gaussian splats.
std::optional<Ellipsoids> ellipsoids_of(const LandmarkMap& map,
                                        std::span<const LandmarkIndex> landmarks) {
  if (!splat_columns(map.landmarks().columns)) return std::nullopt;
  std::vector<double> logarithms;  // of the largest deviations, to base 2
  for (const LandmarkIndex landmark : landmarks) {
    const auto covariance = map.covariance(landmark);
    const double variance = covariance ? spectral_norm(*covariance) : 0.0;
    logarithms.push_back(variance > 0.0 ? 0.5 * std::log2(variance) : kNoValue);
  }
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : logarithms) {
    low = std::fmin(low, value);
    high = std::fmax(high, value);
  }
  if (!(low <= high)) return std::nullopt;
  constexpr double kOctaves = 24.0;  // what is smaller is no more than a point beside the largest
  const auto quantisation = Quantisation::over<std::uint8_t>(std::max(low, high - kOctaves), high);
  Ellipsoids result;
  result.scale = quantisation.step;
  result.offset = quantisation.low;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    constexpr double kLargest = std::numeric_limits<std::int8_t>::max();
    const bool is_known = logarithms[i] >= high - kOctaves;  // false if it is not a number
    const Eigen::Matrix3d c =
        is_known ? Eigen::Matrix3d(*map.covariance(landmarks[i]) * std::exp2(-2.0 * logarithms[i]))
                 : Eigen::Matrix3d::Zero();
    for (const double entry : {c(0, 0), c(1, 1), c(2, 2), c(0, 1), c(0, 2), c(1, 2)}) {
      result.covariances.push_back(
          static_cast<std::int8_t>(std::lround(kLargest * std::clamp(entry, -1.0, 1.0))));
    }
    result.sigmas.push_back(is_known ? quantisation.stored<std::uint8_t>(logarithms[i])
                                     : std::uint8_t{0});
  }
  return result;
}

// Empty if the ids equal the positions in the list.
std::vector<std::uint64_t> unless_counting(std::vector<std::uint64_t> ids) {
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] != i) return ids;
  }
  return {};
}

std::optional<Frames> frames_of(const LandmarkMap& map) {
  if (map.frame_count() == 0) return std::nullopt;
  Frames frames;
  std::vector<std::uint64_t> ids;
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    frames.world_from_camera.push_back(map.world_from_camera(FrameIndex{i}));
    ids.push_back(map.frames().ids[i].value);
  }
  frames.ids = unless_counting(std::move(ids));
  for (const auto& timestamp : map.frames().timestamps_s) {
    frames.timestamps_s.push_back(timestamp.value_or(kNoValue));
  }
  frames.frustum = frustum_of(map);
  return frames;
}

}  // namespace

Map make_map(const LandmarkMap& map, const MapOptions& options) {
  const std::vector<LandmarkIndex> landmarks =
      options.landmarks ? *options.landmarks : all_landmarks(map);
  Map result;
  result.id = options.id;
  result.name = options.name;
  result.length_unit = map.info().length_unit;
  result.count = landmarks.size();
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::uint64_t> ids;
  positions.reserve(landmarks.size());
  ids.reserve(landmarks.size());
  for (const LandmarkIndex landmark : landmarks) {
    if (landmark.value >= map.landmark_count()) {
      throw Error(ErrorKind::kMisuse, "MapOptions.landmarks", fmt::format("{}", landmark.value),
                  fmt::format("one of {} landmarks", map.landmark_count()));
    }
    positions.push_back(map.landmarks().positions[landmark.value]);
    ids.push_back(map.landmarks().ids[landmark.value].value);
  }
  set_positions(positions, result);
  result.ids = unless_counting(std::move(ids));
  result.columns = ColumnBuilder(map, landmarks).build();
  result.colors = colors_of(map, landmarks);
  result.ellipsoids = ellipsoids_of(map, landmarks);
  result.frames = frames_of(map);
  if (result.frames) result.frames->images = options.images;
  return result;
}

std::optional<Frustum> frustum_of(const LandmarkMap& map) {
  for (const auto& camera : map.frames().cameras) {
    if (!camera) continue;
    const Camera& model = map.cameras()[camera->value];
    const Intrinsics lens = intrinsics(model);
    return Frustum{0.5 * model.width / lens.fx, 0.5 * model.height / lens.fy};
  }
  return std::nullopt;
}

std::optional<Eigen::Vector3d> up_of(const LandmarkMap& map) {
  const auto& gravity = map.info().gravity;
  return gravity ? std::optional<Eigen::Vector3d>(-*gravity) : std::nullopt;
}

}  // namespace cairn::report::detail
