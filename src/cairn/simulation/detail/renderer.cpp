// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/renderer.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {

using Eigen::Vector3d;
using Eigen::Vector3f;

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceDeleter>;
using EmbreeScene = std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneDeleter>;

// Light that falls on a surface, at the nodes of a grid from corner to corner.
struct LightGrid {
  int columns = 2;
  int rows = 2;
  std::size_t first = 0;  // of Renderer::State::light
};

// Data for shading a surface, in the world frame. Coordinates (u, v) are texels.
struct Shading {
  Vector3d normal;
  double offset = 0.0;  // normal·x of its points
  Vector3d u_gradient;
  double u_offset = 0.0;
  Vector3d v_gradient;
  double v_offset = 0.0;
  const Texture* texture = nullptr;
  float lod = 0.0F;  // log2 of texels per metre
  // Position in the light grid, of (u, v).
  float light_u_scale = 0.0F;
  float light_u_offset = 0.0F;
  float light_v_scale = 0.0F;
  float light_v_offset = 0.0F;
  LightGrid grid;
  std::uint32_t object = 0;
  std::uint32_t texture_index = 0;
};

namespace {

constexpr std::uint32_t kNothing = RTC_INVALID_GEOMETRY_ID;

// log2 to 0.09, exact at powers of two: good enough to choose a mip level by.
float rough_log2(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  return static_cast<float>(bits) * 0x1p-23F - 127.0F;
}

// Uniform in [0, 1) from a counter.
double uniform_of(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1p-53;
}

// The same in the frame of a camera, for lines of sight d = (x, y, 1):
// 1 / depth = plane·d; u = u_offset + depth * (u·d).
struct Seen {
  Vector3f plane;
  Vector3f u;
  Vector3f v;
  float u_offset;
  float v_offset;
  float distance;  // of the camera from the plane
};

struct alignas(64) Packet {
  std::array<int, 16> valid;
  RTCRayHit16 rays;
};

float dot(const Vector3f& a, float x, float y) {
  return a.x() * x + a.y() * y + a.z();
}

}  // namespace

struct Renderer::State {
  Scene scene;
  Device device;
  EmbreeScene embree;
  std::vector<std::uint32_t> surface_of_triangle;
  std::vector<Shading> shading;
  std::vector<float> light;
  bool smooth_edges = true;

  void build_geometry();
  void build_shading(double light_grid_m);
  void work_out_light(const Executor& executor);
  double light_at(const Surface& surface, const Vector3d& point, std::uint64_t seed) const;
  bool occluded(const Vector3d& from, const Vector3d& direction, double far) const;
};

RayTable ray_table(const Camera& camera) {
  const std::string defect = camera_defect(camera);
  if (!defect.empty()) throw Error(ErrorKind::kMisuse, "ray_table", defect, "a usable camera");
  RayTable table;
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  table.x.reserve(pixels);
  table.y.reserve(pixels);
  Vector3d row_start = Vector3d::UnitZ();
  for (std::uint32_t row = 0; row < camera.height; ++row) {
    Vector3d ray = row_start;
    for (std::uint32_t column = 0; column < camera.width; ++column) {
      const auto solved =
          unproject(camera, {static_cast<double>(column), static_cast<double>(row)}, ray);
      if (!solved || !(solved->z() > 0.0)) {
        throw Error(ErrorKind::kMisuse, "ray_table",
                    fmt::format("no line of sight to the front for pixel ({}, {})", column, row),
                    "a camera that looks forward with its whole image, whose distortion can be "
                    "inverted");
      }
      ray = *solved;
      if (column == 0) row_start = ray;
      table.x.push_back(static_cast<float>(ray.x() / ray.z()));
      table.y.push_back(static_cast<float>(ray.y() / ray.z()));
    }
  }
  return table;
}

