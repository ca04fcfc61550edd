// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/synthetic.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

// Each part of the work has its own random stream, so that an option changes only what depends on it. The
// streams of session s are these plus s * kStreamsPerSession.
enum Stream : std::uint64_t { kScene, kPoints, kMotion, kPath, kDetection, kNoise, kOutliers };
constexpr std::uint64_t kStreamsPerSession = 16;

Random session_stream(std::uint64_t seed, std::uint64_t session, Stream part) {
  return Random(seed).fork(part + kStreamsPerSession * (session + 1));
}

double exponential(Random& random, double mean) {
  return -mean * std::log(1.0 - random.uniform());
}

Vector3d random_direction(Random& random) {
  const double z = random.uniform(-1.0, 1.0);
  const double angle = random.uniform(0.0, 2.0 * pi);
  const double radius = std::sqrt(1.0 - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

// ---- The scene: x to the right, y away from the desk's user, z up; the floor is z = 0.

constexpr double kTableTop = 0.73;
constexpr double kTableThickness = 0.04;
constexpr double kTableHalfWidth = 0.8;
constexpr double kTableHalfDepth = 0.4;

// A box that stands upright, turned about the vertical.
struct Box {
  Vector3d centre;
  Vector3d half_size;
  Vector2d x_axis;  // unit; horizontal

  Vector3d to_local(const Vector3d& direction) const {
    return {x_axis.x() * direction.x() + x_axis.y() * direction.y(),
            x_axis.x() * direction.y() - x_axis.y() * direction.x(), direction.z()};
  }
  Vector3d to_world(const Vector3d& direction) const {
    return {x_axis.x() * direction.x() - x_axis.y() * direction.y(),
            x_axis.y() * direction.x() + x_axis.x() * direction.y(), direction.z()};
  }
  // Half the box's extent along a horizontal unit vector.
  double half_extent(const Vector2d& axis) const {
    const Vector3d local = to_local({axis.x(), axis.y(), 0.0});
    return half_size.x() * std::abs(local.x()) + half_size.y() * std::abs(local.y());
  }
};

Box standing_box(const Vector2d& at, double floor, const Vector3d& size, double yaw) {
  return {Vector3d(at.x(), at.y(), floor + 0.5 * size.z()), 0.5 * size,
          Vector2d(std::cos(yaw), std::sin(yaw))};
}

// A textured spot on a face; coordinates as in Face.
struct Patch {
  Vector2d centre;
  Vector2d deviation;
};

// A rectangle: centre + a * half_a + b * half_b for a and b in [-1, 1].
struct Face {
  Vector3d centre;
  Vector3d half_a;
  Vector3d half_b;
  Vector3d normal;
  Vector2d half_lengths_m;
  std::vector<Patch> patches;
};

struct SurfacePoint {
  Vector3d position;
  Vector3d normal;
};

struct Scene {
  std::vector<Box> occluders;
  std::vector<Face> faces;
  std::vector<double> interest_up_to;  // sum of the interest of the faces up to each
  Vector3d lowest = Vector3d::Constant(std::numeric_limits<double>::max());
  Vector3d highest = Vector3d::Constant(std::numeric_limits<double>::lowest());
};

std::vector<Patch> random_patches(const Vector2d& half_lengths_m, Random& random) {
  constexpr double kAreaEachSquareMetres = 0.02;
  const double area = 4.0 * half_lengths_m.prod();
  const auto count = static_cast<std::size_t>(std::clamp(area / kAreaEachSquareMetres, 1.0, 40.0));
  std::vector<Patch> patches;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector2d centre{random.uniform(-0.85, 0.85), random.uniform(-0.85, 0.85)};
    const double deviation_m = random.uniform(0.004, 0.03);
    patches.push_back({centre, deviation_m * half_lengths_m.cwiseInverse()});
  }
  return patches;
}

// Interest is the density of corners: on surfaces, and higher along their edges.
void add_face(Scene& scene, const Box& box, const Vector3d& local_normal, double interest,
              Random& random) {
  const Vector3d a = local_normal.z() != 0.0 ? Vector3d::UnitX() : Vector3d::UnitZ();
  const Vector3d b = local_normal.cross(a);
  const Vector2d half_lengths_m(box.half_size.dot(a.cwiseAbs()), box.half_size.dot(b.cwiseAbs()));
  const Vector3d to_face = local_normal.cwiseProduct(box.half_size);
  const Face face = {box.centre + box.to_world(to_face),
                     box.to_world(a * half_lengths_m.x()),
                     box.to_world(b * half_lengths_m.y()),
                     box.to_world(local_normal),
                     half_lengths_m,
                     random_patches(half_lengths_m, random)};
  constexpr double kEdgeWidthMetres = 0.05;
  const double area = 4.0 * half_lengths_m.prod() + kEdgeWidthMetres * 4.0 * half_lengths_m.sum();
  const double before = scene.interest_up_to.empty() ? 0.0 : scene.interest_up_to.back();
  scene.interest_up_to.push_back(before + interest * area);
  for (const double sign_a : {-1.0, 1.0}) {
    for (const double sign_b : {-1.0, 1.0}) {
      const Vector3d corner = face.centre + sign_a * face.half_a + sign_b * face.half_b;
      scene.lowest = scene.lowest.cwiseMin(corner);
      scene.highest = scene.highest.cwiseMax(corner);
    }
  }
  scene.faces.push_back(face);
}

// The faces that are visible from in front of the desk.
void add_visible_faces(Scene& scene, const Box& box, double interest, Random& random) {
  add_face(scene, box, Vector3d::UnitZ(), interest, random);
  constexpr double kTurnedAway = 0.5;
  for (const Vector3d& normal : {Vector3d(1.0, 0.0, 0.0), Vector3d(-1.0, 0.0, 0.0),
                                 Vector3d(0.0, 1.0, 0.0), Vector3d(0.0, -1.0, 0.0)}) {
    if (box.to_world(normal).y() < kTurnedAway) add_face(scene, box, normal, interest, random);
  }
}

// Whether two footprints leave `gap` between them (separating axes).
bool apart(const Box& one, const Box& other, double gap) {
  const Vector2d between = (other.centre - one.centre).head<2>();
  for (const Box* const box : {&one, &other}) {
    const Vector2d y_axis(-box->x_axis.y(), box->x_axis.x());
    for (const Vector2d& axis : {box->x_axis, y_axis}) {
      const double reach = one.half_extent(axis) + other.half_extent(axis) + gap;
      if (std::abs(between.dot(axis)) > reach) return true;
    }
  }
  return false;
}

// A kind of object on the desk: its range of sizes, of positions across the desk, and of rotations.
struct ThingKind {
  Vector3d smallest;
  Vector3d largest;
  double nearest_y;
  double farthest_y;
  double max_yaw;
};

Box random_thing(const ThingKind& kind, Random& random) {
  const Vector3d size{random.uniform(kind.smallest.x(), kind.largest.x()),
                      random.uniform(kind.smallest.y(), kind.largest.y()),
                      random.uniform(kind.smallest.z(), kind.largest.z())};
  const Vector2d at{random.uniform(-kTableHalfWidth, kTableHalfWidth),
                    random.uniform(kind.nearest_y, kind.farthest_y)};
  return standing_box(at, kTableTop, size, random.uniform(-kind.max_yaw, kind.max_yaw));
}

bool fits_on_table(const Box& box, std::span<const Box> others) {
  constexpr double kGap = 0.01;
  const bool inside =
      std::abs(box.centre.x()) + box.half_extent(Vector2d::UnitX()) < kTableHalfWidth &&
      std::abs(box.centre.y()) + box.half_extent(Vector2d::UnitY()) < kTableHalfDepth;
  return inside && std::all_of(others.begin(), others.end(),
                               [&](const Box& other) { return apart(box, other, kGap); });
}

std::vector<Box> random_things(Random& random) {
  const ThingKind monitor = {{0.45, 0.05, 0.30}, {0.58, 0.08, 0.40}, 0.10, 0.30, 0.35};
  const ThingKind keyboard = {{0.36, 0.12, 0.02}, {0.45, 0.16, 0.04}, -0.30, -0.05, 0.3};
  const std::array<ThingKind, 3> others = {{
      {{0.14, 0.20, 0.015}, {0.21, 0.28, 0.06}, -0.4, 0.4, pi},  // book
      {{0.07, 0.07, 0.08}, {0.09, 0.09, 0.12}, -0.4, 0.4, pi},   // cup
      {{0.08, 0.06, 0.04}, {0.22, 0.18, 0.20}, -0.4, 0.4, pi},   // carton
  }};
  const std::size_t count = 8 + random.index(8);
  std::vector<Box> things;
  for (std::size_t i = 0; i < count; ++i) {
    const ThingKind& kind = i == 0   ? monitor
                            : i == 1 ? keyboard
                                     : others[random.index(others.size())];
    constexpr int kAttempts = 200;  // then the object is left out, because the desk is full
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const Box thing = random_thing(kind, random);
      if (!fits_on_table(thing, things)) continue;
      things.push_back(thing);
      break;
    }
  }
  return things;
}

