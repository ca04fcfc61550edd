// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include <Eigen/Core>

#include "cairn/map/camera.hpp"

namespace cairn {

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
