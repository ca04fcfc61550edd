// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/confidence/metric.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"
#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"
#include "support/table.hpp"

namespace cairn::cli {
namespace {

struct InfoArguments {
  CommonArguments common;
  std::string input;
  std::string camera;

  void add_to(CLI::App& command);
  int run();
};

void InfoArguments::add_to(CLI::App& command) {
  command.add_option("map", input, "Map to read: .map, .ply or .pcd")->required();
  command
      .add_option("--camera", camera,
                  "The camera of all frames, for reprojection: \"MODEL width height parameters\"")
      ->type_name("CAMERA");
  common.add_to(command);
  command.footer(
      "Example: what the map holds, and how well it explains its images\n"
      "  cairn info desk.map --camera \"PINHOLE 640 480 517.3 516.5 318.6 255.3\"");
}

struct Quantiles {
  double lowest = 0.0;
  double median = 0.0;
  double mean = 0.0;
  double highest = 0.0;
};

std::optional<Quantiles> quantiles(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  double sum = 0.0;
  for (const double value : values) sum += value;
  const std::size_t middle = values.size() / 2;
  const double median =
      values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
  return Quantiles{values.front(), median, sum / static_cast<double>(values.size()), values.back()};
}

Json to_json(const Quantiles& q) {
  return {{"lowest", q.lowest}, {"median", q.median}, {"mean", q.mean}, {"highest", q.highest}};
}

// Distances in pixels between observations and projections, where a camera is known.
std::vector<double> reprojection_errors(const LandmarkMap& map) {
  std::vector<double> errors;
  if (map.frames().cameras.empty()) return errors;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto frames = map.observing_frames(LandmarkIndex{i});
    const auto pixels = map.observed_pixels(LandmarkIndex{i});
    for (std::size_t j = 0; j < frames.size(); ++j) {
      const auto camera = map.frames().cameras[frames[j].value];
      if (!camera) continue;
      const auto projected =
          project(map.cameras()[camera->value],
                  map.world_from_camera(frames[j]).inverse() * map.landmarks().positions[i]);
      if (projected) {
        errors.push_back(std::hypot(projected->u - pixels[j].u, projected->v - pixels[j].v));
      }
    }
  }
  return errors;
}

std::size_t observed_exactly(const LandmarkMap& map, std::size_t count) {
  std::size_t result = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    result += map.observation_count(LandmarkIndex{i}) == count ? 1 : 0;
  }
  return result;
}

// Landmarks beyond the first at each position.
std::size_t repeated_positions(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks) {
  std::vector<std::array<double, 3>> positions;
  positions.reserve(landmarks.size());
  for (const LandmarkIndex landmark : landmarks) {
    const Eigen::Vector3d& x = map.landmarks().positions[landmark.value];
    positions.push_back({x.x(), x.y(), x.z()});
  }
  std::sort(positions.begin(), positions.end());
  const auto distinct = std::unique(positions.begin(), positions.end()) - positions.begin();
  return positions.size() - static_cast<std::size_t>(distinct);
}

// The most common covariance and how many landmarks have it.
std::size_t most_common_covariance(const LandmarkMap& map) {
  std::vector<std::array<double, 9>> covariances;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const auto covariance = map.covariance(LandmarkIndex{i});
    if (!covariance) continue;
    auto& entry = covariances.emplace_back();
    std::copy_n(covariance->data(), 9, entry.begin());
  }
  std::sort(covariances.begin(), covariances.end());
  std::size_t most = 0;
  for (std::size_t i = 0, run = 0; i < covariances.size(); ++i) {
    run = i > 0 && covariances[i] == covariances[i - 1] ? run + 1 : 1;
    most = std::max(most, run);
  }
  return most;
}

std::size_t unobserving_frames(const LandmarkMap& map) {
  std::vector<bool> observes(map.frame_count(), false);
  for (const FrameIndex frame : map.observations().frames) observes[frame.value] = true;
  return static_cast<std::size_t>(std::count(observes.begin(), observes.end(), false));
}

std::vector<std::string> warnings(const LandmarkMap& map) {
  std::vector<std::string> result;
  const std::size_t count = map.landmark_count();
  if (count == 0) result.emplace_back("the map has no landmarks");
  if (!map.has_observations()) {
    result.emplace_back("the map does not know its observations: confidences observations, distance, "
                        "parallax and reprojection cannot be had");
  } else if (count > 0) {
    if (const auto none = observed_exactly(map, 0); none > 0) {
      result.push_back(fmt::format("{} landmarks have no observation", none));
    }
    if (const auto idle = unobserving_frames(map); idle > 0) {
      result.push_back(fmt::format("{} frames observe no landmark", idle));
    }
  }
  const auto kept = landmarks_observed(map, 2);
  if (const auto repeated = repeated_positions(map, kept); repeated > 0) {
    result.push_back(fmt::format(
        "{} landmarks with two or more observations lie exactly where another does", repeated));
  }
  if (count > 0 && !map.has_covariances()) {
    result.emplace_back("the map has no covariances: confidence covariance cannot be had");
  } else if (const auto alike = most_common_covariance(map); count > 1 && alike * 2 > count) {
    result.push_back(fmt::format("{} landmarks share one and the same covariance", alike));
  }
  return result;
}

