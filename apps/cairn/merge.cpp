// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/merge.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/sections.hpp"

#include "commands.hpp"
#include "support/adjustment.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/link_documents.hpp"
#include "support/map_lists.hpp"
#include "support/reports.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

// Landmarks of the placed maps.
std::size_t landmarks_before(const MergeResult& result) {
  std::size_t before = 0;
  for (const MergedMap& map : result.maps) {
    if (map.fusion) before += map.fusion->landmarks;
  }
  return before;
}

// "Placed 3 of 4 maps in the frame of monday: 61,204 landmarks became 44,910. Left out: cellar, attic."
std::string answer_of(std::span<const MergeInput> maps, const MergeResult& result) {
  std::string frame;
  std::vector<std::string> left_out;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const MergedMap& map = result.maps[i];
    if (map.placed && frame.empty()) frame = maps[i].name;
    if (!map.placed) left_out.push_back(maps[i].name);
  }
  if (!result.map) return "No two maps are aligned; no map is written.";
  std::string text =
      fmt::format("Placed {} of {} maps in the frame of {}: {} landmarks became {}.",
                  result.placed(), maps.size(), frame, with_commas(landmarks_before(result)),
                  with_commas(result.map->landmark_count()));
  if (!left_out.empty()) text += fmt::format(" Left out: {}.", fmt::join(left_out, ", "));
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (!result.maps[i].fold) continue;
    text += fmt::format(" {} is folded: {} of its {} images are left out.", maps[i].name,
                        result.maps[i].fold->frames.size(), maps[i].map->frame_count());
  }
  return text;
}

bool has_splats(const MergeResult& result) {
  return result.map && splat_columns(result.map->landmarks().columns);
}

// Title, answer, and the sections that a merge has.
void add_merge(report::Report& report, std::span<const MergeInput> maps, const MergeResult& result,
               bool without_floaters, const std::shared_ptr<report::LinkImages>& images,
               const CommonArguments& common) {
  report.subtitle = answer_of(maps, result);
  std::optional<std::size_t> frame;
  std::vector<report::NetworkMap> nodes;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const MergedMap& merged = result.maps[i];
    const LandmarkMap& map = *maps[i].map;
    if (merged.placed && !frame) frame = i;
    report::NetworkMap node{.name = maps[i].name, .map = &map, .reason = merged.reason};
    if (merged.placed) {
      node.frame = frame;
      node.frame_from_map = *merged.world_from_map;
    }
    if (merged.fusion && has_splats(result)) {
      const std::size_t floaters = without_floaters ? merged.fusion->floaters.value_or(0) : 0;
      std::vector<std::string> left_out;
      const auto add = [&](std::size_t count, const char* what) {
        if (count > 0) left_out.push_back(fmt::format("{} {}", with_commas(count), what));
      };
      add(merged.fusion->fused, "duplicates");
      add(floaters, "floaters");
      node.reason = fmt::format("{}", fmt::join(left_out, ", "));
    } else if (merged.fusion) {
      node.fused = merged.fusion->fused;
    }
    if (merged.fold) {
      node.reason = fold_text(*merged.fold, map, maps[i].name, maps[merged.fold->other].name);
    }
    node.landmarks = map.landmark_count();
    node.keyframes = map.frame_count();
    node.centre = node_extent(map.landmarks().positions).centre;
    node.length_unit = map.info().length_unit;
    nodes.push_back(std::move(node));
  }
  std::vector<report::NetworkEdge> edges;
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const Link& link = result.links[i];
    edges.push_back(edge_of(link, link.target.value, link.source.value, result.used[i]));
  }
  add_network(report, nodes, edges, images, common);
}

bool is_same_file(const std::string& a, const std::string& b) {
  std::error_code ignored;
  return fs::equivalent(a, b, ignored);
}

Json link_json(const Link& link, bool used) {
  Json json = {{"target", link.target.value},
               {"source", link.source.value},
               {"status", link.status()},
               {"kind", to_string(link.kind)},
               {"probability", to_json(link.probability)},
               {"used", used},
               {"reason", link.reason}};
  add_pose(link, json);
  return json;
}

Json map_json(std::size_t number, const MergeResult& result, const std::vector<LoadedMap>& loaded,
              const std::vector<std::string>& names) {
  const MergedMap& map = result.maps[number];
  Json json = {
      {"name", names[number]},     {"placed", map.placed}, {"reason", text_or_null(map.reason)},
      {"world_from_map", nullptr}, {"scale", nullptr},     {"covariance", nullptr},
      {"landmarks", nullptr},      {"fused", nullptr},     {"floaters", nullptr},
      {"bend", nullptr},           {"fold", nullptr},      {"unexplained_deviation", nullptr}};
  if (!map.placed) return json;
  add_placement(map, json);
  if (map.fold) json["fold"] = fold_json(*map.fold, loaded[number].map, names[map.fold->other]);
  return json;
}

// The probability, or who stated the link.
std::string sureness(const Link& link) {
  return link.probability ? probability_text(*link.probability) : std::string(to_string(link.kind));
}

