// SPDX-License-Identifier: BSD-3-Clause
// Verbs of atlas that make a map of maps: init, add, link, optimize, merge.
#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/map_file.hpp"

#include "commands.hpp"
#include "support/adjustment.hpp"
#include "support/arguments.hpp"
#include "support/atlas_arguments.hpp"
#include "support/map_lists.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

std::string counted(std::size_t count, const std::string& noun) {
  return fmt::format("{} {}{}", with_commas(count), noun, count == 1 ? "" : "s");
}

struct InitArguments : AtlasArguments {
  int run() {
    Atlas::create(location, store_options(false));
    common.console().print("created {}\n", shown());
    return kDone;
  }
};

struct AddArguments : AtlasArguments {
  std::vector<std::string> paths;
  std::string name;
  std::string session;

  void add_to(const Command& command) {
    command
        .add_words("maps", paths,
                   "Maps: " + all_formats().titles_text() + "; or folders of .map and .cairn files",
                   "MAP...")
        .required();
    command.add_text("--name", name,
                     "Name of the map, if a single one is added (default: the file's name)",
                     "NAME");
    command.add_text("--session", session, "Session of the maps (default: for a folder, its name)",
                     "NAME");
    AtlasArguments::add_to(command);
    command.footer(
        "The atlas keeps a copy of each map. A map that it already holds is not added again.\n"
        "Example: add a map, and a folder of mini-maps\n"
        "  cairn atlas add monday.map robot2/ --atlas town.atlas");
  }

  int run() {
    std::vector<ListedMap> maps = listed_maps(paths);
    if (!name.empty()) {
      refuse_if(maps.size() > 1, "--name", fmt::format("given for {} maps", maps.size()),
                "one map");
      maps.front().name = name;
    }
    Atlas atlas = open();
    const Console console = common.console();
    Json json = head("add");
    json["maps"] = Json::array();
    std::vector<NodeId> ids;
    for (const ListedMap& map : maps) {
      const LoadedMap loaded = load_map(map.file, common);
      const Atlas::Added added =
          atlas.add(loaded.map, map.name, session.empty() ? map.session : session);
      ids.push_back(added.node);
      if (added.was_there) {
        console.print("{} is in the atlas already, as {}\n", map.file,
                      atlas.state().nodes.at(added.node).name);
      } else {
        console.print("added {}: {}, {}\n", map.name,
                      counted(loaded.map.landmark_count(), "landmark"),
                      counted(loaded.map.frame_count(), "keyframe"));
      }
      json["maps"].push_back({{"path", map.file},
                              {"id", added.node.value},
                              {"name", map.name},
                              {"was_there", added.was_there}});
    }
    std::vector<Link> links = links_of_folders(paths, maps);
    for (Link& link : links) {
      link.target = ids[link.target.value];
      link.source = ids[link.source.value];
    }
    const std::size_t linked = links.empty() ? 0 : atlas.link_by_odometry(links);
    if (linked > 0) console.print("linked {} by odometry\n", counted(linked, "pair"));
    json["linked_by_odometry"] = linked;
    json["commit"] = atlas.store().last_commit().value;
    write_document(json, common);
    return kDone;
  }
};

struct LinkArguments : AtlasArguments {
  AtlasLinkOptions options;
  std::vector<std::string> manual;
  std::vector<std::string> only;
  std::string pose;
  std::string reason;
  std::string shard;
  double sigma_m = 0.02;
  double sigma_deg = 0.5;

  void add_to(const Command& command) {
    add_options(command, LinkOptions::table, &options.links);
    command.add_words("--only", only, "Try only pairs with one of these maps", "NAME...");
    command.add_flag("--retry", options.retry,
                     "Also try pairs that were tried before and not aligned");
    command.add_text("--shard", shard, "Try only part I of N of the pairs, for several processes",
                     "I/N");
    command
        .add_words("--manual", manual, "Add a link with a known pose instead of aligning",
                   "TARGET SOURCE")
        .words(2);
    command.add_text(
        "--pose", pose,
        "With --manual: target_from_source, 16 numbers, row-major, or the JSON of an alignment",
        "FILE");
    add_number(command, "--sigma-m", sigma_m,
               "With --manual: standard deviation of the translation, metres");
    add_number(command, "--sigma-deg", sigma_deg,
               "With --manual: standard deviation of the rotation, degrees");
    command.add_text("--reason", reason, "With --manual: reason, for the log", "TEXT");
    AtlasArguments::add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    command.footer(
        "Each pair is tried once, whatever the result. After an interruption, the verb continues "
        "with the\n"
        "remaining pairs.\n"
        "Example: link new maps, and add one link with a known pose\n"
        "  cairn atlas link --atlas town.atlas\n"
        "  cairn atlas link --manual monday robot2 --pose pose.txt --atlas town.atlas");
  }

