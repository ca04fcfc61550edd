// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/map/synthetic.hpp"

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/arguments.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

struct DemoArguments {
  CommonArguments common;
  std::string displacement = "0.15 -0.1 0.05 3 -4 15";
  std::string save;

  void add_to(CLI::App& command);
  int run();
};

void DemoArguments::add_to(CLI::App& command) {
  common.seed = 1;
  add_text(command, "--displacement", displacement,
           "How far from the true pose to start: \"x y z roll pitch yaw\", metres and degrees",
           "POSE")
      ->capture_default_str();
  add_text(command, "--save", save,
           "Write source.map, target.map, truth.txt and initial.txt to FOLDER, to go on with",
           "FOLDER");
  common.add_to(command);
  command.footer(
      "Example: keep the maps and align them by hand\n"
      "  cairn demo --save desk\n"
      "  cairn align desk/source.map desk/target.map --initial-matrix desk/initial.txt \\\n"
      "      --truth desk/truth.txt --confidence observations");
}

void write_pose(const std::filesystem::path& path, const Rigid3& pose) {
  const Matrix4d matrix = pose.matrix();
  std::string text;
  for (int i = 0; i < 4; ++i) {
    text += fmt::format("{} {} {} {}\n", matrix(i, 0), matrix(i, 1), matrix(i, 2), matrix(i, 3));
  }
  write_file(path, [&](const ByteSink& sink) { sink(text); });
}

// The displacement happens at the landmarks: about the source's origin, a turn would also throw the
// map aside by the distance between the two.
Rigid3 displaced(const Rigid3& truth, const Rigid3& displacement, const LandmarkMap& source) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : source.landmarks().positions) centre += truth * position;
  centre /= static_cast<double>(source.landmark_count());
  const Rigid3 to_centre(Eigen::Quaterniond::Identity(), centre);
  return to_centre * displacement * to_centre.inverse() * truth;
}

void make_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw Error(ErrorKind::kStorage, "--save", folder + " cannot be made: " + error.message(),
                "a folder");
  }
}

int DemoArguments::run() {
  const Rigid3 offset = parse_pose(displacement, "--displacement");
  require_folder_of(common.json_path);
  if (!save.empty()) make_folder(save);
  const SyntheticPair pair = synthetic_pair({.seed = common.seed});
  AlignOptions options;
  options.overlap_radius = 0.05;
  options.initial = displaced(pair.target_from_source, offset, pair.source);
  const std::vector<Alignment> alignments = align_by_all(
      pair.source, pair.target, parse_strategies("none,covariance,observations,distance"), options,
      PointSetOptions(), pair.target_from_source, common);

  if (!save.empty()) {
    const std::filesystem::path folder = save;
    save_map(pair.source, folder / "source.map", common);
    save_map(pair.target, folder / "target.map", common);
    write_pose(folder / "truth.txt", pair.target_from_source);
    write_pose(folder / "initial.txt", options.initial);
  }
  Json json = document("demo", common, Json::object(), {{"displacement", displacement}});
  json["truth"] = to_json(pair.target_from_source);
  json["results"] = Json::array();
  for (const Alignment& alignment : alignments) {
    json["results"].push_back(to_json(alignment, options, LengthUnit::kMetres));
  }
  write_document(json, common);

  const Console console = common.console();
  const PoseError start =
      pose_error(options.initial, pair.target_from_source, pair.source.landmarks().positions);
  console.print(
      fmt::format("Two simulated sessions over one desk: {} and {} landmarks, of which {} are the "
                  "same points.\n"
                  "The source starts {:.2f} m and {:.1f} degrees off its true pose.\n\n",
                  pair.source.landmark_count(), pair.target.landmark_count(), pair.shared.size(),
                  start.translation, degrees(start.rotation_rad)));
  console.print(alignment_table(alignments, options, LengthUnit::kMetres));
  console.print(
      "error    of the pose found against the true one; a lower score need not mean a smaller "
      "error\n"
      "\n"
      "Confidence none is plain ICP: each landmark is matched to the nearest. The others match it "
      "to\n"
      "the most trusted of the k nearest: smallest covariance, most observations, seen from "
      "closest.\n");
  if (!save.empty()) {
    console.print(
        fmt::format("\nSaved to {}: source.map target.map truth.txt initial.txt\n", save));
  }
  return kDone;
}

}  // namespace

Run add_demo(CLI::App& program) {
  auto arguments = std::make_shared<DemoArguments>();
  arguments->add_to(*program.add_subcommand(
      "demo", "Simulate two sessions of one desk and align them by all strategies"));
  return [arguments] { return arguments->run(); };
}

}  // namespace cairn::cli
