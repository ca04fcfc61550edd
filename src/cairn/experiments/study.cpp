// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/study.hpp"

#include <array>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace cairn {
namespace {

using Part = double Displacement::*;

struct NamedPart {
  std::string_view name;
  Part part;
};

constexpr std::array<NamedPart, 6> kParts = {{{"x_m", &Displacement::x_m},
                                              {"y_m", &Displacement::y_m},
                                              {"z_m", &Displacement::z_m},
                                              {"roll_deg", &Displacement::roll_deg},
                                              {"pitch_deg", &Displacement::pitch_deg},
                                              {"yaw_deg", &Displacement::yaw_deg}}};

Displacement draw(Random random, const DisplacementRange& range) {
  Displacement displacement;
  for (const NamedPart& named : kParts) {
    displacement.*named.part = random.uniform(range.low.*named.part, range.high.*named.part);
  }
  return displacement;
}

std::string text_of(const StudyPair& pair) {
  if (const auto* files = std::get_if<PairFiles>(&pair.maps)) {
    return fmt::format("pair {} source {} target {} truth {}\n", pair.name, files->source,
                       files->target, files->truth.value_or("-"));
  }
  const auto& simulation = std::get<PairSimulation>(pair.maps);
  return fmt::format("pair {} simulate {} seed {} path {} frames {} rate_hz {} changed {}\n",
                     pair.name, simulation.environment, simulation.seed, simulation.path,
                     simulation.frames, simulation.rate_hz, simulation.changed);
}

}  // namespace

bool StudyPair::has_truth() const {
  const auto* files = std::get_if<PairFiles>(&maps);
  return files == nullptr || files->truth.has_value();
}

std::string canonical_text(const Study& study) {
  std::string text = fmt::format("study {}\nseed {}\n", study.name, study.seed);
  for (const StudyPair& pair : study.pairs) text += text_of(pair);
  text += fmt::format("initial_poses {}\n", study.initial_count);
  for (const NamedPart& named : kParts) {
    text += fmt::format("{} {} {}\n", named.name, study.initial.low.*named.part,
                        study.initial.high.*named.part);
  }
  // Folders of before there were methods can be gone on with.
  if (study.methods != Study().methods) {
    std::vector<std::string_view> methods;
    for (const Method method : study.methods) methods.push_back(to_string(method));
    text += fmt::format("methods {}\n", fmt::join(methods, " "));
  }
  text += fmt::format("strategies {}\nk {}\n", fmt::join(study.strategies, " "),
                      fmt::join(study.k, " "));
  return text + fmt::format("max_iterations {}\nmax_distance_m {}\nmin_observations {}\n",
                            study.align.max_iterations, study.align.max_distance,
                            study.points.min_observations);
}

StudyPlan::StudyPlan(const Study& study) : study_(study) {
  for (std::size_t i = 0; i < study.k.size(); ++i) {
    for (const Method method : study.methods) {
      for (const std::string& strategy : study.strategies) {
        const bool same_for_all_k = !uses_k(method) || !strategy_named(strategy).metric;
        if (i > 0 && same_for_all_k) continue;
        combinations_.push_back({method, strategy, study.k[i]});
      }
    }
  }
}

Trial StudyPlan::trial(std::size_t run) const {
  const std::size_t pair = pair_of(run);
  const std::size_t within = run % runs_per_pair();
  const std::size_t pose = within / combinations_.size();
  const Combination& combination = combinations_[within % combinations_.size()];
  return {.pair = study_.pairs[pair].name,
          .experiment = study_.name,
          .number = pose + 1,
          .method = combination.method,
          .strategy = combination.strategy,
          .k = combination.k,
          .initial = draw(random_of(run), study_.initial)};
}

Random StudyPlan::random_of(std::size_t run) const {
  const std::size_t pose = run % runs_per_pair() / combinations_.size();
  return Random(study_.seed).fork(pair_of(run)).fork(pose);
}

std::uint64_t StudyPlan::seed_of(std::size_t run) const {
  return random_of(run).fork(1).draw_seed();
}

Rigid3 displaced(const Displacement& displacement, const std::optional<Rigid3>& truth,
                 const Eigen::Vector3d& centroid) {
  const Rigid3 base = truth.value_or(Rigid3());
  const Eigen::Vector3d centre = base * centroid;
  const Rigid3 change = displacement.pose();
  const Rigid3 about_centre(change.quaternion(),
                            centre - change.quaternion() * centre + change.translation());
  return about_centre * base;
}

}  // namespace cairn
