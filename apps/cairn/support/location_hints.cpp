// SPDX-License-Identifier: BSD-3-Clause
#include "support/location_hints.hpp"

#include <cstddef>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"

#include "support/documents.hpp"
#include "support/hints.hpp"

namespace cairn::cli {
namespace {

// Which of the map's images were taken about there, for people.
std::string place_of(const Rigid3& world_from_camera, const LandmarkMap& map) {
  const Eigen::Vector3d& at = world_from_camera.translation();
  std::string place = fmt::format("({:.2f}, {:.2f}, {:.2f})", at.x(), at.y(), at.z());
  const FrameTable& frames = map.frames();
  std::size_t nearest = 0;
  for (std::size_t i = 1; i < frames.translations.size(); ++i) {
    if ((frames.translations[i] - at).norm() < (frames.translations[nearest] - at).norm()) {
      nearest = i;
    }
  }
  if (frames.translations.empty()) return place;
  const bool named = !frames.image_names.empty() && !frames.image_names[nearest].empty();
  return fmt::format("{} near {}", place,
                     named ? printable(frames.image_names[nearest])
                           : fmt::format("frame {}", frames.ids[nearest].value));
}

// What would have given more matches.
std::vector<std::string> about_matches(const ImageLocation& found, std::optional<FocalLength> lens,
                                       const LocateOptions& options) {
  std::vector<std::string> hints;
  const auto asked = static_cast<std::size_t>(options.features.count);
  if (2 * found.corners < asked) {
    hints.push_back(
        fmt::format("Use an image that is sharper or shows more texture: of {} corners asked for, "
                    "it has {}.",
                    asked, found.corners));
  }
  hints.emplace_back("Check that the image shows what the map's images show, from nearby.");
  if (lens == FocalLength::kUnknown) {
    hints.emplace_back("Give the image's lens by --camera; then fewer matches decide.");
  } else if (lens) {
    hints.push_back(
        fmt::format("Add --camera unknown if the image is cropped, or by another lens than {} of "
                    "{} x {} pixels and focal length {:.0f}.",
                    found.camera.model, found.camera.width, found.camera.height,
                    found.camera.parameters.front()));
  }
  return hints;
}

std::vector<std::string> about(const ImageLocation& found, const LandmarkMap& map,
                               std::optional<FocalLength> lens, const LocateOptions& options) {
  switch (*found.failure) {
    case LocationFailure::kFewMatches:
    case LocationFailure::kFewInliers:
      return about_matches(found, lens, options);
    case LocationFailure::kAmbiguous:
      return {
          fmt::format("Use an image that also shows what tells two places apart: {}, and {}, "
                      "are {:.3g} {} from each other.",
                      place_of(*found.estimate, map), place_of(*found.rival, map),
                      (found.estimate->translation() - found.rival->translation()).norm(),
                      unit_symbol(map.info().length_unit))};
    case LocationFailure::kFocalLength:
      return {
          "Give the image's lens by --camera, or use an image that shows more than one surface.",
          "If one camera took several images with one focal length, locate them in one call with "
          "--camera shared; the more images, the better."};
    case LocationFailure::kLens:
      if (!lens) return {"State the images' camera by --camera."};
      return {
          "State the image's camera by --camera, or find its lens with the pose: --camera unknown. "
          "With --camera shared: are all images by one camera, with one focal length, and whole?"};
    case LocationFailure::kGivenPoses:
      return {
          "Check --poses: are they world_from_camera, in the map's unit, and at the images' times? "
          "Or give fewer images, over which the odometry drifts less."};
    case LocationFailure::kUndetermined:
    case LocationFailure::kImprobable:
      break;
  }
  std::vector<std::string> hints = {
      "Use an image that shows more of the map, in more of its area."};
  if (found.probability >= kLeastRequired) hints.push_back(accepted_risk_hint(found.probability));
  return hints;
}

}  // namespace

std::string location_hints(const ImageLocation& found, const LandmarkMap& map,
                           std::optional<FocalLength> lens, const LocateOptions& options) {
  std::string text;
  if (!found.failure) return text;
  for (const std::string& hint : about(found, map, lens, options)) text += hint_line(hint);
  return text;
}

}  // namespace cairn::cli
