// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/prepared_map.hpp"

#include <mutex>
#include <utility>

#include "cairn/map/operations.hpp"

namespace cairn {

class PreparedMap::Parts {
 public:
  Parts(const LandmarkMap& map, const PrepareOptions& options)
      : seed_(options.seed), executor_(options.executor) {
    parts_ = cut_into_parts(map, options.points, options.cut);
    if (parts_.size() < 2) parts_.clear();
    std::vector<std::uint32_t> of_landmark(map.landmark_count(),
                                           static_cast<std::uint32_t>(parts_.size()));
    for (std::uint32_t i = 0; i < parts_.size(); ++i) {
      for (const LandmarkIndex landmark : parts_[i].landmarks) of_landmark[landmark.value] = i;
    }
    for (const LandmarkIndex landmark : landmarks_to_align(map, options.points)) {
      part_of_.push_back(of_landmark[landmark.value]);
    }
    for (const MapPart& part : parts_) {
      clouds_.push_back(
          landmark_cloud(with_landmarks(map, part.landmarks), options.confidence, options.points));
    }
  }

  std::span<const std::uint32_t> part_of() const { return part_of_; }
  std::span<const PreparedPart> prepared() {
    std::call_once(once_, [&] {
      for (std::size_t i = 0; i < parts_.size(); ++i) {
        prepared_.push_back(
            {std::move(parts_[i]), PreparedCloud(std::move(clouds_[i]), seed_, executor_, "part")});
      }
      clouds_.clear();
    });
    return prepared_;
  }

 private:
  std::uint64_t seed_;
  Executor executor_;
  std::once_flag once_;
  std::vector<std::uint32_t> part_of_;
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

}  // namespace cairn
