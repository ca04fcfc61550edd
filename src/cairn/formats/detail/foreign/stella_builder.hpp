// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"

// Shared by the readers of stella_vslam's two file formats.
namespace cairn::detail {

inline constexpr std::size_t kOrbBytes = 32;

struct StellaCamera {
  std::string model_type;  ///< "Perspective", "Fisheye", "Equirectangular", "RadialDivision"
  std::string setup_type;  ///< "Monocular", "Stereo", "RGBD"
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::optional<double> fx, fy, cx, cy;
  Distortion distortion;
  double division = 0.0;  ///< parameter of "RadialDivision"
};

struct StellaKeyframe {
  std::uint64_t id = 0;
  std::optional<double> timestamp_s;
  std::string camera;
  Eigen::Quaterniond rotation_cw = Eigen::Quaterniond::Identity();  ///< of any nonzero norm
  Eigen::Vector3d translation_cw = Eigen::Vector3d::Zero();
  std::vector<Pixel> undistorted;
  std::vector<std::int32_t> octaves;  ///< one per keypoint, or empty
  std::vector<float> depths;          ///< one per keypoint, or empty; unknown unless positive
  std::vector<std::array<std::uint8_t, kOrbBytes>> descriptors;  ///< one per keypoint, or empty
};

/// Both coordinates of the centre of the top-left pixel of an equirectangular image, where coordinates are proportional
/// to the angles. In stella_vslam's other images, both coordinates are 0.
inline constexpr double kStellaPanorama = 0.5;

/// Builds a map from parts in any order.
class StellaBuilder {
 public:
  StellaBuilder(const std::string& name, const Execution& execution);

  void add_camera(const std::string& name, const StellaCamera& camera);
  /// @param landmarks landmark id of each keypoint, negative for none; may be empty
  /// @return the keyframe's defect; empty if valid
  std::string add_keyframe(const StellaKeyframe& keyframe,
                           const std::vector<std::int64_t>& landmarks);
  void add_landmark(std::uint64_t id, const Eigen::Vector3d& position,
                    std::optional<double> visible, std::optional<double> found);
  LandmarkMap finish() &&;

 private:
  std::optional<Camera> lens_of(const StellaCamera& camera) const;
  bool place_cameras();
  void distort_pixels();

  SfmBuilder out_;
  std::map<std::string, StellaCamera> cameras_;
  std::vector<std::string> camera_of_frame_;
  NamedColumn visible_{"visible", {}};
  NamedColumn found_{"found", {}};
  std::size_t unusable_depths_ = 0;
};

}  // namespace cairn::detail
