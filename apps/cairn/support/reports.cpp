// SPDX-License-Identifier: BSD-3-Clause
#include "support/reports.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#ifdef CAIRN_HAS_SEQUENCE
#include "cairn/report/frame_images.hpp"
#endif

#include "support/command_line.hpp"
#include "support/console.hpp"
#include "support/map_lists.hpp"

namespace cairn::cli {
namespace {

report::ShownAlignment shown_of(const StrategyResult& result) {
  return {&result.alignment, report::strategy_name(result.method, result.confidence), result.k};
}

std::optional<std::string> taken(Json& object, std::string_view key) {
  const std::string* const text = object.at(key).text();
  auto value = text != nullptr ? std::optional(*text) : std::nullopt;
  object.erase(key);
  return value;
}

}  // namespace

report::Report begin_report(std::string title, const CommonArguments& common) {
  report::Report report;
  report.title = std::move(title);
  report.provenance.command = command_line();
  report.provenance.seed = common.seed;
  report.provenance.machine = report::this_machine(common.executor().threads());
  return report;
}

void add_pair(report::Report& report, const ReportedPair& pair, const std::string& prefix) {
  auto shown = static_cast<const report::ShownPair&>(pair);
  for (const StrategyResult& result : pair.results) shown.alignments.push_back(shown_of(result));
  std::vector<report::AlignmentRun> runs = report::runs_of(shown);
  // Without maps errors cannot be measured, but the results may know them.
  const bool has_maps = pair.source != nullptr && pair.target != nullptr;
  for (std::size_t i = 0; !has_maps && i < runs.size(); ++i) {
    if (!pair.results[i].error) continue;
    for (auto& [name, value] : runs[i].summary) {
      if (name == "rotation_error_deg") value = degrees(pair.results[i].error->rotation_rad);
      if (name == "translation_error_m") value = pair.results[i].error->translation;
    }
  }
  report::add_pair(report, shown, std::move(runs), prefix);
}

std::string subtitle_of(const std::vector<StrategyResult>& results, LengthUnit unit) {
  std::vector<report::ShownAlignment> judged;
  for (const StrategyResult& result : results) {
    if (result.alignment.verdict) judged.push_back(shown_of(result));
  }
  if (!judged.empty()) return report::verdict_sentence(judged);
  const std::string symbol = unit_symbol(unit);
  const StrategyResult* nearest = nullptr;
  const StrategyResult* closest = nullptr;
  const auto score_of = [](const StrategyResult& result) {
    return result.alignment.registration.score;
  };
  for (const StrategyResult& result : results) {
    if (!has_answer(result.alignment)) continue;
    const auto& error = result.error;
    if (error && (nearest == nullptr || error->translation < nearest->error->translation)) {
      nearest = &result;
    }
    const auto score = score_of(result);
    if (score && (closest == nullptr || *score < *score_of(*closest))) closest = &result;
  }
  if (closest == nullptr) return "No strategy found a pose.";
  std::string text = fmt::format("The lowest score is that of {}: {:.4g} {}² after {} iterations",
                                 shown_of(*closest).name, *score_of(*closest), symbol,
                                 closest->alignment.registration.iterations);
  if (nearest != nullptr) {
    text += fmt::format("; {} is nearest to the true pose, {} {} and {} degrees off",
                        nearest == closest ? "it" : shown_of(*nearest).name,
                        fixed(nearest->error->translation, 4), symbol,
                        fixed(degrees(nearest->error->rotation_rad), 3));
  }
  return text + ".";
}

report::Input reported_input(const std::string& role, Json description) {
  report::Input input;
  input.role = role;
  input.path = taken(description, "path");
  input.hash = taken(description, "hash");
  if (!description.empty()) input.details_json = description.dump(-1);
  return input;
}

void set_provenance(report::Report& report, const Json& document) {
  for (const auto& [role, description] : document.at("inputs").members()) {
    report.provenance.inputs.push_back(reported_input(role, description));
  }
  report.provenance.options_json = document.at("options").dump(-1);
}

std::string file_name(const std::string& path) {
  std::error_code ignored;
  const std::filesystem::path file(path);
  const bool is_folder = !file.has_filename() || std::filesystem::is_directory(file, ignored);
  return is_folder ? map_names({path}).front() : file.filename().string();
}

#ifdef CAIRN_HAS_SEQUENCE
void add_sequence_to(const Command& command, const std::string& option, std::string& folder,
                     const std::string& whose) {
  const Option given = command.add_text(
      option, folder,
      fmt::format("Folder of the images of {}: its RGB-D sequence, or images named as in the map. "
                  "The report shows the images of up to {} keyframes",
                  whose, report::kMostFrameImages),
      "DIR");
  if (command.has_option("--report")) given.needs(command.option("--report"));
}

std::vector<report::FrameImage> images_of(const LandmarkMap& map, const std::string& folder,
                                          const CommonArguments& common) {
  if (folder.empty()) return {};
  return report::frame_images(map, folder, common.console().log());
}

void add_images_to(const Command& command, std::vector<std::string>& folders) {
  command
      .add_words(
          "--images", folders,
          "Folder of the maps' images: their sequence, or images named as in the maps; one folder "
          "for all, or one for each session in the maps' order. For each link, the report shows "
          "the two keyframes with the most landmarks in common",
          "FOLDER...")
      .needs(command.option("--report"));
}

std::shared_ptr<report::LinkImages> open_images(const std::vector<const LandmarkMap*>& maps,
                                                const std::vector<std::filesystem::path>& folders,
                                                const CommonArguments& common) {
  if (folders.empty()) return nullptr;
  return std::make_shared<report::LinkImages>(maps, folders, common.console().log());
}
#else
void add_sequence_to(const Command&, const std::string&, std::string&, const std::string&) {}

std::vector<report::FrameImage> images_of(const LandmarkMap&, const std::string&,
                                          const CommonArguments&) {
  return {};
}

void add_images_to(const Command&, std::vector<std::string>&) {}

std::shared_ptr<report::LinkImages> open_images(const std::vector<const LandmarkMap*>&,
                                                const std::vector<std::filesystem::path>&,
                                                const CommonArguments&) {
  return nullptr;
}
#endif

std::vector<std::filesystem::path> folders_of_maps(const std::vector<std::string>& folders,
                                                   const std::vector<std::string>& sessions) {
  if (folders.empty()) return {};
  std::map<std::string, std::size_t> folder_of;  // by session
  std::vector<std::size_t> index;                // by map
  std::size_t count = 0;
  for (const std::string& session : sessions) {
    const bool is_new = session.empty() || folder_of.emplace(session, count).second;
    index.push_back(is_new ? count++ : folder_of.at(session));
  }
  refuse_if(folders.size() != 1 && folders.size() != count, "--images",
            fmt::format("{} given", folders.size()),
            fmt::format("one, or one for each of the {} sessions", count));
  std::vector<std::filesystem::path> paths;
  for (const std::size_t i : index) paths.emplace_back(folders[folders.size() == 1 ? 0 : i]);
  return paths;
}

report::NetworkEdge edge_of(const Link& link, std::size_t target, std::size_t source,
                            std::optional<bool> agrees) {
  report::LinkUse use = report::LinkUse::kUndecided;
  if (!link.connects()) {
    use = link.verdict == Verdict::kAmbiguous ? report::LinkUse::kAmbiguous
                                              : report::LinkUse::kRejected;
  } else if (agrees) {
    use = *agrees ? report::LinkUse::kUsed : report::LinkUse::kContradicted;
  }
  return {.target = target,
          .source = source,
          .use = use,
          .kind = std::string(to_string(link.kind)),
          .probability = link.probability,
          .reason = link.reason,
          .target_from_source = link.target_from_source};
}

void add_network(report::Report& report, const std::vector<report::NetworkMap>& maps,
                 const std::vector<report::NetworkEdge>& edges,
                 [[maybe_unused]] const std::shared_ptr<report::LinkImages>& images,
                 [[maybe_unused]] const CommonArguments& common) {
  report::add_network(report, maps, edges);
#ifdef CAIRN_HAS_SEQUENCE
  if (images == nullptr) return;
  Execution execution = common.execution();
  execution.log = common.console().log();
  images->add_to(report, edges, execution);
#endif
}

void write_report(const report::Report& report, const CommonArguments& common) {
  if (common.report_path.empty()) return;
  report::save_report(report, common.report_path);
  common.console().print("\nwrote {}\n", common.report_path);
}

}  // namespace cairn::cli