// Bags and cartons on the floor, to the left and right of the table.
std::vector<Box> random_floor_clutter(Random& random) {
  std::vector<Box> clutter;
  for (const double side : {-1.0, 1.0, -1.0, 1.0}) {
    const Vector2d at{side * random.uniform(1.0, 1.4), random.uniform(-0.7, 0.15)};
    const Vector3d size{random.uniform(0.15, 0.35), random.uniform(0.15, 0.35),
                        random.uniform(0.15, 0.45)};
    clutter.push_back(standing_box(at, 0.0, size, random.uniform(-pi, pi)));
  }
  return clutter;
}

Scene make_scene(Random random) {
  Scene scene;
  const Box table =
      standing_box(Vector2d::Zero(), kTableTop - kTableThickness,
                   Vector3d(2.0 * kTableHalfWidth, 2.0 * kTableHalfDepth, kTableThickness), 0.0);
  const Box wall = standing_box(Vector2d(0.0, 0.48), 0.0, Vector3d(2.8, 0.04, 1.6), 0.0);
  const Box floor = standing_box(Vector2d(0.0, -0.44), -0.1, Vector3d(3.2, 1.8, 0.1), 0.0);
  add_visible_faces(scene, table, 1.0, random);
  add_face(scene, wall, -Vector3d::UnitY(), 0.35, random);
  add_face(scene, floor, Vector3d::UnitZ(), 0.05, random);
  // Wall and floor are not occluders, because nothing is behind them.
  scene.occluders.push_back(table);
  for (const Box& thing : random_things(random)) {
    add_visible_faces(scene, thing, 3.0, random);
    scene.occluders.push_back(thing);
  }
  for (const Box& clutter : random_floor_clutter(random)) {
    add_visible_faces(scene, clutter, 0.6, random);
    scene.occluders.push_back(clutter);
  }
  return scene;
}

