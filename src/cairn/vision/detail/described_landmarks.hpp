// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// How the keyframes of a map saw a landmark, compared with a camera at another place.
struct Sight {
  double cosine = 1.0;  ///< of the smallest angle between lines of sight; 1 if unknown
  bool alike = false;   ///< a keyframe saw it from nearly the same direction and distance
};

/// The landmarks of a map that have descriptors, prepared for comparison with images.
class DescribedLandmarks {
 public:
  /// @param map map with descriptors
  explicit DescribedLandmarks(const LandmarkMap& map);

  std::size_t size() const { return indices_.size(); }
  LandmarkIndex index(std::uint32_t i) const { return LandmarkIndex{indices_[i]}; }
  const Eigen::Vector3d& position(std::uint32_t i) const { return positions_[i]; }
  /// Covariance of the position; zero if unknown.
  const Eigen::Matrix3d& covariance(std::uint32_t i) const { return covariances_[i]; }

  /// All descriptors, one per row, with those of a landmark together; and the landmark of each row.
  std::span<const std::uint8_t> descriptors() const { return bytes_; }
  std::span<const std::uint32_t> owners() const { return owners_; }
  /// The rows of a landmark: from row_begin(i) to row_begin(i + 1).
  std::size_t row_begin(std::uint32_t i) const { return begins_[i]; }
  std::span<const std::uint8_t> rows(std::uint32_t i) const {
    return std::span(bytes_).subspan(begins_[i] * bytes_each_,
                                     (begins_[i + 1] - begins_[i]) * bytes_each_);
  }

  /// The frames that see a landmark. Empty if the map has no observations.
  std::span<const std::uint32_t> frames_of(std::uint32_t i) const { return frames_of_.row(i); }
  /// The landmarks with descriptors that a frame sees.
  std::span<const std::uint32_t> seen_in(std::uint32_t frame) const { return seen_in_.row(frame); }
  std::size_t frames() const { return centres_.size(); }
  Sight sight(std::uint32_t i, const Eigen::Vector3d& centre) const;

  /// Factor that lengths were multiplied by, so that limits in metres are valid; 1 if the map is in
  /// metres.
  double scale() const { return scale_; }

 private:
  struct Rows {
    std::vector<std::size_t> begins = {0};
    std::vector<std::uint32_t> values;
    std::span<const std::uint32_t> row(std::size_t i) const {
      if (i + 1 >= begins.size()) return {};
      return std::span(values).subspan(begins[i], begins[i + 1] - begins[i]);
    }
  };

  void add_frames(const LandmarkMap& map);
  void set_scale(double scale);

  std::vector<std::uint32_t> indices_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Eigen::Matrix3d> covariances_;
  std::size_t bytes_each_ = 1;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint32_t> owners_;
  std::vector<std::size_t> begins_ = {0};
  Rows frames_of_;
  Rows seen_in_;
  std::vector<Eigen::Vector3d> centres_;  // of the frames
  double scale_ = 1.0;
};

}  // namespace cairn::detail
