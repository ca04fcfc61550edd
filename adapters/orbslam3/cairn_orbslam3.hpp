// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <iomanip>
#include <limits>
#include <map>
#include <ostream>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

// For users of ORB-SLAM3: writes a map in Cairn's text format, version 3. This header stands alone: it includes no
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

namespace detail {

using OrbDescriptor = std::array<unsigned char, 32>;

inline int differing_bits(const OrbDescriptor& a, const OrbDescriptor& b) {
  int count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (unsigned bits = a[i] ^ b[i]; bits != 0; bits &= bits - 1) ++count;
  }
  return count;
}

/// The first descriptor and up to three others, each time the one that differs most from its nearest among
/// those chosen.
inline std::vector<OrbDescriptor> distinct_views(const std::vector<OrbDescriptor>& all) {
  constexpr std::size_t kMost = 4;
  std::vector<OrbDescriptor> chosen = {all.front()};
  std::vector<int> nearest(all.size(), std::numeric_limits<int>::max());
  while (chosen.size() < kMost) {
    std::size_t farthest = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const int bits = differing_bits(all[i], chosen.back());
      if (bits < nearest[i]) nearest[i] = bits;
      if (nearest[i] > nearest[farthest]) farthest = i;
    }
    if (nearest[farthest] == 0) break;
    chosen.push_back(all[farthest]);
  }
  return chosen;
}

/// @param matrix of bytes, with cols and ptr(row)
template <class Matrix>
bool append_descriptor(const Matrix& matrix, int row, std::vector<OrbDescriptor>& descriptors) {
  if (matrix.cols != 32) return false;
  OrbDescriptor& descriptor = descriptors.emplace_back();
  for (std::size_t i = 0; i < descriptor.size(); ++i) descriptor[i] = matrix.ptr(row)[i];
  return true;
}

}  // namespace detail

/// @tparam Map has GetAllKeyFrames() and GetAllMapPoints(), containers of pointers. Of a keyframe are used
///         mnId, mTimeStamp, fx, fy, cx, cy, isBad(), mvKeysUn[i].pt.x, .pt.y, .octave, mDescriptors, and
///         GetPoseInverse() with translation() and unit_quaternion(). Of a map point are used mnId, isBad(), GetWorldPos()(i),
///         GetObservations(), a map from keyframes to tuples of indices of which -1 is none, and
///         GetDescriptor(); both kinds of descriptors with ptr(row) and cols.
/// @param is_monocular the scale is unknown; without it positions are metres
template <class Map>
void write_orbslam3_map(Map& map, const OrbSlam3Image& image, bool is_monocular,
                        std::ostream& out) {
  out << std::setprecision(std::numeric_limits<double>::max_digits10);
  out << "CAIRN 3\nMETA length_unit " << (is_monocular ? "free" : "metres") << '\n';
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
    // What represents the point, and what differs most from it in the keyframes.
    std::vector<detail::OrbDescriptor> descriptors;
    if (!detail::append_descriptor(point->GetDescriptor(), 0, descriptors)) continue;
    for (const auto& [id, observation] : seen) {
      detail::append_descriptor(observation.second->mDescriptors, observation.first, descriptors);
    }
    for (const detail::OrbDescriptor& descriptor : detail::distinct_views(descriptors)) {
      out << "DESCRIPTOR " << point->mnId << ' ';
      constexpr char kDigits[] = "0123456789abcdef";
      for (const unsigned char byte : descriptor) {
        out << kDigits[byte >> 4U] << kDigits[byte & 15U];
      }
      out << '\n';
    }
  }
}

}  // namespace cairn
