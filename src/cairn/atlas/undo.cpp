// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdint>
#include <map>
#include <ranges>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/atlas/atlas.hpp"
#include "cairn/core/error.hpp"

namespace cairn {
namespace {

// Restores an object's earlier value, unless it was changed since.
template <class Id, class Value, class Equal, class Restore, class Remove>
void set_back(Id id, const std::map<Id, Value>& before, const std::map<Id, Value>& after,
              const std::map<Id, Value>& now, const Equal& equal, const Restore& restore,
              const Remove& remove, const std::string& name, const std::string& what) {
  const auto then = before.find(id);
  const auto left = after.find(id);
  const auto here = now.find(id);
  const bool same = (left == after.end()) == (here == now.end()) &&
                    (left == after.end() || equal(left->second, here->second));
  refuse_if(!same, name, fmt::format("{} was changed again since", what),
            "to undo the later commands first");
  const bool changed = (then == before.end()) != (left == after.end()) ||
                       (then != before.end() && !equal(then->second, left->second));
  if (!changed) return;
  if (then == before.end()) {
    remove(id);
  } else {
    restore(then->second);
  }
}

struct Command {
  AtlasCommit chosen;
  std::vector<CommitId> commits;  // ascending
  std::vector<CommitId>
      later;  // the last commit of each later command that is not undone, the last one first
};

// The command of a commit; std::nullopt: the last one that is not undone.
Command command_to_undo(const std::vector<AtlasCommit>& log, std::optional<CommitId> commit_id,
                        const std::string& name) {
  std::map<CommitId, CommitId> runs;  // by commit
  for (const AtlasCommit& commit : log) runs[commit.id] = commit.run;
  std::set<CommitId> undone;  // runs
  for (const AtlasCommit& commit : std::ranges::reverse_view(log)) {
    // Ignores an undo that was itself undone, and what was undone before the log starts.
    if (!commit.undoes || undone.contains(commit.run)) continue;
    const auto run = runs.find(*commit.undoes);
    if (run != runs.end()) undone.insert(run->second);
  }
  const auto chosen = std::find_if(log.rbegin(), log.rend(), [&](const AtlasCommit& commit) {
    return commit_id ? commit.id == *commit_id : !commit.undoes && !undone.contains(commit.run);
  });
  refuse_if(chosen == log.rend(), name,
            commit_id ? fmt::format("no commit {}", commit_id->value) : "nothing to undo",
            "a commit of its log");
  Command command{*chosen, {}, {}};
  for (const AtlasCommit& commit : log) {
    if (commit.run == chosen->run) command.commits.push_back(commit.id);
  }
  const CommitId first = command.commits.front();
  const CommitId last = command.commits.back();
  CommitId run;  // of the commit after
  for (const AtlasCommit& commit : std::ranges::reverse_view(log)) {
    if (commit.id <= last) break;
    if (commit.run != run && !commit.undoes && !undone.contains(commit.run)) {
      command.later.push_back(commit.id);
    }
    run = commit.run;
  }
  refuse_if(undone.contains(chosen->run), name,
            fmt::format("commit {} is undone already", last.value), "another commit");
  // A run has the id of its first commit.
  refuse_if(first != chosen->run || (first == log.front().id && first.value > 1), name,
            fmt::format("what was before commit {} is compacted", first.value), "a later commit");
  return command;
}

AtlasChanges undoing(const Command& command, AtlasStore& store, const AtlasState& now) {
  const std::vector<CommitId>& commits = command.commits;
  const AtlasTouched touched = store.touched(commits);
  const AtlasState before = store.state(CommitId{commits.front().value - 1});
  const AtlasState after = store.state(commits.back());
  AtlasChanges changes;
  changes.undoes = commits.back();
  changes.text = commits.size() == 1 ? fmt::format("commit {}: {} {}", command.chosen.id.value,
                                                   command.chosen.verb, command.chosen.text)
                                     : fmt::format("commits {} to {}: {}", commits.front().value,
                                                   commits.back().value, command.chosen.verb);
  const std::string& name = store.name();
  const auto same_node = [](const AtlasNode&, const AtlasNode&) { return true; };
  const auto same_link = [](const Link&, const Link&) { return true; };
  for (const NodeId id : touched.nodes) {
    set_back(
        id, before.nodes, after.nodes, now.nodes, same_node,
        [&](const AtlasNode& node) { changes.nodes.push_back(node); },
        [&](NodeId removed) { changes.removed_nodes.push_back(removed); }, name,
        fmt::format("map {}", id.value));
  }
  for (const LinkId id : touched.links) {
    set_back(
        id, before.links, after.links, now.links, same_link,
        [&](const Link& link) { changes.links.push_back(link); },
        [&](LinkId removed) { changes.removed_links.push_back(removed); }, name,
        fmt::format("link {}", id.value));
  }
  for (const NodeId id : touched.poses) {
    set_back(
        id, before.poses, after.poses, now.poses,
        [](const AtlasPose& a, const AtlasPose& b) { return a == b; },
        [&](const AtlasPose& pose) { changes.poses.push_back(pose); },
        [&](NodeId removed) { changes.removed_poses.push_back(removed); }, name,
        fmt::format("the pose of map {}", id.value));
  }
  for (const LinkId id : touched.agrees) {
    set_back(
        id, before.agrees, after.agrees, now.agrees, [](bool a, bool b) { return a == b; },
        [&](bool agrees) { changes.agrees.emplace_back(id, agrees); },
        [&](LinkId removed) { changes.removed_agrees.push_back(removed); }, name,
        fmt::format("the agreement of link {}", id.value));
  }
  return changes;
}

}  // namespace

CommitId Atlas::undo(std::optional<CommitId> commit_id) {
  begin_run();
  CommitId undone;
  std::vector<std::uint64_t> later;
  // Reads the log and the earlier states within the commit, so that no other process drops rows that it restores.
  try {
    commit("undo", [&](const AtlasState& now) {
      later.clear();
      const Command command = command_to_undo(store_->log(), commit_id, store_->name());
      undone = command.commits.back();
      for (const CommitId id : command.later) later.push_back(id.value);
      return undoing(command, *store_, now);
    });
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kMisuse || later.empty()) throw;
    throw Error(ErrorKind::kMisuse, store_->name(),
                fmt::format("later commands build on commit {}", undone.value),
                fmt::format("to undo the later commands first, those of commits {}",
                            fmt::join(later, ", ")));
  }
  return undone;
}

}  // namespace cairn
