// SPDX-License-Identifier: BSD-3-Clause
#include "support/adjustment.hpp"

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"

#include "support/map_lists.hpp"

namespace cairn::cli {

void add_adjustment_to(const Command& command, FusionOptions& options) {
  add_options(command, FusionOptions::table, &options);
  command.option("--refine-intrinsics").needs(command.option("--adjust"));
}

Json bend_json(const std::optional<MapBend>& bend) {
  if (!bend) return nullptr;
  return {{"rotation_deg", degrees(bend->rotation_rad)},
          {"first_keyframe", bend->first.value},
          {"last_keyframe", bend->last.value},
          {"displacement", bend->displacement}};
}

std::string bend_text(const std::optional<MapBend>& bend, const std::string& name) {
  if (!bend) return {};
  return fmt::format("; {} was bent by {:.1f} deg, mended", name, degrees(bend->rotation_rad));
}

void add_placement(const MergedMap& map, Json& json) {
  json["world_from_map"] = to_json(map.world_from_map->matrix());
  json["scale"] = map.world_from_map->scale();
  json["covariance"] = to_json(map.covariance);
  json["landmarks"] = map.fusion->landmarks;
  json["fused"] = map.fusion->fused;
  json["floaters"] = to_json(map.fusion->floaters);
  json["unexplained_deviation"] = map.fusion->deviation;
  json["bend"] = bend_json(map.bend);
}

Json adjustment_json(const std::optional<MergeAdjustment>& adjustment) {
  if (!adjustment) return nullptr;
  return {{"converged", adjustment->converged},
          {"iterations", adjustment->iterations},
          {"matching_rounds", adjustment->matching_rounds},
          {"observations", adjustment->observations},
          {"initial_rms_px", adjustment->initial_rms_px},
          {"final_rms_px", adjustment->final_rms_px}};
}

std::string adjustment_text(const std::optional<MergeAdjustment>& adjustment) {
  if (!adjustment) return {};
  return fmt::format("adjusted by {} observations: residuals {:.2f} px, {:.2f} before{}\n",
                     with_commas(adjustment->observations), adjustment->final_rms_px,
                     adjustment->initial_rms_px,
                     adjustment->converged
                         ? ""
                         : "; not converged: the solver stopped at its limit of iterations, or "
                           "without a better step. The map is as good as these residuals; another "
                           "bundle adjustment, as COLMAP's bundle_adjuster, may improve it");
}

}  // namespace cairn::cli
