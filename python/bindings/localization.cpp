// SPDX-License-Identifier: BSD-3-Clause

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "cairn/vision/image_locator.hpp"
#include "cairn/vision/map_images.hpp"
#include "cairn/vision/map_sequence.hpp"

#include "bindings/images.hpp"
#include "bindings/maps.hpp"
#include "bindings/properties.hpp"
#include "bindings/support.hpp"

namespace cairn::python {
namespace {

struct Locator {
  Camera camera;
  ImageLocator locator;
  std::uint64_t seed = 0;
};

struct LocatorKeywords {
  LocateOptions options;
  std::uint64_t seed = 0;
};

Keywords<LocatorKeywords> locate_keywords() {
  return Keywords<LocatorKeywords>("__init__")
      .add_table(LocateOptions::table, [](auto& o) -> auto& { return o.options; })
      .add("seed", [](auto& o) -> auto& { return o.seed; });
}

std::unique_ptr<Locator> make_locator(const LandmarkMap& map, const Camera& camera,
                                      const py::kwargs& given) {
  const LocatorKeywords keywords = locate_keywords().read(given);
  return unlocked([&] {
    return std::make_unique<Locator>(
        Locator{camera, ImageLocator(map, camera, keywords.options), keywords.seed});
  });
}

ImageLocation locate(const Locator& self, const py::object& image, const py::object& depth_m,
                     const std::string& channels) {
  const std::vector<std::uint8_t> bgr = image_of(image, self.camera, channels);
  const std::vector<float> depth = depth_of(depth_m, self.camera);
  return unlocked([&] {
    const FrameImages images = frame_images(0.0, self.camera.width, self.camera.height, bgr, depth);
    return self.locator.locate(images.gray, images.depth_m, {.seed = self.seed});
  });
}

GrayImage gray_of(const Locator& self, const py::object& image, const std::string& channels) {
  return frame_images(0.0, self.camera.width, self.camera.height,
                      image_of(image, self.camera, channels), {})
      .gray;
}

std::vector<ImageLocation> locate_images_together(const Locator& self,
                                                  const std::vector<py::object>& images,
                                                  const std::vector<py::object>& poses,
                                                  const std::string& channels, unsigned threads) {
  refuse_if(images.size() != poses.size(), "poses", fmt::format("{}", poses.size()),
            fmt::format("one for each of the {} images", images.size()));
  std::vector<GrayImage> pixels(images.size());
  std::vector<BodyView> views;
  for (std::size_t i = 0; i < images.size(); ++i) {
    pixels[i] = gray_of(self, images[i], channels);
    views.push_back({&self.locator, &pixels[i], rigid_of(poses[i], fmt::format("poses[{}]", i))});
  }
  return unlocked([&] {
    return locate_together(views, {Executor(threads), {}, {}, self.seed, {}});
  });
}

std::vector<ImageLocation> locate_images_with_shared_lens(const Locator& self,
                                                          const std::vector<py::object>& images,
                                                          const std::string& channels,
                                                          unsigned threads) {
  std::vector<GrayImage> pixels;
  for (const py::object& image : images) pixels.push_back(gray_of(self, image, channels));
  return unlocked([&] {
    return locate_with_shared_lens(self.locator, pixels.size(),
                                   [&](std::size_t k) { return pixels[k]; },
                                   {Executor(threads), {}, {}, self.seed, {}});
  });
}

std::unique_ptr<Locator> with_camera(const Locator& self, const Camera& camera,
                                     bool focal_length_known) {
  const FocalLength focal_length = focal_length_known ? FocalLength::kKnown : FocalLength::kUnknown;
  return unlocked([&] {
    return std::make_unique<Locator>(
        Locator{camera, self.locator.with_camera(camera, focal_length), self.seed});
  });
}

LandmarkMap map_with_frames(const LandmarkMap& map,
                            const std::vector<std::pair<std::string, ImageLocation>>& given) {
  std::vector<LocatedImage> images;
  for (const auto& [name, location] : given) images.push_back({name, location});
  return unlocked([&] { return with_frames(map, images); });
}

LandmarkMap map_with_new_landmarks(const LandmarkMap& map,
                                   const std::vector<std::pair<std::uint32_t, py::object>>& given,
                                   const std::string& channels, unsigned threads) {
  std::vector<FrameIndex> frames;
  std::map<FrameIndex, ColorImage> images;
  for (const auto& [frame, image] : given) {
    const auto& cameras = map.frames().cameras;
    refuse_if(frame >= cameras.size() || !cameras[frame], "images", fmt::format("frame {}", frame),
              "frames with cameras");
    const Camera& camera = map.cameras()[cameras[frame]->value];
    frames.push_back(FrameIndex{frame});
    images.emplace(frames.back(),
                   ColorImage(camera.width, camera.height, image_of(image, camera, channels)));
  }
  return unlocked([&] {
    return with_new_landmarks(map, frames, [&](FrameIndex frame) { return images.at(frame); }, {},
                              {Executor(threads), {}, {}, 0, {}});
  });
}

LandmarkMap map_with_descriptors(const LandmarkMap& map, const std::filesystem::path& folder,
                                 unsigned threads) {
  return unlocked([&] {
    return with_image_descriptors(map, folder, {Executor(threads), {}, {}}).map;
  });
}

py::array rows_of_matches(const std::vector<ImageMatch>& matches) {
  return row_array(matches, [](const ImageMatch& match) {
    return std::array{static_cast<double>(match.landmark.value), match.pixel.u, match.pixel.v};
  });
}

py::object name_or_none(const std::optional<LocationFailure>& failure) {
  if (!failure) return py::none();
  return py::str(std::string(to_string(*failure)));
}

}  // namespace

void bind_localization(py::module_& module) {
  Exposed<ImageLocation>(module, "ImageLocation", "Pose of an image in a map, judged.")
      .def_readonly("located", &ImageLocation::located, "Whether the pose can be trusted.")
      .def_readonly("probability", &ImageLocation::probability)
      .def_readonly("reason", &ImageLocation::reason)
      .get("failure",
           "Why it was not located: \"few_matches\", \"few_inliers\", \"improbable\", "
           "\"ambiguous\", \"focal_length\", \"lens\", \"undetermined\" or \"given_poses\"; None "
           "if located.",
           &ImageLocation::failure, &name_or_none)
      .get("world_from_camera", "4x4; None unless located.", &ImageLocation::world_from_camera)
      .get("estimate",
           "4x4: the best pose found, whatever its probability; None if none was found.",
           &ImageLocation::estimate)
      .get("rival",
           "4x4: another pose that explains other matches, and so lowers the probability; None "
           "without one.",
           &ImageLocation::rival)
      .get(
          "covariance",
          "(6, 6), of the left perturbation (dt, dphi) of the estimate in the world frame; None if "
          "unknown.",
          &ImageLocation::covariance)
      .get("matches", "(n, 3): landmark index, and u and v of the matched corner, in pixels.",
           &ImageLocation::matches, &rows_of_matches)
      .get("camera", "The image's camera.", &ImageLocation::camera)
      .get("focal_length_sigma",
           "Standard deviation of the camera's focal length, pixels; None unless found with the "
           "pose.",
           &ImageLocation::focal_length_sigma)
      .def("__repr__", [](const ImageLocation& self) {
        return fmt::format("<ImageLocation {}: {}>", self.located ? "located" : "rejected",
                           self.reason);
      });
  Exposed<Locator>(module, "ImageLocator",
                   "Locates images in a map that has ORB or SIFT descriptors.")
      .def(py::init(&make_locator), py::arg("map"), py::arg("camera"),
           kept(locate_keywords().signature("$self, map, camera", false) +
                "Prepares a map for images of one camera. An image is located if its pose has at "
                "least\n`min_probability`."))
      .def("with_camera", &with_camera, py::arg("camera"), py::kw_only(),
           py::arg("focal_length_known") = true,
           "with_camera($self, camera, *, focal_length_known=True)\n--\n\n"
           "The same for images of another camera; the prepared map is shared. If the focal length "
           "is unknown,\nit, the radial distortion and the principal point are found with each "
           "pose; the camera gives the size\nand the lens at which the search begins.")
      .def("locate", &locate, py::arg("image"), py::arg("depth_m") = py::none(), py::kw_only(),
           py::arg("channels") = "rgb",
           "locate($self, image, depth_m=None, *, channels='rgb')\n--\n\n"
           "Estimates and judges the pose of one image, (h, w) or (h, w, 3) uint8. `depth_m` is "
           "its depth,\n(h, w) in metres, if known.")
      .def("locate_with_shared_lens", &locate_images_with_shared_lens, py::arg("images"),
           py::kw_only(), py::arg("channels") = "rgb", py::arg("threads") = 0,
           "locate_with_shared_lens($self, images, *, channels='rgb', threads=0)\n--\n\n"
           "Locates images that one camera took, whose focal length is unknown. Each image is "
           "located with a lens\nof its own, then again with what the lenses of the other images "
           "tell.")
      .def("locate_together", &locate_images_together, py::arg("images"), py::arg("poses"),
           py::kw_only(), py::arg("channels") = "rgb", py::arg("threads") = 0,
           "locate_together($self, images, poses, *, channels='rgb', threads=0)\n--\n\n"
           "Locates images as one. `poses` are the cameras' poses, 4x4, in any frame common to all "
           "images and in\nthe map's unit of length, as odometry or a rig gives them. Each image "
           "gets its own pose and\nmatches, and the common verdict.");
  module.def(
      "with_frames", &map_with_frames, py::arg("map"), py::arg("images"),
      "with_frames(map, images)\n--\n\n"
      "The map with located images as further frames, each with its matches as observations. "
      "`images` has\npairs of a name and an ImageLocation.");
  module.def(
      "with_new_landmarks", &map_with_new_landmarks, py::arg("map"), py::arg("images"),
      py::kw_only(), py::arg("channels") = "rgb", py::arg("threads") = 0,
      "with_new_landmarks(map, images, *, channels='rgb', threads=0)\n--\n\n"
      "The map with landmarks that two or more of the images show and the map does not have. "
      "`images` has\npairs of the index of a frame, 0 to len(map.frame_ids) - 1, and its image.");
  module.def("with_image_descriptors", &map_with_descriptors, py::arg("map"), py::arg("folder"),
             py::kw_only(), py::arg("threads") = 0,
             "with_image_descriptors(map, folder, *, threads=0)\n--\n\n"
             "The map with SIFT descriptors of its images, which are in a folder by their names in "
             "the map.");
}

}  // namespace cairn::python
