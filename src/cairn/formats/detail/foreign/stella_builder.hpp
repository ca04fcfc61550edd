// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/formats/detail/foreign/described_observations.hpp"
#include "cairn/formats/options.hpp"
#include "cairn/map/landmark_map.hpp"

// Shared by the readers of stella_vslam's two file formats. Private to cairn/interchange.
namespace cairn::detail {

inline constexpr std::size_t kOrbBytes = 32;

struct StellaCamera {
  std::string model_type;  ///< "Perspective", "Fisheye", "Equirectangular", "RadialDivision"
  std::string setup_type;  ///< "Monocular", "Stereo", "RGBD"
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::optional<double> fx, fy, cx, cy;
  double k1 = 0.0, k2 = 0.0, p1 = 0.0, p2 = 0.0, k3 = 0.0, k4 = 0.0;
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

/// Builds a map from parts in any order.
class StellaBuilder {
 public:
  StellaBuilder(std::string name, const MapReadOptions& options);

  void add_camera(const std::string& name, const StellaCamera& camera);
  /// @param landmarks landmark id of each keypoint, negative for none; may be empty
  /// @return the keyframe's defect; empty if valid
  std::string add_keyframe(const StellaKeyframe& keyframe,
                           const std::vector<std::int64_t>& landmarks);
  void add_landmark(std::uint64_t id, const Eigen::Vector3d& position,
                    std::optional<double> visible, std::optional<double> found);
  LandmarkMap finish() &&;

 private:
  struct Landmark {
    std::uint64_t id;
    Eigen::Vector3d position;
    double visible;
    double found;
  };
  struct Frame {
    std::uint64_t id;
    std::array<double, 4> quaternion;
    Eigen::Vector3d centre;
    std::optional<double> timestamp_s;
    std::string camera;
  };
  void lost(const std::string& text) const;
  std::vector<std::optional<CameraIndex>> place_cameras(MapTables& tables) const;

  std::string name_;
  const MapReadOptions& options_;
  std::map<std::string, StellaCamera> cameras_;
  std::vector<Frame> frames_;
  std::vector<Landmark> landmarks_;
  std::ptrdiff_t unusable_depths_ = 0;
  DescribedObservations observations_{kOrbBytes};  // FrameIndex: index into frames_
};

}  // namespace cairn::detail