// A coordinate within `inset_m` (random) of one of the two ends.
double near_end(double half_length_m, double mean_inset_m, Random& random) {
  const double inset = std::min(exponential(random, mean_inset_m) / half_length_m, 1.0);
  return random.chance(0.5) ? 1.0 - inset : inset - 1.0;
}

// Reflects coordinates beyond the ends, so that points do not accumulate there.
double folded(double coordinate) {
  const double beyond = std::abs(coordinate) - 1.0;
  if (beyond <= 0.0) return coordinate;
  return std::copysign(std::max(1.0 - beyond, 0.0), coordinate);
}

// Draws a corner on a face: anywhere, in a textured patch, at an edge or at a corner.
Vector2d draw_on_face(const Face& face, Random& random) {
  constexpr double kAnywhere = 0.25;
  constexpr double kInTexture = 0.40;
  constexpr double kAtEdge = 0.25;
  constexpr double kEdgeInsetMetres = 0.004;
  constexpr double kCornerInsetMetres = 0.008;
  const double where = random.uniform();
  if (where < kAnywhere) return Vector2d{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)};
  if (where < kAnywhere + kInTexture) {
    const Patch& patch = face.patches[random.index(face.patches.size())];
    return Vector2d{folded(patch.centre.x() + patch.deviation.x() * random.normal()),
                    folded(patch.centre.y() + patch.deviation.y() * random.normal())};
  }
  if (where < kAnywhere + kInTexture + kAtEdge) {
    const Eigen::Index across = random.chance(0.5) ? 0 : 1;
    Vector2d point;
    point[across] = near_end(face.half_lengths_m[across], kEdgeInsetMetres, random);
    point[1 - across] = random.uniform(-1.0, 1.0);
    return point;
  }
  return Vector2d{near_end(face.half_lengths_m.x(), kCornerInsetMetres, random),
                  near_end(face.half_lengths_m.y(), kCornerInsetMetres, random)};
}

