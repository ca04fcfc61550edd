// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/camera.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

using Distortion = Eigen::Vector2d (*)(const Eigen::Vector2d& normalised, const double* parameters);

Eigen::Vector2d undistorted(const Eigen::Vector2d& x, const double* /*parameters*/) {
  return x;
}

Eigen::Vector2d radial1(const Eigen::Vector2d& x, const double* k) {
  return x * (1.0 + k[0] * x.squaredNorm());
}

Eigen::Vector2d radial2(const Eigen::Vector2d& x, const double* k) {
  const double r2 = x.squaredNorm();
  return x * (1.0 + r2 * (k[0] + r2 * k[1]));
}

// Brown's model: radial factor, and tangential part with p1, p2.
Eigen::Vector2d brown(const Eigen::Vector2d& x, double radial, double p1, double p2) {
  const double r2 = x.squaredNorm();
  const double xy = x.x() * x.y();
  return x * radial + Eigen::Vector2d(2.0 * p1 * xy + p2 * (r2 + 2.0 * x.x() * x.x()),
                                      2.0 * p2 * xy + p1 * (r2 + 2.0 * x.y() * x.y()));
}

Eigen::Vector2d opencv(const Eigen::Vector2d& x, const double* d) {
  const double r2 = x.squaredNorm();
  return brown(x, 1.0 + r2 * (d[0] + r2 * d[1]), d[2], d[3]);
}

Eigen::Vector2d full_opencv(const Eigen::Vector2d& x, const double* d) {
  const double r2 = x.squaredNorm();
  const double above = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  const double below = 1.0 + r2 * (d[5] + r2 * (d[6] + r2 * d[7]));
  return brown(x, above / below, d[2], d[3]);
}

// Equidistant projection: the distance from the axis becomes the angle to it.
Eigen::Vector2d equidistant(const Eigen::Vector2d& x, const double* /*parameters*/) {
  const double r = x.norm();
  constexpr double kOnAxis = 1e-12;
  return r < kOnAxis ? x : Eigen::Vector2d(x * (std::atan(r) / r));
}

Eigen::Vector2d fisheye(const Eigen::Vector2d& x, const double* k) {
  const double r = x.norm();
  constexpr double kOnAxis = 1e-12;
  if (r < kOnAxis) return x;
  const double angle = std::atan(r);
  const double a2 = angle * angle;
  return x * (angle * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))) / r);
}

Eigen::Vector2d radial1_fisheye(const Eigen::Vector2d& x, const double* k) {
  return radial1(equidistant(x, k), k);
}

Eigen::Vector2d radial2_fisheye(const Eigen::Vector2d& x, const double* k) {
  return radial2(equidistant(x, k), k);
}

// Devernay and Faugeras 2001. The only parameter is the field of view; as it tends to 0, so does the
// distortion.
Eigen::Vector2d field_of_view(const Eigen::Vector2d& x, const double* omega) {
  const double r = x.norm();
  constexpr double kNone = 1e-9;
  if (r < kNone || std::abs(omega[0]) < kNone) return x;
  return x * (std::atan(r * 2.0 * std::tan(omega[0] / 2.0)) / (r * omega[0]));
}

// d: k1 k2 p1 p2 k3 k4 sx1 sy1.
Eigen::Vector2d thin_prism_fisheye(const Eigen::Vector2d& x, const double* d) {
  const Eigen::Vector2d y = equidistant(x, d);
  const double r2 = y.squaredNorm();
  const double radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * (d[4] + r2 * d[5])));
  return brown(y, radial, d[2], d[3]) + r2 * Eigen::Vector2d(d[6], d[7]);
}

struct Model {
  CameraModel description;
  int focal_lengths;  // 1: fx = fy
  Distortion distort;
};

