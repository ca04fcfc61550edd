// SPDX-License-Identifier: BSD-3-Clause
// Verbs of atlas that read it: show, path, export.
#include <algorithm>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/atlas/atlas.hpp"
#include "cairn/atlas/export.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/core/error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/sections.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/atlas_arguments.hpp"
#include "support/console.hpp"
#include "support/map_lists.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

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

// Answer, network and log of an atlas.
// @param location of the atlas, for the commands that undo
// @param images folders, or none; see folders_of_maps()
void add_atlas_state(report::Report& report, Atlas& atlas, const AtlasState& state,
                     const std::string& location, const std::vector<fs::path>& images,
                     const CommonArguments& common) {
  report.subtitle = answer_of(state);
  std::map<NodeId, std::size_t> index_of;
  std::deque<LandmarkMap> kept;
  std::vector<const LandmarkMap*> maps;
  std::vector<report::NetworkMap> nodes;
  for (const auto& [id, node] : state.nodes) {
    index_of.emplace(id, nodes.size());
    kept.push_back(atlas.map(node));
    maps.push_back(&kept.back());
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
    const auto agrees = state.agrees.find(id);
    edges.push_back(
        edge_of(link, index_of.at(link.target), index_of.at(link.source),
                agrees == state.agrees.end() ? std::nullopt : std::optional(agrees->second)));
  }
  add_network(report, nodes, edges, open_images(maps, images, common), common);
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

std::string name_of(const AtlasState& state, NodeId id) {
  return state.nodes.at(id).name;
}

// "aligned", or why not; contradicted links say so.
std::string status_of(const Link& link, const AtlasState& state) {
  const auto agrees = state.agrees.find(link.id);
  if (agrees != state.agrees.end() && !agrees->second) return "contradicted";
  return std::string(link.status());
}

struct ShowArguments : AtlasArguments {
  bool all = false;
  std::vector<std::string> images;

  void add_to(const Command& command) {
    command.add_flag("--all", all, "Also list pairs that were tried and not aligned");
    common.add_report_to(command, "maps and links as a graph, a matrix and in 3D, and the log");
    add_images_to(command, images);
    AtlasArguments::add_to(command);
    add_at_to(command);
    command.footer("Example: cairn atlas show --atlas town.atlas --report town.html");
  }

  static Json nodes_json(const AtlasState& state) {
    Json nodes = Json::array();
    for (const auto& [id, node] : state.nodes) {
      const auto pose = state.poses.find(id);
      const bool placed = pose != state.poses.end();
      nodes.push_back(
          {{"id", id.value},
           {"name", node.name},
           {"session", text_or_null(node.session)},
           {"map", node.map},
           {"length_unit", to_string(node.length_unit)},
           {"frames", node.frames},
           {"landmarks", node.landmarks},
           {"observations", node.observations},
           {"frame", placed ? Json(name_of(state, pose->second.frame)) : Json(nullptr)},
           {"frame_from_map",
            placed ? to_json(pose->second.frame_from_node.matrix()) : Json(nullptr)},
           {"scale", placed ? Json(pose->second.frame_from_node.scale()) : Json(nullptr)},
           {"covariance", placed ? to_json(pose->second.covariance) : Json(nullptr)}});
    }
    return nodes;
  }

  int run() {
    Atlas atlas = open_to_read();
    const AtlasState state = atlas.state(commit());
    std::vector<std::string> sessions;
    for (const auto& [id, node] : state.nodes) sessions.push_back(node.session);
    const std::vector<fs::path> image_folders = folders_of_maps(images, sessions);
    std::optional<report::Report> report;
    if (!common.report_path.empty()) {
      report = begin_report(fs::path(shown()).filename().string(), common);
      add_atlas_state(*report, atlas, state, shown(), image_folders, common);
    }
    Table maps({"map", "id", "session", "landmarks", "keyframes", "in the frame of"});
    for (const auto& [id, node] : state.nodes) {
      const auto pose = state.poses.find(id);
      maps.add_row({node.name, fmt::format("#{}", id.value),
                    node.session.empty() ? "-" : node.session, with_commas(node.landmarks),
                    with_commas(node.frames),
                    pose == state.poses.end() ? "-" : name_of(state, pose->second.frame)});
    }
    Table table({"link", "probability", "status", "kind"});
    std::size_t aligned = 0;
    Json links = Json::array();
    for (const auto& [id, link] : state.links) {
      aligned += link.connects() ? 1 : 0;
      links.push_back(to_json(link, state));
      if (!all && !link.connects()) continue;
      table.add_row(
          {fmt::format("{} <- {}", name_of(state, link.target), name_of(state, link.source)),
           link.probability ? probability_text(*link.probability) : "-", status_of(link, state),
           std::string(cairn::to_string(link.kind))});
    }
    const Console console = common.console();
    console.print("{}: commit {}; maps: {}, {} placed; pairs tried or stated: {}, {} aligned\n",
                  shown(), state.commit.value, state.nodes.size(), state.poses.size(),
                  state.links.size(), aligned);
    if (!state.nodes.empty()) console.print("\n" + maps.text());
    if (aligned > 0 || (all && !state.links.empty())) console.print("\n" + table.text());
    Json json = head("show");
    json["commit"] = state.commit.value;
    json["maps"] = nodes_json(state);
    json["links"] = std::move(links);
    write_document(json, common);
    if (report) {
      set_provenance(*report, json);
      write_report(*report, common);
    }
    return kDone;
  }
};

// "0.123 -0.456 7.890 m, roll 1.00 pitch 2.00 yaw 3.00 deg"
std::string pose_text(const Similarity3& pose, const std::string& unit) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Vector3d angles = pose.rigid().roll_pitch_yaw();
  std::string text =
      fmt::format("{} {} {} {}, roll {} pitch {} yaw {} deg", fixed(t.x(), 4), fixed(t.y(), 4),
                  fixed(t.z(), 4), unit, fixed(degrees(angles[0]), 3), fixed(degrees(angles[1]), 3),
                  fixed(degrees(angles[2]), 3));
  if (pose.scale() != 1.0) text += fmt::format(", scale {}", fixed(pose.scale(), 5));
  return text;
}

