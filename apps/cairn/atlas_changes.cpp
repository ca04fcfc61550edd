// SPDX-License-Identifier: BSD-3-Clause
// Verbs of atlas that take back or look back: remove, split, unlink, log, undo, diff, verify, compact, salvage.
#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/atlas/state_difference.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/atlas/world_difference.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"

#include "atlas_verbs.hpp"
#include "support/arguments.hpp"
#include "support/atlas_arguments.hpp"
#include "support/change_documents.hpp"
#include "support/map_lists.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

struct RemoveArguments : AtlasArguments {
  std::vector<std::string> maps;

  void add_to(CLI::App& command) {
    command.add_option("maps", maps, "Maps: names, or # and an id")
        ->required()
        ->take_all()
        ->type_name("NAME...");
    AtlasArguments::add_to(command);
    command.footer(
        "Links and poses of the maps go with them; their history and bytes stay, for undo, until "
        "compact.\n"
        "Example: cairn atlas remove tuesday --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open();
    std::vector<AtlasNode> nodes;
    const AtlasState state = atlas.state();
    for (const std::string& name : maps) nodes.push_back(node_named(state, name, *this));
    Json json = head("remove");
    json["removed"] = Json::array();
    for (const AtlasNode& node : nodes) {
      atlas.remove(node.id);
      common.console().print(fmt::format("removed {}\n", node.name));
      json["removed"].push_back(node.name);
    }
    json["commit"] = atlas.store().last_commit().value;
    write_document(json, common);
    return kDone;
  }
};

struct SplitArguments : AtlasArguments {
  std::string map;
  std::uint64_t frames = 20;

  void add_to(CLI::App& command) {
    command.add_option("map", map, "A map: its name, or # and its id")
        ->required()
        ->type_name("NAME");
    add_number(command, "--keyframes", frames, "Of each part");
    AtlasArguments::add_to(command);
    command.footer(
        "Only landmarks all of whose observations are in one part are kept. Neighbours are linked "
        "as they\n"
        "lie in the map; its links to others go, and link finds those of the parts.\n"
        "Example: cairn atlas split monday --keyframes 20 --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open();
    const AtlasNode node = node_named(atlas.state(), map, *this);
    const std::vector<NodeId> parts = atlas.split(node.id, static_cast<std::size_t>(frames));
    const AtlasState state = atlas.state();
    Json json = head("split");
    json["parts"] = Json::array();
    for (const NodeId id : parts) {
      const AtlasNode& part = state.nodes.at(id);
      common.console().print(fmt::format("{}: {} landmarks, {} keyframes\n", part.name,
                                         with_commas(part.landmarks), part.frames));
      json["parts"].push_back({{"id", id.value}, {"name", part.name}});
    }
    json["commit"] = state.commit.value;
    write_document(json, common);
    return kDone;
  }
};

struct UnlinkArguments : AtlasArguments {
  std::string a;
  std::string b;
  std::string reason;

  void add_to(CLI::App& command) {
    command.add_option("a", a, "A map: its name, or # and its id")->required()->type_name("A");
    command.add_option("b", b, "Another map")->required()->type_name("B");
    add_text(command, "--reason", reason, "Why, for the log", "TEXT");
    AtlasArguments::add_to(command);
    command.footer(
        "The pair is not tried again. Poses change with the next optimize.\n"
        "Example: cairn atlas unlink monday robot2 --reason \"two floors that look alike\" --atlas "
        "town.atlas");
  }

  int run() {
    Atlas atlas = open();
    const AtlasState state = atlas.state();
    const AtlasNode& first = node_named(state, a, *this);
    const AtlasNode& second = node_named(state, b, *this);
    atlas.unlink(first.id, second.id, reason);
    Json json = head("unlink");
    json["commit"] = atlas.store().last_commit().value;
    json["maps"] = {first.name, second.name};
    write_document(json, common);
    common.console().print(fmt::format("unlinked {} and {}\n", first.name, second.name));
    return kDone;
  }
};

struct LogArguments : AtlasArguments {
  bool all = false;

