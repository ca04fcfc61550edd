// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>

#include "cairn/core/detail/time_association.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/evaluation/map_consistency.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/operations.hpp"
#ifdef CAIRN_HAS_ODOMETRY
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"
#endif

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

#ifdef CAIRN_HAS_ODOMETRY
// Between the four pixels around, where they show one surface: there inverse depth is linear.
std::optional<double> depth_between_pixels(const StoredDepthImage& depth, const Pixel& at) {
  const int x = static_cast<int>(std::floor(at.u));
  const int y = static_cast<int>(std::floor(at.v));
  if (x < 0 || y < 0 || x + 1 >= static_cast<int>(depth.width) ||
      y + 1 >= static_cast<int>(depth.height)) {
    return std::nullopt;
  }
  const double right = at.u - x;
  const double down = at.v - y;
  double inverse = 0.0;
  double nearest = 1e9;
  double farthest = 0.0;
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 2; ++column) {
      const double z =
          depth.at(static_cast<std::size_t>(x + column), static_cast<std::size_t>(y + row));
      if (z <= 0.0) return std::nullopt;
      nearest = std::min(nearest, z);
      farthest = std::max(farthest, z);
      inverse += (column == 1 ? right : 1.0 - right) * (row == 1 ? down : 1.0 - down) / z;
    }
  }
  constexpr double kOneSurface = 1.03;
  if (farthest > kOneSurface * nearest) return std::nullopt;
  return 1.0 / inverse;
}

// True positions of a map's landmarks in their first keyframes, from the exact depth images that a
// simulation gives: a landmark is what its first observation's pixel shows. One a landmark; nothing
// where the depth images have no frame of that time, or another surface begins beside the pixel.
// @param folder a sequence in TUM layout, of the camera that took the map's images
// @throws Error (input) naming what is missing
std::vector<std::optional<Eigen::Vector3d>> true_positions_from_depth(
    const LandmarkMap& map, const std::string& folder, double depth_units_per_metre) {
  const auto refuse = [](const std::string& what, const std::string& expected) {
    throw Error(ErrorKind::kInput, "map", what, expected);
  };
  if (map.frames().timestamps_s.empty())
    refuse("has no timestamps of its frames", "a map with timestamps");
  if (map.frames().cameras.empty()) refuse("has no cameras of its frames", "a map with cameras");
  if (!map.has_observations()) refuse("has no observations", "a map with observations");
  const ImageSequence sequence(folder);
  std::vector<double> map_times;
  for (const auto& time : map.frames().timestamps_s) map_times.push_back(time.value_or(-1.0));
  std::vector<double> sequence_times;
  for (const SequenceFrame& frame : sequence.frames()) sequence_times.push_back(frame.timestamp_s);
  constexpr double kSameTime = 1e-3;
  std::vector<StoredDepthImage> depths(map.frame_count());
  for (const auto& [frame, at] : detail::associate_times(map_times, sequence_times, kSameTime)) {
    if (const auto& path = sequence.frames()[at].depth) depths[frame] = read_depth_image(*path);
  }

  std::vector<std::optional<Eigen::Vector3d>> positions(map.landmark_count());
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    const auto keyframe = first_keyframe(map, landmark);
    if (!keyframe || depths[keyframe->value].empty() || !map.frames().cameras[keyframe->value]) {
      continue;
    }
    const auto frames = map.observing_frames(landmark);
    const auto at = static_cast<std::size_t>(
        std::distance(frames.begin(), std::find(frames.begin(), frames.end(), *keyframe)));
    const Pixel& pixel = map.observed_pixels(landmark)[at];
    const auto depth = depth_between_pixels(depths[keyframe->value], pixel);
    const Camera& camera = map.cameras()[map.frames().cameras[keyframe->value]->value];
    const auto ray = unproject(camera, pixel);
    if (!depth || !ray || !(ray->z() > 0.0)) continue;
    positions[i] = *ray * (*depth / depth_units_per_metre / ray->z());
  }
  return positions;
}
#endif

