// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/prepared_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/detail/bends/map_drift.hpp"
#include "cairn/alignment/detail/bends/map_parts.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/map/common_images.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

constexpr std::size_t kViews = 24;         // of a map; more add little information
constexpr std::size_t kFewestInView = 20;  // landmarks; fewer do not show what a camera saw

// Views of keyframes that are evenly spread over the keyframes with enough landmarks.
std::vector<LandmarkView> views_of(const LandmarkMap& map, std::span<const LandmarkIndex> kept) {
  if (!map.has_observations()) return {};
  std::vector<LandmarkView> all(map.frame_count());
  for (std::uint32_t i = 0; i < kept.size(); ++i) {
    for (const FrameIndex frame : map.observing_frames(kept[i])) {
      all[frame.value].landmarks.push_back(i);
    }
  }
  std::vector<std::uint32_t> seeing;
  for (std::uint32_t frame = 0; frame < all.size(); ++frame) {
    if (all[frame].landmarks.size() >= kFewestInView) seeing.push_back(frame);
  }
  std::vector<LandmarkView> views;
  const std::size_t count = std::min(kViews, seeing.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t frame = seeing[(2 * i + 1) * seeing.size() / (2 * count)];
    views.push_back(std::move(all[frame]));
    views.back().centre = map.frames().translations[frame];
    views.back().frame = FrameIndex{frame};
  }
  return views;
}

// Luma of ITU-R BT.601; NaN without a colour.
double lightness_of(const std::optional<Color>& color) {
  if (!color) return std::numeric_limits<double>::quiet_NaN();
  return 0.299 * color->red + 0.587 * color->green + 0.114 * color->blue;
}

// Validates the further descriptors, after the other columns.
void validate_further(const DescriptorColumn& descriptors, std::string_view name) {
  const auto& offsets = descriptors.further_offsets;
  const auto require = [&](bool valid, std::string_view what, std::string_view expected) {
    if (!valid) throw Error(ErrorKind::kMisuse, name, what, expected);
  };
  if (offsets.empty()) {
    require(descriptors.further.empty(), "further descriptors without offsets", "both or neither");
    return;
  }
  const std::size_t count = descriptors.known.size();
  require(offsets.size() == count + 1 && offsets.front() == 0 &&
              std::is_sorted(offsets.begin(), offsets.end()) &&
              offsets.back() == descriptors.further.size() / descriptors.bytes_each &&
              offsets.back() * descriptors.bytes_each == descriptors.further.size(),
          fmt::format("{} offsets of further descriptors of {} landmarks", offsets.size(), count),
          "ascending from 0 to their number, one more than there are landmarks");
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t further = offsets[i + 1] - offsets[i];
    require(further == 0 || (descriptors.known[i] != 0 && further < kMostDescriptorsEach),
            fmt::format("{} further descriptors of landmark {}", further, i),
            fmt::format("fewer than {}, and only if the first is known", kMostDescriptorsEach));
  }
}

}  // namespace

void LandmarkCloud::validate(std::string_view name) const {
  const auto require = [&](bool valid, std::string_view what, std::string_view expected) {
    if (!valid) throw Error(ErrorKind::kMisuse, name, what, expected);
  };
  require(covariances.empty() || covariances.size() == size(),
          fmt::format("{} covariances of {} landmarks", covariances.size(), size()),
          "one a landmark, or none");
  require(weights.empty() || weights.size() == size(),
          fmt::format("{} weights of {} landmarks", weights.size(), size()),
          "one a landmark, or none");
  require(lightness.empty() || lightness.size() == size(),
          fmt::format("{} values of lightness of {} landmarks", lightness.size(), size()),
          "one a landmark, or none");
  if (descriptors) {
    require(descriptors->known.size() == size() &&
                descriptors->bytes.size() == size() * descriptors->bytes_each,
            fmt::format("{} descriptors of {} landmarks", descriptors->known.size(), size()),
            "one a landmark, each of bytes_each bytes");
    require(descriptors->bytes_each >= 1 && descriptors->bytes_each <= kMostDescriptorBytes,
            fmt::format("descriptors of {} bytes", descriptors->bytes_each),
            fmt::format("1 to {} bytes", kMostDescriptorBytes));
    validate_further(*descriptors, name);
  }
  for (std::size_t i = 0; i < size(); ++i) {
    require(are_coordinates(positions[i]),
            fmt::format("position of landmark {} {}", i, coordinate_defect(positions[i])),
            kExpectedCoordinates);
    const std::string defect =
        covariances.empty() ? std::string() : landmark_covariance_defect(covariances[i]);
    require(defect.empty(), fmt::format("covariance of landmark {} is {}", i, defect),
            "a symmetric positive semi-definite matrix");
    require(weight(i) >= 0.0 && std::isfinite(weight(i)),
            fmt::format("weight of landmark {} is {}", i, weight(i)), "0 or a positive number");
  }
  for (const LandmarkView& view : views) {
    require(are_coordinates(view.centre),
            fmt::format("centre of a view {}", coordinate_defect(view.centre)),
            kExpectedCoordinates);
    for (const std::uint32_t landmark : view.landmarks) {
      require(landmark < size(), fmt::format("a view of landmark {} of {}", landmark, size()),
              "indices of landmarks");
    }
  }
}

