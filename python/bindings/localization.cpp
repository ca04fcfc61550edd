// SPDX-License-Identifier: BSD-3-Clause

#include <fmt/format.h>

#include "cairn/vision/image_locator.hpp"
#include "cairn/vision/map_sequence.hpp"

#include "bindings/images.hpp"
#include "bindings/maps.hpp"
#include "bindings/support.hpp"

namespace cairn::python {
namespace {

struct Locator {
  Camera camera;
  ImageLocator locator;
};

const Keywords<LocateOptions>& locate_keywords() {
  static const auto table = [] {
    Keywords<LocateOptions> keywords("__init__");
    keywords.add("features", [](auto& o) -> auto& { return o.features.count; })
        .add("min_probability", [](auto& o) -> auto& { return o.min_probability; })
        .add("seed", [](auto& o) -> auto& { return o.seed; });
    return keywords;
  }();
  return table;
}

std::unique_ptr<Locator> make_locator(const LandmarkMap& map, const Camera& camera,
                                      const py::kwargs& given) {
  const LocateOptions options = locate_keywords().read(given);
  return unlocked([&] {
    return std::make_unique<Locator>(Locator{camera, ImageLocator(map, camera, options)});
  });
}

ImageLocation locate(const Locator& self, const py::object& image, const py::object& depth_m,
                     const std::string& channels) {
  const std::vector<std::uint8_t> bgr = image_of(image, self.camera, channels);
  const std::vector<float> depth = depth_of(depth_m, self.camera);
  return unlocked([&] {
    const FrameImages images = frame_images(0.0, self.camera.width, self.camera.height, bgr, depth);
    return self.locator.locate(images.gray, images.depth_m);
  });
}

}  // namespace

void bind_localization(py::module_& module) {
  py::class_<ImageLocation>(module, "ImageLocation", "Pose of an image in a map, judged.")
      .def_readonly("located", &ImageLocation::located, "Whether the pose can be trusted.")
      .def_readonly("probability", &ImageLocation::probability)
      .def_readonly("reason", &ImageLocation::reason)
      .def_property_readonly(
          "world_from_camera",
          [](const ImageLocation& self) { return pose_array(self.world_from_camera); },
          "4x4; None unless located.")
      .def_property_readonly(
          "estimate", [](const ImageLocation& self) { return pose_array(self.estimate); },
          "4x4: the best pose found, whatever its probability; None if none was found.")
      .def_property_readonly(
          "covariance", [](const ImageLocation& self) { return matrix_or_none(self.covariance); },
          "(6, 6), of the left perturbation (dt, dphi) of the estimate in the world frame; None if "
          "unknown.")
      .def_property_readonly(
          "matches",
          [](const ImageLocation& self) {
            py::array_t<double> matches({self.matches.size(), std::size_t{3}});
            auto rows = matches.mutable_unchecked<2>();
            for (std::size_t i = 0; i < self.matches.size(); ++i) {
              const auto row = static_cast<py::ssize_t>(i);
              rows(row, 0) = self.matches[i].landmark.value;
              rows(row, 1) = self.matches[i].pixel.u;
              rows(row, 2) = self.matches[i].pixel.v;
            }
            return matches;
          },
          "(n, 3): landmark index, and u and v of the matched corner, in pixels.")
      .def("__repr__", [](const ImageLocation& self) {
        return fmt::format("<ImageLocation {}: {}>", self.located ? "located" : "rejected",
                           self.reason);
      });
  py::class_<Locator>(module, "ImageLocator", "Locates images in a map that has ORB descriptors.")
      .def(py::init(&make_locator), py::arg("map"), py::arg("camera"),
           kept(locate_keywords().signature("$self, map, camera", false) +
                "Prepares a map for images of one camera. An image is located if its pose has at "
                "least\n`min_probability`."))
      .def("locate", &locate, py::arg("image"), py::arg("depth_m") = py::none(), py::kw_only(),
           py::arg("channels") = "rgb",
           "locate($self, image, depth_m=None, *, channels='rgb')\n--\n\n"
           "Estimates and judges the pose of one image, (h, w) or (h, w, 3) uint8. `depth_m` is "
           "its depth,\n(h, w) in metres, if known.");
}

}  // namespace cairn::python
