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

namespace detail {
struct Lens;
}  // namespace detail

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
  /// COLMAP's name of a model in `camera_models()`.
  std::string model;
  std::uint32_t width = 0;   ///< pixels
  std::uint32_t height = 0;  ///< pixels
  /// In the order of CameraModel::parameters.
  std::vector<double> parameters;

  friend bool operator==(const Camera&, const Camera&) = default;
};

/// A camera model: its name and the names of its parameters, in order.
struct CameraModel {
  std::string_view name;
  std::vector<std::string_view> parameters;
};

/// All models, in the order of their ids in COLMAP, from 0.
std::span<const CameraModel> camera_models();
/// The model of this name; null if there is none.
const CameraModel* camera_model(std::string_view name);

/// The defect of `camera` (unknown model, wrong number of parameters, a parameter that is not
/// finite or out of its range, no size); empty if it has none.
std::string camera_defect(const Camera& camera);

/// Whether model, size and parameters are equal.
bool is_same_lens(const Camera& a, const Camera& b);

/// Affine map from the image plane to pixels: u = fx·x + cx, v = fy·y + cy. fx and fy are the focal
/// lengths on the optical axis, and (cx, cy) is the principal point.
struct Intrinsics {
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  ///< pixels
};

/// Intrinsics of `camera`, which must have no defect.
Intrinsics intrinsics(const Camera& camera);

/// Pixel of a point in camera coordinates (x right, y down, z forward), possibly outside the image;
/// std::nullopt if the model cannot project the point. Perspective models project points in front
/// of the camera. Wide-angle models (fisheyes, EUCM, DIVISION) project all directions where their
/// formula is invertible; EQUIRECTANGULAR projects all directions. `camera` must have no defect.
std::optional<Pixel> project(const Camera& camera, const Eigen::Vector3d& x_in_camera);

/// Reprojection error of a point in pixels: projection minus observation, in a panorama the shorter
/// way round. std::nullopt as for project().
std::optional<Eigen::Vector2d> reprojection(const Camera& camera,
                                            const Eigen::Vector3d& x_in_camera,
                                            const Pixel& observed);

/// The inverse of project(): the bearing of `pixel`, a unit vector in camera coordinates that
/// projects within 1e-3 pixels of `pixel`. std::nullopt if the pixel has no bearing, e.g. because
/// the distortion folds the image. `camera` must have no defect.
/// @param near initial guess, e.g. the bearing of the neighbouring pixel; saves iterations
std::optional<Eigen::Vector3d> unproject(const Camera& camera, const Pixel& pixel,
                                         const Eigen::Vector3d& near = Eigen::Vector3d::UnitZ());

/// project() for very many points of one camera model, with a single look-up by name.
class CameraProjection {
 public:
  /// @throws Error (misuse) for an unknown model or a wrong number of parameters
  explicit CameraProjection(const Camera& camera);

  /// As project(), with these `parameters` in the model's number and order.
  std::optional<Pixel> operator()(const double* parameters,
                                  const Eigen::Vector3d& x_in_camera) const;
  /// `to` minus `from` in pixels; in a panorama the shorter way round.
  Eigen::Vector2d difference(const double* parameters, const Pixel& to, const Pixel& from) const;
  /// Number of leading focal lengths in the parameters; the principal point follows, then
  /// distortion. 0 for a panorama: its parameters are the image size.
  int focal_lengths() const;

 private:
  const detail::Lens* lens_;
};

}  // namespace cairn
