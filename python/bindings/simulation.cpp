// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "cairn/simulation/environment.hpp"
#include "cairn/simulation/path.hpp"
#include "cairn/simulation/simulator.hpp"

#include "bindings/properties.hpp"
#include "bindings/support.hpp"

namespace cairn::python {
namespace {

using SharedRgbdFrame = std::shared_ptr<RgbdFrame>;

struct Simulation {
  Camera camera;
  RgbdSimulator simulator;
};
using SharedSimulation = std::shared_ptr<Simulation>;

struct SimulateKeywords {
  EnvironmentOptions environment;
  PathOptions path;
  SimulatorOptions simulator;
  std::uint64_t seed = EnvironmentOptions().seed;
};

Keywords<SimulateKeywords> simulate_keywords() {
  Keywords<SimulateKeywords> keywords("simulate");
  keywords.add("seed", [](auto& o) -> auto& { return o.seed; })
      .add("layout", [](auto& o) -> auto& { return o.environment.layout; })
      .add_table(EnvironmentOptions::table, [](auto& o) -> auto& { return o.environment; })
      .add("path", py::str("sweep"),
           [](auto& options, py::handle value) {
             std::string text;
             from_python(value, "path", text);
             options.path.kind = path_kind(text);
           })
      .add_table(PathOptions::table, [](auto& o) -> auto& { return o.path; }, {"clearance_m"})
      .add("camera", py::none(),
           [](auto& options, py::handle value) {
             if (value.is_none()) return;
             if (!py::isinstance<Camera>(value)) throw py::type_error("camera: expected a Camera");
             options.simulator.camera = value.cast<const Camera&>();
           })
      .add("shutter_s", [](auto& o) -> auto& { return o.simulator.shutter_s; })
      .add("stereo_baseline_m", [](auto& o) -> auto& { return o.simulator.stereo_baseline_m; })
      .add_table(SensorOptions::table, [](auto& o) -> auto& { return o.simulator.sensor; },
                 {"depth_step_m", "min_depth_m", "baseline_m", "max_incidence_rad", "edge_holes",
                  "dropout"});
  return keywords;
}

SharedSimulation simulate(const std::string& environment, const py::kwargs& given) {
  CallOptions call;
  SimulateKeywords options = simulate_keywords().read(given, &call);
  options.environment.kind = environment_kind(environment);
  options.environment.seed = options.seed;
  const SessionSeeds seeds = session_seeds(options.seed, options.environment.session);
  options.path.seed = seeds.path;
  options.simulator.seed = seeds.noise;
  options.environment.validate();
  options.path.validate();
  options.simulator.validate();
  SharedSimulation simulation;
  run("simulating", call, [&](const Execution& execution) {
    Environment place = make_environment(options.environment, execution.executor);
    Trajectory trajectory = make_path(place, options.path);
    simulation = std::make_shared<Simulation>(Simulation{
        options.simulator.camera, RgbdSimulator(std::move(place.scene), std::move(trajectory),
                                                options.simulator, execution.executor)});
  });
  return simulation;
}

SharedRgbdFrame rendered_frame(const SharedSimulation& self, std::int64_t index) {
  const auto count = static_cast<std::int64_t>(self->simulator.frame_count());
  if (index < -count || index >= count) {
    throw py::index_error(fmt::format("frame {} of {}", index, count));
  }
  const auto number = static_cast<std::size_t>(index < 0 ? index + count : index);
  SharedRgbdFrame frame;
  run("rendering", {}, [&](const Execution& execution) {
    frame = std::make_shared<RgbdFrame>(self->simulator.frame(number, execution.executor));
  });
  return frame;
}

// None without values.
template <class Scalar>
py::object image(const std::vector<Scalar>& values, const SharedRgbdFrame& frame) {
  if (values.empty()) return py::none();
  return view(values.data(), {frame->height, frame->width}, py::cast(frame));
}

py::object rgb_of(const std::vector<std::uint8_t>& bgr, const SharedRgbdFrame& frame) {
  if (bgr.empty()) return py::none();
  return view(bgr.data(), {frame->height, frame->width, 3}, py::cast(frame))
      .attr("__getitem__")(
          py::make_tuple(py::ellipsis(), py::slice(py::none(), py::none(), py::int_(-1))));
}

}  // namespace

void bind_simulation(py::module_& module) {
  Exposed<RgbdFrame, SharedRgbdFrame>(module, "SimulatedFrame",
                                      "One frame of a simulated sequence.")
      .def_readonly("timestamp_s", &RgbdFrame::timestamp_s)
      .get("world_from_camera", "4x4, exact.", &RgbdFrame::world_from_camera)
      .def_property_readonly(
          "bgr",
          [](const SharedRgbdFrame& self) {
            return view(self->bgr.data(), {self->height, self->width, 3}, py::cast(self));
          },
          "(h, w, 3) uint8, blue, green, red as in OpenCV; a view.")
      .def_property_readonly(
          "rgb", [](const SharedRgbdFrame& self) { return rgb_of(self->bgr, self); },
          "(h, w, 3) uint8; a view.")
      .def_property_readonly(
          "right_rgb", [](const SharedRgbdFrame& self) { return rgb_of(self->right_bgr, self); },
          "(h, w, 3) uint8, of the right camera of a stereo pair; a view. None without.")
      .def_property_readonly(
          "depth_m", [](const SharedRgbdFrame& self) { return image(self->depth_m, self); },
          "(h, w) float32, as measured; 0 where there is no reading; a view. None of a stereo "
          "pair.")
      .def_property_readonly(
          "exact_depth_m",
          [](const SharedRgbdFrame& self) { return image(self->exact_depth_m, self); },
          "(h, w) float32; 0 where the line of sight meets no surface; a view.")
      .def("__repr__", [](const RgbdFrame& self) {
        return fmt::format("<SimulatedFrame: {:.3f} s, {}x{}>", self.timestamp_s, self.width,
                           self.height);
      });
  Exposed<Simulation, SharedSimulation>(
      module, "Simulation",
      "A simulated RGB-D or stereo sequence; frames are rendered when accessed.")
      .def("__len__", [](const Simulation& self) { return self.simulator.frame_count(); })
      .def("__getitem__", &rendered_frame, py::arg("index"))
      .def("frame", &rendered_frame, py::arg("index"),
           "frame($self, index)\n--\n\nRenders a frame, which depends only on the options and its "
           "index.")
      .def_readonly("camera", &Simulation::camera)
      .get("trajectory", "The true trajectory.", &Simulation::simulator, &RgbdSimulator::trajectory)
      .def("__repr__", [](const Simulation& self) {
        return fmt::format("<Simulation: {} frames, {}x{}>", self.simulator.frame_count(),
                           self.camera.width, self.camera.height);
      });
  module.def("simulate", &simulate, py::arg("environment") = "desk",
             kept(simulate_keywords().signature("environment='desk'") +
                  "Simulates an RGB-D sequence with exact ground truth, or a stereo sequence with\n"
                  "`stereo_baseline_m`.\n\n"
                  "environment   'desk', 'office', 'corridor', 'warehouse', 'room' or 'kitchen'\n"
                  "seed, layout  determine the place\n"
                  "session       determines path, noise and changes\n"
                  "path          'sweep', 'orbit' or 'walk'"));
}

}  // namespace cairn::python