const std::vector<Model>& models() {
  static const std::vector<Model> all = {
      {{"SIMPLE_PINHOLE", {"f", "cx", "cy"}}, 1, &undistorted},
      {{"PINHOLE", {"fx", "fy", "cx", "cy"}}, 2, &undistorted},
      {{"SIMPLE_RADIAL", {"f", "cx", "cy", "k"}}, 1, &radial1},
      {{"RADIAL", {"f", "cx", "cy", "k1", "k2"}}, 1, &radial2},
      {{"OPENCV", {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}}, 2, &opencv},
      {{"OPENCV_FISHEYE", {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}}, 2, &fisheye},
      {{"FULL_OPENCV", {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}},
       2,
       &full_opencv},
      {{"FOV", {"fx", "fy", "cx", "cy", "omega"}}, 2, &field_of_view},
      {{"SIMPLE_RADIAL_FISHEYE", {"f", "cx", "cy", "k"}}, 1, &radial1_fisheye},
      {{"RADIAL_FISHEYE", {"f", "cx", "cy", "k1", "k2"}}, 1, &radial2_fisheye},
      {{"THIN_PRISM_FISHEYE",
        {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"}},
       2,
       &thin_prism_fisheye},
      {{"SIMPLE_FISHEYE", {"f", "cx", "cy"}}, 1, &equidistant},
      {{"FISHEYE", {"fx", "fy", "cx", "cy"}}, 2, &equidistant},
  };
  return all;
}

const Model* find_model(std::string_view name) {
  const auto found = std::find_if(models().begin(), models().end(), [&](const Model& model) {
    return model.description.name == name;
  });
  return found == models().end() ? nullptr : &*found;
}

const Model& usable_model(const Camera& camera, std::string_view caller) {
  const Model* const model = find_model(camera.model);
  if (model == nullptr || camera.parameters.size() != model->description.parameters.size()) {
    throw Error(ErrorKind::kMisuse, caller, camera_defect(camera), "a camera without defect");
  }
  return *model;
}

}  // namespace

std::span<const CameraModel> camera_models() {
  static const std::vector<CameraModel> descriptions = [] {
    std::vector<CameraModel> result;
    for (const Model& model : models()) result.push_back(model.description);
    return result;
  }();
  return descriptions;
}

std::string camera_defect(const Camera& camera) {
  const Model* const model = find_model(camera.model);
  if (model == nullptr) {
    std::vector<std::string_view> names;
    for (const Model& known : models()) names.push_back(known.description.name);
    return fmt::format("camera model {} is none of {}", printable(camera.model),
                       fmt::join(names, ", "));
  }
  const auto& names = model->description.parameters;
  if (camera.parameters.size() != names.size()) {
    return fmt::format("camera model {} has {} parameters ({}), not {}", camera.model, names.size(),
                       fmt::join(names, " "), camera.parameters.size());
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double value = camera.parameters[i];
    if (!std::isfinite(value)) return fmt::format("camera parameter {} is not finite", names[i]);
    if (static_cast<int>(i) < model->focal_lengths && value <= 0.0) {
      return fmt::format("focal length {} is {}, not positive", names[i], value);
    }
  }
  if (camera.width == 0 || camera.height == 0) return "the image size is 0";
  return {};
}

Intrinsics intrinsics(const Camera& camera) {
  const int focal_lengths = usable_model(camera, "intrinsics").focal_lengths;
  const double* const p = camera.parameters.data();
  return {p[0], p[focal_lengths - 1], p[focal_lengths], p[focal_lengths + 1]};
}

CameraProjection::CameraProjection(const Camera& camera) {
  const Model& model = usable_model(camera, "project");
  distort_ = model.distort;
  focal_lengths_ = model.focal_lengths;
}

std::optional<Pixel> CameraProjection::operator()(const double* parameters,
                                                  const Eigen::Vector3d& x_in_camera) const {
  if (!(x_in_camera.z() > 0.0)) return std::nullopt;
  const double* const p = parameters;
  const Eigen::Vector2d distorted =
      distort_(x_in_camera.head<2>() / x_in_camera.z(), p + focal_lengths_ + 2);
  return Pixel{p[0] * distorted.x() + p[focal_lengths_],
               p[focal_lengths_ - 1] * distorted.y() + p[focal_lengths_ + 1]};
}

std::optional<Pixel> project(const Camera& camera, const Eigen::Vector3d& x_in_camera) {
  if (!(x_in_camera.z() > 0.0)) return std::nullopt;
  return CameraProjection(camera)(camera.parameters.data(), x_in_camera);
}

std::optional<Eigen::Vector2d> unproject(const Camera& camera, const Pixel& pixel,
                                         const Eigen::Vector2d& near) {
  const Eigen::Vector2d goal(pixel.u, pixel.v);
  const auto projected = [&](double x, double y) {
    const Pixel at = *project(camera, {x, y, 1.0});
    return Eigen::Vector2d(at.u, at.v);
  };
  // Newton's method with numerical derivatives, from `near` or, if that fails, from the axis.
  const auto solve = [&](Eigen::Vector2d x) -> std::optional<Eigen::Vector2d> {
    constexpr int kMostSteps = 50;
    constexpr double kStep = 1e-6;
    for (int i = 0; i < kMostSteps; ++i) {
      const Eigen::Vector2d at = projected(x.x(), x.y());
      Eigen::Matrix2d jacobian;
      jacobian << (projected(x.x() + kStep, x.y()) - at) / kStep,
          (projected(x.x(), x.y() + kStep) - at) / kStep;
      if (!(jacobian.determinant() > 0.0)) return std::nullopt;  // not invertible
      const Eigen::Vector2d step = jacobian.inverse() * (goal - at);
      x += step;
      constexpr double kFarthest = 100.0;  // 89.4 degrees off the axis
      if (!(x.cwiseAbs().maxCoeff() < kFarthest)) return std::nullopt;
      if (step.norm() < 1e-9) break;
    }
    if (!((projected(x.x(), x.y()) - goal).norm() < 1e-3)) return std::nullopt;
    return x;
  };
  const auto found = solve(near);
  return found || near.isZero() ? found : solve(Eigen::Vector2d::Zero());
}

}  // namespace cairn