  int link_by_hand() {
    if (pose.empty())
      throw Error(ErrorKind::kMisuse, "--pose", "not given", "a file with the pose");
    refuse_if(!(sigma_m > 0.0) || !(sigma_deg > 0.0), sigma_m > 0.0 ? "--sigma-deg" : "--sigma-m",
              fmt::format("{}", sigma_m > 0.0 ? sigma_deg : sigma_m), "more than 0");
    const Similarity3 target_from_source = read_similarity_file(pose);
    Atlas atlas = open();
    const AtlasState state = atlas.state();
    const AtlasNode& target = node_named(state, manual[0], *this);
    const AtlasNode& source = node_named(state, manual[1], *this);
    const double sigma_rad = radians(sigma_deg);
    Matrix7d covariance = Matrix7d::Zero();
    for (int i = 0; i < 3; ++i) covariance(i, i) = sigma_m * sigma_m;
    for (int i = 3; i < 6; ++i) covariance(i, i) = sigma_rad * sigma_rad;
    // The scale is known no better than the rotation.
    if (target_from_source.scale() != 1.0) covariance(6, 6) = sigma_rad * sigma_rad;
    const LinkId id =
        atlas.link_manually(target.id, source.id, target_from_source, covariance, reason);
    const AtlasState now = atlas.state();
    Json json = head("link");
    json["commit"] = now.commit.value;
    json["links"] = Json::array({to_json(now.links.at(id), now)});
    write_document(json, common);
    common.console().print("{} <- {} added by hand\n", target.name, source.name);
    return kDone;
  }

  int run() {
    if (!manual.empty()) return link_by_hand();
    refuse_if(!pose.empty() || !reason.empty(), pose.empty() ? "--reason" : "--pose",
              "given without --manual", "--manual TARGET SOURCE");
    if (!shard.empty()) {
      const auto [number, count] = parse_part(shard, "--shard", "I/N with I from 1 to N, as 2/8");
      options.shard = number - 1;
      options.shards = count;
    }
    with_option_names({AlignOptions::table}, [&] { options.validate(); });
    Atlas atlas = open();
    const AtlasState before = atlas.state();
    for (const std::string& one : only) options.only.push_back(node_named(before, one, *this).id);
    const Console console = common.console();
    Json links = Json::array();
    options.on_link = [&](const Link& link, const AtlasState& state) {
      links.push_back(to_json(link, state));
      links.back().erase("id");
      links.back().erase("agrees");
      if (!link.connects()) return;
      console.print("{} <- {} {}{}\n", state.nodes.at(link.target).name,
                    state.nodes.at(link.source).name,
                    probability_text(link.probability.value_or(0.0)),
                    link.repeats ? ", no independent evidence: " + link.reason : "");
    };
    const AtlasLinkResult result = atlas.link(options, common.execution("linking"));
    Json used = options_of(LinkOptions::table, &options.links);
    used["retry"] = options.retry;
    Json json = head("link", std::move(used));
    json["commit"] = atlas.store().last_commit().value;
    json["pairs"] = result.pairs;
    json["tried"] = result.tried;
    json["tried_before"] = result.tried_before;
    json["not_likely"] = result.not_likely;
    json["aligned"] = result.aligned;
    json["links"] = std::move(links);
    write_document(json, common);
    std::string text =
        fmt::format("{} tried, {} aligned", counted(result.tried, "pair"), result.aligned);
    if (result.tried_before > 0) text += fmt::format("; {} tried before", result.tried_before);
    if (result.not_likely > 0)
      text += fmt::format("; {} unlikely and not tried", result.not_likely);
    console.print(text + "\n");
    if (result.aligned < result.tried) {
      console.print(
          "  hint: 'cairn atlas show --all' lists the others. Align the maps of one with 'cairn "
          "align', which shows its candidates and hints.\n");
    }
    return kDone;
  }
};

struct OptimizeArguments : AtlasArguments {
  bool update = false;

  void add_to(const Command& command) {
    command.add_flag("--update", update,
                     "Compute only poses near the maps and links that were added since the last "
                     "'optimize'; all if anything else was changed");
    AtlasArguments::add_to(command);
  }

  int run() {
    Atlas atlas = open();
    const AtlasOptimised result = update ? atlas.update_poses() : atlas.optimize();
    const AtlasState state = atlas.state();
    Json json = head("optimize");
    json["commit"] = result.commit.value;
    json["placed"] = result.placed;
    json["contradicted"] = result.contradicted;
    json["frames"] = Json::array();
    const Console console = common.console();
    for (const AtlasComponent& component : components_of(state)) {
      console.print("{} in the frame of {}\n", counted(component.nodes.size(), "map"),
                    state.nodes.at(component.frame).name);
      json["frames"].push_back(
          {{"frame", state.nodes.at(component.frame).name}, {"maps", component.nodes.size()}});
    }
    if (result.placed < state.nodes.size()) {
      console.print("{} not placed: no link connects them\n",
                    counted(state.nodes.size() - result.placed, "map"));
    }
    for (const auto& [id, agrees] : state.agrees) {
      if (agrees) continue;
      const Link& link = state.links.at(id);
      console.print("not used: {} <- {}: other links contradict it\n",
                    state.nodes.at(link.target).name, state.nodes.at(link.source).name);
    }
    write_document(json, common);
    return kDone;
  }
};

