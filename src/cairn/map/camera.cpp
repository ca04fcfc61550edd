// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/camera.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace detail {

/// A model's formula in three steps: a point in camera coordinates is laid on a plane, moved by the distortion
/// within it, then scaled and shifted to pixels.
struct Lens {
  using Distortion = Eigen::Vector2d (*)(const Eigen::Vector2d& on_plane, const double* parameters);
  /// std::nullopt for what the model cannot see.
  using Flatten = std::optional<Eigen::Vector2d> (*)(const Eigen::Vector3d& x_in_camera,
                                                     const Lens& lens, const double* parameters);
  /// The inverse of Flatten: a vector of any length; std::nullopt if nothing is laid there.
  using Lift = std::optional<Eigen::Vector3d> (*)(const Eigen::Vector2d& on_plane,
                                                  const double* parameters);

  CameraModel description;
  int focal_lengths;  ///< 1: fx = fy; 0: those of a panorama
  Flatten flatten;
  Lift lift;
  Distortion distort;
};

}  // namespace detail

namespace {

using detail::Lens;

// --- Distortions within the plane ------------------------------------------------------------------

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

// The polynomial of an angle, whose terms k1 to k4 have even powers.
Eigen::Vector2d radial4(const Eigen::Vector2d& x, const double* k) {
  const double r2 = x.squaredNorm();
  return x * (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3]))));
}

// Devernay and Faugeras 2001. The only parameter is the field of view; as it tends to 0, so does the
// distortion.
Eigen::Vector2d field_of_view(const Eigen::Vector2d& x, const double* omega) {
  const double r = x.norm();
  constexpr double kNone = 1e-9;
  if (r < kNone || std::abs(omega[0]) < kNone) return x;
  return x * (std::atan(r * 2.0 * std::tan(omega[0] / 2.0)) / (r * omega[0]));
}

// d: k1 k2 p1 p2 k3 k4 sx1 sy1. Weng, Cohen and Herniou 1992.
Eigen::Vector2d thin_prism(const Eigen::Vector2d& x, const double* d) {
  const double r2 = x.squaredNorm();
  const double radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * (d[4] + r2 * d[5])));
  return brown(x, radial, d[2], d[3]) + r2 * Eigen::Vector2d(d[6], d[7]);
}

// d: k0 to k5, p0 p1, s0 to s3. Project Aria's Fisheye624: the tangential and prism terms are of the radially
// distorted point, and p0 is along x.
Eigen::Vector2d radial6_then_thin_prism(const Eigen::Vector2d& x, const double* d) {
  const double r2 = x.squaredNorm();
  double radial = 0.0;
  for (int i = 5; i >= 0; --i) radial = r2 * (d[i] + radial);
  const Eigen::Vector2d y = x * (1.0 + radial);
  const double s2 = y.squaredNorm();
  return brown(y, 1.0, d[7], d[6]) + s2 * Eigen::Vector2d(d[8] + s2 * d[9], d[10] + s2 * d[11]);
}

// --- Planes ----------------------------------------------------------------------------------------

std::optional<Eigen::Vector2d> to_perspective(const Eigen::Vector3d& x, const Lens& /*lens*/,
                                              const double* /*parameters*/) {
  if (!(x.z() > 0.0)) return std::nullopt;
  return x.head<2>() / x.z();
}

std::optional<Eigen::Vector3d> from_perspective(const Eigen::Vector2d& at,
                                                const double* /*parameters*/) {
  return at.homogeneous();
}

// Derivative of the distorted point by the point of the plane.
Eigen::Matrix2d distortion_derivative(const Lens& lens, const double* k, const Eigen::Vector2d& x) {
  constexpr double kStep = 1e-6;
  const Eigen::Vector2d at = lens.distort(x, k);
  Eigen::Matrix2d derivative;
  derivative << lens.distort(x + Eigen::Vector2d(kStep, 0.0), k) - at,
      lens.distort(x + Eigen::Vector2d(0.0, kStep), k) - at;
  return derivative / kStep;
}