// Landmarks against the truth, each in its first keyframe.
struct Calibration {
  std::vector<LandmarkEstimate> landmarks;
  CovarianceCalibration result;
};

// ---- Output

Json json_of(const ReprojectionStatistics& reprojection) {
  Json json = to_json(reprojection.px);
  json["inlier_share"] = reprojection.inlier_share;
  return json;
}

Json json_of(const MapConsistency& consistency) {
  Json reprojection = {{"missing", text_or_null(consistency.missing_for_reprojection)},
                       {"px", nullptr},
                       {"behind_camera", consistency.observations_behind},
                       {"by_octave", Json::array()}};
  if (consistency.reprojection) reprojection["px"] = json_of(*consistency.reprojection);
  for (const auto& [octave, statistics] : consistency.by_octave) {
    reprojection["by_octave"].push_back({{"octave", octave}, {"px", json_of(statistics)}});
  }
  Json depth = {{"missing", text_or_null(consistency.missing_for_depth)},
                {"error", nullptr},
                {"bias", to_json(consistency.depth_bias)}};
  if (consistency.depth) depth["error"] = to_json(*consistency.depth);
  return {{"reprojection", std::move(reprojection)}, {"depth", std::move(depth)}};
}

Json json_of(const std::optional<NeesStatistics>& statistics) {
  if (!statistics)
    return {{"count", 0}, {"mean", nullptr}, {"median", nullptr}, {"inside_95", nullptr}};
  return {{"count", statistics->count},
          {"mean", statistics->mean},
          {"median", statistics->median},
          {"inside_95", statistics->inside_95}};
}

template <class Bound>
Json json_of(const std::vector<NeesBin<Bound>>& bins) {
  Json list = Json::array();
  for (const auto& bin : bins) {
    Json entry = {{"from", bin.from}, {"to", to_json(bin.to)}};
    entry.update(json_of(bin.statistics));
    list.push_back(std::move(entry));
  }
  return list;
}

Json json_of(const CovarianceCalibration& calibration) {
  return {{"expected", {{"mean", kExpectedNees}, {"inside_95", 0.95}}},
          {"all", json_of(calibration.all)},
          {"by_depth", json_of(calibration.by_depth)},
          {"by_observations", json_of(calibration.by_observations)},
          {"without_truth", calibration.without_truth},
          {"without_covariance", calibration.without_covariance},
          {"singular", calibration.singular}};
}

// Mean of what is known of one landmark's observations.
std::optional<double> mean_of_landmark(const std::vector<std::optional<double>>& values,
                                       const LandmarkMap& map, std::uint32_t landmark) {
  if (values.empty()) return std::nullopt;
  double sum = 0.0;
  std::size_t count = 0;
  const auto& offsets = map.observations().offsets;
  for (std::uint64_t i = offsets[landmark]; i < offsets[landmark + 1]; ++i) {
    if (!values[i]) continue;
    sum += *values[i];
    ++count;
  }
  return count > 0 ? std::optional(sum / static_cast<double>(count)) : std::nullopt;
}

detail::Csv rows_of(const LandmarkMap& map, const MapConsistency& consistency,
                    const std::optional<Calibration>& calibration) {
  detail::Csv rows({"landmark", "observations", "first_keyframe", "depth", "reprojection_px",
                    "depth_error", "error_x", "error_y", "error_z", "nees"});
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const LandmarkIndex landmark{i};
    const auto keyframe = first_keyframe(map, landmark);
    rows << map.landmarks().ids[i].value;
    rows << (map.has_observations() ? std::optional<std::uint64_t>(map.observation_count(landmark))
                                    : std::nullopt);
    rows << (keyframe ? std::optional(map.frames().ids[keyframe->value].value) : std::nullopt);
    rows << (keyframe ? std::optional((map.world_from_camera(*keyframe).inverse() *
                                       map.landmarks().positions[i])
                                          .z())
                      : std::nullopt);
    rows << mean_of_landmark(consistency.reprojection_px, map, i);
    rows << mean_of_landmark(consistency.depth_errors, map, i);
    std::optional<Eigen::Vector3d> error;
    if (calibration && calibration->landmarks[i].truth) {
      error = calibration->landmarks[i].estimate - *calibration->landmarks[i].truth;
    }
    for (int k = 0; k < 3; ++k) rows << (error ? std::optional((*error)[k]) : std::nullopt);
    rows << (calibration ? calibration->result.nees[i] : std::nullopt);
    rows.end_row();
  }
  return rows;
}

