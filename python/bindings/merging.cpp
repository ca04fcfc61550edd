// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/merging.hpp"

#include <fmt/format.h>

#include "cairn/geometry/angles.hpp"

#include "bindings/properties.hpp"
#include "bindings/text.hpp"

namespace cairn::python {
namespace {

struct MergedPart {
  std::string name;
  MergedMap part;
};

Keywords<MergeOptions> merge_keywords() {
  Keywords<MergeOptions> keywords("merge");
  keywords.add_table(LinkOptions::table, [](auto& o) -> auto& { return o.links; });
  keywords.add_table(FusionOptions::table, [](auto& o) -> auto& { return o; }).add_seed();
  return keywords;
}

Merged merge_maps(const std::vector<SharedMap>& maps, const py::object& given_names,
                  const std::optional<std::vector<SharedMap>>& models, const py::kwargs& given) {
  CallOptions call;
  const MergeOptions options = merge_keywords().read(given, &call);
  Merged merged;
  std::vector<MergeInput> inputs;
  std::optional<std::vector<std::string>> names;
  if (!given_names.is_none()) names = encoded_each(given_names, "names");
  if (names && names->size() != maps.size()) {
    throw Error(ErrorKind::kMisuse, "names", fmt::format("{} names", names->size()),
                fmt::format("{}, one a map", maps.size()));
  }
  if (models && models->size() != maps.size()) {
    throw Error(ErrorKind::kMisuse, "models", fmt::format("{} models", models->size()),
                fmt::format("{}, one a map", maps.size()));
  }
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (maps[i] == nullptr)
      throw py::type_error(fmt::format("maps[{}]: None; expected a LandmarkMap", i));
    merged.names.push_back(names ? (*names)[i] : fmt::format("map {}", i));
    inputs.push_back({.name = merged.names.back(),
                      .map = maps[i].get(),
                      .model = models ? (*models)[i].get() : nullptr});
  }
  std::vector<std::string> remarks;
  run("merging", call, [&](Execution execution) {
    execution.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
    merged.result = merge(inputs, options, execution);
  });
  warn(remarks);
  if (merged.result.map) {
    merged.map = std::make_shared<LandmarkMap>(std::move(*merged.result.map));
    merged.result.map.reset();
  }
  return merged;
}

// Of a map that is not placed, all counts are 0.
MapFusion fusion_of(const MergedPart& map) {
  return map.part.fusion.value_or(MapFusion());
}

std::vector<std::uint32_t> folded_indices(const MapFold& fold) {
  std::vector<std::uint32_t> indices;
  for (const FrameIndex frame : fold.frames) indices.push_back(frame.value);
  return indices;
}

std::vector<MergedPart> merged_parts(const Merged& self) {
  std::vector<MergedPart> parts;
  for (std::size_t i = 0; i < self.names.size(); ++i) {
    parts.push_back({self.names[i], self.result.maps[i]});
  }
  return parts;
}

std::vector<NamedLink> named_links(const Merged& self) {
  std::vector<NamedLink> links;
  for (std::size_t i = 0; i < self.result.links.size(); ++i) {
    const Link& link = self.result.links[i];
    links.push_back(
        {self.names[link.source.value], self.names[link.target.value], link, self.result.used[i]});
  }
  return links;
}

void bind_parts(py::module_& module) {
  Exposed<MergedPart>(module, "MergedMap", "Result of a merge for one map.")
      .get("name", "", &MergedPart::name)
      .get("placed", "", &MergedPart::part, &MergedMap::placed)
      .get("reason", "Why the map is not placed, in one sentence; empty if it is placed.",
           &MergedPart::part, &MergedMap::reason)
      .get("world_from_map", "4x4, including the scale; None if the map is not placed.",
           &MergedPart::part, &MergedMap::world_from_map)
      .get("covariance", "(7, 7), of the left perturbation (dt, dphi, dlog s) in the world frame.",
           &MergedPart::part, &MergedMap::covariance)
      .get("landmarks", "", &fusion_of, &MapFusion::landmarks)
      .get("fused", "Number of landmarks that were fused with a landmark of an earlier map.",
           &fusion_of, &MapFusion::fused)
      .get("floaters",
           "Number of splats that the images of another map's model look through; None if no other "
           "map has a model.",
           &fusion_of, &MapFusion::floaters)
      .get("bend_deg",
           "How far the map was bent, if it was straightened before the fusion; else None.",
           &MergedPart::part, &MergedMap::bend, &MapBend::rotation_rad, &degrees)
      .get("folded_frames",
           "Indices of the frames that were left out because another map shows them elsewhere; "
           "None if there are none.",
           &MergedPart::part, &MergedMap::fold, &folded_indices)
      .def("__repr__", [](const MergedPart& self) {
        return decoded(fmt::format("<MergedMap {}: {}>", self.name,
                                   self.part.placed ? "placed" : self.part.reason));
      });
  Exposed<NamedLink>(module, "Link", "Link between two maps: from align(), odometry or a person.")
      .get("source", "", &NamedLink::source)
      .get("target", "", &NamedLink::target)
      .get("kind", "'placement' (from align()), 'odometry' or 'manual'.", &NamedLink::link,
           &Link::kind)
      .get("verdict",
           "'aligned', 'ambiguous' or 'rejected'; None if the link is stated, not judged.",
           &NamedLink::link, &Link::verdict)
      .get("probability", "Probability that the transform is right; None if it was not judged.",
           &NamedLink::link, &Link::probability)
      .get("reason", "", &NamedLink::link, &Link::reason)
      .get("target_from_source", "4x4; None unless the verdict is 'aligned' or the link is stated.",
           &NamedLink::link, &Link::target_from_source)
      .get("covariance",
           "(6, 6), of the left perturbation (dt, dphi) in the target frame; None if unknown.",
           &NamedLink::link, &Link::covariance)
      .get("covariance_with_scale",
           "(7, 7), of (dt, dphi, dlog s); None unless the link measures the scale.",
           &NamedLink::link, &Link::covariance_with_scale)
      .def_readonly("used", &NamedLink::used,
                    "Whether the link is aligned and agrees with the maps' poses.")
      .def("__repr__", [](const NamedLink& self) {
        return decoded(fmt::format("<Link {} to {}: {}{}>", self.source, self.target,
                                   self.link.status(), self.used ? "" : ", not used"));
      });
}

}  // namespace

