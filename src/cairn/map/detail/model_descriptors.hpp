// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn::detail {

/// Collects the descriptors of a model's landmarks from the features of its images: those of each landmark's first eight
/// observations that state their keypoint.
class ModelDescriptors {
 public:
  /// An observation whose descriptor is wanted.
  struct Wanted {
    std::size_t rank;  ///< among all that are wanted
    std::uint32_t keypoint;
    Pixel pixel;
  };

  /// @param model must outlive this
  /// @param has_descriptor whether a landmark can have one; by default all can
  explicit ModelDescriptors(const LandmarkMap& model,
                            const std::function<bool(LandmarkIndex)>& has_descriptor = {});

  const LandmarkMap& model() const { return model_; }
  std::span<const Wanted> wanted(FrameIndex frame) const { return wanted_[frame.value]; }

  /// Whether half of what is wanted of a frame is near the keypoints of its features. The keypoints of undistorted images
  /// are the same ones at slightly different positions.
  /// @param pixel of a keypoint, the centre of the top-left pixel being (0, 0); std::nullopt: unknown
  bool are_near(FrameIndex frame,
                const std::function<std::optional<Pixel>(std::uint32_t keypoint)>& pixel) const;

  /// @param descriptor of the same size as all others
  void set(const Wanted& wanted, std::span<const std::uint8_t> descriptor);
  /// Sets descriptor_bytes(). Does nothing if the numbers are not finite, or all zero.
  void set(const Wanted& wanted, std::span<const float> descriptor);

  /// The column. std::nullopt if no descriptor was set.
  std::optional<DescriptorColumn> column(std::string kind, std::size_t bytes_each) const;

 private:
  const LandmarkMap& model_;
  std::vector<std::vector<Wanted>> wanted_;  // of each frame
  std::vector<std::size_t> first_;   // rank of each landmark's first wanted one, and the end
  std::vector<std::size_t> places_;  // of each rank, the start of its descriptor in bytes_
  std::vector<std::uint8_t> bytes_;
};

}  // namespace cairn::detail