void add_statistics(Table& table, const std::string& name, const std::string& unit, int digits,
                    const ErrorStatistics& statistics, std::optional<double> inlier_share) {
  table.add_row({name, unit, std::to_string(statistics.count), fixed(statistics.median, digits),
                 fixed(statistics.mean, digits), fixed(statistics.rmse, digits),
                 fixed(statistics.percentile_95, digits),
                 inlier_share ? fixed(100.0 * *inlier_share, 1) + " %" : "-"});
}

std::string bin_name(const NeesBin<double>& bin, const std::string& unit) {
  return bin.to ? fmt::format("depth {:g}-{:g} {}", bin.from, *bin.to, unit)
                : fmt::format("depth {:g}+ {}", bin.from, unit);
}

std::string bin_name(const NeesBin<std::size_t>& bin, const std::string& /*unit*/) {
  if (!bin.to) return fmt::format("observed {}+ times", bin.from);
  if (*bin.to == bin.from + 1) return fmt::format("observed {} times", bin.from);
  return fmt::format("observed {}-{} times", bin.from, *bin.to - 1);
}

std::string calibration_text(const CovarianceCalibration& calibration, const std::string& unit) {
  Table table({"covariances", "landmarks", "NEES mean", "median", "in 95 % ellipsoid"});
  table.add_row({"if they are right", "", fixed(kExpectedNees, 3), "2.366", "95.0 %"});
  const auto add = [&](const std::string& name, const std::optional<NeesStatistics>& statistics) {
    if (statistics) {
      table.add_row({name, std::to_string(statistics->count), fixed(statistics->mean, 3),
                     fixed(statistics->median, 3), fixed(100.0 * statistics->inside_95, 1) + " %"});
    } else {
      table.add_row({name, "0", "-", "-", "-"});
    }
  };
  add("all", calibration.all);
  for (const auto& bin : calibration.by_depth) add(bin_name(bin, unit), bin.statistics);
  for (const auto& bin : calibration.by_observations) add(bin_name(bin, unit), bin.statistics);
  std::string text = table.text();
  text +=
      "\nNEES  squared error over covariance, in the first keyframe; a mean above 3 tells of "
      "covariances\n      that are too small\n";
  for (const auto& [count, why] :
       {std::pair{calibration.without_truth, "no true position in their first keyframe"},
        {calibration.without_covariance, "no covariance"},
        {calibration.singular, "a singular covariance"}}) {
    if (count > 0) text += fmt::format("left out: {} landmarks with {}\n", count, why);
  }
  return text;
}

struct EvaluateMapArguments {
  CommonArguments common;
  std::string input;
  std::string camera;
  std::string truth_map;
  std::string truth_trajectory;
  std::string truth_depth;
  std::size_t min_observations = 2;
  double max_time_difference_s = 0.02;
  double inlier_px = kInlierPx;

