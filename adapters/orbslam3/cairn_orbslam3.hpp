// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <iomanip>
#include <limits>
#include <map>
#include <ostream>
#include <tuple>
#include <type_traits>
#include <utility>

// For users of ORB-SLAM3: writes a map in Cairn's text format, version 2. This header stands alone: it includes no
// part of Cairn, and uses only those members of ORB-SLAM3's classes that it calls. Call it in your own code, after
// the run, for each map of the atlas:
//
//   #include "cairn_orbslam3.hpp"
//   std::ofstream file("orbslam3.map");
//   cairn::write_orbslam3_map(*map, {width, height}, is_monocular, file);
namespace cairn {

struct OrbSlam3Image {
  unsigned width = 0;
  unsigned height = 0;
};

/// @tparam Map has GetAllKeyFrames() and GetAllMapPoints(), containers of pointers. Of a keyframe are used
///         mnId, mTimeStamp, fx, fy, cx, cy, isBad(), mvKeysUn[i].pt.x, .pt.y, .octave, and GetPoseInverse()
///         with translation() and unit_quaternion(). Of a map point are used mnId, isBad(), GetWorldPos()(i),
///         GetObservations(), a map from keyframes to tuples of indices of which -1 is none, and
///         GetDescriptor() with ptr() and cols.
/// @param is_monocular the scale is unknown; without it positions are metres
template <class Map>
void write_orbslam3_map(Map& map, const OrbSlam3Image& image, bool is_monocular,
                        std::ostream& out) {
  out << std::setprecision(std::numeric_limits<double>::max_digits10);
  out << "CAIRN 2\nMETA length_unit " << (is_monocular ? "free" : "metres") << '\n';
  out << "META provenance ORB-SLAM3\nDESCRIPTORS ORB 32\n";
  const auto keyframes = map.GetAllKeyFrames();
  // A camera for each set of numbers; undistorted keypoints have no distortion.
  std::map<std::tuple<float, float, float, float>, std::size_t> cameras;
  for (auto* const keyframe : keyframes) {
    const std::tuple<float, float, float, float> k(keyframe->fx, keyframe->fy, keyframe->cx,
                                                   keyframe->cy);
    if (!cameras.emplace(k, cameras.size()).second) continue;
    out << "CAMERA " << cameras.size() - 1 << " PINHOLE " << image.width << ' ' << image.height
        << ' ' << keyframe->fx << ' ' << keyframe->fy << ' ' << keyframe->cx << ' ' << keyframe->cy
        << '\n';
  }
  for (auto* const keyframe : keyframes) {
    if (keyframe->isBad()) continue;
    const auto world_from_camera = keyframe->GetPoseInverse();
    const auto t = world_from_camera.translation();
    const auto q = world_from_camera.unit_quaternion();
    const auto id = keyframe->mnId;
    out << "FRAME " << id << ' ' << t(0) << ' ' << t(1) << ' ' << t(2) << ' ' << q.w() << ' '
        << q.x() << ' ' << q.y() << ' ' << q.z() << "\nTIME " << id << ' ' << keyframe->mTimeStamp
        << "\nVIEW " << id << ' '
        << cameras.at({keyframe->fx, keyframe->fy, keyframe->cx, keyframe->cy}) << '\n';
  }
  for (auto* const point : map.GetAllMapPoints()) {
    if (point == nullptr || point->isBad()) continue;
    const auto x = point->GetWorldPos();
    std::size_t count = 0;
    const auto observations = point->GetObservations();
    for (const auto& [keyframe, indices] : observations) {
      count += !keyframe->isBad() && std::get<0>(indices) >= 0 ? 1 : 0;
    }
    out << "LANDMARK " << point->mnId << ' ' << x(0) << ' ' << x(1) << ' ' << x(2) << " - "
        << count;
    using Keyframe = std::decay_t<decltype(keyframes.front())>;
    using Id = std::decay_t<decltype(keyframes.front()->mnId)>;
    std::map<Id, std::pair<int, Keyframe>> seen;  // by id: the same map gives the same file
    for (const auto& [keyframe, indices] : observations) {
      const int index = std::get<0>(indices);
      if (!keyframe->isBad() && index >= 0) seen.insert({keyframe->mnId, {index, keyframe}});
    }
    for (const auto& [id, observation] : seen) {
      const auto& keypoint =
          observation.second->mvKeysUn[static_cast<std::size_t>(observation.first)];
      out << ' ' << id << ' ' << keypoint.pt.x << ' ' << keypoint.pt.y;
    }
    out << '\n';
    if (!seen.empty()) out << "DETAIL " << point->mnId;
    for (const auto& [id, observation] : seen) {
      const auto& keypoint =
          observation.second->mvKeysUn[static_cast<std::size_t>(observation.first)];
      out << ' ' << observation.first << " - " << keypoint.octave;
    }
    if (!seen.empty()) out << '\n';
    const auto descriptor = point->GetDescriptor();
    if (descriptor.cols != 32) continue;
    out << "DESCRIPTOR " << point->mnId << ' ';
    constexpr char kDigits[] = "0123456789abcdef";
    for (int i = 0; i < 32; ++i) {
      const unsigned char byte = descriptor.ptr()[i];
      out << kDigits[byte >> 4U] << kDigits[byte & 15U];
    }
    out << '\n';
  }
}

}  // namespace cairn