// Whether the distortion is invertible from the axis to this angle. Beyond the angles that a lens sees, its polynomial
// may turn back and put what is behind the camera into the image.
bool is_unfolded(const Lens& lens, const Eigen::Vector2d& direction, double angle,
                 const double* k) {
  constexpr double kStep = 0.1;  // radians
  for (double a = kStep; a < angle + kStep; a += kStep) {
    const Eigen::Vector2d x = direction * std::min(a, angle);
    if (!(distortion_derivative(lens, k, x).determinant() > 0.0)) return false;
  }
  return true;
}

// Equidistant: the distance from the axis becomes the angle to it.
std::optional<Eigen::Vector2d> to_equidistant(const Eigen::Vector3d& x, const Lens& lens,
                                              const double* parameters) {
  const double across = x.head<2>().norm();
  constexpr double kOnAxis = 1e-12;
  if (!(across > kOnAxis * std::abs(x.z()))) return to_perspective(x, lens, parameters);
  const double angle = std::atan2(across, x.z());
  const Eigen::Vector2d direction = x.head<2>() / across;
  if (x.z() <= 0.0 && !is_unfolded(lens, direction, angle, parameters)) return std::nullopt;
  return direction * angle;
}

std::optional<Eigen::Vector3d> from_equidistant(const Eigen::Vector2d& at,
                                                const double* /*parameters*/) {
  const double angle = at.norm();
  if (!(angle < std::numbers::pi)) return std::nullopt;
  constexpr double kOnAxis = 1e-12;
  if (angle < kOnAxis) return at.homogeneous();
  Eigen::Vector3d ray;
  ray << at * (std::sin(angle) / angle), std::cos(angle);
  return ray;
}

// Fitzgibbon 2001: the point y of the image belongs to the ray (y, 1 + k·|y|²). With k < 0 also behind the camera.
std::optional<Eigen::Vector2d> to_division(const Eigen::Vector3d& x, const Lens& /*lens*/,
                                           const double* k) {
  const double across2 = x.head<2>().squaredNorm();
  const double discriminant = x.z() * x.z() - 4.0 * k[0] * across2;
  if (!(discriminant >= 0.0)) return std::nullopt;
  const double root = std::sqrt(discriminant);
  if (x.z() > 0.0) return x.head<2>() * (2.0 / (x.z() + root));
  // The same number, without the difference of two that are nearly equal.
  if (!(k[0] < 0.0) || across2 == 0.0) return std::nullopt;
  return x.head<2>() * ((x.z() - root) / (2.0 * k[0] * across2));
}

std::optional<Eigen::Vector3d> from_division(const Eigen::Vector2d& at, const double* k) {
  Eigen::Vector3d ray;
  ray << at, 1.0 + k[0] * at.squaredNorm();
  if (k[0] > 0.0 && k[0] * at.squaredNorm() > 1.0) return std::nullopt;  // beyond the farthest ray
  return ray;
}

// Khomutenko, Garcia and Martinet 2016. d: alpha, beta.
std::optional<Eigen::Vector2d> to_eucm(const Eigen::Vector3d& x, const Lens& /*lens*/,
                                       const double* d) {
  const double alpha = d[0];
  const double distance = std::sqrt(d[1] * x.head<2>().squaredNorm() + x.z() * x.z());
  const double farthest = alpha > 0.5 ? (1.0 - alpha) / alpha : alpha / (1.0 - alpha);
  if (!(x.z() > -farthest * distance)) return std::nullopt;
  return x.head<2>() / (alpha * distance + (1.0 - alpha) * x.z());
}

std::optional<Eigen::Vector3d> from_eucm(const Eigen::Vector2d& at, const double* d) {
  const double alpha = d[0];
  const double beta_r2 = d[1] * at.squaredNorm();
  const double square = 1.0 - (2.0 * alpha - 1.0) * beta_r2;
  if (!(square >= 0.0)) return std::nullopt;
  Eigen::Vector3d ray;
  ray << at, (1.0 - alpha * alpha * beta_r2) / (alpha * std::sqrt(square) + 1.0 - alpha);
  return ray;
}

