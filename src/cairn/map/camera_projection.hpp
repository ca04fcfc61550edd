// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include <Eigen/Core>

#include "cairn/map/camera.hpp"

namespace cairn {

/// project() of one camera model, which is looked up by its name once: for those who project by the million.
class CameraProjection {
 public:
  /// @throws Error (misuse) for a camera with a model or a number of parameters that there is not
  explicit CameraProjection(const Camera& camera);

  /// As project(), of a camera of that model with these parameters; as many as the model has.
  std::optional<Pixel> operator()(const double* parameters,
                                  const Eigen::Vector3d& x_in_camera) const;
  /// With how many focal lengths its parameters begin; the optical axis' pixel follows, then distortion.
  int focal_lengths() const { return focal_lengths_; }

 private:
  using Distortion = Eigen::Vector2d (*)(const Eigen::Vector2d& normalised,
                                         const double* parameters);
  Distortion distort_;
  int focal_lengths_;  // 1: fx = fy
};

}  // namespace cairn