void Renderer::State::build_geometry() {
  std::vector<float> vertices;
  std::vector<std::uint32_t> triangles;
  for (std::size_t i = 0; i < scene.surfaces.size(); ++i) {
    const auto first = static_cast<std::uint32_t>(vertices.size() / 3);
    const std::vector<Vector3d> corners = scene.surfaces[i].corners();
    for (const Vector3d& corner : corners) {
      for (int k = 0; k < 3; ++k) vertices.push_back(static_cast<float>(corner[k]));
    }
    for (std::uint32_t k = 2; k < corners.size(); ++k) {
      triangles.insert(triangles.end(), {first, first + k - 1, first + k});
      surface_of_triangle.push_back(static_cast<std::uint32_t>(i));
    }
  }
  // Embree builds with all of the machine's threads. A limit would affect the whole process, which shares TBB
  // with it.
  device.reset(rtcNewDevice(nullptr));
  if (!device) {
    throw Error(ErrorKind::kStorage, "Renderer", "Embree cannot be started", "a usable processor");
  }
  embree.reset(rtcNewScene(device.get()));
  rtcSetSceneFlags(embree.get(), RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(embree.get(), RTC_BUILD_QUALITY_HIGH);
  if (!triangles.empty()) {
    auto* const geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* const vertex_buffer =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), vertices.size() / 3);
    auto* const index_buffer =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t), triangles.size() / 3);
    if (vertex_buffer == nullptr || index_buffer == nullptr) throw std::bad_alloc();
    std::copy(vertices.begin(), vertices.end(), static_cast<float*>(vertex_buffer));
    std::copy(triangles.begin(), triangles.end(), static_cast<std::uint32_t*>(index_buffer));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(embree.get(), geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(embree.get());
  if (rtcGetDeviceError(device.get()) != RTC_ERROR_NONE) {
    // Of a scene whose tasks could not be started, Embree's destructor ends the process. Leave it.
    static_cast<void>(embree.release());
    throw std::bad_alloc();
  }
}

void Renderer::State::build_shading(double light_grid_m) {
  double area = 0.0;
  for (const Surface& surface : scene.surfaces) {
    area += surface.edge_u.norm() * surface.edge_v.norm();
  }
  // Halls get a coarser grid: their light changes slower, too.
  constexpr double kMostNodes = 40000.0;
  const double step = std::max(light_grid_m, std::sqrt(area / kMostNodes));
  std::size_t nodes = 0;
  for (const Surface& surface : scene.surfaces) {
    Shading shade;
    shade.normal = surface.normal();
    shade.offset = shade.normal.dot(surface.origin);
    shade.texture = &scene.textures[surface.texture];
    shade.texture_index = surface.texture;
    shade.object = surface.object;
    const double wide = shade.texture->width();
    const double high = shade.texture->height();
    const auto [left, top, right, bottom] = surface.region;
    shade.u_gradient = surface.edge_u / surface.edge_u.squaredNorm() * (right - left) * wide;
    shade.v_gradient = surface.edge_v / surface.edge_v.squaredNorm() * (bottom - top) * high;
    shade.u_offset = left * wide - shade.u_gradient.dot(surface.origin);
    shade.v_offset = top * high - shade.v_gradient.dot(surface.origin);
    shade.lod = static_cast<float>(
        0.5 * std::log2(std::max(shade.u_gradient.norm() * shade.v_gradient.norm(), 1e-9)));
    const auto cells = [&](double length) {
      return surface.emits_light ? 2 : std::clamp(static_cast<int>(length / step) + 2, 2, 256);
    };
    shade.grid = {cells(surface.edge_u.norm()), cells(surface.edge_v.norm()), nodes};
    nodes +=
        static_cast<std::size_t>(shade.grid.columns) * static_cast<std::size_t>(shade.grid.rows);
    const auto scale = [](double extent, double low, double high_end, int count) {
      return static_cast<float>((count - 1) / (extent * (high_end - low)));
    };
    shade.light_u_scale = scale(wide, left, right, shade.grid.columns);
    shade.light_v_scale = scale(high, top, bottom, shade.grid.rows);
    shade.light_u_offset = static_cast<float>(-left * wide) * shade.light_u_scale;
    shade.light_v_offset = static_cast<float>(-top * high) * shade.light_v_scale;
    shading.push_back(shade);
  }
  light.assign(nodes, 1.0F);
}

