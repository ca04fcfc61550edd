// SPDX-License-Identifier: BSD-3-Clause
// Verbs of atlas that take back or look back: remove, split, unlink, log, undo, diff, verify, compact, salvage.
#include <iterator>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/merging/changes.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/atlas_arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"
#include "support/map_lists.hpp"

namespace cairn::cli {
namespace {

Json place_json(const std::optional<ChangedPlace>& place) {
  if (!place) return nullptr;
  return {{"position", to_json(place->centre)},
          {"low", to_json(place->low)},
          {"high", to_json(place->high)},
          {"size", to_json(Eigen::Vector3d(place->high - place->low))},
          {"landmarks", place->landmarks.size()}};
}

std::string place_text(const ChangedPlace& place, const std::string& unit) {
  const Eigen::Vector3d size = place.high - place.low;
  return fmt::format("{} {} {}, {} x {} x {} {}, {} landmarks", fixed(place.centre.x(), 2),
                     fixed(place.centre.y(), 2), fixed(place.centre.z(), 2), fixed(size.x(), 2),
                     fixed(size.y(), 2), fixed(size.z(), 2), unit, place.landmarks.size());
}

// Changes as documents have them.
Json changes_json(const ChangeResult& result) {
  Json json = {{"comparable_first", result.comparable_first},
               {"comparable_second", result.comparable_second},
               {"found_again", result.repeated},
               {"changes", Json::array()}};
  for (const Change& change : result.changes) {
    json["changes"].push_back(
        {{"kind", to_string(change.kind)},
         {"confidence", change.confidence},
         {"before", place_json(change.before)},
         {"after", place_json(change.after)},
         {"after_from_before", change.after_from_before
                                   ? to_json(Similarity3(*change.after_from_before).matrix())
                                   : Json(nullptr)}});
  }
  return json;
}

// A line of each change, for people; empty if there are none.
std::string changes_text(const ChangeResult& result, LengthUnit unit) {
  const std::string symbol = unit_symbol(unit);
  std::string text;
  for (const Change& change : result.changes) {
    text +=
        fmt::format("{:<8} {:>7}  ", to_string(change.kind), probability_text(change.confidence));
    if (change.before) text += "at " + place_text(*change.before, symbol);
    if (change.before && change.after) text += "; now ";
    if (change.after) text += "at " + place_text(*change.after, symbol);
    text += "\n";
  }
  return text;
}

struct RemoveArguments : AtlasArguments {
  std::vector<std::string> maps;

