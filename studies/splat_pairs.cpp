// SPDX-License-Identifier: BSD-3-Clause
// Whether two Gaussian splats of one place are aligned right, and splats of different places not at all.
//   cairn_splat_pairs_benchmark PAIRS [STRANGERS]
//   cairn_splat_pairs_benchmark models SOURCE TARGET TRUTH [SOURCE TARGET TRUTH ...]
// Splats are made of the landmarks of simulated sessions (synthetic_pair(), without descriptors): a fifth of them is there
// twice; opacities, sizes and shapes are drawn; 2 % floaters and a shell of 5 % in the background are added; each splat
// has a frame and a unit of its own. Of given models, the radius takes the place of a metre, and TRUTH
// is a file with target_from_source as 16 numbers. One CSV row a pair to stdout.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/splats.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/pose_graph/optimise_poses.hpp"

#include "random_pose.hpp"
#include "session_pairs.hpp"
#include "study_main.hpp"

namespace {

using namespace cairn;
using benchmarks::random_pose;

Eigen::Vector3d normal_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

class SplatTable {
 public:
  explicit SplatTable(Random random) : random_(std::move(random)) {
    tables_.info.length_unit = LengthUnit::kFree;
    for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
                             "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
      tables_.landmarks.columns.push_back({name, {}});
    }
  }

  Random& random() { return random_; }

  // @param logit of the opacity, mean of those that are drawn
  // @param size  standard deviation along an axis, median of those that are drawn
  void add(const Eigen::Vector3d& position, double logit, double size) {
    LandmarkTable& landmarks = tables_.landmarks;
    landmarks.ids.push_back(LandmarkId{landmarks.ids.size()});
    landmarks.positions.push_back(position);
    for (std::size_t k = 0; k < landmarks.columns.size(); ++k) {
      double value = random_.normal();
      if (k == 3) value = logit + 1.5 * value;
      if (k >= 4 && k < 7) value = std::log(size) + 0.5 * value;
      landmarks.columns[k].values.push_back(value);
    }
  }

  LandmarkMap map() && {
    set_splat_looks(*splat_columns(tables_.landmarks.columns), tables_.landmarks);
    return LandmarkMap(std::move(tables_));
  }

 private:
  Random random_;
  MapTables tables_;
};

// @param metre in the map's unit
LandmarkMap splats_of(const LandmarkMap& map, Random random, double metre = 1.0) {
  const double size = 0.01 * metre;
  const double noise = 0.002 * metre;   // of positions
  const double farthest = 8.0 * metre;  // of the background
  SplatTable table(std::move(random));
  const auto& positions = map.landmarks().positions;
  for (const Eigen::Vector3d& position : positions) {
    do {
      table.add(position + noise * normal_vector(table.random()), 2.0, size);
    } while (table.random().chance(1.0 / 6.0));
  }
  const Eigen::Vector3d centre = positions.front();
  for (std::size_t i = 0; i < positions.size() / 50; ++i) {
    table.add(centre + 0.7 * metre * normal_vector(table.random()), 0.0, 3.0 * size);
  }
  for (std::size_t i = 0; i < positions.size() / 20; ++i) {
    const double distance = table.random().uniform(0.5, 1.0) * farthest;
    table.add(centre + distance * normal_vector(table.random()).normalized(), 1.0, 0.3 * metre);
  }
  return std::move(table).map();
}

struct SplatPair {
  LandmarkMap source;
  LandmarkMap target;
  Similarity3 target_from_source;
  double overlap = 0.0;
};

SplatPair splat_pair(std::uint64_t number, bool same_place) {
  Random random(number);
  SyntheticOptions options{.seed = 2 * number + 1, .overlap = random.uniform(0.25, 0.8)};
  const SyntheticPair pair = synthetic_pair(options);
  options.seed += 1'000'001;
  const LandmarkMap target = same_place ? pair.target : synthetic_pair(options).target;
  const auto own_frame = [&] {
    return Similarity3(std::exp(random.uniform(-1.5, 1.5)), random_pose(random, 5.0));
  };
  const Similarity3 of_source = own_frame();
  const Similarity3 of_target = own_frame();
  return {transformed(splats_of(pair.source, random.fork(1)), of_source),
          transformed(splats_of(target, random.fork(2)), of_target),
          of_target * pair.target_from_source * of_source.inverse(),
          static_cast<double>(pair.shared.size()) /
              static_cast<double>(std::min(pair.source.landmark_count(), target.landmark_count()))};
}

Similarity3 read_truth(const std::string& path) {
  std::ifstream file(path);
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 16; ++i) file >> matrix(i / 4, i % 4);
  if (!file) throw Error(ErrorKind::kInput, path, "fewer than 16 numbers", "a 4x4 matrix");
  return Similarity3::from_matrix(matrix, 1e-3);
}

SplatPair pair_of_models(std::uint64_t number, std::span<const std::string> paths) {
  Random random(number);
  const auto splats = [&](const std::string& path, std::uint64_t stream) {
    const LandmarkMap map = read_map(path);
    return splats_of(map, random.fork(stream), node_extent(map.landmarks().positions).radius);
  };
  return {splats(paths[0], 1), splats(paths[1], 2), read_truth(paths[2])};
}

void print_row(std::uint64_t number, bool same_place, const SplatPair& pair) {
  const Alignment found = align(pair.source, pair.target, {}, {.seed = number});
  std::string errors = ",,";
  std::string right;
  if (same_place && found.estimate) {
    const PoseError error =
        pose_error(*found.estimate, pair.target_from_source, pair.source.landmarks().positions);
    errors = fmt::format("{:.4f},{:.5f},", degrees(error.rotation_rad), error.log_scale);
    right = degrees(error.rotation_rad) <= 0.5 && error.log_scale <= 0.005 ? "yes" : "no";
  }
  std::printf("%s\n", fmt::format("{},{},{:.3f},{},{},{}{},{:.2f}", number,
                                  same_place ? "same" : "strangers",
                                  same_place ? pair.overlap : 0.0, status_of(found),
                                  found.probability.value_or(0.0), errors, right, found.duration_s)
                          .c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  return benchmarks::study_main(
      argc, argv, 1, "PAIRS [STRANGERS] | models SOURCE TARGET TRUTH ...", [](const auto& words) {
        std::printf(
            "pair,place,overlap,verdict,probability,rotation_deg,log_scale,right,seconds\n");
        if (words[0] == "models") {
          for (std::size_t i = 1; i + 2 < words.size(); i += 3) {
            print_row(i, true, pair_of_models(i, std::span(words).subspan(i, 3)));
          }
          return;
        }
        const std::uint64_t pairs = benchmarks::whole_number(words[0]);
        for (std::uint64_t i = 0; i < pairs; ++i) print_row(i, true, splat_pair(i, true));
        const std::uint64_t strangers = words.size() > 1 ? benchmarks::whole_number(words[1]) : 0;
        for (std::uint64_t i = 0; i < strangers; ++i)
          print_row(pairs + i, false, splat_pair(pairs + i, false));
      });
}
