// SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/rigid3.hpp"

namespace cairn::detail {
namespace {

using AliceVisionJson = nlohmann::ordered_json;

constexpr std::uint64_t kNoAliceVisionIndex = std::numeric_limits<std::uint32_t>::max();
constexpr double kSensorMm = 36.0;  // any width will do: only its ratio to the focal length counts

// AliceVision writes numbers as texts.
std::string number_text(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

template <class Numbers>
AliceVisionJson texts(const Numbers& numbers) {
  AliceVisionJson result = AliceVisionJson::array();
  for (const double number : numbers) result.push_back(number_text(number));
  return result;
}

// The type and the parameters of a camera's distortion; std::nullopt for a model that AliceVision lacks.
std::optional<std::pair<std::string, std::vector<double>>> alicevision_distortion(
    const Camera& camera) {
  using Result = std::pair<std::string, std::vector<double>>;
  if (camera.model == "FOV") return Result{"fisheye1", {camera.parameters.back()}};
  const auto d = opencv_distortion(camera);
  if (!d) return std::nullopt;
  if (d->is_fisheye) return Result{"fisheye4", {d->k1, d->k2, d->k3, d->k4}};
  if (d->p1 != 0.0 || d->p2 != 0.0) return Result{"brown", {d->k1, d->k2, d->k3, d->p1, d->p2}};
  if (camera.model == "SIMPLE_RADIAL") return Result{"radial1", {d->k1}};
  const bool is_plain = d->k1 == 0.0 && d->k2 == 0.0 && d->k3 == 0.0;
  return is_plain ? Result{"pinhole", {}} : Result{"radial3", {d->k1, d->k2, d->k3}};
}

class AliceVisionWriter {
 public:
  explicit AliceVisionWriter(const LandmarkMap& map)
      : map_(map),
        names_(json_image_names(map)),
        ids_(map, kNoAliceVisionIndex - 1, kNoAliceVisionIndex - 1, 0) {
    require_cameras(map, "a view of AliceVision");
    for (const Camera& camera : map.cameras()) {
      if (!alicevision_distortion(camera)) refuse_model(camera, "AliceVision");
    }
  }

  void remark(const LogSink& log) const {
    log_losses(log, map_, {.keypoints = true}, "AliceVision");
    ids_.log_replaced(log, map_, "AliceVision");
  }

  void write(const ByteSink& sink) const {
    JsonMembers out(sink);
    // The last version with one name for lens and distortion, which newer programs read too.
    out.member("version", {"1", "2", "6"});
    out.array("views", map_.frame_count(), [&](std::size_t i) { return view(i); });
    out.array("intrinsics", map_.cameras().size(), [&](std::size_t i) { return intrinsic(i); });
    out.array("poses", map_.frame_count(), [&](std::size_t i) { return pose(i); });
    out.array("structure", map_.landmark_count(), [&](std::size_t i) { return landmark(i); });
    out.finish();
  }

 private:
  AliceVisionJson view(std::size_t i) const {
    const Camera& camera = camera_of(map_, FrameIndex{static_cast<std::uint32_t>(i)});
    const std::string id = std::to_string(ids_.frames[i]);
    return {{"viewId", id},
            {"poseId", id},
            {"intrinsicId", std::to_string(ids_.cameras[map_.frames().cameras[i]->value])},
            {"path", names_[i]},
            {"width", std::to_string(camera.width)},
            {"height", std::to_string(camera.height)},
            {"metadata", ""}};
  }

  AliceVisionJson intrinsic(std::size_t i) const {
    const Camera& camera = map_.cameras()[i];
    const Intrinsics k = cairn::intrinsics(camera);
    const auto [type, distortion] = *alicevision_distortion(camera);
    const std::string focal = number_text(k.fx / camera.width * kSensorMm);
    AliceVisionJson json = {
        {"intrinsicId", std::to_string(ids_.cameras[i])},
        {"width", std::to_string(camera.width)},
        {"height", std::to_string(camera.height)},
        {"sensorWidth", number_text(kSensorMm)},
        {"sensorHeight", number_text(kSensorMm * camera.height / camera.width)},
        {"serialNumber", ""},
        {"type", type},
        {"initializationMode", "calibrated"},
        {"initialFocalLength", focal},
        {"focalLength", focal},
        {"pixelRatio", number_text(k.fy / k.fx)},
        {"pixelRatioLocked", "true"},
        {"principalPoint",
         texts(std::vector<double>{k.cx - 0.5 * camera.width, k.cy - 0.5 * camera.height})},
        {"distortionInitializationMode", "none"}};
    if (distortion.empty()) {
      json["distortionParams"] = "";  // an empty list, as AliceVision writes it
    } else {
      json["distortionParams"] = texts(distortion);
    }
    json["locked"] = "false";
    return json;
  }

  AliceVisionJson pose(std::size_t i) const {
    const Rigid3 world_from_camera =
        map_.world_from_camera(FrameIndex{static_cast<std::uint32_t>(i)});
    const Eigen::Matrix3d camera_from_world = world_from_camera.rotation().transpose();
    return {{"poseId", std::to_string(ids_.frames[i])},
            {"pose",
             {{"transform",
               {{"rotation", texts(camera_from_world.reshaped())},  // column by column
                {"center", texts(world_from_camera.translation())}}},
              {"locked", "0"}}}};
  }

  AliceVisionJson landmark(std::size_t i) const {
    const LandmarkIndex index{static_cast<std::uint32_t>(i)};
    const Color color = cairn::detail::color_of(map_, index.value);
    AliceVisionJson json = {
        {"landmarkId", std::to_string(ids_.landmarks[i])},
        {"descType", "unknown"},
        {"color",
         {std::to_string(color.red), std::to_string(color.green), std::to_string(color.blue)}},
        {"X", texts(map_.landmarks().positions[i])}};
    AliceVisionJson& observations = json["observations"] = AliceVisionJson::array();
    const auto frames = map_.observing_frames(index);
    const auto pixels = map_.observed_pixels(index);
    const std::uint64_t first = frames.empty() ? 0 : map_.observations().offsets[i];
    for (std::size_t j = 0; j < frames.size(); ++j) {
      const std::uint64_t feature = keypoint_index(map_, first + j, kNoAliceVisionIndex);
      observations.push_back({{"observationId", std::to_string(ids_.frames[frames[j].value])},
                              {"featureId", std::to_string(feature)},
                              {"x", texts(std::vector<double>{pixels[j].u, pixels[j].v})},
                              {"scale", "0"}});
    }
    if (observations.empty()) observations = "";
    return json;
  }

  const LandmarkMap& map_;
  std::vector<std::string> names_;
  WrittenIds ids_;
};

}  // namespace

void write_alicevision(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  const AliceVisionWriter writer(map);
  writer.remark(execution.log);
  writer.write(sink);
}

}  // namespace cairn::detail
