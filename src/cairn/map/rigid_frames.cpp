// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/rigid_frames.hpp"

#include <numeric>

namespace cairn {

std::unordered_map<CameraIndex, Rigid3> cameras_from_rigs(std::span<const Rig> rigs) {
  std::unordered_map<CameraIndex, Rigid3> result;
  for (const Rig& rig : rigs) {
    for (const Rig::Mount& mount : rig.mounts) {
      result.emplace(mount.camera, mount.camera_from_rig());
    }
  }
  return result;
}

RigidFrames rigid_frames(std::span<const Rig> rigs, const FrameTable& frames) {
  const std::size_t count = frames.ids.size();
  RigidFrames result{std::vector<std::uint32_t>(count), std::vector<Rigid3>(count)};
  std::iota(result.lead.begin(), result.lead.end(), 0U);
  const auto from_rig = cameras_from_rigs(rigs);
  std::unordered_map<InstantId, std::uint32_t> lead_of;
  for (std::uint32_t i = 0; i < frames.instants.size(); ++i) {
    const std::optional<InstantId> instant = frames.instants[i];
    if (!instant) continue;
    const std::uint32_t lead = lead_of.emplace(*instant, i).first->second;
    if (lead == i) continue;
    result.lead[i] = lead;
    result.camera_from_lead[i] =
        from_rig.at(*frames.cameras[i]) * from_rig.at(*frames.cameras[lead]).inverse();
  }
  return result;
}

void hold_rigs(MapTables& tables) {
  FrameTable& frames = tables.frames;
  const RigidFrames rigid = rigid_frames(tables.rigs, frames);
  for (std::size_t i = 0; i < frames.ids.size(); ++i) {
    if (rigid.leads(i)) continue;
    const std::uint32_t lead = rigid.lead[i];
    const auto& of_lead = frames.quaternions[lead];
    const Rigid3 pose = Rigid3(Eigen::Quaterniond(of_lead[0], of_lead[1], of_lead[2], of_lead[3]),
                               frames.translations[lead]) *
                        rigid.camera_from_lead[i].inverse();
    const Eigen::Quaterniond q = pose.quaternion();
    frames.translations[i] = pose.translation();
    frames.quaternions[i] = {q.w(), q.x(), q.y(), q.z()};
  }
}

}  // namespace cairn