  void add_to(const Command& command) {
    command.add_text("map", input, "Map to evaluate: " + all_formats().titles_text()).required();
    command.add_text("--camera", camera,
                     fmt::format("Camera of all frames, for reprojection errors: {}", kCameraHelp),
                     "CAMERA");
    command.add_text(
        "--truth-map", truth_map,
        "Map with the true positions of the landmarks and frames of the same ids; evaluates the "
        "covariances",
        "MAP");
    command.add_text(
        "--truth-trajectory", truth_trajectory,
        "With --truth-map: true poses of the frames, by timestamp, instead of the true map's "
        "(TUM format)",
        "FILE");
#ifdef CAIRN_HAS_ODOMETRY
    command.add_text(
        "--truth-depth", truth_depth,
        "Instead of --truth-map: sequence in TUM layout with the exact depth of the map's "
        "images, as written by cairn simulate --no-depth-noise",
        "FOLDER");
#endif
    add_number(command, "--max-time-difference", max_time_difference_s,
               "Largest time difference between a frame and its true pose, seconds");
    add_number(command, "--min-observations", min_observations,
               "Leave out landmarks with fewer observations");
    add_number(command, "--inlier-px", inlier_px,
               "Largest reprojection error of an inlier, pixels");
    common.add_csv_to(command, "landmark");
    common.add_to(command);
    command.footer(
        "Example: print the reprojection errors, then evaluate the covariances\n"
        "  cairn evaluate map desk.map --camera \"PINHOLE 640 480 517.3 516.5 318.6 255.3\"\n"
        "  cairn evaluate map desk.map --truth-map true.map --csv landmarks.csv");
  }

  int run() {
    check_options();
    const auto given_camera =
        camera.empty() ? std::nullopt : std::optional(load_camera(camera).camera);
    const LoadedMap loaded = load_map(input, common);
    const auto truth =
        truth_map.empty() ? std::nullopt : std::optional(load_map(truth_map, common));

    LandmarkMap map = with_landmarks(loaded.map, landmarks_observed(loaded.map, min_observations));
    reject_if(map.landmark_count() == 0, input,
              fmt::format("has no landmarks with {} or more observations", min_observations),
              "landmarks, or a smaller --min-observations");
    if (given_camera) map = with_camera(map, *given_camera);
    const MapConsistency consistency = map_consistency(map, inlier_px);
    if (!consistency.reprojection && !consistency.depth && !truth && truth_depth.empty()) {
      const std::string& pixels = consistency.missing_for_reprojection;
      const std::string& depths = consistency.missing_for_depth;
      throw Error(ErrorKind::kInput, input,
                  pixels.empty()     ? "no observation is in a frame with a camera"
                  : pixels == depths ? fmt::format("the map has no {}", pixels)
                                     : fmt::format("the map has no {} and no {}", pixels, depths),
                  "one of them, --camera for reprojection errors, or --truth-map");
    }
    const auto calibration =
        truth || !truth_depth.empty() ? std::optional(calibrate(map, truth)) : std::nullopt;

    Json inputs = {{"map", loaded.description}};
    inputs["map"]["kept_landmarks"] = map.landmark_count();
    if (truth) inputs["truth_map"] = truth->description;
    if (!truth_trajectory.empty()) {
      inputs["truth_trajectory"] = describe_file(truth_trajectory, common);
    }
    Json json = document("evaluate_map", common, std::move(inputs),
                         {{"camera", text_or_null(camera)},
                          {"truth_depth", text_or_null(truth_depth)},
                          {"min_observations", min_observations},
                          {"inlier_px", inlier_px},
                          {"max_time_difference_s", max_time_difference_s}});
    json["length_unit"] = to_string(map.info().length_unit);
    json.update(json_of(consistency));
    json["calibration"] = calibration ? json_of(calibration->result) : Json(nullptr);
    write_document(json, common);
    if (!common.csv_path.empty()) write_rows(rows_of(map, consistency, calibration), common);
    print(loaded, map, consistency, calibration);
    return kDone;
  }

 private:
  void check_options() const {
    refuse_if(!kFinitePositive.contains(inlier_px), "--inlier-px", fmt::format("{}", inlier_px),
              "a positive number");
    refuse_if(!(max_time_difference_s > 0.0), "--max-time-difference",
              fmt::format("{}", max_time_difference_s), "a positive number");
    refuse_if(!truth_trajectory.empty() && truth_map.empty(), "--truth-trajectory",
              "given without --truth-map", "both, because a trajectory has no landmarks");
    refuse_if(!truth_depth.empty() && !truth_map.empty(), "--truth-depth", "given with --truth-map",
              "one of them");
    require_outputs(common);
  }

