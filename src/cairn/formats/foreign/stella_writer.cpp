// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/stella_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"
#include "cairn/formats/detail/losses.hpp"

namespace cairn::detail {
namespace {

using StellaJson = nlohmann::json;  // its keys are in the order of stella_vslam's, the alphabet's

constexpr std::string_view kOrbParameters = "default ORB feature extraction setting";
constexpr std::uint64_t kMostStellaId = std::numeric_limits<std::uint32_t>::max();

StellaJson vector_json(const Eigen::Vector3d& x) {
  return StellaJson::array({x.x(), x.y(), x.z()});
}

std::string stella_camera_name(const Camera& camera) {
  return fmt::format("camera {}", camera.id.value);
}

class StellaWriter {
 public:
  StellaWriter(const LandmarkMap& map, const ByteSink& sink, const Execution& execution)
      : map_(map),
        sink_(sink),
        execution_(execution),
        frame_ids_(fitting_ids(map.frames().ids, kMostStellaId - 1, 0)),
        landmark_ids_(fitting_ids(map.landmarks().ids, (kMostStellaId >> 1) - 1, 0)),
        observations_(map) {
    check();
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      observed_ += map.observation_count(LandmarkIndex{i}) > 0 ? 1 : 0;
    }
    find_parents();
  }

  void write() {
    begin_map(6);
    put("cameras");
    put(cameras());
    put("keyframe_next_id");
    put(next_id(frame_ids_));
    put("keyframes");
    begin_map(map_.frame_count());
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      put(std::to_string(frame_ids_[i]));
      put(keyframe(i));
    }
    put("landmark_next_id");
    put(next_id(landmark_ids_));
    put("landmarks");
    begin_map(observed_);
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      if (map_.observing_frames(LandmarkIndex{i}).empty()) continue;
      put(std::to_string(landmark_ids_[i]));
      put(landmark(LandmarkIndex{i}));
    }
    put("orb_params");
    put(orb_parameters());
    sink_(bytes_);
    remark();
  }

 private:
  void check() const {
    require_cameras(map_, "a keyframe of stella_vslam");
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      const Camera& camera = camera_of(map_, FrameIndex{i});
      if (opencv_distortion(camera) || is_panorama(camera) || division_of(camera)) continue;
      throw Error(ErrorKind::kInput, fmt::format("frame {}", map_.frames().ids[i].value),
                  "has a camera of model " + camera.model + ", which stella_vslam does not have",
                  "a perspective camera with at most k1, k2, p1, p2 and k3, a fisheye with at most "
                  "k1 to k4, DIVISION or EQUIRECTANGULAR");
    }
  }

  static std::uint64_t next_id(const std::vector<std::uint64_t>& ids) {
    return ids.empty() ? 0 : *std::max_element(ids.begin(), ids.end()) + 1;
  }

  static constexpr std::size_t kMostShared = 1000;

  // A spanning tree: the parent of a frame is the earlier frame that shares most landmarks with it.
  void find_parents() {
    children_.resize(map_.frame_count());
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      std::map<std::uint32_t, std::size_t> shared;
      for (const std::uint64_t k : observations_.of_frame[i]) {
        auto others = map_.observing_frames(LandmarkIndex{observations_.landmark_of[k]});
        // All pairs of more would take quadratic time.
        others = others.first(std::min<std::size_t>(others.size(), kMostShared));
        for (const FrameIndex other : others) {
          if (other.value < i) ++shared[other.value];
        }
      }
      const auto most =
          std::max_element(shared.begin(), shared.end(),
                           [](const auto& a, const auto& b) { return a.second < b.second; });
      parents_.push_back(most == shared.end() ? std::nullopt : std::optional(most->first));
      if (parents_.back()) children_[*parents_.back()].push_back(frame_ids_[i]);
    }
  }

  StellaJson cameras() const {
    StellaJson result = StellaJson::object();
    for (const Camera& camera : map_.cameras()) {
      StellaJson& json = result[stella_camera_name(camera)];
      json = {{"color_order", "Gray"}, {"cols", camera.width},     {"rows", camera.height},
              {"fps", 30.0},           {"focal_x_baseline", 0.0},  {"num_grid_cols", 64},
              {"num_grid_rows", 48},   {"setup_type", "Monocular"}};
      json.update(lens_json(camera));
    }
    return result;
  }

  static std::optional<double> division_of(const Camera& camera) {
    const bool is_division = camera.model == "DIVISION" || camera.model == "SIMPLE_DIVISION";
    return is_division ? std::optional(camera.parameters.back()) : std::nullopt;
  }

  static StellaJson lens_json(const Camera& camera) {
    if (is_panorama(camera)) return {{"model_type", "Equirectangular"}};
    const Intrinsics k = intrinsics(camera);
    StellaJson json = {{"fx", k.fx}, {"fy", k.fy}, {"cx", k.cx}, {"cy", k.cy}};
    if (const auto division = division_of(camera)) {
      json["model_type"] = "RadialDivision";
      json["distortion"] = *division;
      return json;
    }
    const Distortion d = opencv_distortion(camera).value_or(Distortion{});
    json.update({{"k1", d.k1}, {"k2", d.k2}, {"k3", d.k3}});
    json["model_type"] = d.is_fisheye ? "Fisheye" : "Perspective";
    if (d.is_fisheye) {
      json["k4"] = d.k4;
    } else {
      json["p1"] = d.p1;
      json["p2"] = d.p2;
    }
    return json;
  }

  // Where the keypoint is in the undistorted image.
  Pixel undistorted(const Camera& camera, const Pixel& pixel) {
    if (camera.model == "PINHOLE" || camera.model == "SIMPLE_PINHOLE") return pixel;
    if (is_panorama(camera)) return {pixel.u + kStellaPanorama, pixel.v + kStellaPanorama};
    const Intrinsics k = intrinsics(camera);
    if (const auto ray = unproject(camera, pixel); ray && ray->z() > 0.0) {
      return {k.fx * ray->x() / ray->z() + k.cx, k.fy * ray->y() / ray->z() + k.cy};
    }
    ++folded_;
    return pixel;
  }

  StellaJson keyframe(std::uint32_t i) {
    const FrameTable& frames = map_.frames();
    const ObservationTable& observations = map_.observations();
    const Camera& camera = camera_of(map_, FrameIndex{i});
    StellaJson descriptors = StellaJson::array();
    StellaJson landmarks = StellaJson::array();
    StellaJson keypoints = StellaJson::array();
    for (const std::uint64_t k : observations_.of_frame[i]) {
      descriptors.push_back(descriptor_json(k));
      landmarks.push_back(landmark_ids_[observations_.landmark_of[k]]);
      const std::int32_t octave =
          observations.octaves.empty() ? 0 : observations.octaves[k].value_or(0);
      most_octave_ = std::max(most_octave_, octave);
      const Pixel pixel = undistorted(camera, observations.pixels[k]);
      // OpenCV's angle for unknown.
      keypoints.push_back(
          {{"ang", -1.0}, {"oct", octave}, {"pt", StellaJson::array({pixel.u, pixel.v})}});
    }
    const auto& q = frames.quaternions[i];
    StellaJson result;
    result["cam"] = stella_camera_name(camera);
    result["depths"] = StellaJson::array();
    result["descs"] = std::move(descriptors);
    result["lm_ids"] = std::move(landmarks);
    result["loop_edges"] = StellaJson::array();
    result["n_keypts"] = observations_.of_frame[i].size();
    result["orb_params"] = kOrbParameters;
    result["rot_cw"] = StellaJson::array({-q[1], -q[2], -q[3], q[0]});
    result["span_children"] = children_[i];
    result["span_parent"] = -1;
    if (parents_[i]) result["span_parent"] = frame_ids_[*parents_[i]];
    result["trans_cw"] =
        vector_json(map_.world_from_camera(FrameIndex{i}).inverse() * Eigen::Vector3d::Zero());
    result["ts"] = frames.timestamps_s.empty() ? 0.0 : frames.timestamps_s[i].value_or(0.0);
    result["undist_keypts"] = std::move(keypoints);
    result["x_rights"] = StellaJson::array();
    return result;
  }

  bool has_orb() const {
    const auto& descriptors = map_.landmarks().descriptors;
    return descriptors && descriptors->kind == "ORB" && descriptors->bytes_each == kOrbBytes;
  }

  // Number of a landmark's further descriptors that are written: fewer than half of its observations, so that
  // readers who choose the medoid choose the first descriptor; and no more than readers keep.
  std::size_t further_written(std::uint32_t landmark) const {
    const std::size_t observations = map_.observation_count(LandmarkIndex{landmark});
    const std::size_t count = map_.landmarks().descriptors->count(landmark);
    if (count < 2 || observations < 3) return 0;
    return std::min({count - 1, (observations - 1) / 2, kDistinctViews - 1});
  }

  // Whether all descriptors of all landmarks are written.
  bool holds_further() const {
    const auto& descriptors = map_.landmarks().descriptors;
    if (!descriptors || !descriptors->has_further()) return true;
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      if (descriptors->count(i) > 1 + further_written(i)) return false;
    }
    return true;
  }

  // As words of 32 bits. The observations after the first have the landmark's further descriptors, one each.
  StellaJson descriptor_json(std::uint64_t observation) const {
    std::array<std::uint32_t, kOrbBytes / 4> words{};
    if (has_orb()) {
      const std::uint32_t landmark = observations_.landmark_of[observation];
      const std::uint64_t place = observation - map_.observations().offsets[landmark];
      const std::span<const std::uint8_t> bytes = map_.landmarks().descriptors->descriptor(
          landmark, place <= further_written(landmark) ? place : 0);
      for (std::size_t i = 0; i < kOrbBytes; ++i) {
        words[i / 4] |= std::uint32_t{bytes[i]} << (8 * (i % 4));
      }
    }
    return words;
  }

  StellaJson landmark(LandmarkIndex landmark) const {
    const auto frames = map_.observing_frames(landmark);
    const auto count = [&](const char* name) {
      const NamedColumn* const column = map_.column(name);
      const double value = column == nullptr ? std::numeric_limits<double>::quiet_NaN()
                                             : column->values[landmark.value];
      const bool is_count = value >= 0.0 && value < 4294967296.0;
      return is_count ? static_cast<std::uint64_t>(value) : frames.size();
    };
    const std::uint64_t first = frame_ids_[std::min_element(frames.begin(), frames.end())->value];
    return {{"1st_keyfrm", first},
            {"n_fnd", count("found")},
            {"n_vis", count("visible")},
            {"pos_w", vector_json(map_.landmarks().positions[landmark.value])},
            {"ref_keyfrm", first}};
  }

  // The defaults of stella_vslam.
  StellaJson orb_parameters() const {
    constexpr std::int32_t kLevels = 8;
    constexpr std::int32_t kMostOctave = std::numeric_limits<std::int32_t>::max();
    StellaJson result;
    result[kOrbParameters] = {
        {"ini_fast_threshold", 20},
        {"min_fast_threshold", 7},
        {"name", kOrbParameters},
        {"num_levels", std::max(kLevels, most_octave_ + (most_octave_ < kMostOctave ? 1 : 0))},
        {"scale_factor", 1.2}};
    return result;
  }

  // Writes the head of a MessagePack map, whose keys and values follow.
  void begin_map(std::uint64_t pairs) {
    const int bytes = pairs < 16 ? 0 : pairs < 65536 ? 2 : 4;
    bytes_ += static_cast<char>(bytes == 0 ? 0x80U | pairs : bytes == 2 ? 0xdeU : 0xdfU);
    for (int i = bytes - 1; i >= 0; --i) bytes_ += static_cast<char>(pairs >> (8 * i) & 0xffU);
  }

  void put(const StellaJson& value) {
    StellaJson::to_msgpack(value, bytes_);
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (bytes_.size() < kLarge) return;
    sink_(bytes_);
    bytes_.clear();
  }

  void remark() const {
    if (!execution_.log) return;
    const auto say = [&](const std::string& text, RemarkKind kind = RemarkKind::kLoss) {
      execution_.log({"stella_vslam: " + text, kind});
    };
    static constexpr std::array<std::string_view, 2> kColumns = {"visible", "found"};
    log_losses(execution_.log, map_,
               {.image_names = false,
                .timestamps = true,
                .octaves = true,
                .colors = false,
                .descriptors = has_orb() ? "ORB" : "",
                .further_descriptors = holds_further(),
                .columns = kColumns},
               "stella_vslam");
    const auto& times = map_.frames().timestamps_s;
    const auto timeless = times.empty() ? 0 : std::ranges::count(times.known(), 0);
    if (timeless > 0) say(fmt::format("{} keyframes without a time get the time 0", timeless));
    if (observed_ < map_.landmark_count()) {
      say(fmt::format("{} landmarks without an observation have no place; left out",
                      map_.landmark_count() - observed_));
    }
    if (!has_orb()) {
      say("the landmarks have no ORB descriptors, so those of the keypoints are zero: stella_vslam "
          "cannot relocalise in this map",
          RemarkKind::kInformation);
    }
    const auto is_same = [](std::uint64_t written, auto id) { return written == id.value; };
    const auto& frames = map_.frames().ids;
    const auto& landmarks = map_.landmarks().ids;
    const bool renumbered =
        !std::equal(frame_ids_.begin(), frame_ids_.end(), frames.begin(), is_same) ||
        !std::equal(landmark_ids_.begin(), landmark_ids_.end(), landmarks.begin(), is_same);
    if (renumbered) say("ids are too large: numbered from 0");
    if (folded_ > 0) say(fmt::format("{} pixels have no line of sight; left distorted", folded_));
  }

  const LandmarkMap& map_;
  const ByteSink& sink_;
  const Execution& execution_;
  std::string bytes_;
  std::vector<std::uint64_t> frame_ids_;
  std::vector<std::uint64_t> landmark_ids_;
  FrameObservations observations_;
  std::vector<std::optional<std::uint32_t>> parents_;
  std::vector<std::vector<std::uint64_t>> children_;  // their ids
  std::size_t observed_ = 0;
  std::size_t folded_ = 0;
  std::int32_t most_octave_ = 0;
};

}  // namespace

void write_stella(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  StellaWriter(map, sink, execution).write();
}

}  // namespace cairn::detail
