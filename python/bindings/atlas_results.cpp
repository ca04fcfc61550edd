// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/atlas_results.hpp"

#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/atlas/store/open_store.hpp"
#include "cairn/atlas/store/store.hpp"

#include "bindings/properties.hpp"

namespace cairn::python {
namespace {

py::object text_or_none(const std::string& text) {
  if (text.empty()) return py::none();
  return decoded(text);
}

py::object utc_time(std::int64_t time_ms) {
  const py::module_ datetime = py::module_::import("datetime");
  return datetime.attr("datetime")
      .attr("fromtimestamp")(1e-3 * static_cast<double>(time_ms),
                             datetime.attr("timezone").attr("utc"));
}

std::string held_map_text(const HeldMap& self) {
  return fmt::format("<AtlasMap {}: {} landmarks, {} frames, {}>", self.node.name,
                     self.node.landmarks, self.node.frames,
                     self.pose ? "in the frame of " + self.frame : "not placed");
}

void bind_contents(py::module_& module) {
  Exposed<HeldMap>(module, "AtlasMap",
                   "Description of a map in an atlas at the time of the call. Atlas.map() gives "
                   "the map itself.")
      .get("name", "", &HeldMap::node, &AtlasNode::name)
      .get("session", "Name shared by the maps of one run; None if unknown.", &HeldMap::node,
           &AtlasNode::session, &text_or_none)
      .get("length_unit", "'metres' or 'free'.", &HeldMap::node, &AtlasNode::length_unit)
      .get("landmarks", "", &HeldMap::node, &AtlasNode::landmarks)
      .get("frames", "", &HeldMap::node, &AtlasNode::frames)
      .get("observations", "", &HeldMap::node, &AtlasNode::observations)
      .get("frame",
           "Name of the map whose frame frame_from_map refers to, the same for all maps of a "
           "group;\nNone without a pose.",
           [](const HeldMap& self) { return text_or_none(self.pose ? self.frame : ""); })
      .get("frame_from_map", "4x4, including the scale; None until optimize() has placed the map.",
           &HeldMap::pose, &AtlasPose::frame_from_node)
      .get("covariance",
           "(7, 7), of the left perturbation (dt, dphi, dlog s) in `frame`; None without a pose.",
           &HeldMap::pose, &AtlasPose::covariance)
      .def("__repr__", [](const HeldMap& self) { return decoded(held_map_text(self)); });
  Exposed<AtlasCommit>(module, "AtlasCommit", "A change of an atlas.")
      .get("id", "", &AtlasCommit::id)
      .get("time", "A datetime, in UTC.", &AtlasCommit::time_ms, &utc_time)
      .get("author", "", &AtlasCommit::author, &text_or_none)
      .get("host", "", &AtlasCommit::host, &text_or_none)
      .get("verb", "'add', 'link' and so on.", &AtlasCommit::verb)
      .get("text", "Description of the change, for people.", &AtlasCommit::text)
      .get("run", "Id of the first commit of the same call.", &AtlasCommit::run)
      .get("undoes",
           "Id of the last commit of the call that this commit undid; None if it undid none.",
           &AtlasCommit::undoes)
      .def("__repr__", [](const AtlasCommit& self) {
        return decoded(
            fmt::format("<AtlasCommit {}: {}: {}>", self.id.value, self.verb, self.text));
      });
  Exposed<Route>(module, "AtlasRoute", "A chain of links from one map of an atlas to another.")
      .get("maps", "Names of the maps, from the target to the source.", &Route::maps)
      .def_readonly("links", &Route::links, "Links between consecutive maps.")
      .get("target_from_source", "4x4, along the links.", &Route::route,
           &AtlasRoute::target_from_source)
      .get(
          "covariance",
          "(7, 7), of the left perturbation (dt, dphi, dlog s) in the target frame; None if a link "
          "has none.",
          &Route::route, &AtlasRoute::covariance)
      .get("optimised",
           "4x4: target_from_source from the optimised poses, which use all links; None unless "
           "both\n"
           "maps are in one frame.",
           &Route::route, &AtlasRoute::optimised)
      .def("__repr__", [](const Route& self) {
        return decoded(fmt::format("<AtlasRoute: {}>", fmt::join(self.maps, " <- ")));
      });
}

py::tuple box_of(const ChangedPlace& place) {
  return py::make_tuple(copied_matrix(place.low), copied_matrix(place.high));
}

std::string world_text(const WorldDifference& self) {
  std::map<ChangeKind, std::size_t> counts;
  for (const Change& change : self.result.changes) ++counts[change.kind];
  return fmt::format("<WorldDifference: {} moved, {} vanished, {} appeared>",
                     counts[ChangeKind::kMoved], counts[ChangeKind::kVanished],
                     counts[ChangeKind::kAppeared]);
}

void bind_world(py::module_& module) {
  Exposed<ChangedPlace>(module, "ChangedPlace", "Position of a changed object in one map.")
      .get("landmarks", "Number of the object's landmarks there.", &ChangedPlace::landmarks, kSize)
      .get("position", "", &ChangedPlace::centre)
      .get("box", "Lowest and highest corner of a box around nearly all its landmarks.", &box_of)
      .def("__repr__", [](const ChangedPlace& self) {
        return fmt::format("<ChangedPlace: {} landmarks at ({:.2f}, {:.2f}, {:.2f})>",
                           self.landmarks.size(), self.centre.x(), self.centre.y(),
                           self.centre.z());
      });
  Exposed<Change>(module, "Change", "An object that appeared, vanished or moved.")
      .get("kind", "'moved', 'vanished' or 'appeared'.", &Change::kind)
      .def_readonly("before", &Change::before, "None if the object appeared.")
      .def_readonly("after", &Change::after, "None if the object vanished.")
      .get("after_from_before", "4x4: motion of a moved object; None for other changes.",
           &Change::after_from_before)
      .def_readonly("confidence", &Change::confidence, "Probability that it is a change, 0 to 1.")
      .def("__repr__", [](const Change& self) {
        return fmt::format("<Change: {}, confidence {:.3f}>", to_string(self.kind),
                           self.confidence);
      });
  Exposed<WorldDifference>(module, "WorldDifference",
                           "Differences between two sessions or maps of an atlas.")
      .get("changes", "Moved, vanished, appeared; each by descending confidence.",
           &WorldDifference::result, &ChangeResult::changes)
      .get(
          "comparable",
          "Number of landmarks of the first and of the second that the other should also have; (0, "
          "0) if\nno keyframe of either observed the other's landmarks.",
          [](const WorldDifference& self) {
            return std::pair(self.result.comparable_first, self.result.comparable_second);
          })
      .get("found_again", "Share of the comparable landmarks that the other has.",
           &WorldDifference::result, &ChangeResult::repeated)
      .get("frame", "Name of the map whose frame the positions are in.", &WorldDifference::frame)
      .def("__repr__", &world_text);
}

void bind_results(py::module_& module) {
  Exposed<AtlasCompaction>(module, "AtlasCompaction", "Numbers of what Atlas.compact() dropped.")
      .def_readonly("commits", &AtlasCompaction::commits, "Number of commits joined into one.")
      .def_readonly("maps", &AtlasCompaction::maps)
      .def_readonly("map_bytes", &AtlasCompaction::map_bytes)
      .def_readonly("links", &AtlasCompaction::links)
      .def_readonly("poses", &AtlasCompaction::poses)
      .def("__repr__", [](const AtlasCompaction& self) {
        return fmt::format("<AtlasCompaction: {} commits, {} maps, {} links, {} poses>",
                           self.commits, self.maps, self.links, self.poses);
      });
  Exposed<AtlasSalvage>(module, "AtlasSalvage", "Numbers of what Atlas.salvage() copied.")
      .def_readonly("maps", &AtlasSalvage::maps)
      .def_readonly("links", &AtlasSalvage::links)
      .def_readonly("poses", &AtlasSalvage::poses)
      .get("lost", "One sentence for each loss.", &AtlasSalvage::lost)
      .def("__repr__", [](const AtlasSalvage& self) {
        return fmt::format("<AtlasSalvage: {} maps, {} links, {} poses; {} lost>", self.maps,
                           self.links, self.poses, self.lost.size());
      });
  Exposed<AtlasLinkResult>(module, "AtlasLinkResult", "Numbers of pairs of Atlas.link().")
      .def_readonly("pairs", &AtlasLinkResult::pairs, "Pairs of maps in the atlas.")
      .def_readonly("tried", &AtlasLinkResult::tried, "Pairs tried by this call.")
      .def_readonly("tried_before", &AtlasLinkResult::tried_before,
                    "Pairs tried before, or linked by a person.")
      .def_readonly("not_likely", &AtlasLinkResult::not_likely, "Pairs excluded by recognition.")
      .def_readonly("aligned", &AtlasLinkResult::aligned, "Pairs aligned by this call.")
      .def("__repr__", [](const AtlasLinkResult& self) {
        return fmt::format(
            "<AtlasLinkResult: {} of {} pairs tried, {} aligned; {} tried before, {} not likely>",
            self.tried, self.pairs, self.aligned, self.tried_before, self.not_likely);
      });
  Exposed<AtlasOptimised>(module, "AtlasOptimised", "Result of Atlas.optimize().")
      .def_readonly("placed", &AtlasOptimised::placed, "Number of maps with a pose.")
      .def_readonly("contradicted", &AtlasOptimised::contradicted,
                    "Number of aligned links that disagree with the poses and are not used.")
      .def_readonly("changed", &AtlasOptimised::changed, "Whether the call changed the atlas.")
      .get("commit", "", &AtlasOptimised::commit)
      .def("__repr__", [](const AtlasOptimised& self) {
        return fmt::format("<AtlasOptimised: {} maps placed, {} links contradicted>", self.placed,
                           self.contradicted);
      });
}

}  // namespace

void bind_atlas_results(py::module_& module) {
  bind_contents(module);
  bind_results(module);
  bind_world(module);
}

}  // namespace cairn::python
