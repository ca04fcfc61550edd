// SPDX-License-Identifier: BSD-3-Clause
#include "support/atlas_report.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/report/sections.hpp"

#include "support/atlas_arguments.hpp"
#include "support/map_lists.hpp"

namespace cairn::cli {
namespace {

report::LinkUse atlas_use_of(const Link& link, const AtlasState& state) {
  if (!link.connects()) {
    return link.verdict == Verdict::kAmbiguous ? report::LinkUse::kAmbiguous
                                               : report::LinkUse::kRejected;
  }
  const auto agrees = state.agrees.find(link.id);
  if (agrees == state.agrees.end()) return report::LinkUse::kUndecided;
  return agrees->second ? report::LinkUse::kUsed : report::LinkUse::kContradicted;
}

// A word in a shell, quoted where it must be.
std::string shell_word(const std::string& word) {
  const bool plain = !word.empty() && word.find_first_not_of(
                                          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                          "0123456789_./-+=:@%,") == std::string::npos;
  if (plain) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

report::Table log_table(const std::vector<AtlasCommit>& log, const std::string& location) {
  report::Table table;
  table.columns = {{"Commit", std::nullopt, report::CellType::kNumber, 0},
                   {"Time (UTC)", std::nullopt, report::CellType::kText, std::nullopt},
                   {"By", std::nullopt, report::CellType::kText, std::nullopt},
                   {"What", std::nullopt, report::CellType::kText, std::nullopt},
                   {"To undo it", std::nullopt, report::CellType::kCommand, std::nullopt}};
  for (auto commit = log.rbegin(); commit != log.rend(); ++commit) {
    // All commits of a command are undone together: the command stands at the last of them.
    const bool follows = commit != log.rbegin() && std::prev(commit)->run == commit->run;
    const std::string undo = fmt::format("cairn atlas undo --commit {} --atlas {}",
                                         commit->id.value, shell_word(location));
    table.rows.push_back(
        {static_cast<double>(commit->id.value), time_text(commit->time_ms),
         commit->host.empty() ? commit->author : commit->author + "@" + commit->host, commit->text,
         follows ? report::Scalar() : report::Scalar(undo)});
  }
  return table;
}

std::string answer_of(const AtlasState& state) {
  const std::vector<AtlasComponent> components = components_of(state);
  std::size_t aligned = 0;
  std::size_t contradicted = 0;
  for (const auto& [id, link] : state.links) {
    aligned += link.connects() ? 1 : 0;
    const auto agrees = state.agrees.find(id);
    contradicted += agrees != state.agrees.end() && !agrees->second ? 1 : 0;
  }
  std::string text = fmt::format("After commit {}: {} maps, {} of them placed", state.commit.value,
                                 state.nodes.size(), state.poses.size());
  if (components.size() == 1) {
    text += fmt::format(" in the frame of {}", state.nodes.at(components.front().frame).name);
  } else if (components.size() > 1) {
    text += fmt::format(" in {} groups", components.size());
  }
  text += fmt::format("; {} of {} pairs are aligned", aligned, state.links.size());
  if (contradicted > 0) text += fmt::format(", {} of them contradicted by others", contradicted);
  return text + ".";
}

}  // namespace

void add_atlas_state(report::Report& report, Atlas& atlas, const AtlasState& state,
                     const std::string& location) {
  report.subtitle = answer_of(state);
  std::map<NodeId, std::size_t> index_of;
  std::deque<LandmarkMap> kept;
  std::vector<report::NetworkMap> nodes;
  for (const auto& [id, node] : state.nodes) {
    index_of.emplace(id, nodes.size());
    kept.push_back(atlas.map(node));
    report::NetworkMap shown{.name = node.name, .map = &kept.back(), .session = node.session};
    shown.landmarks = node.landmarks;
    shown.keyframes = node.frames;
    shown.centre = node.extent.centre;
    shown.length_unit = node.length_unit;
    nodes.push_back(std::move(shown));
  }
  for (const auto& [id, index] : index_of) {
    const auto pose = state.poses.find(id);
    if (pose == state.poses.end()) {
      nodes[index].reason =
          "no aligned link connects it, or 'cairn atlas optimize' was not run since";
      continue;
    }
    nodes[index].frame = index_of.at(pose->second.frame);
    nodes[index].frame_from_map = pose->second.frame_from_node;
  }
  std::vector<report::NetworkEdge> edges;
  for (const auto& [id, link] : state.links) {
    edges.push_back({.target = index_of.at(link.target),
                     .source = index_of.at(link.source),
                     .use = atlas_use_of(link, state),
                     .kind = std::string(cairn::to_string(link.kind)),
                     .probability = link.probability,
                     .reason = link.reason,
                     .target_from_source = link.target_from_source});
  }
  report::add_network(report, nodes, edges);
  std::vector<AtlasCommit> log = atlas.store().log();
  std::erase_if(log, [&](const AtlasCommit& commit) { return commit.id > state.commit; });
  if (!log.empty()) {
    report.sections.push_back({.id = "log",
                               .title = "Log",
                               .text = "What was done, the last first. All commits of one command "
                                       "are undone together, in a new commit.",
                               .content = log_table(log, location)});
  }
}

}  // namespace cairn::cli