SurfacePoint draw_surface_point(const Scene& scene, Random& random) {
  const auto& sums = scene.interest_up_to;
  const auto found = std::upper_bound(sums.begin(), sums.end(), random.uniform(0.0, sums.back()));
  const auto index = std::min(static_cast<std::size_t>(found - sums.begin()), sums.size() - 1);
  const Face& face = scene.faces[index];
  const Vector2d at = draw_on_face(face, random);
  return {face.centre + at.x() * face.half_a + at.y() * face.half_b, face.normal};
}

Vector3d draw_outlier(const Scene& scene, Random& random) {
  constexpr double kGrownMetres = 0.5;
  Vector3d position;
  for (Eigen::Index i = 0; i < 3; ++i) {
    position[i] = random.uniform(scene.lowest[i] - kGrownMetres, scene.highest[i] + kGrownMetres);
  }
  return position;
}

// ---- The path of the camera.

// A smooth irregular motion between -1 and 1.
struct Wobble {
  explicit Wobble(Random& random)
      : slow_rate(random.uniform(0.6, 1.4)),
        slow_phase(random.uniform(0.0, 2.0 * pi)),
        fast_rate(random.uniform(2.0, 4.0)),
        fast_phase(random.uniform(0.0, 2.0 * pi)) {}

  double operator()(double passes) const {
    return 0.8 * std::sin(2.0 * pi * slow_rate * passes + slow_phase) +
           0.2 * std::sin(2.0 * pi * fast_rate * passes + fast_phase);
  }

  double slow_rate;
  double slow_phase;
  double fast_rate;
  double fast_phase;
};

Rigid3 looking(const Vector3d& from, const Vector3d& at, double roll) {
  const Vector3d forward = (at - from).normalized();
  const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized();
  Matrix3d world_from_camera;
  world_from_camera << right, forward.cross(right), forward;
  const Eigen::AngleAxisd rolled(roll, Vector3d::UnitZ());
  return {Eigen::Quaterniond(world_from_camera * rolled.toRotationMatrix()), from};
}

// Poses (world_from_camera) of a hand-held camera that looks along the desk, to and fro.
std::vector<Rigid3> make_path(std::size_t frames, Random random) {
  constexpr std::size_t kFramesPerPass = 40;  // a path of fewer frames is one faster pass
  const double passes_per_frame = 1.0 / static_cast<double>(std::min(frames, kFramesPerPass));
  const double way = random.chance(0.5) ? 1.0 : -1.0;
  const double middle_azimuth = random.uniform(-0.3, 0.3);
  const double middle_elevation = random.uniform(0.55, 0.75);
  const double middle_distance = random.uniform(0.9, 1.15);
  const Wobble azimuth(random);
  const Wobble elevation(random);
  const Wobble distance(random);
  const Wobble depth(random);
  const Wobble roll(random);
  std::vector<Rigid3> path;
  path.reserve(frames);
  for (std::size_t i = 0; i < frames; ++i) {
    const double passes = (static_cast<double>(i) + 0.5) * passes_per_frame;
    const Vector3d at(-0.5 * way * std::cos(pi * passes), 0.05 + 0.1 * depth(passes),
                      kTableTop + 0.08);
    const double around = middle_azimuth + 0.45 * azimuth(passes);
    const double up = middle_elevation + 0.15 * elevation(passes);
    const Vector3d back(std::cos(up) * std::sin(around), -std::cos(up) * std::cos(around),
                        std::sin(up));
    const double metres = middle_distance + 0.25 * distance(passes);
    path.push_back(looking(at + metres * back, at, 0.1 * roll(passes)));
  }
  return path;
}

// ---- Seeing.

constexpr double kFx = 517.3;
constexpr double kFy = 516.5;
constexpr double kCx = 318.6;
constexpr double kCy = 255.3;
constexpr std::uint32_t kWidth = 640;
constexpr std::uint32_t kHeight = 480;
constexpr double kMinDepthMetres = 0.3;
constexpr double kMaxDepthMetres = 4.0;

Camera tum_fr1_camera() {
  return {CameraId{0}, "PINHOLE", kWidth, kHeight, {kFx, kFy, kCx, kCy}};
}

// The camera above without the checks of project(), for the inner loop.
Pixel projected(const Vector3d& x_in_camera) {
  return {kFx * x_in_camera.x() / x_in_camera.z() + kCx,
          kFy * x_in_camera.y() / x_in_camera.z() + kCy};
}