bool Renderer::State::occluded(const Vector3d& from, const Vector3d& direction, double far) const {
  RTCRay ray{};
  ray.org_x = static_cast<float>(from.x());
  ray.org_y = static_cast<float>(from.y());
  ray.org_z = static_cast<float>(from.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tfar = static_cast<float>(far);
  ray.mask = ~0U;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(embree.get(), &context, &ray);
  return ray.tfar < 0.0F;
}

double Renderer::State::light_at(const Surface& surface, const Vector3d& point,
                                 std::uint64_t seed) const {
  const Vector3d normal = surface.normal();
  constexpr double kLift = 0.002;
  const Vector3d from = point + kLift * normal;
  double sum = 0.0;
  // Ambient light: near surfaces block some of it and reflect some.
  constexpr int kDirections = 24;
  constexpr double kReach = 1.0;
  constexpr double kThrownBack = 0.3;
  const Vector3d across = normal.unitOrthogonal();
  const Vector3d along = normal.cross(across);
  const double turn = uniform_of(seed);
  for (int i = 0; i < kDirections; ++i) {
    const double angle = 2.0 * std::numbers::pi * (i * std::numbers::phi + turn);
    const double height = std::sqrt((i + 0.5) / kDirections);  // more light from above
    const double radius = std::sqrt(1.0 - height * height);
    const Vector3d direction =
        height * normal + radius * (std::cos(angle) * across + std::sin(angle) * along);
    sum += scene.ambient / kDirections * (occluded(from, direction, kReach) ? kThrownBack : 1.0);
  }
  const int samples = scene.lights.size() > 6 ? 2 : 4;
  for (std::size_t k = 0; k < scene.lights.size(); ++k) {
    const AreaLight& lamp = scene.lights[k];
    for (int i = 0; i < samples; ++i) {
      const std::uint64_t draw = seed * 1000003 + k * 64 + static_cast<std::uint64_t>(i) * 2;
      const Vector3d target =
          lamp.centre + Vector3d((uniform_of(draw) - 0.5) * lamp.width_m,
                                 ((i + uniform_of(draw + 1)) / samples - 0.5) * lamp.length_m, 0.0);
      const Vector3d way = target - from;
      const double squared = way.squaredNorm();
      const Vector3d direction = way / std::sqrt(squared);
      const double cosine = normal.dot(direction);
      if (cosine <= 0.0 || direction.z() <= 0.0) continue;
      if (occluded(from, way, 0.999)) continue;
      sum += lamp.power * cosine * direction.z() / (samples * std::max(squared, 0.1));
    }
  }
  return sum;
}

void Renderer::State::work_out_light(const Executor& executor) {
  executor.for_blocks(scene.surfaces.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Surface& surface = scene.surfaces[i];
      const LightGrid& grid = shading[i].grid;
      if (surface.emits_light) continue;
      for (int row = 0; row < grid.rows; ++row) {
        for (int column = 0; column < grid.columns; ++column) {
          // Slightly inside, because adjacent walls occlude each other in the corner itself.
          constexpr double kInset = 0.02;
          const auto inside = [&](int index, int count, double length) {
            const double margin = std::min(0.3, kInset / length);
            return std::clamp(static_cast<double>(index) / (count - 1), margin, 1.0 - margin);
          };
          const Vector3d point = surface.point(inside(column, grid.columns, surface.edge_u.norm()),
                                               inside(row, grid.rows, surface.edge_v.norm()));
          const std::size_t node =
              grid.first + static_cast<std::size_t>(row * grid.columns + column);
          light[node] = static_cast<float>(light_at(surface, point, node));
        }
      }
    }
  });
}

Renderer::Renderer(Scene scene, double light_grid_m, bool smooth_edges, const Executor& executor) {
  scene.validate();
  auto state = std::make_shared<State>();
  state->scene = std::move(scene);
  state->smooth_edges = smooth_edges;
  state->build_geometry();
  state->build_shading(light_grid_m);
  state->work_out_light(executor);
  state_ = std::move(state);
}

const Scene& Renderer::scene() const {
  return state_->scene;
}

namespace {

std::uint16_t clipped(std::uint32_t light) {
  return static_cast<std::uint16_t>(
      std::min<std::uint32_t>(light, std::numeric_limits<std::uint16_t>::max()));
}

// The picture that is being made.
struct Job {
  const std::vector<Shading>& shading;
  const std::vector<float>& light;
  const std::vector<std::uint32_t>& surface_of_triangle;
  RTCScene embree;
  const RayTable& rays;
  Eigen::Matrix3f rotation;
  Vector3f origin;
  std::vector<Seen> seen;
  float pixel_lod;  // log2 of a pixel's angle
  RenderedFrame frame;
  std::vector<std::uint32_t> surfaces;  // of each pixel
  std::vector<std::uint8_t> edge;       // whether an edge runs through each pixel