struct MergeAtlasArguments : AtlasArguments {
  std::string output;
  std::string frame;
  FusionOptions options;

  void add_to(const Command& command) {
    command.add_text("-o,--output", output,
                     "Map to write; its ending selects the format: " +
                         all_formats().endings_text() + ". Required",
                     "FILE");
    command.add_text("--with", frame,
                     "Merge the maps in the frame of this one (default: the largest group)",
                     "NAME");
    add_adjustment_to(command, options);
    AtlasArguments::add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    add_at_to(command);
    command.footer(
        "Fuses landmarks as cairn merge does. Names and leaves out maps without a pose or in "
        "another frame;\n"
        "the exit code is then 4.\n"
        "Example: cairn atlas merge --atlas town.atlas -o town.map");
  }

  int run() {
    refuse_if(output.empty(), "--output", "not given", "the name of the map to write");
    require_map_path(output, "--output");
    Atlas atlas = open_to_read();
    const AtlasState state = atlas.state(commit());
    const Console console = common.console();
    std::optional<NodeId> with;
    if (!frame.empty()) with = node_named(state, frame, *this).id;
    Execution execution = common.execution("merging");
    execution.log = console.log();
    const MergeResult merged = atlas.merge(options, with, state.commit, execution);
    save_map(*merged.map, output, common);
    std::size_t before = 0;
    std::string bends;
    std::string frame_name;
    std::string left_out;
    Json json = head("merge");
    json["commit"] = state.commit.value;
    json["maps"] = Json::array();
    json["left_out"] = Json::array();
    std::size_t number = 0;
    for (const auto& [id, node] : state.nodes) {
      const MergedMap& map = merged.maps[number++];
      if (!map.placed) {
        json["left_out"].push_back(node.name);
        left_out +=
            fmt::format("left out {}: {}\n", node.name,
                        state.poses.contains(id) ? "in another frame" : "no link places it");
        continue;
      }
      if (frame_name.empty()) frame_name = node.name;
      before += map.fusion->landmarks;
      Json described = {{"name", node.name}};
      add_placement(map, described);
      json["maps"].push_back(std::move(described));
      bends += bend_text(map.bend, node.name);
    }
    console.print("merged {} of {}, in the frame of {}\n{}", merged.placed(),
                  counted(state.nodes.size(), "map"), frame_name, left_out);
    json["output"] = {{"path", output},
                      {"landmarks_before", before},
                      {"landmarks", merged.map->landmark_count()},
                      {"frames", merged.map->frame_count()},
                      {"observations", merged.map->observation_count()}};
    json["adjustment"] = adjustment_json(merged.adjustment);
    write_document(json, common);
    console.print("{} landmarks became {}{}\n{}wrote {}\n", with_commas(before),
                  with_commas(merged.map->landmark_count()), bends,
                  adjustment_text(merged.adjustment), output);
    return merged.placed() == state.nodes.size() ? kDone : kNoTrustworthyAlignment;
  }
};

}  // namespace

void add_atlas_maps(const Command& atlas) {
  add_verb<InitArguments>(atlas, "init", "Create an empty atlas")
      .footer("Example: cairn atlas init --atlas town.atlas");
  add_verb<AddArguments>(atlas, "add", "Add maps");
  add_verb<LinkArguments>(atlas, "link", "Align the pairs of maps that were not tried yet");
  add_verb<OptimizeArguments>(atlas, "optimize", "Compute the maps' poses from the links")
      .footer(
          "The frame of each group of linked maps is that of its "
          "first map. Links that other links contradict\n"
          "are named and not used.\n"
          "Examples:\n"
          "  cairn atlas optimize --atlas town.atlas\n"
          "  cairn atlas optimize --atlas town.atlas --update");
  add_verb<MergeAtlasArguments>(atlas, "merge", "Merge the placed maps into one map");
}

void add_atlas(const Command& program) {
  const Command atlas = program.add_group(
      "atlas", "Keep maps, their links and their history in one file or database");
  add_atlas_maps(atlas);
  add_atlas_queries(atlas);
  add_atlas_changes(atlas);
  atlas.footer(
      "Example: merge two sessions; the atlas can take more later\n"
      "  cairn atlas init --atlas town.atlas\n"
      "  cairn atlas add monday.map tuesday.map --atlas town.atlas\n"
      "  cairn atlas link --atlas town.atlas\n"
      "  cairn atlas optimize --atlas town.atlas\n"
      "  cairn atlas merge --atlas town.atlas -o town.map");
}

}  // namespace cairn::cli