bool in_image(const Pixel& pixel) {
  constexpr double kBorder = 16.0;  // without detections, because the detector's window is cut off
  return pixel.u >= kBorder && pixel.u <= kWidth - 1 - kBorder && pixel.v >= kBorder &&
         pixel.v <= kHeight - 1 - kBorder;
}

// Whether a box occludes the point `eye` + `ray` (slab test).
bool hides(const Box& box, const Vector3d& eye, const Vector3d& ray, double nearly_there) {
  const Vector3d from = box.to_local(eye - box.centre);
  const Vector3d along = box.to_local(ray);
  double enter = 0.0;
  double leave = nearly_there;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double inverse = 1.0 / along[i];
    const double first = (-box.half_size[i] - from[i]) * inverse;
    const double second = (box.half_size[i] - from[i]) * inverse;
    // For a ray parallel to the slab both are infinite, with opposite signs inside it. Exactly in its surface
    // one is NaN, which the comparisons ignore.
    enter = std::max(enter, std::min(first, second));
    leave = std::min(leave, std::max(first, second));
  }
  return enter < leave;
}

struct View {
  Vector3d centre;
  Matrix3d world_from_camera;
};

// The point in camera coordinates, if this view sees it.
std::optional<Vector3d> seen(const SurfacePoint& point, const View& view,
                             std::span<const Box> occluders) {
  constexpr double kMinFacingCosine = 0.15;
  constexpr double kOwnSurfaceMetres = 0.001;
  const Vector3d ray = point.position - view.centre;
  const double distance = ray.norm();
  if (-point.normal.dot(ray) < kMinFacingCosine * distance) return std::nullopt;
  const Vector3d x_in_camera = view.world_from_camera.transpose() * ray;
  if (x_in_camera.z() < kMinDepthMetres || x_in_camera.z() > kMaxDepthMetres) return std::nullopt;
  if (!in_image(projected(x_in_camera))) return std::nullopt;
  const double nearly_there = 1.0 - kOwnSurfaceMetres / distance;
  for (const Box& box : occluders) {
    if (hides(box, view.centre, ray, nearly_there)) return std::nullopt;
  }
  return x_in_camera;
}

// ---- Measuring.

struct Sighting {
  std::uint32_t frame;
  Vector3d x_in_camera;
};

struct Measurement {
  Pixel pixel;
  double depth;
};

struct Noise {
  double pixel_px;
  double depth_m;  // at 1 m
};

double depth_deviation(double z, const Noise& noise) {
  return noise.depth_m * z * z;
}

Measurement measure(const Vector3d& x_in_camera, const Noise& noise, Random& random) {
  const double z = x_in_camera.z();
  const Pixel exact = projected(x_in_camera);
  return {
      Pixel{exact.u + noise.pixel_px * random.normal(), exact.v + noise.pixel_px * random.normal()},
      z + depth_deviation(z, noise) * random.normal()};
}

Vector3d back_projected(const Measurement& measurement) {
  const double z = measurement.depth;
  return {(measurement.pixel.u - kCx) / kFx * z, (measurement.pixel.v - kCy) / kFy * z, z};
}

// Inverse of the covariance J·diag(σ_pixel², σ_pixel², σ_depth²)·Jᵀ that back-projection gives the
// point, in the camera's axes: the rows of J⁻¹ are the gradients of u, v and z.
Matrix3d information_in_camera(const Vector3d& x_in_camera, const Noise& noise) {
  // No noise in one of the two would make the covariance singular.
  constexpr double kLeastPixelPixels = 1e-3;
  constexpr double kLeastDepthMetres = 1e-6;
  const double z = x_in_camera.z();
  const Vector3d gradient_u(kFx / z, 0.0, -kFx * x_in_camera.x() / (z * z));
  const Vector3d gradient_v(0.0, kFy / z, -kFy * x_in_camera.y() / (z * z));
  const double pixel = std::max(noise.pixel_px, kLeastPixelPixels);
  const double depth = std::max(depth_deviation(z, noise), kLeastDepthMetres);
  Matrix3d information =
      (gradient_u * gradient_u.transpose() + gradient_v * gradient_v.transpose()) / (pixel * pixel);
  information(2, 2) += 1.0 / (depth * depth);
  return information;
}

