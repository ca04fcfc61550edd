// SPDX-License-Identifier: BSD-3-Clause
// Experiments.
#include <cstdio>
#include <exception>
#include <string>
#include <vector>
#include <chrono>

#include <fmt/format.h>

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/by_parts.hpp"
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
      if (argc > 5) std::printf("part %llu-%llu %.2f-%.2f s %zu\n", (unsigned long long)part.first.value, (unsigned long long)part.last.value,
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
  const auto start = std::chrono::steady_clock::now();
  PlaceOptions o;
  const PartsAlignment parts = place_by_parts(A, B, o);
  std::printf("by parts %.2f s: aligned %zu of %zu consensus %d contradictory %d\n", std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
     parts.aligned, parts.parts.size(), parts.consensus, parts.contradictory);
  for (const PartPose& p : parts.parts) {
    const auto rv = [&](const Similarity3& s) { return Eigen::Vector3d(degrees(1.0) * rotation_log(s.rigid().quaternion())); };
    std::printf("  %s %llu-%llu %zu %s %.4f agrees %d", std::string(to_string(p.map)).c_str(), (unsigned long long)p.first.value, (unsigned long long)p.last.value, p.landmarks, std::string(to_string(p.verdict)).c_str(), p.probability, p.agrees);
    if (p.found) std::printf(" found %.2f %.2f %.2f", rv(*p.found).x(), rv(*p.found).y(), rv(*p.found).z());
    if (p.target_from_source) std::printf(" pose %.2f %.2f %.2f", rv(*p.target_from_source).x(), rv(*p.target_from_source).y(), rv(*p.target_from_source).z());
    std::printf("\n");
  }
  if (parts.consensus) {
    std::vector<Eigen::Vector3d> at;
    for (const auto& p : A.cloud().landmarks().positions) at.push_back(p + A.cloud().centred()->centre);
    const PoseError error = pose_error(*parts.target_from_source, Rigid3(), at);
    const Eigen::Vector3d rv(degrees(1.0) * rotation_log(parts.target_from_source->rigid().quaternion()));
    std::printf("  bend of %s %.2f deg between %llu and %llu, displaced %.3f; pose %.2f %.2f %.2f off %.2f deg %.3f m p %.4f\n", std::string(to_string(parts.bend->map)).c_str(), degrees(parts.bend->rotation_rad),
      (unsigned long long)parts.bend->first.value, (unsigned long long)parts.bend->last.value, parts.bend->displacement, rv.x(), rv.y(), rv.z(), degrees(error.rotation_rad), error.translation, parts.probability);
    const Matrix4d m = parts.target_from_source->matrix();
    for (int i = 0; i < 4; ++i) std::printf("  %.9f %.9f %.9f %.9f\n", m(i,0), m(i,1), m(i,2), m(i,3));
  }
}
