// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cairn/map/common_images.hpp"
#include "cairn/merging/detail/association.hpp"
#include "cairn/merging/fusion/fuse_maps.hpp"

namespace cairn::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;

inline bool is_known(const Matrix3d& covariance) {
  return !std::isnan(covariance(0, 0));
}

// A map's landmarks in the world frame. Covariances are zero if unknown.
struct WorldLandmarks {
  std::vector<Vector3d> positions;
  std::vector<Matrix3d> covariances;
};

// A landmark of a map that is part of a fused landmark.
struct Member {
  std::uint32_t map = 0;
  std::uint32_t landmark = 0;
  double probability = 1.0;  // probability that it is the same as the earlier members
  std::uint32_t previous = kNoMember;

  static constexpr std::uint32_t kNoMember = std::numeric_limits<std::uint32_t>::max();
};

// An estimate of a position. The uncertainty of a map's pose moves all landmarks of the map together, so it does not
// affect their weights.
struct Estimate {
  Vector3d position;
  Matrix3d covariance;  // for the weights of landmarks
  Matrix3d
      compared;  // for comparisons: with the uncertainty of the poses relative to the largest map
  Matrix3d stated;  // includes the uncertainty of the poses in the world
};

// Unit, gravity, frame and georeference of maps in the world.
MapInfo info_of_world(std::span<const PlacedMap> maps);

// The fused map under construction.
class Fusion {
 public:
  Fusion(std::span<const PlacedMap> maps, const FusionOptions& options, const Execution& execution);

  FusionResult run();

 private:
  void add(std::size_t m);
  CameraIndex add_camera(Camera camera, bool is_mounted);
  std::vector<CameraIndex> add_cameras(std::size_t m);
  void add_frames(std::size_t m);
  void drop_unused_cameras();
  void tell_images_apart();
  std::vector<std::optional<FrameIndex>> known_images_of(std::size_t m);
  void log_common_images(std::size_t k, std::size_t m, const CommonImages& common) const;
  std::optional<FrameIndex> known_frame(std::size_t m, std::uint32_t i,
                                        std::optional<CameraIndex> camera) const;
  AssociationResult with_identities(std::size_t m, AssociationResult association) const;
  bool repeats_another(std::size_t m, const AssociationResult& association);
  void estimate_variances(std::size_t m, const AssociationResult& association);
  double share_of_own(std::uint32_t map, std::uint32_t landmark, std::uint32_t earlier) const;
  Estimate estimate(std::uint32_t landmark) const;
  void count_fused();
  void append(std::size_t m, std::uint32_t i);
  void set_positions();
  void take_looks(std::size_t m, std::uint32_t i, std::uint32_t landmark);
  void take_further(const DescriptorColumn& theirs, std::uint32_t i, std::uint32_t landmark);
  void set_further();
  void set_columns();
  std::vector<std::vector<bool>> repeated_observations() const;
  void set_observations();
  std::string frames_line(std::size_t m) const;
  // The folder of a map's images; without blanks, because COLMAP ends a name at a blank.
  std::string image_folder(std::size_t m) const {
    std::string folder = maps_[m].name + "/";
    std::replace(folder.begin(), folder.end(), ' ', '_');
    return folder;
  }
  std::string image_name(std::size_t m, const std::string& name) const {
    return has_prefix_[m] && !name.empty() ? image_folder(m) + name : name;
  }
  std::string fused_name(std::size_t m, const std::string& name) const;
  void set_info();

  bool has_covariance(std::size_t m, std::uint32_t i) const {
    const auto& covariances = maps_[m].map->landmarks().covariances;
    return !covariances.empty() && is_known(covariances[i]);
  }

  std::span<const PlacedMap> maps_;
  const FusionOptions& options_;
  const Execution& execution_;
  std::vector<std::size_t> order_;  // in which maps are added, whatever the order of the input
  FusionResult result_;
  MapTables tables_;
  std::vector<WorldLandmarks> world_;  // by map
  // By map: variance of its landmarks that their covariances do not explain. Unknown until another map has the same
  // landmarks.
  std::vector<std::optional<double>> variances_;
  std::vector<std::size_t>
      original_;  // by map: the first one with the same landmarks or observations, mostly itself
  std::vector<std::size_t> rank_;  // by map: its place in order_
  std::vector<Member> members_;
  std::vector<std::uint32_t> last_member_;  // per fused landmark
  std::vector<Vector3d> positions_;         // of the fused landmarks, so far
  std::vector<Matrix3d> covariances_;       // with the variances
  bool has_colors_ = false;
  // Per fused landmark: observations of the member that gave its descriptor.
  std::vector<std::uint32_t> best_observed_;
  bool has_further_ = false;  // whether a map has several descriptors of a landmark
  // If so, per fused landmark: bytes of all its descriptors.
  std::vector<std::vector<std::uint8_t>> descriptors_;
  std::vector<std::vector<std::uint32_t>> landmark_of_;  // by map and landmark of the map
  // Landmarks of two maps that keypoints of common images show to be the same.
  struct Identities {
    std::size_t earlier;
    std::size_t later;
    std::vector<std::pair<LandmarkIndex, LandmarkIndex>> landmarks;
  };
  std::vector<Identities> identities_;
  std::vector<MapImages> images_;          // by map
  std::vector<bool> is_mounted_;           // by camera: whether it belongs to a rig
  std::uint32_t instants_ = 0;             // number of instants of all maps; each map keeps its own
  std::vector<bool> is_shared_;            // by frame: whether two maps have it
  std::vector<std::size_t> map_of_frame_;  // by frame: map whose pose it has
  std::vector<std::size_t> map_of_camera_;  // by frame: map whose camera it has, if any
  // By map: whether its image names begin with the map's name.
  std::vector<bool> has_prefix_;
  std::vector<std::uint32_t> from_map_;
  std::vector<std::uint32_t> from_landmark_;  // index
  std::vector<std::uint32_t> parts_;
};

}  // namespace cairn::detail