// Equirectangular: longitude to the right and latitude down, radians.
std::optional<Eigen::Vector2d> to_sphere(const Eigen::Vector3d& x, const Lens& /*lens*/,
                                         const double* /*parameters*/) {
  if (!(x.squaredNorm() > 0.0)) return std::nullopt;
  return Eigen::Vector2d(std::atan2(x.x(), x.z()), std::atan2(x.y(), std::hypot(x.x(), x.z())));
}

std::optional<Eigen::Vector3d> from_sphere(const Eigen::Vector2d& at,
                                           const double* /*parameters*/) {
  if (!(std::abs(at.y()) <= 0.5 * std::numbers::pi)) return std::nullopt;
  return Eigen::Vector3d(std::cos(at.y()) * std::sin(at.x()), std::sin(at.y()),
                         std::cos(at.y()) * std::cos(at.x()));
}

// --- The models ------------------------------------------------------------------------------------

Lens perspective(CameraModel description, int focal_lengths, Lens::Distortion distort) {
  return {std::move(description), focal_lengths, &to_perspective, &from_perspective, distort};
}

Lens equidistant(CameraModel description, int focal_lengths, Lens::Distortion distort) {
  return {std::move(description), focal_lengths, &to_equidistant, &from_equidistant, distort};
}

const std::vector<Lens>& lenses() {
  static const std::vector<Lens> all = {
      perspective({"SIMPLE_PINHOLE", {"f", "cx", "cy"}}, 1, &undistorted),
      perspective({"PINHOLE", {"fx", "fy", "cx", "cy"}}, 2, &undistorted),
      perspective({"SIMPLE_RADIAL", {"f", "cx", "cy", "k"}}, 1, &radial1),
      perspective({"RADIAL", {"f", "cx", "cy", "k1", "k2"}}, 1, &radial2),
      perspective({"OPENCV", {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}}, 2, &opencv),
      equidistant({"OPENCV_FISHEYE", {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}}, 2,
                  &radial4),
      perspective(
          {"FULL_OPENCV", {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}},
          2, &full_opencv),
      perspective({"FOV", {"fx", "fy", "cx", "cy", "omega"}}, 2, &field_of_view),
      equidistant({"SIMPLE_RADIAL_FISHEYE", {"f", "cx", "cy", "k"}}, 1, &radial1),
      equidistant({"RADIAL_FISHEYE", {"f", "cx", "cy", "k1", "k2"}}, 1, &radial2),
      equidistant({"THIN_PRISM_FISHEYE",
                   {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"}},
                  2, &thin_prism),
      equidistant({"RAD_TAN_THIN_PRISM_FISHEYE",
                   {"fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0",
                    "s1", "s2", "s3"}},
                  2, &radial6_then_thin_prism),
      {{"SIMPLE_DIVISION", {"f", "cx", "cy", "k"}}, 1, &to_division, &from_division, &undistorted},
      {{"DIVISION", {"fx", "fy", "cx", "cy", "k"}}, 2, &to_division, &from_division, &undistorted},
      equidistant({"SIMPLE_FISHEYE", {"f", "cx", "cy"}}, 1, &undistorted),
      equidistant({"FISHEYE", {"fx", "fy", "cx", "cy"}}, 2, &undistorted),
      {{"EUCM", {"fx", "fy", "cx", "cy", "alpha", "beta"}}, 2, &to_eucm, &from_eucm, &undistorted},
      {{"EQUIRECTANGULAR", {"w", "h"}}, 0, &to_sphere, &from_sphere, &undistorted},
  };
  return all;
}

const Lens* find_lens(std::string_view name) {
  const auto found = std::find_if(lenses().begin(), lenses().end(),
                                  [&](const Lens& lens) { return lens.description.name == name; });
  return found == lenses().end() ? nullptr : &*found;
}

const Lens& usable_lens(const Camera& camera, std::string_view caller) {
  const Lens* const lens = find_lens(camera.model);
  if (lens == nullptr || camera.parameters.size() != lens->description.parameters.size()) {
    throw Error(ErrorKind::kMisuse, caller, camera_defect(camera), "a camera without defect");
  }
  return *lens;
}

Intrinsics intrinsics_of(const Lens& lens, const double* p) {
  if (lens.focal_lengths > 0) {
    const int n = lens.focal_lengths;
    return {p[0], p[n - 1], p[n], p[n + 1]};
  }
  // The whole sphere fills the image; the centre of its first pixel is at (0, 0).
  return {p[0] / (2.0 * std::numbers::pi), p[1] / std::numbers::pi, 0.5 * p[0] - 0.5,
          0.5 * p[1] - 0.5};
}

const double* distortion_of(const Lens& lens, const double* parameters) {
  return parameters + lens.focal_lengths + 2;
}

// Constraints on the parameters besides that they are finite; empty if they hold.
std::string range_defect(const Lens& lens, const std::vector<double>& values) {
  const auto& names = lens.description.parameters;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string_view name = names[i];
    const double value = values[i];
    const bool is_focal = static_cast<int>(i) < lens.focal_lengths;
    if (is_focal && value <= 0.0) {
      return fmt::format("focal length {} is {}, not positive", name, value);
    }
    const bool is_positive = name == "w" || name == "h" || name == "beta";
    if (is_positive && value <= 0.0) {
      return fmt::format("camera parameter {} is {}, not positive", name, value);
    }
    if (name == "alpha" && (value < 0.0 || value > 1.0)) {
      return fmt::format("camera parameter alpha is {}, not 0 to 1", value);
    }
  }
  return {};
}

// The point of the plane that the distortion moves to `goal`, by Newton's method with numerical derivatives.
std::optional<Eigen::Vector2d> solve_distortion(const Lens& lens, const double* k,
                                                const Eigen::Vector2d& goal, Eigen::Vector2d x,
                                                double tolerance) {
  const auto missing = [&](const Eigen::Vector2d& at) -> Eigen::Vector2d {
    return goal - lens.distort(at, k);
  };
  constexpr int kMostSteps = 50;
  Eigen::Vector2d left = missing(x);
  for (int i = 0; i < kMostSteps; ++i) {
    const Eigen::Matrix2d derivative = distortion_derivative(lens, k, x);
    if (!(derivative.determinant() > 0.0)) return std::nullopt;  // not invertible
    Eigen::Vector2d step = derivative.inverse() * left;
    if (!step.allFinite()) return std::nullopt;  // half of it would be no smaller
    // Where the distortion grows fast, a whole step goes too far.
    constexpr double kSmall = 1e-12;
    Eigen::Vector2d then = missing(x + step);
    while (!(then.norm() < left.norm()) && step.norm() > kSmall) {
      step *= 0.5;
      then = missing(x + step);
    }
    x += step;
    left = then;
    constexpr double kFarthest = 100.0;  // 89.4 degrees off the axis
    if (!(x.cwiseAbs().maxCoeff() < kFarthest)) return std::nullopt;
    if (step.norm() < kSmall) break;
  }
  if (!(left.norm() < tolerance)) return std::nullopt;
  return x;
}

}  // namespace

