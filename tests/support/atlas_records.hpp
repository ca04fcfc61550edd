// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "cairn/atlas/store/store.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/refusal.hpp"

// Small maps and links for tests of stores.
namespace cairn::testing {

inline std::string bytes_of(const LandmarkMap& map) {
  std::string bytes;
  write_binary(map, [&](std::string_view more) { bytes += more; });
  return bytes;
}

inline AtlasNode node(AtlasStore& store, const std::string& name, std::uint64_t seed) {
  AtlasNode node;
  node.name = name;
  node.map = store.put_map(bytes_of(synthetic_map({.seed = seed, .landmarks = 30, .frames = 4})));
  node.landmarks = 30;
  return node;
}

inline AtlasCommitted add(AtlasStore& store, const std::string& name, std::uint64_t seed) {
  const AtlasNode added = node(store, name, seed);
  return store.commit({.verb = "add"}, [&](const AtlasState&) {
    AtlasChanges changes;
    changes.text = name;
    changes.nodes = {added};
    return changes;
  });
}

inline Link link(NodeId target, NodeId source) {
  Link link;
  link.target = target;
  link.source = source;
  link.verdict = Verdict::kAligned;
  link.probability = 0.999;
  link.reason = "found";
  link.target_from_source =
      Similarity3(1.25, Rigid3::from_roll_pitch_yaw({0.1, -2.0, 3.0}, 0.3, 0.2, -0.1));
  link.covariance_with_scale = 1e-4 * Matrix7d::Identity();
  return link;
}

inline AtlasCommitted add_link(AtlasStore& store, const Link& link) {
  return store.commit({.verb = "link"}, [&](const AtlasState&) {
    AtlasChanges changes;
    changes.links = {link};
    return changes;
  });
}

}  // namespace cairn::testing