void bind_merging(py::module_& module) {
  bind_parts(module);
  Exposed<Merged>(module, "MergeResult", "Result of merging maps.")
      .def_readonly(
          "map", &Merged::map,
          "The merged map, in the frame of the first placed map; None if no two maps were "
          "placed.")
      .get("maps", "Results of the maps: a list of MergedMap.", &merged_parts)
      .get("links", "Links of all pairs that were tried or stated, aligned or not.", &named_links)
      .get("adjusted",
           "Whether all keyframes and landmarks were adjusted, which `adjust` requests.",
           [](const Merged& self) { return self.result.adjustment.has_value(); })
      .get("placed", "Number of placed maps.", &Merged::result, &MergeResult::placed)
      .def("__repr__", [](const Merged& self) {
        return fmt::format("<MergeResult: {} of {} maps placed, {} landmarks>",
                           self.result.placed(), self.names.size(),
                           self.map ? self.map->landmark_count() : 0);
      });
  module.def(
      "merge", &merge_maps, py::arg("maps"), py::arg("names") = py::none(),
      py::arg("models") = py::none(),
      kept(merge_keywords().signature("maps, names=None, models=None") +
           "Merges maps of one place: computes their poses, rejects links that disagree, and "
           "fuses landmarks\n"
           "that are the same. A map without a link to the largest group is left out, with a "
           "reason.\n\n"
           "models             maps in the same frames that are aligned in place of the maps, such "
           "as the SfM\n"
           "                   models that splats were trained on; None for a map itself\n"
           "candidates         number of other maps to try each map with, the likeliest; 0: all.\n"
           "                   None: all of up to 32 maps, otherwise 10\n"
           "straighten         straighten maps that others show to be bent\n"
           "thin_splats        leave out duplicates of Gaussian splats of lower opacity\n"
           "drop_floaters      leave out Gaussian splats that the images of another map's model "
           "look\n"
           "                   through\n"
           "adjust             optimise all keyframes and landmarks (bundle adjustment); warns if "
           "the\n"
           "                   maps lack the data\n"
           "refine_intrinsics  adjust the cameras too\n"
           "matching_rounds    number of rounds in which landmarks are matched again after an\n"
           "                   adjustment"));
}

}  // namespace cairn::python