  void add_to(CLI::App& command) {
    command.add_flag("--all", all, "Each commit, where a command made several");
    AtlasArguments::add_to(command);
    command.footer(
        "A command that made several commits is one line. Times are UTC.\n"
        "Example: cairn atlas log --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open_to_read();
    const std::vector<AtlasCommit> log = atlas.store().log();
    const Console console = common.console();
    if (log.empty()) console.print("no commits yet\n");
    Json json = head("log");
    json["commits"] = Json::array();
    for (auto commit = log.rbegin(); commit != log.rend(); ++commit) {
      // Behind the last commit of its command, which was printed for all.
      const bool follows = commit != log.rbegin() && std::prev(commit)->run == commit->run;
      if (all || !follows) {
        std::size_t others = 0;
        for (auto one = std::next(commit); one != log.rend() && one->run == commit->run; ++one) {
          ++others;
        }
        console.print(
            fmt::format("{:>6}  {}  {}  {}: {}{}\n", commit->id.value, time_text(commit->time_ms),
                        commit->host.empty() ? commit->author : commit->author + "@" + commit->host,
                        commit->verb, commit->text,
                        all || others == 0 ? "" : fmt::format("; and {} commits before", others)));
      }
      json["commits"].push_back(
          {{"id", commit->id.value},
           {"run", commit->run.value},
           {"time_ms", commit->time_ms},
           {"author", commit->author},
           {"host", commit->host},
           {"verb", commit->verb},
           {"text", commit->text},
           {"undoes", commit->undoes ? Json(commit->undoes->value) : Json(nullptr)}});
    }
    write_document(json, common);
    return kDone;
  }
};

struct UndoArguments : AtlasArguments {
  std::optional<std::uint64_t> which;

  void add_to(CLI::App& command) {
    add_number(command, "--commit", which,
               "Undo the command that this commit belongs to; else the last that is not undone");
    AtlasArguments::add_to(command);
    command.footer(
        "All that one command did is undone, in a new commit: nothing is lost, and undo --commit "
        "with that\n"
        "commit does it again. What later commands build on must be undone first.\n"
        "Example: cairn atlas undo --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open();
    const CommitId undone = atlas.undo(which ? std::optional(CommitId{*which}) : std::nullopt);
    const std::vector<AtlasCommit> log = atlas.store().log();
    common.console().print(fmt::format("undid {}\n", log.back().text));
    Json json = head("undo");
    json["undone"] = undone.value;
    json["commit"] = log.back().id.value;
    write_document(json, common);
    return kDone;
  }
};

struct DiffArguments : AtlasArguments {
  std::string first;
  std::string second;
  bool world = false;
  ChangeOptions changes;

  void add_to(CLI::App& command) {
    command.add_option("before", first, "A commit; with --world a session or a map")
        ->required()
        ->type_name("COMMIT");
    command
        .add_option("after", second,
                    "Another commit, the last if not given; with --world the other")
        ->type_name("COMMIT");
    command.add_flag("--world", world,
                     "What the two sessions or maps show differently: things that appeared, "
                     "vanished or moved");
    add_number(command, "--min-size", changes.min_size,
               "With --world: longest side of a thing, at least, in the map's unit");
    add_number(command, "--min-confidence", changes.min_confidence,
               "With --world: from which confidence a thing is reported, between 0 and 1");
    AtlasArguments::add_to(command);
    add_at_to(command);
    command.footer(
        "A session is all maps that were added under it. Both must be placed in one frame.\n"
        "Example: what changed since commit 12; what is elsewhere on Tuesday\n"
        "  cairn atlas diff 12 --atlas town.atlas\n"
        "  cairn atlas diff --world monday tuesday --atlas town.atlas");
  }

  // The maps of a session of that name, else the map.
  std::vector<NodeId> side(const AtlasState& state, const std::string& name) const {
    std::vector<NodeId> nodes = placed_of_session(state, name);
    if (nodes.empty()) nodes.push_back(node_named(state, name, *this).id);
    return nodes;
  }

  int compare_worlds() {
    if (second.empty()) {
      throw Error(ErrorKind::kMisuse, "--world", "one session or map", "two of them");
    }
    changes.seed = common.seed;
    with_option_names({{"ChangeOptions.min_size", "--min-size"},
                       {"ChangeOptions.min_confidence", "--min-confidence"}},
                      [&] { changes.validate(); });
    Atlas atlas = open_to_read();
    const AtlasState state = atlas.state(commit());
    const std::vector<NodeId> before = side(state, first);
    const std::vector<NodeId> after = side(state, second);
    const ChangeResult result = world_difference(atlas, state, before, after, changes);
    const NodeId frame = state.poses.at(before.front()).frame;
    Json json = head("diff_world",
                     {{"min_size", changes.min_size}, {"min_confidence", changes.min_confidence}});
    json["commit"] = state.commit.value;
    json["first"] = first;
    json["second"] = second;
    json["frame"] = state.nodes.at(frame).name;
    json.update(to_json(result));
    write_document(json, common);
    const Console console = common.console();
    if (result.comparable_first + result.comparable_second == 0) {
      console.print("nothing to compare: no keyframe of one saw what the other holds\n");
    } else {
      console.print(fmt::format(
          "{} and {} landmarks should be in the other, {} of them are; in the frame of {}\n",
          with_commas(result.comparable_first), with_commas(result.comparable_second),
          percent(result.repeated), state.nodes.at(frame).name));
      const std::string text = changes_text(result, state.nodes.at(frame).length_unit);
      console.print(text.empty() ? "no thing appeared, vanished or moved\n" : text);
    }
    return kDone;
  }