std::span<const CameraModel> camera_models() {
  static const std::vector<CameraModel> descriptions = [] {
    std::vector<CameraModel> result;
    for (const Lens& lens : lenses()) result.push_back(lens.description);
    return result;
  }();
  return descriptions;
}

const CameraModel* camera_model(std::string_view name) {
  const Lens* const lens = find_lens(name);
  return lens == nullptr ? nullptr
                         : &camera_models()[static_cast<std::size_t>(lens - lenses().data())];
}

std::string camera_defect(const Camera& camera) {
  const Lens* const lens = find_lens(camera.model);
  if (lens == nullptr) {
    std::vector<std::string_view> names;
    for (const CameraModel& known : camera_models()) names.push_back(known.name);
    return fmt::format("camera model {} is none of {}", printable(camera.model),
                       fmt::join(names, ", "));
  }
  const auto& names = lens->description.parameters;
  if (camera.parameters.size() != names.size()) {
    return fmt::format("camera model {} has {} parameters ({}), not {}", camera.model, names.size(),
                       fmt::join(names, " "), camera.parameters.size());
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!std::isfinite(camera.parameters[i])) {
      return fmt::format("camera parameter {} is not finite", names[i]);
    }
  }
  if (std::string defect = range_defect(*lens, camera.parameters); !defect.empty()) return defect;
  if (camera.width == 0 || camera.height == 0) return "the image size is 0";
  return {};
}

