// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/report.hpp"

#include <cctype>
#include <filesystem>

#include <fmt/format.h>

#include "cairn/report/machine.hpp"
#include "cairn/report/map_builder.hpp"
#include "cairn/report/run_builder.hpp"
#include "cairn/report/viewer_page.hpp"
#include "cairn/report/writer.hpp"

#include "bindings/alignment.hpp"

namespace cairn::python {
namespace {

struct Page {
  std::string title;
  std::string html;
};

std::string run_name(const AlignmentRecord& record) {
  const std::string method(to_string(record.method));
  return record.confidence == "none" ? method : method + " " + record.confidence;
}

report::AlignmentRun run_of(const AlignmentResult& result, const report::ShownPoints& source,
                            const report::ShownPoints& target,
                            const std::optional<Similarity3>& truth) {
  const Alignment& alignment = result.alignment();
  RegistrationResult registration = alignment.registration;
  registration.reason = alignment.reason;
  registration.duration_s = alignment.duration_s;
  if (alignment.verdict == Verdict::kRejected) registration.status = RegistrationStatus::kFailed;
  return report::make_run(registration, source, target,
                          {.name = run_name(result.record),
                           .initial = result.initial,
                           .k = result.record.k,
                           .truth = truth,
                           .status = std::string(status_of(alignment))});
}

void add_pair(report::Report& report, const LandmarkMap& source, const LandmarkMap& target,
              const std::vector<SharedAlignment>& results,
              const std::optional<Similarity3>& truth) {
  const PointSetOptions points = results.empty() ? PointSetOptions{} : results.front()->points;
  const auto from = report::ShownPoints::only_aligned(source, points);
  const auto to = report::ShownPoints::only_aligned(target, points);
  std::vector<report::AlignmentRun> runs;
  for (const SharedAlignment& result : results) runs.push_back(run_of(*result, from, to, truth));
  const LengthUnit unit = target.info().length_unit;
  for (const auto& [id, map] : {std::pair{"source", &source}, {"target", &target}}) {
    report.maps.push_back(report::make_map(
        *map, {.id = id, .name = id, .landmarks = landmarks_to_align(*map, points)}));
  }
  report.sections.push_back({.id = "scene",
                             .title = "Alignment",
                             .text = std::nullopt,
                             .content = report::Scene{.source = "source",
                                                      .target = "target",
                                                      .truth = truth,
                                                      .up = report::up_of(target),
                                                      .runs = runs}});
  if (runs.empty()) return;
  report.sections.push_back({.id = "strategies",
                             .title = "Results",
                             .text = std::nullopt,
                             .content = report::run_table(runs, unit)});
  const auto add_chart = [&](const char* id, const char* title, report::LinesChart chart) {
    if (chart.series.empty()) return;
    report.sections.push_back({.id = id,
                               .title = title,
                               .text = std::nullopt,
                               .content = report::Chart(std::move(chart))});
  };
  add_chart("convergence", "Convergence", report::convergence_chart(runs, unit));
  add_chart("translation-error", "Translation error", report::error_chart(runs, unit, true));
  add_chart("rotation-error", "Rotation error", report::error_chart(runs, unit, false));
}

void add_map(report::Report& report, const LandmarkMap& map) {
  report.maps.push_back(
      report::make_map(map, {.id = "map", .name = "map", .landmarks = std::nullopt}));
  report.sections.push_back({.id = "scene",
                             .title = "Map",
                             .text = std::nullopt,
                             .content = report::Scene{.source = std::nullopt,
                                                      .target = "map",
                                                      .truth = std::nullopt,
                                                      .up = report::up_of(map),
                                                      .runs = {}}});
}

std::string subtitle_of(const std::vector<SharedAlignment>& results) {
  std::string text;
  for (const SharedAlignment& result : results) {
    std::string status(status_of(result->alignment()));
    status.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(status.front())));
    if (!text.empty()) text += " ";
    text += (results.size() > 1 ? run_name(result->record) + ": " : "") + status + ": " +
            result->alignment().reason + ".";
  }
  return text;
}

Page make_page(const SharedMap& source, const SharedMap& target,
               const std::vector<SharedAlignment>& results, const py::object& truth,
               const std::optional<std::string>& title) {
  for (const SharedAlignment& result : results) {
    if (result == nullptr) throw py::type_error("results: None; expected an Alignment");
  }
  if (target == nullptr && !results.empty()) {
    throw Error(ErrorKind::kMisuse, "target", "None", "the target map beside results");
  }
  std::optional<Similarity3> true_pose;
  if (!truth.is_none()) true_pose = similarity_of(truth, "truth");
  return unlocked([&] {
    report::Report report;
    report.title = title.value_or(target == nullptr ? "Map" : "Alignment of two maps");
    report.provenance.machine = report::this_machine(0);
    if (!results.empty()) {
      report.subtitle = subtitle_of(results);
      report.provenance.seed = results.front()->seed;
      report.provenance.options_json = results.front()->options_json;
    }
    if (target == nullptr) {
      add_map(report, *source);
    } else {
      add_pair(report, *source, *target, results, true_pose);
    }
    Page page{report.title, {}};
    report::write_report(report, report::viewer_page(),
                         [&](std::string_view piece) { page.html += piece; });
    return page;
  });
}

// A frame in which the page's scripts run apart from the notebook's.
py::str frame_of(const Page& page) {
  const py::object escaped = py::module_::import("html").attr("escape")(page.html);
  return py::str(
      fmt::format("<iframe srcdoc=\"{}\" style=\"width:100%;height:720px;border:0\"></iframe>",
                  escaped.cast<std::string>()));
}

}  // namespace

void bind_report(py::module_& module) {
  py::class_<Page>(module, "Report",
                   "One HTML page that works offline: maps in 3D, matches, charts.")
      .def_readonly("title", &Page::title)
      .def_readonly("html", &Page::html)
      .def(
          "write",
          [](const Page& self, const std::filesystem::path& path) {
            write_file(path, [&](const ByteSink& sink) { sink(self.html); });
          },
          py::arg("path"), "write($self, path)\n--\n\nWrites the page, whole or not at all.")
      .def(
          "show",
          [](const py::object& self) { py::module_::import("cairn._notebook").attr("show")(self); },
          "show($self)\n--\n\nPuts the page into the notebook; outside of one, opens it in a "
          "browser.")
      .def("_repr_html_", &frame_of)
      .def("__repr__", [](const Page& self) {
        return fmt::format("<Report: {}, {} kB>", self.title, self.html.size() / 1000);
      });
  module.def(
      "report", &make_page, py::arg("source"), py::arg("target") = py::none(),
      py::arg("results") = py::tuple(), py::kw_only(), py::arg("truth") = py::none(),
      py::arg("title") = py::none(),
      "report(source, target=None, results=(), *, truth=None, title=None)\n--\n\n"
      "A page that shows one map, or the alignments of two. With trace=True in align() it shows\n"
      "each iteration; with `truth` (4x4, target_from_source) also the errors.");
  module.def(
      "has_viewer", &report::has_viewer,
      "has_viewer()\n--\n\nWhether this build can make reports (CMake option CAIRN_WITH_VIEWER).");
}

}  // namespace cairn::python
