// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/report.hpp"

#include <filesystem>

#include <fmt/format.h>

#ifdef CAIRN_HAS_SEQUENCE
#include "cairn/report/frame_images.hpp"
#endif
#include "cairn/report/sections.hpp"

#include "bindings/alignment.hpp"

namespace cairn::python {
namespace {

struct Page {
  std::string title;
  std::string html;
};

std::vector<report::ShownAlignment> shown(const std::vector<SharedAlignment>& results) {
  std::vector<report::ShownAlignment> all;
  for (const SharedAlignment& result : results) {
    const AlignmentRecord& record = result->record;
    all.push_back(
        {&result->alignment(), report::strategy_name(record.method, record.confidence), record.k});
  }
  return all;
}

using Folder = std::optional<std::filesystem::path>;

std::vector<report::FrameImage> images_of([[maybe_unused]] const LandmarkMap& map,
                                          const Folder& sequence) {
  if (!sequence) return {};
#ifdef CAIRN_HAS_SEQUENCE
  return report::frame_images(map, *sequence);
#else
  throw Error(ErrorKind::kMisuse, "sequence", "cairn was built without reading images",
              "the CMake option CAIRN_WITH_OPENCV");
#endif
}

void add_pair(report::Report& report, const LandmarkMap& source, const LandmarkMap& target,
              const std::vector<SharedAlignment>& results, const std::optional<Similarity3>& truth,
              const Folder& source_sequence, const Folder& target_sequence) {
  report::ShownPair pair;
  pair.source_images = images_of(source, source_sequence);
  pair.target_images = images_of(target, target_sequence);
  pair.source = &source;
  pair.target = &target;
  pair.unit = target.info().length_unit;
  pair.truth = truth;
  if (!results.empty()) {
    pair.points = results.front()->points;
    pair.initial = results.front()->initial;
  }
  pair.alignments = shown(results);
  report::add_pair(report, pair, report::runs_of(pair));
}

Page make_page(const SharedMap& source, const SharedMap& target,
               const std::vector<SharedAlignment>& results, const py::object& truth,
               const std::optional<std::string>& title, const Folder& source_sequence,
               const Folder& target_sequence) {
  for (const SharedAlignment& result : results) {
    if (result == nullptr) throw py::type_error("results: None; expected an Alignment");
  }
  refuse_if(target == nullptr && !results.empty(), "target", "None",
            "the target map beside results");
  refuse_if(target == nullptr && target_sequence, "target", "None",
            "the target map beside target_sequence");
  std::optional<Similarity3> true_pose;
  if (!truth.is_none()) true_pose = similarity_of(truth, "truth");
  return unlocked([&] {
    report::Report report;
    report.title = title.value_or(target == nullptr ? "Map" : "Alignment of two maps");
    report.provenance.machine = report::this_machine(0);
    if (!results.empty()) {
      report.subtitle = report::verdict_sentence(shown(results));
      report.provenance.seed = results.front()->seed;
      report.provenance.options_json = results.front()->options_json;
    }
    if (target == nullptr) {
      report::add_map(report, *source, "map", {}, images_of(*source, source_sequence));
    } else {
      add_pair(report, *source, *target, results, true_pose, source_sequence, target_sequence);
    }
    Page page{report.title, {}};
    report::write_report(report, report::viewer_page(),
                         [&](std::string_view piece) { page.html += piece; });
    return page;
  });
}

// An iframe, which isolates the page's scripts from the notebook's.
py::str frame_of(const Page& page) {
  const py::object escaped = py::module_::import("html").attr("escape")(page.html);
  return py::str(
      fmt::format("<iframe srcdoc=\"{}\" style=\"width:100%;height:720px;border:0\"></iframe>",
                  escaped.cast<std::string>()));
}

}  // namespace

void bind_report(py::module_& module) {
  py::class_<Page>(module, "Report",
                   "A self-contained HTML page that works offline, with maps in 3D, matches and "
                   "charts.")
      .def_readonly("title", &Page::title)
      .def_readonly("html", &Page::html)
      .def(
          "write",
          [](const Page& self, const std::filesystem::path& path) {
            write_file(path, [&](const ByteSink& sink) { sink(self.html); });
          },
          py::arg("path"), "write($self, path)\n--\n\nWrites the page, completely or not at all.")
      .def(
          "show",
          [](const py::object& self) { py::module_::import("cairn._notebook").attr("show")(self); },
          "show($self)\n--\n\nShows the page in a notebook, or opens it in a browser if there is "
          "none.")
      .def("_repr_html_", &frame_of)
      .def("__repr__", [](const Page& self) {
        return fmt::format("<Report: {}, {} kB>", self.title, self.html.size() / 1000);
      });
  module.def(
      "report", &make_page, py::arg("source"), py::arg("target") = py::none(),
      py::arg("results") = py::tuple(), py::kw_only(), py::arg("truth") = py::none(),
      py::arg("title") = py::none(), py::arg("source_sequence") = py::none(),
      py::arg("target_sequence") = py::none(),
      "report(source, target=None, results=(), *, truth=None, title=None, source_sequence=None, "
      "target_sequence=None)\n--\n\n"
      "Makes a page that shows one map, or the alignments of two. Shows each iteration of results\n"
      "from align(trace=True), and pose errors with `truth` (4x4, target_from_source). With the\n"
      "folder of the RGB-D sequence that a map was built from, shows what its keyframes saw.");
  module.def(
      "has_viewer", &report::has_viewer,
      "has_viewer()\n--\n\nWhether this build can make reports (CMake option CAIRN_WITH_VIEWER).");
}

}  // namespace cairn::python