  void add_to(const Command& command) {
    command.add_words("maps", maps, "Maps to remove: names, or # and an id", "NAME...").required();
    AtlasArguments::add_to(command);
    command.footer(
        "Also removes their links and poses. Until compact drops the maps, undo restores them.\n"
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
      common.console().print("removed {}\n", node.name);
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

  void add_to(const Command& command) {
    command.add_text("map", map, "A map: its name, or # and its id", "NAME").required();
    add_number(command, "--keyframes", frames, "Keyframes of each part");
    AtlasArguments::add_to(command);
    command.footer(
        "Keeps a landmark if one part has all its observations. Links neighbouring parts by their "
        "poses in\n"
        "the map. Removes the map's links; 'cairn atlas link' links the parts to other maps.\n"
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
      common.console().print("{}: {} landmarks, {} keyframes\n", part.name,
                             with_commas(part.landmarks), part.frames);
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

  void add_to(const Command& command) {
    command.add_text("a", a, "A map: its name, or # and its id", "A").required();
    command.add_text("b", b, "Another map", "B").required();
    command.add_text("--reason", reason, "Reason, for the log", "TEXT");
    AtlasArguments::add_to(command);
    command.footer(
        "'cairn atlas link' does not try the pair again. The next 'cairn atlas optimize' updates "
        "the poses.\n"
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
    common.console().print("unlinked {} and {}\n", first.name, second.name);
    return kDone;
  }
};

struct LogArguments : AtlasArguments {
  bool all = false;

  void add_to(const Command& command) {
    command.add_flag("--all", all, "List every commit of a command, not only one line per command");
    AtlasArguments::add_to(command);
    command.footer(
        "Times are UTC.\n"
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
        console.print("{:>6}  {}  {}  {}: {}{}\n", commit->id.value, time_text(commit->time_ms),
                      commit->host.empty() ? commit->author : commit->author + "@" + commit->host,
                      commit->verb, commit->text,
                      all || others == 0 ? ""
                                         : fmt::format("; and {} {} before", others,
                                                       others == 1 ? "commit" : "commits"));
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

  void add_to(const Command& command) {
    add_number(command, "--commit", which,
               "Undo the command of this commit (default: the last command that is not undone)");
    AtlasArguments::add_to(command);
    command.footer(
        "Reverts all commits of one command in a new commit N; 'cairn atlas undo --commit N' "
        "restores them.\n"
        "Undo later commands that build on the command first.\n"
        "Example: cairn atlas undo --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open();
    const CommitId undone = atlas.undo(which ? std::optional(CommitId{*which}) : std::nullopt);
    const std::vector<AtlasCommit> log = atlas.store().log();
    common.console().print("undid {}\n", log.back().text);
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

  void add_to(const Command& command) {
    command.add_text("before", first, "First commit; with --world: first session or map", "COMMIT")
        .required();
    command.add_text("after", second,
                     "Second commit (default: the last); with --world: second session or map",
                     "COMMIT");
    command.add_flag("--world", world,
                     "List things that appeared, vanished or moved between two sessions or maps");
    add_options(command, ChangeOptions::table, &changes);
    AtlasArguments::add_to(command);
    common.add_seed_to(command);
    add_at_to(command);
    command.footer(
        "Both sessions or maps must be placed in one frame.\n"
        "Example: list what changed since commit 12, and what moved between two sessions\n"
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
    refuse_if(second.empty(), "--world", "one session or map", "two sessions or maps");
    with_option_names({ChangeOptions::table}, [&] { changes.validate(); });
    Atlas atlas = open_to_read();
    const AtlasState state = atlas.state(commit());
    const std::vector<NodeId> before = side(state, first);
    const std::vector<NodeId> after = side(state, second);
    const ChangeResult result =
        world_difference(atlas, state, before, after, changes, {.seed = common.seed});
    const NodeId frame = state.poses.at(before.front()).frame;
    Json json = head("diff_world", options_of(ChangeOptions::table, &changes));
    json["commit"] = state.commit.value;
    json["first"] = first;
    json["second"] = second;
    json["frame"] = state.nodes.at(frame).name;
    json.update(changes_json(result));
    write_document(json, common);
    const Console console = common.console();
    if (result.comparable_first + result.comparable_second == 0) {
      console.print("no comparable landmarks: no keyframe of one observed the area of the other\n");
    } else {
      console.print(
          "{} and {} landmarks are comparable, {} % of them were found again; in the frame of {}\n",
          with_commas(result.comparable_first), with_commas(result.comparable_second),
          fixed(100.0 * result.repeated, 1), state.nodes.at(frame).name);
      const std::string text = changes_text(result, state.nodes.at(frame).length_unit);
      console.print(text.empty() ? "no changes found\n" : text);
    }
    return kDone;
  }

  int run() {
    if (world) return compare_worlds();
    refuse_if(at.has_value(), "--at", "given without --world", "two commits to compare");
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
        console.print("{} {}\n", text, state.nodes.at(id).name);
        json[key].push_back(state.nodes.at(id).name);
      }
    };
    const auto links = [&](const char* key, const char* text, const std::vector<LinkId>& ids,
                           const AtlasState& state) {
      json[key] = Json::array();
      for (const LinkId id : ids) {
        const Link& link = state.links.at(id);
        console.print("{} {} <- {} ({})\n", text, state.nodes.at(link.target).name,
                      state.nodes.at(link.source).name, link.status());
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
        console.print("moved {}: to the frame of {}\n", node.name, now.nodes.at(frame).name);
      } else {
        console.print("moved {}: by {} {}, {} deg\n", node.name, fixed(moved.shift, 4),
                      unit_symbol(now.nodes.at(frame).length_unit),
                      fixed(degrees(moved.turn_rad), 3));
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
    console.print("{}: {} commits, {} maps of {} MB, {} links, {} poses: {}\n", shown(),
                  result.commits, result.maps,
                  fixed(1e-6 * static_cast<double>(result.map_bytes), 1), result.links,
                  result.poses, result.problems.empty() ? "sound" : "damaged");
    if (result.problems.empty()) return kDone;
    console.print("'cairn atlas salvage' copies the undamaged data to a new atlas\n");
    return kBadInput;
  }
};

struct CompactArguments : AtlasArguments {
  std::uint64_t keep = kKeptCommits;
  bool yes = false;

  void add_to(const Command& command) {
    add_number(command, "--keep", keep, "Number of commits to keep, the latest ones");
    command.add_flag("--yes", yes, "Drop the data; without --yes, only list it");
    AtlasArguments::add_to(command);
    command.footer(
        "Joins the commits before the last N into one and drops data that only they need. This "
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
    common.console().print("{} {} commits, {} links, {} poses, and {} maps of {} MB\n",
                           yes ? "dropped" : "would drop", result.commits, result.links,
                           result.poses, result.maps,
                           fixed(1e-6 * static_cast<double>(result.map_bytes), 1));
    if (!yes) common.console().print("no data was dropped; add --yes to drop it\n");
    return kDone;
  }
};

struct SalvageArguments : AtlasArguments {
  std::string output;

  void add_to(const Command& command) {
    command.add_text("-o,--output", output, "Atlas to write. Required", "FILE");
    AtlasArguments::add_to(command);
    command.footer(
        "Copies undamaged maps, links and poses of the last commit to a new atlas, without the "
        "history.\n"
        "The damaged atlas is not changed.\n"
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
    for (const std::string& lost : result.lost) console.print("lost {}\n", lost);
    console.print("saved {} maps, {} links and {} poses\nwrote {}\n", result.maps, result.links,
                  result.poses, output);
    return kDone;
  }
};

}  // namespace

void add_atlas_changes(const Command& atlas) {
  add_verb<RemoveArguments>(atlas, "remove", "Remove maps");
  add_verb<SplitArguments>(atlas, "split", "Split a map into several maps");
  add_verb<UnlinkArguments>(atlas, "unlink", "Remove the link between two maps");
  add_verb<LogArguments>(atlas, "log", "List the commits, latest first");
  add_verb<UndoArguments>(atlas, "undo", "Undo a command");
  add_verb<DiffArguments>(atlas, "diff", "Compare two commits, sessions or maps");
  add_verb<VerifyArguments>(atlas, "verify", "Check all data")
      .footer(
          "The exit code is 3 if the atlas is damaged.\n"
          "Example: cairn atlas verify --atlas town.atlas");
  add_verb<CompactArguments>(atlas, "compact", "Drop data that only old commits need");
  add_verb<SalvageArguments>(atlas, "salvage",
                             "Copy the undamaged data of a damaged atlas to a new one");
}

}  // namespace cairn::cli
