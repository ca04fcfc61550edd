// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/odometry.hpp"

#include <mutex>

#include <fmt/format.h>

#include "cairn/vision/map_sequence.hpp"
#include "cairn/vision/sequence.hpp"

#include "bindings/images.hpp"
#include "bindings/properties.hpp"
#include "bindings/support.hpp"
#include "bindings/text.hpp"

namespace cairn::python {
namespace {

// Odometry that several Python threads may use; calls run one at a time.
class SharedOdometry {
 public:
  SharedOdometry(Camera camera, const OdometryOptions& options)
      : camera_(std::move(camera)), odometry_(camera_, options) {}

  const Camera& camera() const { return camera_; }

  template <class Work>
  auto alone(const Work& work) {
    return unlocked([&] {
      const std::lock_guard lock(mutex_);
      return work(odometry_);
    });
  }

 private:
  Camera camera_;
  std::mutex mutex_;
  Odometry odometry_;
};

template <class Options, class Part>
void add_odometry_keywords(Keywords<Options>& keywords, const Part& part) {
  keywords.add("features", [part](auto& o) -> auto& { return part(o).features.count; })
      .add("pyramid_levels", [part](auto& o) -> auto& { return part(o).features.levels; })
      .add("max_depth_m", [part](auto& o) -> auto& { return part(o).features.max_depth_m; })
      .add("pixel_noise", [part](auto& o) -> auto& { return part(o).noise.pixel; })
      .add("depth_noise_floor_m", [part](auto& o) -> auto& { return part(o).noise.depth_floor_m; })
      .add("depth_noise_quadratic",
           [part](auto& o) -> auto& { return part(o).noise.depth_quadratic; })
      .add("disparity_noise", [part](auto& o) -> auto& { return part(o).noise.disparity; })
      .add_table(OdometryOptions::table, part);
}

template <class Options, class Part>
void add_map_keywords(Keywords<Options>& keywords, const Part& part) {
  keywords.add_table(MapOptions::table, part)
      .add(
          "covariance", [part](auto& o) -> auto& { return part(o).covariance; },
          Words<LandmarkCovariance>{{"recursive", LandmarkCovariance::kRecursive},
                                    {"marginal", LandmarkCovariance::kMarginal}});
}

struct OdometryKeywords {
  OdometryOptions options;
  std::optional<Rigid3> start;
};

Keywords<OdometryKeywords> odometry_keywords() {
  Keywords<OdometryKeywords> keywords("__init__");
  keywords.add("start", py::none(), [](auto& options, py::handle value) {
    if (!value.is_none()) options.start = rigid_of(value, "start");
  });
  keywords.add("baseline_m", [](auto& o) -> auto& { return o.options.features.baseline_m; });
  add_odometry_keywords(keywords, [](auto& o) -> auto& { return o.options; });
  return keywords;
}

Keywords<MapOptions> map_keywords() {
  Keywords<MapOptions> keywords("map");
  add_map_keywords(keywords, [](auto& o) -> auto& { return o; });
  return keywords;
}

std::unique_ptr<SharedOdometry> make_odometry(const Camera& camera, const py::kwargs& given) {
  OdometryKeywords keywords = odometry_keywords().read(given);
  if (keywords.start) keywords.options.start = [start = *keywords.start](double) { return start; };
  return std::make_unique<SharedOdometry>(camera, keywords.options);
}

FrameReport track(SharedOdometry& self, double timestamp_s, const py::object& image,
                  const py::object& depth_m, const py::object& right, const std::string& channels,
                  const py::str& image_name) {
  const std::vector<std::uint8_t> bgr = image_of(image, self.camera(), channels);
  const std::vector<float> depth = depth_of(depth_m, self.camera());
  const std::vector<std::uint8_t> right_bgr =
      right.is_none() ? std::vector<std::uint8_t>() : image_of(right, self.camera(), channels);
  const std::string name = encoded(image_name, "image_name");
  return self.alone([&](Odometry& odometry) {
    FrameImages images =
        frame_images(timestamp_s, self.camera().width, self.camera().height, bgr, depth);
    images.name = name;
    if (!right_bgr.empty()) {
      images.right =
          frame_images(timestamp_s, self.camera().width, self.camera().height, right_bgr, {}).gray;
    }
    return odometry.track(images);
  });
}

std::string_view status_name(FrameStatus status) {
  switch (status) {
    case FrameStatus::kWaiting:
      return "waiting";
    case FrameStatus::kTracked:
      return "tracked";
    case FrameStatus::kLost:
      return "lost";
  }
  return "lost";
}

struct SequenceKeywords {
  MapSequenceOptions options;
  SequenceOptions sequence;
  std::optional<double> mini_map_metres;
  std::optional<std::size_t> mini_map_frames;
};

Keywords<SequenceKeywords> sequence_keywords() {
  Keywords<SequenceKeywords> keywords("map_sequence");
  keywords.add_table(SequenceOptions::table, [](auto& o) -> auto& { return o.sequence; })
      .add("mini_map_metres", [](auto& o) -> auto& { return o.mini_map_metres; })
      .add("mini_map_frames", [](auto& o) -> auto& { return o.mini_map_frames; })
      .add("skip_unreadable", [](auto& o) -> auto& { return o.options.skip_unreadable; });
  add_odometry_keywords(keywords, [](auto& o) -> auto& { return o.options.odometry; });
  add_map_keywords(keywords, [](auto& o) -> auto& { return o.options.map; });
  return keywords;
}

struct Mapped {
  MappedSequence sequence;
  std::vector<SharedMap> maps;
};

Mapped map_folder(const std::filesystem::path& folder, const std::optional<Camera>& camera,
                  const py::kwargs& given) {
  CallOptions call;
  SequenceKeywords keywords = sequence_keywords().read(given, &call);
  if (keywords.mini_map_metres || keywords.mini_map_frames) {
    keywords.options.mini_maps.emplace();
    keywords.options.mini_maps->metres = keywords.mini_map_metres;
    keywords.options.mini_maps->frames = keywords.mini_map_frames;
  }
  Mapped mapped;
  run("mapping", call, [&](const Execution& execution) {
    const ImageSequence sequence(folder, keywords.sequence);
    mapped.sequence = map_sequence(sequence, sequence.camera(camera), keywords.options, execution);
  });
  for (LandmarkMap& map : mapped.sequence.maps) {
    mapped.maps.push_back(std::make_shared<LandmarkMap>(std::move(map)));
  }
  mapped.sequence.maps.clear();
  return mapped;
}

}  // namespace

void bind_odometry(py::module_& module) {
  Exposed<FrameReport>(module, "FrameReport", "Result of tracking one frame.")
      .get("status", "'waiting', 'tracked' or 'lost'.", &FrameReport::status, &status_name)
      .def_readonly("keyframe", &FrameReport::keyframe)
      .def_readonly("landmarks", &FrameReport::landmarks, "Number of landmarks found in it.")
      .get("reprojection_errors", "(landmarks,) float32, pixels.",
           &FrameReport::reprojection_errors)
      .def("__repr__", [](const FrameReport& self) {
        return fmt::format("<FrameReport: {}, {} landmarks{}>", status_name(self.status),
                           self.landmarks, self.keyframe ? ", keyframe" : "");
      });
  static const std::string signature_of_init =
      odometry_keywords().signature("$self, camera", false);
  Exposed<SharedOdometry>(
      module, "Odometry",
      "RGB-D or stereo odometry: estimates poses and a landmark map from frames in time order.")
      .def(
          py::init(&make_odometry), py::arg("camera"),
          kept(
              signature_of_init +
              "`start` is the pose of the first frame (4x4, world_from_camera), by "
              "default the identity. `baseline_m` is\nthat of a rectified stereo pair; 0 for depth "
              "images."))
      .def("track", &track, py::arg("timestamp_s"), py::arg("image"),
           py::arg("depth_m") = py::none(), py::kw_only(), py::arg("right") = py::none(),
           py::arg("channels") = "rgb", py::arg("image_name") = "",
           "track($self, timestamp_s, image, depth_m=None, *, right=None, channels='rgb', "
           "image_name='')\n--\n\n"
           "Tracks the next frame: image (h, w) or (h, w, 3) uint8, depth (h, w) in metres, 0 or "
           "NaN where\n"
           "unknown, or the right image of a stereo pair. `channels` is 'rgb', or 'bgr' as in "
           "OpenCV.")
      .def(
          "complete",
          [](SharedOdometry& self) { self.alone([](Odometry& odometry) { odometry.complete(); }); },
          "complete($self)\n--\n\nAdjusts all keyframes and landmarks at once.")
      .def(
          "map",
          [](SharedOdometry& self, const py::kwargs& given) {
            const MapOptions options = map_keywords().read(given);
            return self.alone([&](Odometry& odometry) {
              return std::make_shared<LandmarkMap>(odometry.map(options));
            });
          },
          kept(map_keywords().signature("$self", false) +
               "The map so far. `covariance` is 'recursive', or 'marginal' (from the whole "
               "least-squares\nproblem)."))
      .def(
          "trajectory",
          [](SharedOdometry& self) {
            return self.alone([](Odometry& odometry) { return odometry.trajectory(); });
          },
          "trajectory($self)\n--\n\nThe poses of all frames tracked so far.")
      .def_property_readonly(
          "last_pose",
          [](SharedOdometry& self) {
            return seen(self.alone([](Odometry& odometry) { return odometry.last_pose(); }));
          },
          "4x4, world_from_camera of the last frame; None if it was not tracked.")
      .get("camera", "", &SharedOdometry::camera)
      .def("__repr__", [](const SharedOdometry& self) {
        return fmt::format("<Odometry: {} {}x{}>", self.camera().model, self.camera().width,
                           self.camera().height);
      });
  Exposed<Mapped>(module, "MappedSequence", "Result of mapping a sequence.")
      .def_readonly("maps", &Mapped::maps, "One map, or the mini-maps in time order.")
      .get("trajectory", "", &Mapped::sequence, &MappedSequence::trajectory)
      .get("frames", "", &Mapped::sequence, &MappedSequence::frames)
      .get("tracked", "", &Mapped::sequence, &MappedSequence::tracked)
      .get("keyframes", "", &Mapped::sequence, &MappedSequence::keyframes)
      .get("lost", "", &Mapped::sequence, &MappedSequence::lost_frames)
      .def("__repr__", [](const Mapped& self) {
        return fmt::format("<MappedSequence: {} maps, {} of {} frames tracked>", self.maps.size(),
                           self.sequence.tracked, self.sequence.frames);
      });
  module.def("map_sequence", &map_folder, py::arg("folder"), py::arg("camera") = py::none(),
             kept(sequence_keywords().signature("folder, camera=None") +
                  "Maps an RGB-D sequence in the layout of the TUM benchmark, or a stereo sequence "
                  "in that of\nKITTI odometry or EuRoC, which has its cameras."));
}

}  // namespace cairn::python
