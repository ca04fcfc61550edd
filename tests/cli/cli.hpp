// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <initializer_list>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/command.hpp"
#include "support/maps.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::testing {

using Json = nlohmann::json;
using Words = std::vector<std::string>;

enum ExitCode { kDone = 0, kSystemError = 1, kWrongUsage = 2, kBadInput = 3, kNoAlignment = 4 };

/// Each test runs the tool in an empty folder of its own.
class CliTest : public ::testing::Test {
 protected:
  CommandResult cairn(const Words& words, CommandOptions options = {}) const {
    if (options.folder.empty()) options.folder = folder_.path();
    return run_command(command(words), options);
  }

  /// For what must succeed: its standard output.
  std::string answer(const Words& words) const {
    const CommandResult result = cairn(words);
    EXPECT_EQ(result.exit_code, kDone) << result.errors;
    return result.output;
  }

  /// The document that --json - writes.
  Json document(Words words, int exit_code = kDone) const {
    words.insert(words.end(), {"--json", "-"});
    const CommandResult result = cairn(words);
    EXPECT_EQ(result.exit_code, exit_code) << result.errors;
    return Json::parse(result.output);
  }

  /// The tool must refuse: this exit code, nothing on stdout, and all fragments in the message.
  void expect_refusal(const Words& words, int exit_code,
                      std::initializer_list<std::string_view> fragments) const {
    const CommandResult result = cairn(words);
    EXPECT_EQ(result.exit_code, exit_code);
    EXPECT_EQ(result.output, "");
    EXPECT_THAT(result.errors, ::testing::StartsWith("cairn: "));
    for (const std::string_view fragment : fragments) {
      EXPECT_THAT(result.errors, ::testing::HasSubstr(std::string(fragment)));
    }
  }

  static Words command(Words words) {
    words.insert(words.begin(), CAIRN_TOOL);
    return words;
  }

  std::filesystem::path path(std::string_view name) const { return folder_ / name; }

  void write(std::string_view name, std::string_view content) const {
    folder_.write(name, content);
  }

  std::string content(std::string_view name) const { return read_text(path(name)); }

  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      names.insert(entry.path().filename());
    }
    return names;
  }

  /// Writes source.map and target.map, two sessions over one scene; truth.txt; and start.txt, a pose
  /// a few degrees and centimetres off it.
  SyntheticPair write_pair(std::size_t landmarks = 600) const {
    SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = landmarks, .frames = 20});
    write_map(pair.source, path("source.map"));
    write_map(pair.target, path("target.map"));
    write("truth.txt", matrix_text(pair.target_from_source));
    const Rigid3 step = Rigid3::from_roll_pitch_yaw({0.03, -0.02, 0.01}, 0.01, -0.02, 0.03);
    write("start.txt", matrix_text(step * pair.target_from_source));
    return pair;
  }

  /// Writes into a folder two maps that show nothing in common, 1.map and 2.map, and the graph in which
  /// odometry links them, as 'cairn map --mini-map-length' does. @return the first from the second
  Similarity3 write_mini_maps(const std::string& folder) const {
    std::filesystem::create_directory(path(folder));
    PoseGraph graph;
    for (const std::uint64_t seed : {1, 2}) {
      const std::string name = std::to_string(seed) + ".map";
      write_map(synthetic_map({.seed = seed, .landmarks = 200, .frames = 6}), path(folder) / name);
      graph.nodes.push_back({NodeId{seed}, name, "a run", {}});
    }
    const Similarity3 first_from_second(Rigid3::from_roll_pitch_yaw({3.0, 1.0, 0.0}, 0, 0, 0.7));
    graph.links.push_back({.target = NodeId{1},
                           .source = NodeId{2},
                           .kind = LinkKind::kOdometry,
                           .target_from_source = first_from_second,
                           .covariance = Matrix6d(1e-4 * Matrix6d::Identity())});
    write(folder + "/pose_graph.json", pose_graph_text(graph));
    return first_from_second;
  }

  /// Writes plain.map: two frames and three landmarks, observed twice, once and never.
  LandmarkMap write_plain() const {
    write_map(plain_map(), path("plain.map"));
    return plain_map();
  }

  /// As a file of a pose has it.
  static std::string matrix_text(const Rigid3& pose) {
    const Matrix4d matrix = pose.matrix();
    std::string text;
    for (int i = 0; i < 16; ++i) text += fmt::format("{}\n", matrix(i / 4, i % 4));
    return text;
  }

 private:
  TemporaryFolder folder_;
};

inline Rigid3 pose_of(const Json& rows) {
  Matrix4d matrix;
  for (int i = 0; i < 16; ++i) {
    matrix(i / 4, i % 4) =
        rows.at(static_cast<std::size_t>(i / 4)).at(static_cast<std::size_t>(i % 4)).get<double>();
  }
  return Rigid3::from_matrix(matrix);
}

}  // namespace cairn::testing