// The information-weighted mean of measurements of a point, built up one by one. It holds
// differences to the true point, which keep their digits.
class Estimate {
 public:
  void add(const View& view, const Vector3d& true_x_in_camera, const Measurement& measurement,
           const Noise& noise) {
    const Matrix3d information = view.world_from_camera *
                                 information_in_camera(true_x_in_camera, noise) *
                                 view.world_from_camera.transpose();
    const Vector3d error = back_projected(measurement) - true_x_in_camera;
    information_ += information;
    weighted_error_ += information * (view.world_from_camera * error);
  }
  Matrix3d covariance() const {
    const Matrix3d inverse = information_.inverse();
    return 0.5 * (inverse + inverse.transpose());
  }
  Vector3d error(const Matrix3d& covariance) const { return covariance * weighted_error_; }

 private:
  Matrix3d information_ = Matrix3d::Zero();
  Vector3d weighted_error_ = Vector3d::Zero();
};

// ---- A session.

std::string random_uuid(Random random) {
  std::array<std::size_t, 8> g{};
  for (std::size_t& group : g) group = random.index(0x10000);
  // Version 8 (RFC 9562): the content is ours to choose.
  return fmt::format("{:04x}{:04x}-{:04x}-{:04x}-{:04x}-{:04x}{:04x}{:04x}", g[0], g[1], g[2],
                     0x8000 | (g[3] & 0x0fff), 0x8000 | (g[4] & 0x3fff), g[5], g[6], g[7]);
}

// FNV-1a.
std::uint64_t text_hash(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return hash;
}

// The map's metadata. Maps with different provenance have different UUIDs.
MapInfo make_info(const SyntheticOptions& options, std::string_view made_by) {
  MapInfo info;
  info.world_frame = "synthetic_desk";
  info.gravity = -Vector3d::UnitZ();
  info.provenance = {fmt::format(
      "{}: seed {}, landmarks {}, frames {}, pixel_noise_px {}, depth_noise_m {}, overlap {}, "
      "outlier_fraction {}",
      made_by, options.seed, options.landmarks, options.frames, options.pixel_noise_px,
      options.depth_noise_m, options.overlap, options.outlier_fraction)};
  info.uuid = random_uuid(Random(options.seed).fork(text_hash(info.provenance.front())));
  return info;
}

FrameTable make_frames(std::span<const Rigid3> path) {
  constexpr double kFramesPerSecond = 5.0;
  FrameTable frames;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Eigen::Quaterniond q = path[i].quaternion();
    frames.ids.push_back(FrameId{i});
    frames.translations.push_back(path[i].translation());
    frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    frames.timestamps_s.emplace_back(static_cast<double>(i) / kFramesPerSecond);
  }
  frames.cameras.assign(path.size(), CameraIndex{0});
  return frames;
}

// A session: a walk past the scene, and the resulting map.
class Session {
 public:
  /// @param number distinguishes the sessions of a seed
  Session(const SyntheticOptions& options, const Scene& scene, std::uint64_t number)
      : options_(options),
        scene_(scene),
        detection_(session_stream(options.seed, number, kDetection)),
        noise_(session_stream(options.seed, number, kNoise)),
        outliers_(session_stream(options.seed, number, kOutliers)) {
    const auto path = make_path(options.frames, session_stream(options.seed, number, kPath));
    for (const Rigid3& pose : path) views_.push_back({pose.translation(), pose.rotation()});
    tables_.cameras = {tum_fr1_camera()};
    tables_.frames = make_frames(path);
    tables_.landmarks.ids.reserve(options.landmarks);
    tables_.landmarks.positions.reserve(options.landmarks);
    tables_.landmarks.covariances.reserve(options.landmarks);
    tables_.observations.offsets.reserve(options.landmarks + 1);
    tables_.observations.offsets.push_back(0);
  }

  std::size_t landmark_count() const { return tables_.landmarks.ids.size(); }

  /// Whether some frame detects the point; remembers which, for map_detected.
  bool detect(const SurfacePoint& point) {
    sightings_.clear();
    // A point is tracked for a while, possibly from before the session.
    const std::size_t length = track_length();
    const std::size_t end = 1 + detection_.index(views_.size() + length - 1);
    follow(point, end > length ? end - length : 0, end);
    // The camera comes back and the point is recognised.
    constexpr double kRecognised = 0.25;
    constexpr std::size_t kPause = 5;
    if (detection_.chance(kRecognised)) {
      const std::size_t again = end + kPause + detection_.index(views_.size());
      follow(point, again, again + track_length());
    }
    return !sightings_.empty();
  }

