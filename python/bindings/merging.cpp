// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/merging.hpp"

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"

#include "bindings/text.hpp"

namespace cairn::python {
namespace {

struct MergedPart {
  std::string name;
  MergedMap part;
};

const Keywords<MergeOptions>& merge_keywords() {
  static const auto table = [] {
    Keywords<MergeOptions> keywords("merge");
    keywords.add_table(LinkOptions::table, [](auto& o) -> auto& { return o.links; }, {"seed"});
    add_merge_placed_to(keywords, [](auto& o) -> auto& { return o.placed; });
    keywords.add("seed", [](auto& o) -> auto& { return o.seed; });
    return keywords;
  }();
  return table;
}

Merged merge_maps(const std::vector<SharedMap>& maps, const py::object& given_names,
                  const py::kwargs& given) {
  CallOptions call;
  MergeOptions options = merge_keywords().read(given, &call);
  Merged merged;
  std::vector<MergeInput> inputs;
  std::optional<std::vector<std::string>> names;
  if (!given_names.is_none()) names = encoded_each(given_names, "names");
  if (names && names->size() != maps.size()) {
    throw Error(ErrorKind::kMisuse, "names", fmt::format("{} names", names->size()),
                fmt::format("{}, one a map", maps.size()));
  }
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (maps[i] == nullptr)
      throw py::type_error(fmt::format("maps[{}]: None; expected a LandmarkMap", i));
    merged.names.push_back(names ? (*names)[i] : fmt::format("map {}", i));
    inputs.push_back({merged.names.back(), maps[i].get()});
  }
  std::vector<std::string> remarks;
  options.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
  run("merging", call, [&](const Execution& execution) {
    options.execution = execution;
    merged.result = merge(inputs, options);
  });
  warn(remarks);
  if (merged.result.map) {
    merged.map = std::make_shared<LandmarkMap>(std::move(*merged.result.map));
    merged.result.map.reset();
  }
  return merged;
}

}  // namespace