LandmarkCloud scaled(LandmarkCloud cloud, double scale) {
  for (Eigen::Vector3d& position : cloud.positions) position *= scale;
  for (Eigen::Matrix3d& covariance : cloud.covariances) covariance *= scale * scale;
  for (LandmarkView& view : cloud.views) view.centre *= scale;
  return cloud;
}

LandmarkCloud landmark_cloud(const LandmarkMap& map, const std::optional<Metric>& weights,
                             const PointSetOptions& options) {
  PointSet points = point_set(map, weights, options);
  LandmarkCloud cloud;
  cloud.positions = std::move(points.positions);
  cloud.weights = std::move(points.confidences);
  for (double& weight : cloud.weights) weight = std::max(weight, 0.0);
  const double total = std::reduce(cloud.weights.begin(), cloud.weights.end());
  if (total > 0.0) {
    for (double& weight : cloud.weights) weight *= static_cast<double>(cloud.size()) / total;
  }
  const std::vector<LandmarkIndex> kept = landmarks_to_align(map, options);
  cloud.views = views_of(map, kept);
  if (map.landmarks().descriptors) {
    std::vector<std::uint32_t> rows;
    rows.reserve(kept.size());
    for (const LandmarkIndex landmark : kept) rows.push_back(landmark.value);
    cloud.descriptors = descriptor_rows(*map.landmarks().descriptors, rows);
  }
  const auto& colors = map.landmarks().colors;
  if (!colors.empty()) {
    cloud.lightness.reserve(cloud.size());
    for (const LandmarkIndex landmark : kept) {
      cloud.lightness.push_back(lightness_of(colors[landmark.value]));
    }
  }
  if (map.has_covariances()) {
    cloud.covariances.reserve(cloud.size());
    for (const LandmarkIndex landmark : kept) {
      cloud.covariances.push_back(
          map.covariance(landmark).value_or(Eigen::Matrix3d(Eigen::Matrix3d::Zero())));
    }
  }
  return cloud;
}

PreparedMap::PreparedMap(LandmarkCloud cloud, std::string_view name, const Execution& execution)
    : cloud_(std::make_shared<const detail::PreparedCloud>(std::move(cloud), execution.seed,
                                                           execution.executor, name)) {
  constexpr std::size_t kDense = 2 * detail::PreparedCloud::kSample;
  const LandmarkCloud& landmarks = cloud_->landmarks();
  if (landmarks.size() <= kDense || landmarks.descriptors || !landmarks.views.empty()) return;
  even_ = std::make_shared<const detail::PreparedCloud>(cloud_->even(execution.executor));
}

PreparedMap::PreparedMap(const LandmarkMap& map, const PrepareOptions& options,
                         const Execution& execution)
    : PreparedMap(landmark_cloud(map, options.confidence, options.points), "cloud", execution) {
  length_unit_ = map.info().length_unit;
  gravity_ = map.info().gravity;
  const std::vector<LandmarkIndex> given = landmarks_to_align(map, options.points);
  std::vector<LandmarkIndex> landmarks;  // in the order of the cloud
  std::vector<std::optional<LandmarkIndex>> in_cloud(map.landmark_count());
  for (std::uint32_t i = 0; i < given.size(); ++i) {
    landmarks.push_back(given[cloud_->as_given(i)]);
    in_cloud[landmarks.back().value] = LandmarkIndex{i};
  }
  MapImages images(map);
  if (!images.all().empty()) {
    images_ = std::make_shared<const MapImages>(std::move(images).renumbered(in_cloud));
  }
  detail::MapDrift drift(map, landmarks);
  if (!drift.empty()) drift_ = std::make_shared<const detail::MapDrift>(std::move(drift));
  parts_ = std::make_shared<detail::PreparedParts>(map, options, execution.seed);
}

}  // namespace cairn
