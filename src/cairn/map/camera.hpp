// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/ids.hpp"

namespace cairn {

/// An image point: u to the right, v down, in pixels; the centre of the top-left pixel is (0, 0), as in
/// OpenCV.
struct Pixel {
  double u = 0.0;
  double v = 0.0;

  friend bool operator==(const Pixel&, const Pixel&) = default;
};

/// The intrinsics of one camera.
struct Camera {
  CameraId id;
  /// A model of `camera_models()`, with COLMAP's name.
  std::string model;
  std::uint32_t width = 0;   ///< pixels
  std::uint32_t height = 0;  ///< pixels
  /// As many as the model has, in its order.
  std::vector<double> parameters;

  friend bool operator==(const Camera&, const Camera&) = default;
};

/// A camera model: its name and the names of its parameters, in order.
struct CameraModel {
  std::string_view name;
  std::vector<std::string_view> parameters;
};

/// All models Cairn can project with.
std::span<const CameraModel> camera_models();

/// The defect of `camera` (unknown model, wrong number of parameters, a focal length that is not positive,
/// a parameter that is not finite, no size); empty if it has none.
std::string camera_defect(const Camera& camera);

/// The parameters that every model has: focal lengths and principal point.
struct Intrinsics {
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  ///< pixels
};

/// Intrinsics of `camera`, which must have no defect.
Intrinsics intrinsics(const Camera& camera);

/// Pixel of a point in camera coordinates (x right, y down, z forward), also outside the image;
/// std::nullopt if the point is not in front of the camera. `camera` must have no defect.
std::optional<Pixel> project(const Camera& camera, const Eigen::Vector3d& x_in_camera);

/// The inverse of project: the (x, y) for which (x, y, 1) in camera coordinates projects to `pixel`, to
/// 1e-3 pixels. std::nullopt if no line of sight belongs to the pixel because the distortion folds the
/// image. `camera` must have no defect.
/// @param near a nearby solution, e.g. of the neighbouring pixel; saves iterations
std::optional<Eigen::Vector2d> unproject(const Camera& camera, const Pixel& pixel,
                                         const Eigen::Vector2d& near = Eigen::Vector2d::Zero());

/// project() of one camera model, looked up by name once, for very many projections.
class CameraProjection {
 public:
  /// @throws Error (misuse) for an unknown model or a wrong number of parameters
  explicit CameraProjection(const Camera& camera);

  /// As project(), with these parameters; as many as the model has.
  std::optional<Pixel> operator()(const double* parameters,
                                  const Eigen::Vector3d& x_in_camera) const;
  /// Number of focal lengths with which the parameters begin; the principal point follows, then distortion.
  int focal_lengths() const { return focal_lengths_; }

 private:
  using Distortion = Eigen::Vector2d (*)(const Eigen::Vector2d& normalised,
                                         const double* parameters);
  Distortion distort_;
  int focal_lengths_;  // 1: fx = fy
};

}  // namespace cairn