  int run() {
    if (world) return compare_worlds();
    if (at) {
      throw Error(ErrorKind::kMisuse, "--at", "given without --world", "two commits to compare");
    }
    const auto before = parse_as<std::uint64_t>(first, "before");
    const auto after =
        second.empty() ? std::nullopt : std::optional(parse_as<std::uint64_t>(second, "after"));
    Atlas atlas = open_to_read();
    const AtlasState old = atlas.state(CommitId{before});
    const AtlasState now = atlas.state(after ? std::optional(CommitId{*after}) : std::nullopt);
    const AtlasDifference found = difference(old, now);
    const Console console = common.console();
    Json json = head("diff");
    json["before"] = old.commit.value;
    json["after"] = now.commit.value;
    const auto nodes = [&](const char* key, const char* text, const std::vector<NodeId>& ids,
                           const AtlasState& state) {
      json[key] = Json::array();
      for (const NodeId id : ids) {
        console.print(fmt::format("{} {}\n", text, state.nodes.at(id).name));
        json[key].push_back(state.nodes.at(id).name);
      }
    };
    const auto links = [&](const char* key, const char* text, const std::vector<AtlasLinkId>& ids,
                           const AtlasState& state) {
      json[key] = Json::array();
      for (const AtlasLinkId id : ids) {
        const AtlasLink& link = state.links.at(id);
        console.print(fmt::format("{} {} <- {} ({})\n", text, state.nodes.at(link.target).name,
                                  state.nodes.at(link.source).name,
                                  cairn::to_string(link.verdict)));
        json[key].push_back(to_json(link, state));
      }
    };
    nodes("added_maps", "added", found.added_nodes, now);
    nodes("removed_maps", "removed", found.removed_nodes, old);
    links("added_links", "linked", found.added_links, now);
    links("removed_links", "no longer linked", found.removed_links, old);
    nodes("placed", "placed", found.placed, now);
    nodes("no_longer_placed", "no longer placed", found.no_longer_placed, old);
    json["moved"] = Json::array();
    for (const MovedNode& moved : found.moved) {
      const AtlasNode& node = now.nodes.at(moved.node);
      const NodeId frame = now.poses.at(moved.node).frame;
      if (moved.frame_changed) {
        console.print(
            fmt::format("moved {}: to the frame of {}\n", node.name, now.nodes.at(frame).name));
      } else {
        console.print(fmt::format("moved {}: by {} {}, {} deg\n", node.name, fixed(moved.shift, 4),
                                  unit_symbol(now.nodes.at(frame).length_unit),
                                  fixed(degrees(moved.turn_rad), 3)));
      }
      json["moved"].push_back({{"map", node.name},
                               {"frame_changed", moved.frame_changed},
                               {"shift", moved.shift},
                               {"turn_deg", degrees(moved.turn_rad)}});
    }
    links("now_contradicted", "now contradicted:", found.now_contradicted, now);
    links("no_longer_contradicted", "no longer contradicted:", found.no_longer_contradicted, now);
    if (found.empty()) console.print("no difference\n");
    write_document(json, common);
    return kDone;
  }
};

struct VerifyArguments : AtlasArguments {
  int run() {
    Atlas atlas = open_to_read();
    const AtlasVerification result = atlas.store().verify();
    Json json = head("verify");
    json["sound"] = result.problems.empty();
    json["commits"] = result.commits;
    json["maps"] = result.maps;
    json["map_bytes"] = result.map_bytes;
    json["links"] = result.links;
    json["poses"] = result.poses;
    json["problems"] = result.problems;
    write_document(json, common);
    const Console console = common.console();
    for (const std::string& problem : result.problems) console.print(problem + "\n");
    console.print(fmt::format("{}: {} commits, {} maps of {} MB, {} links, {} poses: {}\n", shown(),
                              result.commits, result.maps,
                              fixed(1e-6 * static_cast<double>(result.map_bytes), 1), result.links,
                              result.poses, result.problems.empty() ? "sound" : "damaged"));
    if (result.problems.empty()) return kDone;
    console.print("'cairn atlas salvage' takes what is sound into a new atlas\n");
    return kBadInput;
  }
};

struct CompactArguments : AtlasArguments {
  std::uint64_t keep = kKeptCommits;
  bool yes = false;