// "placed 3 of 3: monday <- tuesday 99.9984 %, tuesday <- robot2 99.98 %"
std::string placement_text(const MergeResult& result, const std::vector<std::string>& names) {
  std::string text = fmt::format("placed {} of {}", result.placed(), result.maps.size());
  std::vector<bool> is_placed(names.size(), false);
  std::vector<std::string> links;
  for (const std::size_t index : result.tree) {
    const Link& link = result.links[index];
    if (links.empty()) is_placed[std::min(link.target, link.source).value] = true;
    const bool forward = is_placed[link.target.value];
    const std::size_t from = (forward ? link.target : link.source).value;
    const std::size_t added = (forward ? link.source : link.target).value;
    is_placed[added] = true;
    links.push_back(fmt::format("{} <- {} {}", names[from], names[added], sureness(link)));
  }
  if (!links.empty()) text += fmt::format(": {}", fmt::join(links, ", "));
  return text + "\n";
}

// The maps that are left out, and the links that are not used.
std::string omission_text(const MergeResult& result, const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (result.maps[i].placed) continue;
    text += fmt::format("left out {}: {}\n", names[i], result.maps[i].reason);
  }
  // Two maps may share their likeliest link, whose reason is long.
  std::set<std::size_t> likeliest;
  for (const MergedMap& map : result.maps) {
    if (map.likeliest_link) likeliest.insert(*map.likeliest_link);
  }
  for (const std::size_t index : likeliest) {
    const Link& link = result.links[index];
    text += fmt::format("{}: {} <- {}: {}\n", link.status(), names[link.target.value],
                        names[link.source.value], link.reason);
  }
  if (!likeliest.empty()) {
    text +=
        "  hint: Align the maps of one of these with 'cairn align', which shows its candidates and "
        "hints.\n";
  }
  for (std::size_t i = 0; i < result.links.size(); ++i) {
    const Link& link = result.links[i];
    const bool contradicted = link.connects() && !result.used[i] &&
                              result.maps[link.target.value].placed &&
                              result.maps[link.source.value].placed;
    if (!contradicted) continue;
    text += fmt::format("not used: {} <- {} {}: other links contradict it\n",
                        names[link.target.value], names[link.source.value], sureness(link));
  }
  return text;
}

// Of splats: "first: 1,132 duplicates left out, 73 floaters, which images of other splats look through".
std::string splats_text(const MergeResult& result, const std::vector<std::string>& names,
                        bool without_floaters) {
  if (!has_splats(result)) return {};
  std::string text;
  std::size_t floaters = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto& fusion = result.maps[i].fusion;
    if (!fusion) continue;
    text += fmt::format("{}: {} duplicates left out", names[i], with_commas(fusion->fused));
    if (fusion->floaters) {
      text += fmt::format(
          ", {} floaters{}", with_commas(*fusion->floaters),
          without_floaters ? " left out" : ", which images of other splats look through");
      floaters += *fusion->floaters;
    }
    text += "\n";
  }
  if (floaters > 0 && !without_floaters) text += "  hint: --drop-floaters leaves floaters out\n";
  return text;
}

struct MergeMapsArguments {
  CommonArguments common;
  std::vector<std::string> paths;
  std::vector<std::string> models;
  std::vector<std::string> images;
  std::string output;
  MergeOptions options;

  void add_to(const Command& command) {
    command
        .add_words("maps", paths,
                   "Maps of one place: " + all_formats().titles_text() +
                       "; or folders of .map and .cairn files",
                   "MAP...")
        .required();
    command.add_text("-o,--output", output,
                     "Map to write; its ending selects the format: " +
                         all_formats().endings_text() + ". Required",
                     "FILE");
    add_models_to(command, models, "one for each");
    add_options(command, LinkOptions::table, &options.links);
    add_adjustment_to(command, options);
    command
        .add_flag("--drop-floaters", options.drop_floaters,
                  "Leave out floaters: Gaussians in space that the images of another splat's model "
                  "show to be empty")
        .needs(command.option("--models"));
    common.add_report_to(command, "maps and links as a graph, a matrix and in 3D");
    add_images_to(command, images);
    common.add_to(command);
    common.add_threads_to(command);
    common.add_seed_to(command);
    command.list_under("Pairs", {"--min-probability", "--prior-odds", "--effort",
                                 "--min-observations", "--candidates"});
    command.list_under("Merged map",
                       {"--straighten", "--thin-splats", "--drop-floaters", "--refine-intrinsics"});
    command.footer(
        "Aligns every pair of maps without an initial pose and uses the pairs that are judged "
        "aligned. The\n"
        "result is in the frame of the first map that is placed. Names and leaves out maps that no "
        "link\n"
        "connects with the largest group; the exit code is then 4. For a folder of mini-maps made "
        "by\n"
        "'cairn map --mini-map-length', also uses the odometry links in its pose_graph.json.\n"
        "Example: merge two sessions and a folder of mini-maps into one map\n"
        "  cairn merge monday.map tuesday.map robot2/ -o building.map --report building.html\n"
        "Example: merge two Gaussian splats by the models that they were trained on\n"
        "  cairn merge first.ply second.ply --models first/sparse/0 second/sparse/0 -o both.ply");
  }

