// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/prepared_map.hpp"

#include <algorithm>
#include <mutex>
#include <utility>

#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

// The most observed of some landmarks, in their order.
std::vector<LandmarkIndex> most_observed(const LandmarkMap& map,
                                         const std::vector<LandmarkIndex>& landmarks,
                                         std::size_t count) {
  if (landmarks.size() <= count) return landmarks;
  std::vector<LandmarkIndex> chosen = landmarks;
  const auto before = [&](LandmarkIndex a, LandmarkIndex b) {
    const std::size_t of_a = map.observing_frames(a).size();
    const std::size_t of_b = map.observing_frames(b).size();
    return of_a != of_b ? of_a > of_b : a < b;
  };
  std::nth_element(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(count),
                   chosen.end(), before);
  chosen.resize(count);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

}  // namespace

class PreparedMap::Parts {
 public:
  Parts(const LandmarkMap& map, const PrepareOptions& options) : seed_(options.seed) {
    parts_ = cut_into_parts(map, options.points, options.cut);
    if (parts_.size() < 2) parts_.clear();
    std::vector<std::uint32_t> of_landmark(map.landmark_count(),
                                           static_cast<std::uint32_t>(parts_.size()));
    std::vector<FrameId> middles;
    for (std::uint32_t i = 0; i < parts_.size(); ++i) {
      for (const LandmarkIndex landmark : parts_[i].landmarks) of_landmark[landmark.value] = i;
      middles.push_back(parts_[i].middle);
    }
    AlongParts of_map;
    if (!parts_.empty()) of_map = along_parts(map, middles);
    for (const LandmarkIndex landmark : landmarks_to_align(map, options.points)) {
      part_of_.push_back(of_landmark[landmark.value]);
      if (!parts_.empty()) along_.landmarks.push_back(of_map.landmarks[landmark.value]);
    }
    along_.keyframes = std::move(of_map.keyframes);
    along_.centre = of_map.centre;
    for (const MapPart& part : parts_) {
      clouds_.push_back(landmark_cloud(
          with_landmarks(map, most_observed(map, part.landmarks, options.cut.placed)),
          options.confidence, options.points));
    }
  }

  std::span<const std::uint32_t> part_of() const { return part_of_; }
  const AlongParts& along() const { return along_; }
  std::span<const PreparedPart> prepared() {
    std::call_once(once_, [&] {
      for (std::size_t i = 0; i < parts_.size(); ++i) {
        // On this thread only, because executing other tasks here could deadlock.
        prepared_.push_back({std::move(parts_[i]),
                             PreparedCloud(std::move(clouds_[i]), seed_, Executor(), "part")});
      }
      clouds_.clear();
    });
    return prepared_;
  }

 private:
  std::uint64_t seed_;
  std::once_flag once_;
  std::vector<std::uint32_t> part_of_;
  AlongParts along_;
  std::vector<MapPart> parts_;
  std::vector<LandmarkCloud> clouds_;
  std::vector<PreparedPart> prepared_;
};

PreparedMap::PreparedMap(const LandmarkMap& map, const PrepareOptions& options)
    : cloud_(landmark_cloud(map, options.confidence, options.points), options.seed,
             options.executor),
      length_unit_(map.info().length_unit),
      gravity_(map.info().gravity),
      parts_(std::make_shared<Parts>(map, options)) {}

std::span<const PreparedPart> PreparedMap::parts() const {
  return parts_->prepared();
}

std::span<const std::uint32_t> PreparedMap::part_of() const {
  return parts_->part_of();
}

const AlongParts& PreparedMap::along() const {
  return parts_->along();
}

}  // namespace cairn
