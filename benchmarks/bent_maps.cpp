// SPDX-License-Identifier: BSD-3-Clause
// Experiments.
#include <cstdio>
#include <exception>
#include <string>
#include <vector>
#include <chrono>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/map/io/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/placement/map_parts.hpp"

using namespace cairn;
int main(int argc, char** argv) {
  const LandmarkMap source = read_map(argv[1]);
  const LandmarkMap target = read_map(argv[2]);
  const std::size_t size = argc > 3 ? std::stoul(argv[3]) : 600;
  const PoseSearch search = argc > 4 ? PoseSearch::kNever : PoseSearch::kWhereNeeded;
  const Executor executor(1);
  const auto parts_of = [&](const LandmarkMap& map) {
    std::vector<PreparedMap> prepared;
    for (const MapPart& part : cut_into_parts(map, {}, {.landmarks = size})) {
      std::printf("part %llu-%llu %.2f-%.2f s %zu\n", (unsigned long long)part.first.value, (unsigned long long)part.last.value,
                  part.first_s.value_or(0) - *map.frames().timestamps_s[0], part.last_s.value_or(0) - *map.frames().timestamps_s[0], part.landmarks.size());
      prepared.emplace_back(with_landmarks(map, part.landmarks), PrepareOptions{.executor = executor});
    }
    return prepared;
  };
  const auto a = parts_of(source);
  const auto b = parts_of(target);
  const PreparedMap A(source, {.executor = executor});
  const PreparedMap B(target, {.executor = executor});
  const auto tell = [&](const char* name, const PreparedMap& s, const PreparedMap& t) {
    PlaceOptions options;
    options.search = search;
    options.execution.executor = executor;
    PreparedPair pair(s.cloud(), t.cloud(), options);
    const PlacementResult r = pair.place();
    if (r.candidates.empty()) { std::printf("%s none %.2f s\n", name, r.duration_s); return; }
    const auto& c = r.candidates.front();
    const auto& pose = r.alignment.target_from_source;
    std::vector<Eigen::Vector3d> at;
    for (const auto& p : s.cloud().landmarks().positions) at.push_back(p + s.cloud().centred()->centre);
    const PoseError error = pose_error(pose, Rigid3(), at);
    const Eigen::AngleAxisd aa(pose.quaternion());
    const Eigen::Vector3d rv = degrees(1.0) * aa.angle() * aa.axis();
    std::printf("%s %-9s p %.4f rot %.2f (%.2f %.2f %.2f) deg moved %.3f m agree %zu spread %zu share %.2f %.2f s\n", name,
                std::string(to_string(r.verdict)).c_str(), r.probability, degrees(error.rotation_rad), rv.x(), rv.y(), rv.z(), error.translation,
                c.support.agreement ? c.support.agreement->agreeing : 0, c.support.agreement ? c.support.agreement->spread : 0, c.support.share, r.duration_s);
    std::fflush(stdout);
  };
  tell("whole", A, B);
  for (std::size_t i = 0; i < a.size(); ++i) tell(fmt::format("s{} T", i).c_str(), a[i], B);
  for (std::size_t i = 0; i < b.size(); ++i) tell(fmt::format("S t{}", i).c_str(), A, b[i]);
  if (argc > 5) for (std::size_t i = 0; i < a.size(); ++i) for (std::size_t j = 0; j < b.size(); ++j) tell(fmt::format("s{} t{}", i, j).c_str(), a[i], b[j]);
}