struct PathArguments : AtlasArguments {
  std::string target;
  std::string source;

  void add_to(const Command& command) {
    command.add_text("target", target, "A map: its name, or # and its id", "A").required();
    command.add_text("source", source, "Second map", "B").required();
    AtlasArguments::add_to(command);
    add_at_to(command);
    command.footer(
        "Prints the most certain chain of links between two maps, the transform A_from_B along it "
        "with its\n"
        "standard deviation, and the transform between the optimised poses. The exit code is 4 if "
        "no chain\n"
        "connects the maps.\n"
        "Example: cairn atlas path monday robot2 --atlas town.atlas");
  }

  int run() {
    Atlas atlas = open_to_read();
    const AtlasState state = atlas.state(commit());
    const AtlasNode& a = node_named(state, target, *this);
    const AtlasNode& b = node_named(state, source, *this);
    const auto route = find_route(state, a.id, b.id);
    Json json = head("path");
    json["commit"] = state.commit.value;
    json["route"] = nullptr;
    const Console console = common.console();
    if (!route) {
      write_document(json, common);
      console.print("no chain of links connects {} and {}\n", a.name, b.name);
      return kNoTrustworthyAlignment;
    }
    std::vector<std::string> names;
    for (const NodeId id : route->nodes) names.push_back(name_of(state, id));
    Json links = Json::array();
    for (const LinkId id : route->links) links.push_back(to_json(state.links.at(id), state));
    json["route"] = names;
    json["links"] = std::move(links);
    json["target_from_source"] = to_json(route->target_from_source.matrix());
    json["scale"] = route->target_from_source.scale();
    json["covariance"] = route->covariance ? to_json(*route->covariance) : Json(nullptr);
    json["optimised_target_from_source"] =
        route->optimised ? to_json(route->optimised->matrix()) : Json(nullptr);
    write_document(json, common);
    const std::string unit = unit_symbol(a.length_unit);
    console.print("{}\n", fmt::join(names, " <- "));
    console.print("along the links: {}\n", pose_text(route->target_from_source, unit));
    if (route->covariance) {
      const Matrix7d& c = *route->covariance;
      console.print("standard deviation: {} {}, {} deg\n",
                    fixed(std::sqrt(c(0, 0) + c(1, 1) + c(2, 2)), 4), unit,
                    fixed(degrees(std::sqrt(c(3, 3) + c(4, 4) + c(5, 5))), 3));
    }
    if (route->optimised) {
      console.print("optimised:       {}\n", pose_text(*route->optimised, unit));
    }
    return kDone;
  }
};

struct ExportArguments : AtlasArguments {
  std::string output;
  std::string map;
  std::string with;

  void add_to(const Command& command) {
    command.add_text(
        "-o,--output", output,
        "File or folder to write. .g2o, .json: graph of links and poses; .tum: keyframes of "
        "the placed maps; .ply: their landmarks, not fused; .mcap: placed maps and links, for "
        "Foxglove, Lichtblick and rerun; folder: every map as .cairn, and the graph. Required",
        "FILE");
    command.add_text("--map", map, "Write only this map, in its own frame and any map format",
                     "NAME");
    command.add_text(
        "--with", with,
        "For .tum, .ply and .mcap: write the maps in the frame of this one (default: the "
        "largest group)",
        "NAME");
    AtlasArguments::add_to(command);
    add_at_to(command);
    command.footer(
        "Example: write the graph for another optimiser, and the keyframes for an evaluation\n"
        "  cairn atlas export --atlas town.atlas -o town.g2o\n"
        "  cairn atlas export --atlas town.atlas -o town.tum\n"
        "Example: write maps and links for Foxglove\n"
        "  cairn atlas export --atlas town.atlas -o town.mcap");
  }

  int run() {
    refuse_if(output.empty(), "--output", "not given", "the name of a file or folder");
    if (!map.empty()) {
      require_map_path(output, "--output");
    } else if (export_of(output) != AtlasExport::kFolder) {
      require_folder_of(output);
    }
    Atlas atlas = open_to_read();
    const AtlasState state = atlas.state(commit());
    if (!map.empty()) {
      save_map(atlas.map(node_named(state, map, *this)), output, common);
    } else {
      std::optional<NodeId> frame;
      if (!with.empty()) frame = node_named(state, with, *this).id;
      export_atlas(atlas, state, output, frame, common.console().log());
    }
    Json json = head("export");
    json["commit"] = state.commit.value;
    json["output"] = output;
    write_document(json, common);
    common.console().print("wrote {}\n", output);
    return kDone;
  }
};

}  // namespace

void add_atlas_queries(const Command& atlas) {
  add_verb<ShowArguments>(atlas, "show", "List maps and links");
  add_verb<PathArguments>(atlas, "path",
                          "Print the transform between two maps and its chain of links");
  add_verb<ExportArguments>(atlas, "export",
                            "Write the graph, keyframes, landmarks or maps to files");
}

}  // namespace cairn::cli
