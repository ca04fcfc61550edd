// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"
#include "cairn/pose_graph/pose_graph.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/sections.hpp"

#include "support/alignments.hpp"
#include "support/documents.hpp"

namespace cairn::report {
class LinkImages;
}

namespace cairn::cli {

/// A pair of maps aligned by several strategies, as a report shows it.
struct ReportedPair : report::ShownPair {
  std::vector<StrategyResult> results = {};  ///< with a trace: also scores and matches
};

/// A report that names this run of the tool: command, version, machine, seed.
report::Report begin_report(std::string title, const CommonArguments& common);

/// Adds the scene, the table of strategies and the curves of convergence.
/// @param prefix prefix of the ids, e.g. "r2-", for several pairs in one report; may be empty
/// @throws Error (misuse) if a match names a landmark that is not there
void add_pair(report::Report& report, const ReportedPair& pair, const std::string& prefix = {});

/// One or more sentences: the verdicts, or which strategy was best, and by which measure.
std::string subtitle_of(const std::vector<StrategyResult>& results, LengthUnit unit);

/// Sets the inputs and options as a document has them.
void set_provenance(report::Report& report, const Json& document);

/// An input for the report's provenance, from its description in a document: path, hash, counts.
report::Input reported_input(const std::string& role, Json description);

/// Name of a path on a page: its last part, or for a folder the name by map_names().
std::string file_name(const std::string& path);

/// Adds an option that names the folder of the sequence that a map was built from, if this build reads
/// images. The option needs --report, if the verb has --report.
/// @param whose e.g. "the source map"
void add_sequence_to(const Command& command, const std::string& option, std::string& folder,
                     const std::string& whose);

/// Images of a map's frames, read from its sequence; empty if `folder` is empty.
/// @throws Error (input) as report::frame_images()
std::vector<report::FrameImage> images_of(const LandmarkMap& map, const std::string& folder,
                                          const CommonArguments& common);

/// Adds --images, which names folders with the images of maps' keyframes, if this build reads images.
void add_images_to(const Command& command, std::vector<std::string>& folders);

/// The folder of each map: the only one, or that of its session; empty if none is given.
/// @param sessions of the maps; a map without one is a session of its own
/// @throws Error (misuse) for another number of folders
std::vector<std::filesystem::path> folders_of_maps(const std::vector<std::string>& folders,
                                                   const std::vector<std::string>& sessions);

/// Opens the folders with the images of maps' keyframes; null if none are given.
/// @throws Error (input) if a folder has no image of its maps
std::shared_ptr<report::LinkImages> open_images(const std::vector<const LandmarkMap*>& maps,
                                                const std::vector<std::filesystem::path>& folders,
                                                const CommonArguments& common);

/// A link between two maps of a network.
/// @param agrees whether it agrees with the maps' poses; std::nullopt if these were not computed since
report::NetworkEdge edge_of(const Link& link, std::size_t target, std::size_t source,
                            std::optional<bool> agrees);

/// Adds maps and links, and the images if there are any.
void add_network(report::Report& report, const std::vector<report::NetworkMap>& maps,
                 const std::vector<report::NetworkEdge>& edges,
                 const std::shared_ptr<report::LinkImages>& images, const CommonArguments& common);

/// Writes the report to the path of --report, and prints this; does nothing if it was not given.
void write_report(const report::Report& report, const CommonArguments& common);

}  // namespace cairn::cli