  int run() {
    // What the command line says is checked before any file is read.
    // Not CLI11's own check, which would come before that of options it does not know.
    refuse_if(output.empty(), "--output", "not given", "the name of the map to write");
    require_map_path(output, "--output");
    require_outputs(common);
    with_option_names({AlignOptions::table}, [&] { options.validate(); });
    const std::vector<ListedMap> maps = listed();
    std::vector<std::string> sessions;
    for (const ListedMap& map : maps) sessions.push_back(map.session);
    const std::vector<fs::path> image_folders = folders_of_maps(images, sessions);
    std::vector<std::string> names;
    std::vector<LoadedMap> loaded;
    std::vector<LandmarkMap> aligned;
    std::vector<MergeInput> inputs;
    loaded.reserve(maps.size());
    aligned.reserve(maps.size());
    for (const ListedMap& map : maps) {
      names.push_back(map.name);
      loaded.push_back(load_map(map.file, common));
      inputs.push_back({map.name, &loaded.back().map, map.session});
      if (common.report_path.empty()) inputs.back().disposable = &loaded.back().map;
      if (models.empty()) continue;
      aligned.push_back(load_model(models[aligned.size()], loaded.back(), common));
      inputs.back().model = &aligned.back();
    }
    std::vector<const LandmarkMap*> shown;
    for (const LoadedMap& map : loaded) shown.push_back(&map.map);
    const auto link_images = open_images(shown, image_folders, common);
    options.stated = links_of_folders(paths, maps);
    Execution execution = common.execution("merging");
    execution.log = common.console().log();
    const MergeResult result = merge(inputs, options, execution);

    if (result.map) save_map(*result.map, output, common);
    write_document(describe(loaded, names, result), common);
    print(result, names);
    if (!common.report_path.empty()) {
      report::Report report = begin_report(
          fmt::format("{} maps merged into {}", names.size(), file_name(output)), common);
      add_merge(report, inputs, result, options.drop_floaters, link_images, common);
      Json by_role = Json::object();
      for (std::size_t i = 0; i < names.size(); ++i) by_role[names[i]] = loaded[i].description;
      set_provenance(report, {{"inputs", by_role}, {"options", options_json()}});
      write_report(report, common);
    }
    return result.placed() == names.size() ? kDone : kNoTrustworthyAlignment;
  }

 private:
  std::vector<ListedMap> listed() const {
    std::vector<ListedMap> maps = listed_maps(paths);
    for (const ListedMap& map : maps) {
      refuse_if(is_same_file(map.file, output), "--output", output + " is one of the maps",
                "another file");
    }
    refuse_if(maps.size() < 2, "maps", fmt::format("{} given", maps.size()), "at least two maps");
    refuse_if(!models.empty() && models.size() != maps.size(), "--models",
              fmt::format("{} given", models.size()),
              fmt::format("one for each of the {} maps", maps.size()));
    return maps;
  }

  Json options_json() const {
    Json json = options_of(LinkOptions::table, &options.links);
    json.update(options_of(FusionOptions::table, static_cast<const FusionOptions*>(&options)));
    return json;
  }

  Json describe(const std::vector<LoadedMap>& loaded, const std::vector<std::string>& names,
                const MergeResult& result) const {
    Json descriptions = Json::array();
    for (const LoadedMap& map : loaded) descriptions.push_back(map.description);
    Json json = document("merge", common, {{"maps", std::move(descriptions)}}, options_json());
    json["placed"] = result.placed();
    json["maps"] = Json::array();
    for (std::size_t i = 0; i < names.size(); ++i) {
      json["maps"].push_back(map_json(i, result, loaded, names));
    }
    json["links"] = Json::array();
    for (std::size_t i = 0; i < result.links.size(); ++i) {
      json["links"].push_back(link_json(result.links[i], result.used[i]));
    }
    json["output"] = nullptr;
    if (result.map) {
      json["output"] = {{"path", output},
                        {"length_unit", to_string(result.map->info().length_unit)},
                        {"frames", result.map->frame_count()},
                        {"landmarks_before", landmarks_before(result)},
                        {"landmarks", result.map->landmark_count()},
                        {"observations", result.map->observation_count()}};
    }
    json["adjustment"] = adjustment_json(result.adjustment);
    return json;
  }

  void print(const MergeResult& result, const std::vector<std::string>& names) const {
    std::string text = placement_text(result, names) + omission_text(result, names);
    if (result.map) {
      text += fmt::format("{} landmarks became {}", with_commas(landmarks_before(result)),
                          with_commas(result.map->landmark_count()));
      for (std::size_t i = 0; i < names.size(); ++i) {
        text += bend_text(result.maps[i].bend, names[i]);
      }
      text += fmt::format("\n{}{}wrote {}\n", splats_text(result, names, options.drop_floaters),
                          adjustment_text(result.adjustment), output);
    } else {
      text += fmt::format("{} is not written: no two maps are aligned\n", output);
    }
    common.console().print(text);
  }
};

}  // namespace

void add_merge(const Command& program) {
  add_verb<MergeMapsArguments>(program, "merge", "Merge maps of one place into one");
}

}  // namespace cairn::cli