  std::vector<std::optional<Eigen::Vector3d>> true_positions(
      const LandmarkMap& map, const std::optional<LoadedMap>& truth) const {
#ifdef CAIRN_HAS_ODOMETRY
    if (!truth) return true_positions_from_depth(map, truth_depth, kTumDepthUnits);
#endif
    KeyframePoses poses;
    if (truth_trajectory.empty()) {
      poses = keyframe_poses(map, truth->map);
    } else {
      poses = keyframe_poses(map, read_trajectory(truth_trajectory, common.console().log()),
                             max_time_difference_s);
    }
    return true_positions_in_first_keyframe(map, truth->map, poses);
  }

  Calibration calibrate(const LandmarkMap& map, const std::optional<LoadedMap>& truth) const {
    Calibration calibration;
    calibration.landmarks = estimates_in_first_keyframe(map, true_positions(map, truth));
    calibration.result = calibrate_covariances(calibration.landmarks);
    reject_if(!calibration.result.all, truth_map.empty() ? truth_depth : truth_map,
              fmt::format("no landmark can be judged: of {}, {} without a true position in their "
                          "first keyframe, {} without covariance, {} with a singular one",
                          map.landmark_count(), calibration.result.without_truth,
                          calibration.result.without_covariance, calibration.result.singular),
              "landmarks and frames with the ids of " + input);
    return calibration;
  }

  void print(const LoadedMap& loaded, const LandmarkMap& kept, const MapConsistency& consistency,
             const std::optional<Calibration>& calibration) const {
    const Console console = common.console();
    const std::string unit = unit_symbol(kept.info().length_unit);
    console.print("{}: {} of {} landmarks, {} frames, {} observations\n\n", loaded.path,
                  kept.landmark_count(), loaded.map.landmark_count(), kept.frame_count(),
                  kept.observation_count());
    Table table({"error", "unit", "count", "median", "mean", "rms", "95 %",
                 fmt::format("below {:g} px", inlier_px)});
    if (const auto& reprojection = consistency.reprojection) {
      add_statistics(table, "reprojection", "px", 3, reprojection->px, reprojection->inlier_share);
      for (const auto& [octave, statistics] : consistency.by_octave) {
        add_statistics(table, fmt::format("  octave {}", octave), "px", 3, statistics.px,
                       statistics.inlier_share);
      }
    }
    if (consistency.depth)
      add_statistics(table, "depth", unit, 5, *consistency.depth, std::nullopt);
    if (consistency.reprojection || consistency.depth) console.print(table.text());
    if (consistency.depth_bias) {
      console.print("measured depths are {} {} {} than those of the map, on average\n",
                    fixed(std::abs(*consistency.depth_bias), 5), unit,
                    *consistency.depth_bias < 0.0 ? "shorter" : "longer");
    }
    if (consistency.observations_behind > 0) {
      console.print("observations of landmarks behind their camera: {}\n",
                    consistency.observations_behind);
    }
    if (const auto& missing = consistency.missing_for_reprojection; !missing.empty()) {
      console.print("no reprojection errors: the map has no {}{}\n", missing,
                    missing.starts_with("cameras") ? "; add --camera" : "");
    }
    if (const auto& missing = consistency.missing_for_depth; !missing.empty()) {
      console.print("no depth errors: the map has no {}\n", missing);
    }
    if (calibration) console.print("\n" + calibration_text(calibration->result, unit));
  }
};

}  // namespace

void add_evaluate_map(const Command& evaluate) {
  add_verb<EvaluateMapArguments>(
      evaluate, "map",
      "Compute reprojection and depth errors of a map, and the calibration of its covariances");
}

}  // namespace cairn::cli
