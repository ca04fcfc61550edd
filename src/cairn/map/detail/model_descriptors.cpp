// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/detail/model_descriptors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kMostOfLandmark = 8;  // descriptors to compare
constexpr std::size_t kUnset = std::numeric_limits<std::size_t>::max();

}  // namespace

ModelDescriptors::ModelDescriptors(const LandmarkMap& model,
                                   const std::function<bool(LandmarkIndex)>& has_descriptor)
    : model_(model) {
  const ObservationTable& observations = model_.observations();
  wanted_.resize(model_.frame_count());
  if (observations.keypoints.empty()) return;
  first_.push_back(0);
  for (std::uint32_t i = 0; i < model_.landmark_count(); ++i) {
    const std::uint64_t first = observations.offsets[i];
    const std::uint64_t end = has_descriptor && !has_descriptor(LandmarkIndex{i})
                                  ? first
                                  : std::min(observations.offsets[i + 1], first + kMostOfLandmark);
    for (std::uint64_t k = first; k < end; ++k) {
      if (!observations.keypoints[k]) continue;
      wanted_[observations.frames[k].value].push_back(
          {places_.size(), *observations.keypoints[k], observations.pixels[k]});
      places_.push_back(kUnset);
    }
    first_.push_back(places_.size());
  }
}

bool ModelDescriptors::are_near(
    FrameIndex frame,
    const std::function<std::optional<Pixel>(std::uint32_t keypoint)>& pixel) const {
  const auto& cameras = model_.frames().cameras;
  const auto camera = cameras.empty() ? std::nullopt : cameras[frame.value];
  const double most = camera ? 0.05 * model_.cameras()[camera->value].width : 50.0;
  std::size_t near = 0;
  for (const Wanted& one : wanted(frame)) {
    const auto at = pixel(one.keypoint);
    if (at && std::hypot(at->u - one.pixel.u, at->v - one.pixel.v) <= most) ++near;
  }
  return 2 * near >= wanted(frame).size();
}

void ModelDescriptors::set(const Wanted& wanted, std::span<const std::uint8_t> descriptor) {
  std::size_t& place = places_[wanted.rank];
  if (place == kUnset) {
    place = bytes_.size();
    bytes_.resize(place + descriptor.size());
  }
  std::copy(descriptor.begin(), descriptor.end(),
            bytes_.begin() + static_cast<std::ptrdiff_t>(place));
}

void ModelDescriptors::set(const Wanted& wanted, std::span<const float> descriptor) {
  constexpr float kMost = 1e6F;
  const bool are_finite = std::ranges::all_of(
      descriptor, [](float value) { return std::isfinite(value) && std::abs(value) < kMost; });
  const bool any = std::ranges::any_of(descriptor, [](float value) { return value != 0.0F; });
  if (are_finite && any) set(wanted, descriptor_bytes(descriptor));
}

std::optional<DescriptorColumn> ModelDescriptors::column(std::string kind,
                                                         std::size_t bytes_each) const {
  if (bytes_.empty()) return std::nullopt;
  const DescriptorNorm norm = is_binary(kind) ? DescriptorNorm::kHamming : DescriptorNorm::kSquared;
  DescriptorColumn column{std::move(kind), bytes_each, {}, {}};
  std::vector<std::span<const std::uint8_t>> of_landmark;
  for (std::size_t i = 0; i < model_.landmark_count(); ++i) {
    of_landmark.clear();
    for (std::size_t rank = first_[i]; rank < first_[i + 1]; ++rank) {
      if (places_[rank] == kUnset) continue;
      of_landmark.push_back(std::span(bytes_).subspan(places_[rank], bytes_each));
    }
    append_distinct(column, of_landmark, norm);
  }
  return column;
}

}  // namespace cairn::detail