Intrinsics intrinsics(const Camera& camera) {
  return intrinsics_of(usable_lens(camera, "intrinsics"), camera.parameters.data());
}

CameraProjection::CameraProjection(const Camera& camera) : lens_(&usable_lens(camera, "project")) {}

int CameraProjection::focal_lengths() const {
  return lens_->focal_lengths;
}

std::optional<Pixel> CameraProjection::operator()(const double* parameters,
                                                  const Eigen::Vector3d& x_in_camera) const {
  const double* const d = distortion_of(*lens_, parameters);
  const auto flat = lens_->flatten(x_in_camera, *lens_, d);
  if (!flat) return std::nullopt;
  const Eigen::Vector2d distorted = lens_->distort(*flat, d);
  const Intrinsics k = intrinsics_of(*lens_, parameters);
  return Pixel{k.fx * distorted.x() + k.cx, k.fy * distorted.y() + k.cy};
}

Eigen::Vector2d CameraProjection::difference(const double* parameters, const Pixel& to,
                                             const Pixel& from) const {
  Eigen::Vector2d difference(to.u - from.u, to.v - from.v);
  if (lens_->focal_lengths == 0) {
    difference.x() = std::remainder(difference.x(), parameters[0]);  // the width of the panorama
  }
  return difference;
}

std::optional<Pixel> project(const Camera& camera, const Eigen::Vector3d& x_in_camera) {
  return CameraProjection(camera)(camera.parameters.data(), x_in_camera);
}

std::optional<Eigen::Vector2d> reprojection(const Camera& camera,
                                            const Eigen::Vector3d& x_in_camera,
                                            const Pixel& observed) {
  const CameraProjection projection(camera);
  const auto pixel = projection(camera.parameters.data(), x_in_camera);
  if (!pixel) return std::nullopt;
  return projection.difference(camera.parameters.data(), *pixel, observed);
}

std::optional<Eigen::Vector3d> unproject(const Camera& camera, const Pixel& pixel,
                                         const Eigen::Vector3d& near) {
  const Lens& lens = usable_lens(camera, "unproject");
  const double* const d = distortion_of(lens, camera.parameters.data());
  const Intrinsics k = intrinsics(camera);
  const Eigen::Vector2d goal((pixel.u - k.cx) / k.fx, (pixel.v - k.cy) / k.fy);
  const double tolerance = 1e-3 / std::max(k.fx, k.fy);
  const auto from = [&](const Eigen::Vector3d& start) {
    const auto flat = lens.flatten(start, lens, d);
    return solve_distortion(lens, d, goal, flat.value_or(Eigen::Vector2d::Zero()), tolerance);
  };
  auto found = from(near);
  if (!found && near != Eigen::Vector3d::UnitZ()) found = from(Eigen::Vector3d::UnitZ());
  if (!found) return std::nullopt;
  const auto ray = lens.lift(*found, d);
  if (!ray) return std::nullopt;
  return ray->normalized();
}

bool is_same_lens(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height &&
         a.parameters == b.parameters;
}

}  // namespace cairn