  /// Adds the point detected last as a landmark. False if it became an outlier.
  bool map_detected(const SurfacePoint& point) {
    const Noise noise = {options_.pixel_noise_px, options_.depth_noise_m};
    Estimate estimate;
    for (const Sighting& sighting : sightings_) {
      const Measurement measurement = measure(sighting.x_in_camera, noise, noise_);
      estimate.add(views_[sighting.frame], sighting.x_in_camera, measurement, noise);
      tables_.observations.frames.push_back(FrameIndex{sighting.frame});
      tables_.observations.pixels.push_back(measurement.pixel);
      tables_.observations.depths.emplace_back(measurement.depth);
    }
    tables_.observations.offsets.push_back(tables_.observations.frames.size());
    const bool exact = noise.pixel_px == 0.0 && noise.depth_m == 0.0;
    const Matrix3d covariance = exact ? Matrix3d::Zero() : estimate.covariance();
    // Drawn for every landmark, so that a larger share only adds outliers.
    const Vector3d anywhere = draw_outlier(scene_, outliers_);
    const bool outlier = outliers_.chance(options_.outlier_fraction);
    tables_.landmarks.ids.push_back(LandmarkId{landmark_count()});
    tables_.landmarks.positions.push_back(
        outlier ? anywhere : Vector3d(point.position + estimate.error(covariance)));
    tables_.landmarks.covariances.push_back(covariance);
    reserve_observations();
    return !outlier;
  }

  /// Returns the map and ends the session.
  LandmarkMap map(MapInfo info) && {
    tables_.info = std::move(info);
    return LandmarkMap(std::move(tables_));
  }

 private:
  std::size_t track_length() {
    constexpr double kMeanFrames = 6.0;
    return 1 + static_cast<std::size_t>(exponential(detection_, kMeanFrames));
  }

  // Looks for the point in the frames [begin, end).
  void follow(const SurfacePoint& point, std::size_t begin, std::size_t end) {
    constexpr double kDetected = 0.75;
    for (std::size_t frame = begin; frame < std::min(end, views_.size()); ++frame) {
      if (!detection_.chance(kDetected)) continue;
      const auto x_in_camera = seen(point, views_[frame], scene_.occluders);
      if (x_in_camera) sightings_.push_back({static_cast<std::uint32_t>(frame), *x_in_camera});
    }
  }

  // The first landmarks tell how many observations to expect: growing by doubling would cost
  // large maps half their memory.
  void reserve_observations() {
    constexpr std::size_t kSample = 4096;
    if (landmark_count() != kSample || options_.landmarks <= kSample) return;
    const double each = 1.1 * static_cast<double>(tables_.observations.frames.size()) / kSample;
    const auto expected = static_cast<std::size_t>(each * static_cast<double>(options_.landmarks));
    tables_.observations.frames.reserve(expected);
    tables_.observations.pixels.reserve(expected);
    tables_.observations.depths.reserve(expected);
  }

  const SyntheticOptions& options_;
  const Scene& scene_;
  Random detection_;
  Random noise_;
  Random outliers_;
  std::vector<View> views_;
  std::vector<Sighting> sightings_;  // of the point detected last
  MapTables tables_;
};

// A point that all the sessions detect; std::nullopt after too many failed draws.
std::optional<SurfacePoint> draw_detected(const Scene& scene, std::span<Session* const> sessions,
                                          Random& random) {
  constexpr int kAttempts = 20'000;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const SurfacePoint point = draw_surface_point(scene, random);
    if (std::all_of(sessions.begin(), sessions.end(),
                    [&](Session* session) { return session->detect(point); })) {
      return point;
    }
  }
  return std::nullopt;
}

using SharedLandmarks = std::vector<std::pair<LandmarkIndex, LandmarkIndex>>;

