// SPDX-License-Identifier: BSD-3-Clause
// Aligns maps that a SLAM system has in memory: its keyframes, landmarks, observations and ORB descriptors become a
// LandmarkMap. A simulated room stands for the SLAM system.
#include <algorithm>
#include <array>
#include <cstdint>
#include <iostream>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <cairn/cairn.hpp>

namespace {

// What a SLAM system of your own holds.
struct Keyframe {
  std::uint64_t id;
  Eigen::Isometry3d world_from_camera;
};
struct Sighting {
  std::uint32_t keyframe;  // its index
  double u, v;             // pixels
};
struct MapPoint {
  std::uint64_t id;
  Eigen::Vector3d position;  // metres, in the world
  std::array<std::uint8_t, 32> orb;
  std::vector<Sighting> sightings;
};
struct SlamMap {
  std::vector<Keyframe> keyframes;
  std::vector<MapPoint> points;
};

cairn::LandmarkMap landmark_map(const SlamMap& slam) {
  cairn::MapTables tables;  // metres, unless info.length_unit says otherwise
  for (const Keyframe& keyframe : slam.keyframes) {
    const Eigen::Quaterniond q(keyframe.world_from_camera.rotation());
    tables.frames.ids.push_back(cairn::FrameId{keyframe.id});
    tables.frames.translations.emplace_back(keyframe.world_from_camera.translation());
    tables.frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
  }
  cairn::DescriptorColumn orb = {.kind = "ORB", .bytes_each = 32, .known = {}, .bytes = {}};
  tables.observations.offsets.push_back(0);
  for (const MapPoint& point : slam.points) {
    tables.landmarks.ids.push_back(cairn::LandmarkId{point.id});
    tables.landmarks.positions.push_back(point.position);
    orb.known.push_back(1);
    orb.bytes.insert(orb.bytes.end(), point.orb.begin(), point.orb.end());
    for (const Sighting& sighting : point.sightings) {
      tables.observations.frames.push_back(cairn::FrameIndex{sighting.keyframe});
      tables.observations.pixels.push_back({sighting.u, sighting.v});
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  tables.landmarks.descriptors = std::move(orb);
  return cairn::LandmarkMap(std::move(tables));  // throws if an index or a size is wrong
}

// A session in a room of 6 by 4 by 2.5 metres, whose world is that of its first camera.
SlamMap run_slam(unsigned session, const Eigen::Isometry3d& world_from_room) {
  std::mt19937 room(7);  // the same room in each session
  std::mt19937 noise(session);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::normal_distribution<double> error(0.0, 0.004);
  SlamMap slam;
  for (std::uint32_t k = 0; k < 24; ++k) {  // looks level, once around
    const Eigen::Matrix3d level = (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
    Eigen::Isometry3d room_from_camera = Eigen::Isometry3d::Identity();
    room_from_camera.translate(Eigen::Vector3d(3.0, 2.0, 1.2 + 0.02 * k));
    room_from_camera.rotate(Eigen::AngleAxisd(0.26 * k, Eigen::Vector3d::UnitZ()) * level);
    slam.keyframes.push_back({k, world_from_room * room_from_camera});
  }
  for (std::uint64_t id = 0; id < 2000; ++id) {
    Eigen::Vector3d corner(6.0 * share(room), 4.0 * share(room), 2.5 * share(room));
    const int axis = static_cast<int>(id % 2);  // on one of four walls
    corner[axis] = id % 4 < 2 ? 0.0 : (axis == 0 ? 6.0 : 4.0);
    MapPoint point = {id, {}, {}, {}};
    for (std::uint8_t& byte : point.orb) byte = static_cast<std::uint8_t>(room());
    if (share(noise) < 0.4) continue;  // not detected in this session
    point.orb[noise() % 32] ^= static_cast<std::uint8_t>(noise());
    corner += Eigen::Vector3d(error(noise), error(noise), error(noise));
    point.position = world_from_room * corner;
    for (std::uint32_t k = 0; k < slam.keyframes.size(); ++k) {
      const Eigen::Vector3d seen = slam.keyframes[k].world_from_camera.inverse() * point.position;
      if (seen.z() < 0.3) continue;
      const double u = 320.0 + 500.0 * seen.x() / seen.z();
      const double v = 240.0 + 500.0 * seen.y() / seen.z();
      if (u >= 0.0 && u < 640.0 && v >= 0.0 && v < 480.0) point.sightings.push_back({k, u, v});
    }
    if (point.sightings.size() >= 2) slam.points.push_back(point);
  }
  return slam;
}

}  // namespace

int main() try {
  Eigen::Isometry3d source_from_room = Eigen::Isometry3d::Identity();
  source_from_room.translate(Eigen::Vector3d(-3.0, 1.0, 0.5));
  source_from_room.rotate(Eigen::AngleAxisd(1.2, Eigen::Vector3d(0.1, 0.2, 1.0).normalized()));
  const SlamMap yesterday = run_slam(1, Eigen::Isometry3d::Identity());
  const SlamMap today = run_slam(2, source_from_room);

  const cairn::Alignment result = cairn::align(landmark_map(today), landmark_map(yesterday));
  std::cout << cairn::status_of(result) << ": " << result.reason << "\n";
  if (!result.target_from_source) return 4;
  const Eigen::Matrix4d difference =
      result.target_from_source->matrix() * source_from_room.matrix() - Eigen::Matrix4d::Identity();
  std::cout << "off by " << difference.cwiseAbs().maxCoeff() << "\n";
  return difference.cwiseAbs().maxCoeff() < 0.01 ? 0 : 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