  void look(const Rigid3& world_from_camera) {
    const Eigen::Matrix3d camera_from_world = world_from_camera.rotation().transpose();
    const Vector3d& eye = world_from_camera.translation();
    rotation = world_from_camera.rotation().cast<float>();
    origin = eye.cast<float>();
    seen.reserve(shading.size());
    for (const Shading& shade : shading) {
      const double distance = shade.offset - shade.normal.dot(eye);
      Seen one;
      one.distance = static_cast<float>(std::abs(distance));
      // Skips a surface whose plane contains the camera, because no ray hits it.
      constexpr double kInPlane = 1e-9;
      one.plane = std::abs(distance) < kInPlane
                      ? Vector3f(0.0F, 0.0F, 0.0F)
                      : Vector3f((camera_from_world * shade.normal / distance).cast<float>());
      one.u = (camera_from_world * shade.u_gradient).cast<float>();
      one.v = (camera_from_world * shade.v_gradient).cast<float>();
      one.u_offset = static_cast<float>(shade.u_offset + shade.u_gradient.dot(eye));
      one.v_offset = static_cast<float>(shade.v_offset + shade.v_gradient.dot(eye));
      seen.push_back(one);
    }
  }

  // Fires the rays along (x, y, 1); leaves the surface of each in `hit`.
  void trace(Packet& packet, const std::array<float, 16>& x, const std::array<float, 16>& y,
             std::array<std::uint32_t, 16>& hit) const {
    constexpr float kNearest = 0.01F;
    for (std::size_t i = 0; i < 16; ++i) {
      packet.rays.ray.org_x[i] = origin.x();
      packet.rays.ray.org_y[i] = origin.y();
      packet.rays.ray.org_z[i] = origin.z();
      packet.rays.ray.dir_x[i] = rotation(0, 0) * x[i] + rotation(0, 1) * y[i] + rotation(0, 2);
      packet.rays.ray.dir_y[i] = rotation(1, 0) * x[i] + rotation(1, 1) * y[i] + rotation(1, 2);
      packet.rays.ray.dir_z[i] = rotation(2, 0) * x[i] + rotation(2, 1) * y[i] + rotation(2, 2);
      packet.rays.ray.tnear[i] = kNearest;
      packet.rays.ray.tfar[i] = std::numeric_limits<float>::infinity();
      packet.rays.ray.time[i] = 0.0F;
      packet.rays.ray.mask[i] = ~0U;
      packet.rays.ray.flags[i] = 0;
      packet.rays.hit.geomID[i] = kNothing;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(packet.valid.data(), embree, &context, &packet.rays);
    for (std::size_t i = 0; i < 16; ++i) {
      hit[i] = packet.rays.hit.geomID[i] == kNothing
                   ? kNothing
                   : surface_of_triangle[packet.rays.hit.primID[i]];
    }
  }

  float depth(std::uint32_t surface, float x, float y) const {
    const float inverse = dot(seen[surface].plane, x, y);
    return inverse > 0.0F ? 1.0F / inverse : 0.0F;
  }

  std::array<std::uint32_t, 3> color(std::uint32_t surface, float x, float y, float z,
                                     float facing) const {
    const Seen& one = seen[surface];
    const Shading& shade = shading[surface];
    const float u = one.u_offset + z * dot(one.u, x, y);
    const float v = one.v_offset + z * dot(one.v, x, y);
    // The footprint of a pixel is longer the more slanted the surface: its mean side.
    const float slant = std::max(facing, 0.05F);
    const float level = shade.lod + pixel_lod + rough_log2(z) - 0.5F * rough_log2(slant);
    const std::uint32_t texel = shade.texture->sample(u, v, level);

    const LightGrid& grid = shade.grid;
    const float gx = std::clamp(u * shade.light_u_scale + shade.light_u_offset, 0.0F,
                                static_cast<float>(grid.columns - 1) - 1e-4F);
    const float gy = std::clamp(v * shade.light_v_scale + shade.light_v_offset, 0.0F,
                                static_cast<float>(grid.rows - 1) - 1e-4F);
    const int column = static_cast<int>(gx);
    const int row = static_cast<int>(gy);
    const float fx = gx - static_cast<float>(column);
    const float fy = gy - static_cast<float>(row);
    const float* const node =
        light.data() + grid.first + static_cast<std::size_t>(row * grid.columns + column);
    const float upper = node[0] + (node[1] - node[0]) * fx;
    const float lower = node[grid.columns] + (node[grid.columns + 1] - node[grid.columns]) * fx;
    const float brightness = upper + (lower - upper) * fy;
    const auto scale =
        static_cast<std::uint32_t>(brightness * (256.0F * RenderedFrame::kLightPerLevel));
    return {((texel & 0xffU) * scale) >> 8, (((texel >> 8) & 0xffU) * scale) >> 8,
            (((texel >> 16) & 0xffU) * scale) >> 8};
  }

  void centres(std::uint32_t first_row, std::uint32_t last_row) {
    Packet packet;
    std::array<float, 16> x{};
    std::array<float, 16> y{};
    std::array<std::uint32_t, 16> hit{};
    for (std::uint32_t top = first_row; top < last_row; top += 4) {
      for (std::uint32_t left = 0; left < frame.width; left += 4) {
        for (std::uint32_t i = 0; i < 16; ++i) {
          const bool inside = left + i % 4 < frame.width && top + i / 4 < last_row;
          const std::uint32_t column = std::min(left + i % 4, frame.width - 1);
          const std::uint32_t row = std::min(top + i / 4, last_row - 1);
          const std::size_t pixel = std::size_t{row} * frame.width + column;
          packet.valid[i] = inside ? -1 : 0;
          x[i] = rays.x[pixel];
          y[i] = rays.y[pixel];
        }
        trace(packet, x, y, hit);
        for (std::uint32_t i = 0; i < 16; ++i) {
          if (packet.valid[i] == 0) continue;
          const std::size_t pixel = std::size_t{top + i / 4} * frame.width + left + i % 4;
          const std::uint32_t surface = hit[i];
          const float z = surface == kNothing ? 0.0F : depth(surface, x[i], y[i]);
          surfaces[pixel] = z > 0.0F ? surface : kNothing;
          if (!(z > 0.0F)) continue;
          const float length = std::sqrt(x[i] * x[i] + y[i] * y[i] + 1.0F);
          const float facing = std::min(1.0F, seen[surface].distance / (z * length));
          frame.depth_m[pixel] = z;
          frame.facing[pixel] = facing;
          const auto bgr = color(surface, x[i], y[i], z, facing);
          for (std::size_t k = 0; k < 3; ++k) frame.bgr[3 * pixel + k] = clipped(bgr[k]);
        }
      }
    }
  }

  bool on_edge(std::uint32_t column, std::uint32_t row) const {
    const std::size_t pixel = std::size_t{row} * frame.width + column;
    const std::uint32_t own = surfaces[pixel];
    const auto differs = [&](std::size_t other) {
      const std::uint32_t its = surfaces[other];
      if (its == own) return false;
      if (its == kNothing || own == kNothing) return true;
      // Adjacent facets of a round object have no edge between them.
      const bool continues = shading[its].object == shading[own].object &&
                             shading[its].texture_index == shading[own].texture_index;
      constexpr float kJump = 0.02F;
      if (continues &&
          std::abs(frame.depth_m[other] - frame.depth_m[pixel]) <= kJump * frame.depth_m[pixel]) {
        return false;
      }
      // An invisible edge needs no smoothing.
      constexpr int kFaint = 8 * RenderedFrame::kLightPerLevel;
      for (std::size_t k = 0; k < 3; ++k) {
        if (std::abs(frame.bgr[3 * other + k] - frame.bgr[3 * pixel + k]) > kFaint) return true;
      }
      return false;
    };
    return (column > 0 && differs(pixel - 1)) || (column + 1 < frame.width && differs(pixel + 1)) ||
           (row > 0 && differs(pixel - frame.width)) ||
           (row + 1 < frame.height && differs(pixel + frame.width));
  }

  void find_edges(std::uint32_t first_row, std::uint32_t last_row) {
    for (std::uint32_t row = first_row; row < last_row; ++row) {
      for (std::uint32_t column = 0; column < frame.width; ++column) {
        edge[std::size_t{row} * frame.width + column] = on_edge(column, row) ? 1 : 0;
      }
    }
  }

  void smooth_edges(std::uint32_t first_row, std::uint32_t last_row) {
    // A rotated grid: each row and column of a quarter pixel once.
    constexpr std::array<std::array<float, 2>, 4> kOffsets = {
        {{-0.125F, -0.375F}, {0.375F, -0.125F}, {0.125F, 0.375F}, {-0.375F, 0.125F}}};
    Packet packet;
    std::array<float, 16> x{};
    std::array<float, 16> y{};
    std::array<std::uint32_t, 16> hit{};
    std::array<std::size_t, 4> pixels{};
    std::size_t waiting = 0;
    const auto fire = [&] {
      for (std::size_t i = 0; i < 16; ++i) packet.valid[i] = i < 4 * waiting ? -1 : 0;
      trace(packet, x, y, hit);
      for (std::size_t k = 0; k < waiting; ++k) {
        std::array<std::uint32_t, 3> sum{};
        for (std::size_t i = 4 * k; i < 4 * k + 4; ++i) {
          const float z = hit[i] == kNothing ? 0.0F : depth(hit[i], x[i], y[i]);
          if (!(z > 0.0F)) continue;
          const float length = std::sqrt(x[i] * x[i] + y[i] * y[i] + 1.0F);
          const float facing = std::min(1.0F, seen[hit[i]].distance / (z * length));
          const auto bgr = color(hit[i], x[i], y[i], z, facing);
          for (std::size_t c = 0; c < 3; ++c) sum[c] += bgr[c];
        }
        for (std::size_t c = 0; c < 3; ++c) frame.bgr[3 * pixels[k] + c] = clipped(sum[c] / 4);
      }
      waiting = 0;
    };
    for (std::uint32_t row = first_row; row < last_row; ++row) {
      for (std::uint32_t column = 0; column < frame.width; ++column) {
        const std::size_t pixel = std::size_t{row} * frame.width + column;
        if (edge[pixel] == 0) continue;
        // The distance of rays, from the next pixel or, at the border, from the previous one.
        const std::size_t left = column + 1 < frame.width || column == 0 ? pixel : pixel - 1;
        const std::size_t right = std::min(left + 1, std::size_t{row + 1} * frame.width - 1);
        const std::size_t above = row + 1 < frame.height || row == 0 ? pixel : pixel - frame.width;
        const std::size_t below = row + 1 < frame.height || row > 0 ? above + frame.width : above;
        for (std::size_t i = 0; i < 4; ++i) {
          const auto [across, down] = kOffsets[i];
          x[4 * waiting + i] = rays.x[pixel] + across * (rays.x[right] - rays.x[left]) +
                               down * (rays.x[below] - rays.x[above]);
          y[4 * waiting + i] = rays.y[pixel] + across * (rays.y[right] - rays.y[left]) +
                               down * (rays.y[below] - rays.y[above]);
        }
        pixels[waiting++] = pixel;
        if (waiting == 4) fire();
      }
    }
    if (waiting > 0) fire();
  }
};

}  // namespace

RenderedFrame Renderer::render(const Camera& camera, const RayTable& rays,
                               const Rigid3& world_from_camera, const Executor& executor) const {
  const std::size_t count = std::size_t{camera.width} * camera.height;
  refuse_if(count == 0 || rays.x.size() != count || rays.y.size() != count, "Renderer::render",
            fmt::format("{} rays for {} pixels", rays.x.size(), count),
            "the camera's own ray_table");
  Job job{state_->shading,
          state_->light,
          state_->surface_of_triangle,
          state_->embree.get(),
          rays,
          {},
          {},
          {},
          0.0F,
          {},
          {},
          {}};
  job.look(world_from_camera);
  // The angle of a pixel in the middle of the image.
  const std::size_t middle = std::size_t{camera.height / 2} * camera.width + camera.width / 2;
  const std::size_t before = middle > 0 ? middle - 1 : middle;
  const float angle = std::abs(rays.x[middle] - rays.x[before]);
  job.pixel_lod = rough_log2(std::max(angle, 1e-6F));
  job.frame.width = camera.width;
  job.frame.height = camera.height;
  job.frame.bgr.assign(3 * count, 0);
  job.frame.depth_m.assign(count, 0.0F);
  job.frame.facing.assign(count, 0.0F);
  job.surfaces.assign(count, kNothing);
  constexpr std::size_t kRows = 16;
  const auto rows_of = [&](auto&& body) {
    executor.for_blocks(camera.height, kRows, [&](std::size_t begin, std::size_t end) {
      body(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
    });
  };
  rows_of([&](std::uint32_t begin, std::uint32_t end) { job.centres(begin, end); });
  if (state_->smooth_edges) {
    // All edges are found before any pixel changes, or they would depend on the order of the rows.
    job.edge.resize(count);
    rows_of([&](std::uint32_t begin, std::uint32_t end) { job.find_edges(begin, end); });
    rows_of([&](std::uint32_t begin, std::uint32_t end) { job.smooth_edges(begin, end); });
  }
  return std::move(job.frame);
}

}  // namespace cairn::detail