  void add_to(CLI::App& command) {
    add_number(command, "--keep", keep, "How many of the last commits are kept");
    command.add_flag("--yes", yes, "Do it; without, it is only said what would be dropped");
    AtlasArguments::add_to(command);
    command.footer(
        "Commits before the last N become one, and what none of the last N needs is dropped: it "
        "cannot be\n"
        "undone. The file becomes smaller.\n"
        "Example: cairn atlas compact --keep 20 --yes --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open();
    AtlasCompaction result;
    with_option_names({{"keep", "--keep"}}, [&] { result = atlas.store().compact(keep, !yes); });
    Json json = head("compact", {{"keep", keep}, {"yes", yes}});
    json["done"] = yes;
    json["commits"] = result.commits;
    json["nodes"] = result.nodes;
    json["links"] = result.links;
    json["poses"] = result.poses;
    json["maps"] = result.maps;
    json["map_bytes"] = result.map_bytes;
    write_document(json, common);
    common.console().print(fmt::format("{} {} commits, {} links, {} poses, and {} maps of {} MB\n",
                                       yes ? "dropped" : "would drop", result.commits, result.links,
                                       result.poses, result.maps,
                                       fixed(1e-6 * static_cast<double>(result.map_bytes), 1)));
    if (!yes) common.console().print("nothing was changed; --yes does it\n");
    return kDone;
  }
};

struct SalvageArguments : AtlasArguments {
  std::string output;

  void add_to(CLI::App& command) {
    add_text(command, "-o,--output", output, "The new atlas. Required", "FILE");
    AtlasArguments::add_to(command);
    command.footer(
        "Takes the maps, links and poses that are sound, as they were last, into a new atlas. The "
        "history\n"
        "is not kept. The damaged atlas is not changed.\n"
        "Example: cairn atlas salvage --atlas town.atlas -o saved.atlas");
  }

  int run() {
    if (output.empty())
      throw Error(ErrorKind::kMisuse, "--output", "not given", "a name for the new atlas");
    require_outputs(common);
    const AtlasSalvage result = salvage_store(location, output, store_options(false));
    Json json = head("salvage");
    json["output"] = output;
    json["maps"] = result.maps;
    json["links"] = result.links;
    json["poses"] = result.poses;
    json["lost"] = result.lost;
    write_document(json, common);
    const Console console = common.console();
    for (const std::string& lost : result.lost) console.print(fmt::format("lost {}\n", lost));
    console.print(fmt::format("saved {} maps, {} links and {} poses\nwrote {}\n", result.maps,
                              result.links, result.poses, output));
    return kDone;
  }
};

}  // namespace

Run add_atlas_remove(CLI::App& atlas) {
  return add_atlas_verb<RemoveArguments>(atlas, "remove", "Take maps out of it");
}

Run add_atlas_split(CLI::App& atlas) {
  return add_atlas_verb<SplitArguments>(atlas, "split", "Make several maps of one");
}

Run add_atlas_unlink(CLI::App& atlas) {
  return add_atlas_verb<UnlinkArguments>(atlas, "unlink", "State that two maps are not linked");
}

Run add_atlas_log(CLI::App& atlas) {
  return add_atlas_verb<LogArguments>(atlas, "log", "List its commits, the last first");
}

Run add_atlas_undo(CLI::App& atlas) {
  return add_atlas_verb<UndoArguments>(atlas, "undo", "Take back what a command did");
}

Run add_atlas_diff(CLI::App& atlas) {
  return add_atlas_verb<DiffArguments>(atlas, "diff", "What changed between two commits");
}

Run add_atlas_verify(CLI::App& atlas) {
  return add_atlas_verb<VerifyArguments>(atlas, "verify", "Read all of it and check it",
                                         "Exit code 3: it is damaged.\n"
                                         "Example: cairn atlas verify --atlas town.atlas");
}

Run add_atlas_compact(CLI::App& atlas) {
  return add_atlas_verb<CompactArguments>(atlas, "compact", "Drop what only old commits need");
}

Run add_atlas_salvage(CLI::App& atlas) {
  return add_atlas_verb<SalvageArguments>(atlas, "salvage",
                                          "Take what is sound in a damaged atlas into a new one");
}

}  // namespace cairn::cli