// Fills two sessions with points of both and points of one alone, in random order so that the
// number of a landmark does not reveal its counterpart.
SharedLandmarks map_both(const SyntheticOptions& options, const Scene& scene, Session& source,
                         Session& target, Random random) {
  const std::array both = {&source, &target};
  const auto common = static_cast<std::size_t>(
      std::round(options.overlap * static_cast<double>(options.landmarks)));
  const std::size_t alone = options.landmarks - common;
  struct Share {
    std::span<Session* const> sessions;
    std::size_t remaining;
  };
  const std::span<Session* const> all(both);
  std::array<Share, 3> shares = {{{all, common}, {all.first(1), alone}, {all.last(1), alone}}};
  SharedLandmarks shared;
  shared.reserve(common);
  for (std::size_t left = common + 2 * alone; left > 0;) {
    std::size_t pick = random.index(left);
    auto share = shares.begin();
    for (; pick >= share->remaining; ++share) pick -= share->remaining;
    const auto point = draw_detected(scene, share->sessions, random);
    if (!point) {
      left -= share->remaining;
      share->remaining = 0;
      continue;
    }
    --left;
    --share->remaining;
    const std::pair<LandmarkIndex, LandmarkIndex> next = {
        LandmarkIndex{static_cast<std::uint32_t>(source.landmark_count())},
        LandmarkIndex{static_cast<std::uint32_t>(target.landmark_count())}};
    bool trusted = true;
    for (Session* const session : share->sessions) {
      trusted = session->map_detected(*point) && trusted;
    }
    if (trusted && share->sessions.size() == both.size()) shared.push_back(next);
  }
  return shared;
}

// Any rotation, up to 3 m.
Rigid3 random_motion(Random random) {
  const Vector3d axis = random_direction(random);
  const double angle = random.uniform(0.0, pi);
  const Vector3d direction = random_direction(random);
  const double length = 3.0 * std::cbrt(random.uniform());
  return {rotation_exp(angle * axis), length * direction};
}

// The map in another frame under a name of its own: transformed() drops the UUID, as it makes
// another map; here it makes the one that `info` describes.
LandmarkMap moved(LandmarkMap map, const Rigid3& new_from_old, std::string_view world_frame) {
  const auto uuid = map.info().uuid;
  map = transformed(map, new_from_old);
  MapTables tables = std::move(map).tables();
  tables.info.uuid = uuid;
  tables.info.world_frame = world_frame;
  return LandmarkMap(std::move(tables));
}

}  // namespace

constexpr OptionField kSyntheticFields[] = {
    {"seed", option_at<&SyntheticOptions::seed>},
    {"landmarks", option_at<&SyntheticOptions::landmarks>,
     within(1, std::numeric_limits<std::uint32_t>::max())},
    {"frames", option_at<&SyntheticOptions::frames>, within(1, 1e6)},
    {"pixel_noise_px", option_at<&SyntheticOptions::pixel_noise_px>, within(0, 20)},
    // A depth must stay positive: noise is small against it in all of the scene.
    {"depth_noise_m", option_at<&SyntheticOptions::depth_noise_m>, within(0, 0.03)},
    {"overlap", option_at<&SyntheticOptions::overlap>, within(0, 1)},
    {"outlier_fraction", option_at<&SyntheticOptions::outlier_fraction>, within(0, 1)},
};
constinit const OptionTable SyntheticOptions::table = {"SyntheticOptions", kSyntheticFields};

void SyntheticOptions::validate() const {
  check_options(*this);
}

LandmarkMap synthetic_map(const SyntheticOptions& options) {
  options.validate();
  const Random random(options.seed);
  const Scene scene = make_scene(random.fork(kScene));
  Session session(options, scene, 0);
  const std::array sessions = {&session};
  Random points = random.fork(kPoints);
  while (session.landmark_count() < options.landmarks) {
    const auto point = draw_detected(scene, sessions, points);
    if (!point) break;
    session.map_detected(*point);
  }
  return std::move(session).map(make_info(options, "synthetic map"));
}

SyntheticPair synthetic_pair(const SyntheticOptions& options) {
  options.validate();
  const Random random(options.seed);
  const Scene scene = make_scene(random.fork(kScene));
  // The target is the session of synthetic_map: same path.
  Session target(options, scene, 0);
  Session source(options, scene, 1);
  SyntheticPair pair;
  pair.shared = map_both(options, scene, source, target, random.fork(kPoints));
  pair.target_from_source = random_motion(random.fork(kMotion));
  pair.target = std::move(target).map(make_info(options, "synthetic pair, target"));
  pair.source = moved(std::move(source).map(make_info(options, "synthetic pair, source")),
                      pair.target_from_source.inverse(), "synthetic_desk_source");
  return pair;
}

}  // namespace cairn
