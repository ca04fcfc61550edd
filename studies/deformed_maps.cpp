// SPDX-License-Identifier: BSD-3-Clause
// Whether maps of different places, or poses that are wrong, can be made to fit by a deformation.
//   cairn_deformed_maps_benchmark POSES MAP...
// Begins with so many random poses between each two maps: any rotation, scales within a third of the ratio of the
// maps' extents, their centres up to half of the extent apart. One CSV row a pair to stdout: how many poses led to a
// deformation that 20 matches agree with, how many of these are aligned, how far apart these poses are at most, in
// radii of the source, and the greatest probability.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/bends.hpp"
#include "cairn/alignment/detail/prepared_cloud.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/random.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/detail/pose_distance.hpp"

#include "random_pose.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;

struct Counts {
  std::size_t fitted = 0;
  std::vector<Similarity3> aligned;
  double apart = 0.0;
  std::size_t matches = 0;
  double probability = 0.0;
};

Counts tried(const PreparedMap& source, const PreparedMap& target, std::size_t poses,
             Random random) {
  const auto middle = [](const PreparedMap& map) {
    return Similarity3(Rigid3(Eigen::Quaterniond::Identity(), map.cloud().centre()));
  };
  const double extent = target.cloud().scales().extent;
  const double ratio = extent / source.cloud().scales().extent;
  std::vector<Eigen::Vector3d> positions;
  for (const Eigen::Vector3d& position : source.cloud().landmarks().positions) {
    positions.emplace_back(position + source.cloud().centre());
  }
  const DeformablePair pair(source, target);
  const PoseDistance distance = PoseDistance::of(positions);
  Counts counts;
  for (std::size_t i = 0; i < poses; ++i) {
    const double scale = ratio * std::exp(random.uniform(-0.3, 0.3));
    const Similarity3 centred(scale, benchmarks::random_pose(random, 0.5 * extent));
    const Similarity3 start = middle(target) * centred * middle(source).inverse();
    const auto found = pair.fit(std::array{start});
    if (!found) continue;
    ++counts.fitted;
    counts.matches = std::max(counts.matches, found->figures.matches);
    AlignOptions options;
    options.scale = ScaleRange();
    const Alignment placed = pair.judge(*found, options);
    counts.probability = std::max(counts.probability, *placed.probability);
    if (placed.verdict != Verdict::kAligned) continue;
    for (const Similarity3& other : counts.aligned) {
      counts.apart = std::max(counts.apart, distance(other, found->target_from_source) /
                                                (other.scale() * distance.radius));
    }
    counts.aligned.push_back(found->target_from_source);
  }
  return counts;
}

void run(const std::vector<std::string>& words) {
  const std::size_t poses = std::stoul(words[0]);
  const std::vector<std::string> paths(words.begin() + 1, words.end());
  std::vector<PreparedMap> maps;
  for (const std::string& path : paths) maps.emplace_back(read_map(path));
  fmt::print("source,target,poses,fitted,most_matches,aligned,apart,greatest_probability\n");
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (std::size_t j = i + 1; j < maps.size(); ++j) {
      const Counts counts = tried(maps[i], maps[j], poses, Random(i).fork(j));
      fmt::print("{},{},{},{},{},{},{:.4f},{:.6f}\n", paths[i], paths[j], poses, counts.fitted,
                 counts.matches, counts.aligned.size(), counts.apart, counts.probability);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(argc, argv, 3, "POSES MAP...", run);
}