int InfoArguments::run() {
  const auto given_camera = camera.empty() ? std::nullopt : std::optional(parse_camera(camera));
  LoadedMap loaded = load_map(input, common);
  if (given_camera) loaded.map = with_camera(loaded.map, *given_camera);
  const LandmarkMap& map = loaded.map;
  const auto kept = landmarks_observed(map, 2);

  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  std::vector<double> counts;
  for (const LandmarkIndex landmark : kept) {
    low = low.cwiseMin(map.landmarks().positions[landmark.value]);
    high = high.cwiseMax(map.landmarks().positions[landmark.value]);
    if (map.has_observations()) {
      counts.push_back(static_cast<double>(map.observation_count(landmark)));
    }
  }
  const auto reprojection = quantiles(reprojection_errors(map));
  const std::vector<std::string> remarks = warnings(map);

  const Console console = common.console();
  const std::string unit = map.info().length_unit == LengthUnit::kMetres ? "m" : "units";
  console.print(fmt::format("{}\n  frames        {}\n  landmarks     {}\n", input, map.frame_count(),
                            map.landmark_count()));
  if (map.has_observations()) {
    console.print(fmt::format("  observations  {}\n  observed by two or more frames  {}\n",
                              map.observation_count(), kept.size()));
  }
  if (const auto q = quantiles(counts)) {
    console.print(fmt::format("  observations of those           {} to {}, mean {:.2f}\n", q->lowest,
                              q->highest, q->mean));
  }
  if (!kept.empty()) {
    console.print(fmt::format("  extent        x {:.2f} to {:.2f}, y {:.2f} to {:.2f}, z {:.2f} to {:.2f} {}\n",
                              low.x(), high.x(), low.y(), high.y(), low.z(), high.z(), unit));
  }
  console.print(fmt::format("  cameras       {}\n", map.cameras().size()));
  if (map.info().world_frame) console.print(fmt::format("  world frame   {}\n", *map.info().world_frame));
  if (map.info().uuid) console.print(fmt::format("  uuid          {}\n", *map.info().uuid));
  for (const std::string& step : map.info().provenance) {
    console.print(fmt::format("  provenance    {}\n", step));
  }
  if (reprojection) {
    console.print(fmt::format("  reprojection  median {:.3g} px, mean {:.3g} px, worst {:.3g} px\n",
                              reprojection->median, reprojection->mean, reprojection->highest));
  }

  Json metrics = Json::object();
  Table table({"confidence", "lowest", "median", "mean", "highest"});
  for (const char* name : {"covariance", "observations", "distance", "parallax", "reprojection"}) {
    metrics[name] = nullptr;
    try {
      const std::vector<double> all = metric_named(name).evaluate(map);
      std::vector<double> values;
      for (const LandmarkIndex landmark : kept) values.push_back(all[landmark.value]);
      const auto q = quantiles(std::move(values));
      if (!q) continue;
      metrics[name] = to_json(*q);
      table.add_row({name, fmt::format("{:.4g}", q->lowest), fmt::format("{:.4g}", q->median),
                     fmt::format("{:.4g}", q->mean), fmt::format("{:.4g}", q->highest)});
    } catch (const Error&) {
      table.add_row({name, "-", "-", "-", "-"});  // the map lacks its input
    }
  }
  console.print("\n" + table.text());
  if (!remarks.empty()) console.print("\n");
  for (const std::string& remark : remarks) console.print("warning: " + remark + "\n");

  Json json = document("info", common, {{"map", loaded.description}}, {{"camera", camera}});
  json["observed_twice_or_more"] = map.has_observations() ? Json(kept.size()) : Json(nullptr);
  json["observations_each"] = counts.empty() ? Json(nullptr) : to_json(*quantiles(counts));
  json["length_unit"] = to_string(map.info().length_unit);
  json["world_frame"] = cli::to_json(map.info().world_frame);
  json["uuid"] = cli::to_json(map.info().uuid);
  json["provenance"] = map.info().provenance;
  json["cameras"] = map.cameras().size();
  json["extent"] =
      kept.empty() ? Json(nullptr) : Json{{"low", cli::to_json(low)}, {"high", cli::to_json(high)}};
  json["reprojection_px"] = reprojection ? to_json(*reprojection) : Json(nullptr);
  json["confidence"] = std::move(metrics);
  json["warnings"] = remarks;
  write_document(json, common);
  return kDone;
}

}  // namespace

Run add_info(CLI::App& program) {
  auto arguments = std::make_shared<InfoArguments>();
  arguments->add_to(
      *program.add_subcommand("info", "What a map holds, how good it is, what is wrong with it"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