void bind_merging(py::module_& module) {
  py::class_<MergedPart>(module, "MergedMap", "Result of a merge for one map.")
      .def_property_readonly("name", [](const MergedPart& self) { return decoded(self.name); })
      .def_property_readonly("placed", [](const MergedPart& self) { return self.part.placed; })
      .def_property_readonly(
          "reason", [](const MergedPart& self) { return decoded(self.part.reason); },
          "Why the map is not placed, in one sentence; empty if it is placed.")
      .def_property_readonly(
          "world_from_map",
          [](const MergedPart& self) { return pose_array(self.part.world_from_map); },
          "4x4, including the scale; None if the map is not placed.")
      .def_property_readonly(
          "covariance", [](const MergedPart& self) { return copied_matrix(self.part.covariance); },
          "(7, 7), of the left perturbation (dt, dphi, dlog s) in the world frame.")
      .def_property_readonly("landmarks",
                             [](const MergedPart& self) {
                               return self.part.fusion ? self.part.fusion->landmarks
                                                       : std::size_t{0};
                             })
      .def_property_readonly(
          "fused",
          [](const MergedPart& self) {
            return self.part.fusion ? self.part.fusion->fused : std::size_t{0};
          },
          "Number of landmarks that were fused with a landmark of an earlier map.")
      .def_property_readonly(
          "bend_deg",
          [](const MergedPart& self) -> std::optional<double> {
            if (!self.part.bend) return std::nullopt;
            return degrees(self.part.bend->rotation_rad);
          },
          "How far the map was bent, if it was straightened before the fusion; else None.")
      .def("__repr__", [](const MergedPart& self) {
        return decoded(fmt::format("<MergedMap {}: {}>", self.name,
                                   self.part.placed ? "placed" : self.part.reason));
      });
  py::class_<NamedLink>(module, "Link",
                        "Link between two maps: from align(), odometry or a person.")
      .def_property_readonly("source", [](const NamedLink& self) { return decoded(self.source); })
      .def_property_readonly("target", [](const NamedLink& self) { return decoded(self.target); })
      .def_property_readonly(
          "kind", [](const NamedLink& self) { return std::string(to_string(self.link.kind)); },
          "'placement' (from align()), 'odometry' or 'manual'.")
      .def_property_readonly(
          "verdict",
          [](const NamedLink& self) {
            return self.link.verdict ? std::optional(std::string(to_string(*self.link.verdict)))
                                     : std::nullopt;
          },
          "'aligned', 'ambiguous' or 'rejected'; None if the link is stated, not judged.")
      .def_property_readonly(
          "probability", [](const NamedLink& self) { return self.link.probability; },
          "Probability that the transform is right; None if it was not judged.")
      .def_property_readonly("reason",
                             [](const NamedLink& self) { return decoded(self.link.reason); })
      .def_property_readonly(
          "target_from_source",
          [](const NamedLink& self) { return pose_array(self.link.target_from_source); },
          "4x4; None unless the verdict is 'aligned' or the link is stated.")
      .def_property_readonly(
          "covariance", [](const NamedLink& self) { return matrix_or_none(self.link.covariance); },
          "(6, 6), of the left perturbation (dt, dphi) in the target frame; None if unknown.")
      .def_property_readonly(
          "covariance_with_scale",
          [](const NamedLink& self) { return matrix_or_none(self.link.covariance_with_scale); },
          "(7, 7), of (dt, dphi, dlog s); None unless the link measures the scale.")
      .def_readonly("used", &NamedLink::used,
                    "Whether the link is aligned and agrees with the maps' poses.")
      .def("__repr__", [](const NamedLink& self) {
        return decoded(fmt::format("<Link {} to {}: {}{}>", self.source, self.target,
                                   self.link.status(), self.used ? "" : ", not used"));
      });
  py::class_<Merged>(module, "MergeResult", "Result of merging maps.")
      .def_readonly(
          "map", &Merged::map,
          "The merged map, in the frame of the first placed map; None if no two maps were "
          "placed.")
      .def_property_readonly(
          "maps",
          [](const Merged& self) {
            std::vector<MergedPart> parts;
            for (std::size_t i = 0; i < self.names.size(); ++i) {
              parts.push_back({self.names[i], self.result.maps[i]});
            }
            return parts;
          },
          "Results of the maps: a list of MergedMap.")
      .def_property_readonly(
          "links",
          [](const Merged& self) {
            std::vector<NamedLink> links;
            for (std::size_t i = 0; i < self.result.links.size(); ++i) {
              const Link& link = self.result.links[i];
              links.push_back({self.names[link.source.value], self.names[link.target.value], link,
                               self.result.used[i]});
            }
            return links;
          },
          "Links of all pairs that were tried or stated, aligned or not.")
      .def_property_readonly(
          "adjusted", [](const Merged& self) { return self.result.adjustment.has_value(); },
          "Whether all keyframes and landmarks were adjusted, which `adjust` requests.")
      .def_property_readonly(
          "placed", [](const Merged& self) { return self.result.placed(); },
          "Number of placed maps.")
      .def("__repr__", [](const Merged& self) {
        return fmt::format("<MergeResult: {} of {} maps placed, {} landmarks>",
                           self.result.placed(), self.names.size(),
                           self.map ? self.map->landmark_count() : 0);
      });
  module.def(
      "merge", &merge_maps, py::arg("maps"), py::arg("names") = py::none(),
      kept(merge_keywords().signature("maps, names=None") +
           "Merges maps of one place: computes their poses, rejects links that disagree, and "
           "fuses landmarks\n"
           "that are the same. A map without a link to the largest group is left out, with a "
           "reason.\n\n"
           "straighten         straighten maps that others show to be bent\n"
           "adjust             optimise all keyframes and landmarks (bundle adjustment); warns if "
           "the\n"
           "                   maps lack the data\n"
           "refine_intrinsics  adjust the cameras too\n"
           "matching_rounds    number of rounds in which landmarks are matched again after an\n"
           "                   adjustment"));
}

}  // namespace cairn::python
