// SPDX-License-Identifier: BSD-3-Clause

#include <fmt/format.h>

#include "cairn/experiments/paper.hpp"

#include "bindings/properties.hpp"
#include "bindings/support.hpp"

namespace cairn::python {
namespace {

Keywords<PaperOptions> paper_keywords() {
  return Keywords<PaperOptions>("paper_experiment")
      .add("success_score", [](auto& o) -> auto& { return o.success_score; })
      .add("rotation_tolerance_deg", [](auto& o) -> auto& { return o.tolerance.rotation_deg; })
      .add("translation_tolerance_m", [](auto& o) -> auto& { return o.tolerance.translation_m; })
      .add("min_observations", [](auto& o) -> auto& { return o.points.min_observations; })
      .add("max_iterations", [](auto& o) -> auto& { return o.align.max_iterations; });
}

struct PaperRun {
  PaperResults results;
  PoseTolerance tolerance;
};

template <class Get>
py::array column(const PaperRun& self, const Get& get) {
  std::vector<double> values;
  for (const TrialResult& run : self.results.runs) values.push_back(get(run));
  return copied(values);
}

template <class Get>
py::list texts(const PaperRun& self, const Get& get) {
  py::list values;
  for (const TrialResult& run : self.results.runs) values.append(get(run));
  return values;
}

// Columns with one entry per run, for pandas.DataFrame().
py::dict runs_of(const PaperRun& self) {
  const double nan = std::nan("");
  py::dict runs;
  runs["experiment"] = texts(self, [](const TrialResult& run) { return run.trial.experiment; });
  runs["number"] =
      column(self, [](const TrialResult& run) { return static_cast<double>(run.trial.number); });
  runs["strategy"] = texts(self, [](const TrialResult& run) { return run.trial.strategy; });
  runs["k"] = column(self, [](const TrialResult& run) { return static_cast<double>(run.trial.k); });
  runs["initial"] = texts(self, [](const TrialResult& run) { return describe(run.trial.initial); });
  runs["status"] =
      texts(self, [](const TrialResult& run) { return std::string(to_string(run.status)); });
  runs["iterations"] =
      column(self, [](const TrialResult& run) { return static_cast<double>(run.iterations); });
  runs["initial_score"] =
      column(self, [&](const TrialResult& run) { return run.initial_score.value_or(nan); });
  runs["score"] = column(self, [&](const TrialResult& run) { return run.score.value_or(nan); });
  runs["success"] =
      texts(self, [&](const TrialResult& run) { return self.results.score_success(run); });
  runs["rotation_error_rad"] = column(
      self, [&](const TrialResult& run) { return run.error ? run.error->rotation_rad : nan; });
  runs["translation_error"] = column(
      self, [&](const TrialResult& run) { return run.error ? run.error->translation : nan; });
  return runs;
}

}  // namespace

void bind_experiments(py::module_& module) {
  Exposed<PaperRun>(module, "PaperResults",
                    "Results of the paper's 45 configurations with 4 strategies on a pair of maps.")
      .get(
          "runs",
          "Dict of columns with one entry per run, in the published order, for pandas.DataFrame().",
          &runs_of)
      .get("success_score", "A run with a lower score, in square metres, counts as a success.",
           &PaperRun::results, &PaperResults::success_score)
      .def_property_readonly(
          "tables",
          [](const PaperRun& self) {
            py::dict tables;
            for (const ResultTable& table : paper_tables(self.results, self.tolerance)) {
              tables[py::str(table.name)] = table.markdown();
            }
            return tables;
          },
          "The paper's tables with the published numbers beside these: Markdown by name.")
      .def("__repr__", [](const PaperRun& self) {
        std::size_t successes = 0;
        for (const TrialResult& run : self.results.runs)
          successes += self.results.score_success(run) ? 1 : 0;
        return fmt::format("<PaperResults: {} runs, {} below {:.4g} m²>", self.results.runs.size(),
                           successes, self.results.success_score);
      });
  module.def(
      "paper_experiment",
      [](const SharedMap& source, const SharedMap& target, const py::object& truth,
         const py::kwargs& given) {
        CallOptions call;
        const PaperOptions options = paper_keywords().read(given, &call);
        MapPair pair{"pair", *source, *target, std::nullopt};
        if (!truth.is_none()) pair.truth = rigid_of(truth, "truth");
        PaperRun result;
        result.tolerance = options.tolerance;
        run("paper's experiment", call, [&](const Execution& execution) {
          result.results = run_paper_experiments(pair, options, execution);
        });
        return result;
      },
      py::arg("source"), py::arg("target"), py::arg("truth") = py::none(),
      kept(paper_keywords().signature("source, target, truth=None") +
           "Runs the paper's experiments on two maps. With `truth` (4x4, target_from_source), the "
           "runs\n"
           "start from it, displaced, and have pose errors; without, they start from the maps as "
           "they\n"
           "lie."));
}

}  // namespace cairn::python
