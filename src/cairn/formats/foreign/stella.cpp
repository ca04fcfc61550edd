// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/stella.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/msgpack.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/stella_builder.hpp"
#include "cairn/formats/losses.hpp"

namespace cairn {
namespace {

using detail::kOrbBytes;
using detail::MsgpackReader;
using detail::MsgpackWriter;
using detail::StellaCamera;
using detail::StellaKeyframe;

constexpr std::uint64_t kMost32 = std::numeric_limits<std::uint32_t>::max();

// --- Reading --------------------------------------------------------------------------------------

// Calls `read` with each key; it takes the value.
template <class Read>
void for_each_key(MsgpackReader& in, std::string_view field, const Read& read) {
  const std::uint64_t count = in.begin_map(field);
  for (std::uint64_t i = 0; i < count; ++i) read(in.text(field));
}

std::uint64_t id_of(const MsgpackReader& in, const std::string& key, std::string_view field) {
  const auto id = parse_unsigned(key);
  if (!id || *id > kMost32) {
    in.refuse(field, printable(key) + " is no id", fmt::format("0 to {}", kMost32));
  }
  return *id;
}

Eigen::Vector3d vector3(MsgpackReader& in, std::string_view field) {
  in.begin_array(field, 3);
  Eigen::Vector3d result;
  for (int i = 0; i < 3; ++i) result[i] = in.number_or_nan(field);
  return result;
}

Pixel pixel(MsgpackReader& in, std::string_view field) {
  in.begin_array(field, 2);
  const double u = in.number(field);
  return {u, in.number(field)};
}

StellaCamera read_camera(MsgpackReader& in) {
  StellaCamera camera;
  const std::map<std::string_view, double*> distortion = {{"k1", &camera.k1}, {"k2", &camera.k2},
                                                          {"p1", &camera.p1}, {"p2", &camera.p2},
                                                          {"k3", &camera.k3}, {"k4", &camera.k4}};
  const std::map<std::string_view, std::optional<double>*> pinhole = {
      {"fx", &camera.fx}, {"fy", &camera.fy}, {"cx", &camera.cx}, {"cy", &camera.cy}};
  const auto size = [&](std::string_view field) {
    const std::int64_t value = in.whole(field);
    return value >= 0 && value <= std::int64_t{kMost32} ? static_cast<std::uint32_t>(value) : 0U;
  };
  for_each_key(in, "camera", [&](const std::string& key) {
    if (const auto found = distortion.find(key); found != distortion.end()) {
      *found->second = in.number(key);
    } else if (const auto known = pinhole.find(key); known != pinhole.end()) {
      *known->second = in.number(key);
    } else if (key == "model_type") {
      camera.model_type = in.text(key);
    } else if (key == "setup_type") {
      camera.setup_type = in.text(key);
    } else if (key == "cols") {
      camera.width = size(key);
    } else if (key == "rows") {
      camera.height = size(key);
    } else {
      in.skip();
    }
  });
  return camera;
}

void read_keypoints(MsgpackReader& in, StellaKeyframe& keyframe, bool with_pixels) {
  const std::uint64_t count = in.begin_array("keypoints");
  for (std::uint64_t i = 0; i < count; ++i) {
    for_each_key(in, "keypoint", [&](const std::string& key) {
      if (key == "pt" && with_pixels) {
        keyframe.undistorted.push_back(pixel(in, "pt of a keypoint"));
      } else if (key == "oct") {
        const std::int64_t octave = in.whole("oct of a keypoint");
        keyframe.octaves.push_back(static_cast<std::int32_t>(
            std::clamp<std::int64_t>(octave, std::numeric_limits<std::int32_t>::min(),
                                     std::numeric_limits<std::int32_t>::max())));
      } else {
        in.skip();
      }
    });
  }
}

void read_descriptors(MsgpackReader& in, StellaKeyframe& keyframe) {
  const std::uint64_t count = in.begin_array("descs");
  for (std::uint64_t i = 0; i < count; ++i) {
    in.begin_array("descriptor", kOrbBytes / 4);
    auto& bytes = keyframe.descriptors.emplace_back();
    for (std::size_t word = 0; word < kOrbBytes / 4; ++word) {
      const auto value = static_cast<std::uint64_t>(in.whole("descriptor"));
      if (value > kMost32) in.refuse("descriptor", "a word is too large", "32 bits");
      for (std::size_t j = 0; j < 4; ++j) {
        bytes[4 * word + j] = static_cast<std::uint8_t>(value >> (8 * j) & 0xffU);
      }
    }
  }
}

void read_keyframe(MsgpackReader& in, std::uint64_t id, detail::StellaBuilder& out) {
  StellaKeyframe keyframe;
  keyframe.id = id;
  std::vector<std::int64_t> landmarks;
  bool has_rotation = false;
  bool has_translation = false;
  for_each_key(in, "keyframe", [&](const std::string& key) {
    if (key == "ts") {
      keyframe.timestamp_s = in.number(key);
    } else if (key == "cam") {
      keyframe.camera = in.text(key);
    } else if (key == "rot_cw") {
      in.begin_array(key, 4);
      for (int i = 0; i < 4; ++i) keyframe.rotation_cw.coeffs()[i] = in.number(key);
      has_rotation = true;
    } else if (key == "trans_cw") {
      keyframe.translation_cw = vector3(in, key);
      has_translation = true;
    } else if (key == "undist_keypts") {
      read_keypoints(in, keyframe, true);
    } else if (key == "keypts") {  // of OpenVSLAM: as seen, beside the undistorted ones
      read_keypoints(in, keyframe, false);
    } else if (key == "undists") {
      const std::uint64_t count = in.begin_array(key);
      for (std::uint64_t i = 0; i < count; ++i) keyframe.undistorted.push_back(pixel(in, key));
    } else if (key == "depths") {
      const std::uint64_t count = in.begin_array(key);
      for (std::uint64_t i = 0; i < count; ++i) {
        keyframe.depths.push_back(static_cast<float>(in.number_or_nan(key)));
      }
    } else if (key == "descs") {
      read_descriptors(in, keyframe);
    } else if (key == "lm_ids") {
      const std::uint64_t count = in.begin_array(key);
      for (std::uint64_t i = 0; i < count; ++i) landmarks.push_back(in.whole(key));
    } else {
      in.skip();
    }
  });
  const std::string where = fmt::format("keyframe {}", id);
  if (!has_rotation) in.refuse(where, "has no rot_cw", "a rotation");
  if (!has_translation) in.refuse(where, "has no trans_cw", "a translation");
  const std::string defect = out.add_keyframe(keyframe, landmarks);
  if (!defect.empty()) in.refuse(where, defect, "a keyframe of stella_vslam");
}

void read_landmark(MsgpackReader& in, std::uint64_t id, detail::StellaBuilder& out) {
  std::optional<Eigen::Vector3d> position;
  std::optional<double> visible;
  std::optional<double> found;
  for_each_key(in, "landmark", [&](const std::string& key) {
    if (key == "pos_w") {
      position = vector3(in, key);
    } else if (key == "n_vis") {
      visible = in.number(key);
    } else if (key == "n_fnd") {
      found = in.number(key);
    } else {
      in.skip();
    }
  });
  if (!position) in.refuse(fmt::format("landmark {}", id), "has no pos_w", "a position");
  out.add_landmark(id, *position, visible, found);
}

// A map of at most 15 entries, of which the first has a name that stella_vslam gives.
bool looks_like_stella(std::string_view bytes) {
  if (bytes.size() < 2 || (static_cast<unsigned char>(bytes[0]) & 0xf0U) != 0x80) return false;
  const auto head = static_cast<unsigned char>(bytes[1]);
  if ((head & 0xe0U) != 0xa0) return false;
  const std::string_view key = bytes.substr(2, head & 0x1fU);
  constexpr std::array<std::string_view, 7> kKeys = {
      "cameras",          "frame_next_id", "keyframe_next_id", "keyframes",
      "landmark_next_id", "landmarks",     "orb_params"};
  return std::find(kKeys.begin(), kKeys.end(), key) != kKeys.end();
}

// --- Writing --------------------------------------------------------------------------------------

constexpr std::string_view kOrbParameters = "default ORB feature extraction setting";

std::string camera_name(const Camera& camera) {
  return fmt::format("camera {}", camera.id.value);
}

class Writer {
 public:
  Writer(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options)
      : map_(map), sink_(sink), options_(options), out_(bytes_) {
    check();
    const bool fit = std::all_of(map.frames().ids.begin(), map.frames().ids.end(),
                                 [](FrameId id) { return id.value < kMost32; });
    for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
      frame_ids_.push_back(fit ? map.frames().ids[i].value : i);
    }
    bool landmarks_fit = true;
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      landmarks_fit = landmarks_fit && map.landmarks().ids[i].value < kMost32 >> 1;
    }
    for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
      landmark_ids_.push_back(landmarks_fit ? map.landmarks().ids[i].value : i);
      observed_ += map.observation_count(LandmarkIndex{i}) > 0 ? 1 : 0;
    }
    renumbered_ = !fit || !landmarks_fit;
    list_keypoints();
    find_parents();
  }

  void write() {
    out_.begin_map(6);
    out_.text("cameras");
    write_cameras();
    out_.text("keyframe_next_id");
    out_.whole(next_id(frame_ids_));
    out_.text("keyframes");
    out_.begin_map(map_.frame_count());
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      write_keyframe(i);
      flush();
    }
    out_.text("landmark_next_id");
    out_.whole(next_id(landmark_ids_));
    out_.text("landmarks");
    out_.begin_map(observed_);
    for (std::uint32_t i = 0; i < map_.landmark_count(); ++i) {
      write_landmark(LandmarkIndex{i});
      flush();
    }
    out_.text("orb_params");
    write_orb_parameters();
    sink_(bytes_);
    bytes_.clear();
    remark();
  }

 private:
  void check() const {
    const FrameTable& frames = map_.frames();
    for (std::size_t i = 0; i < map_.frame_count(); ++i) {
      const auto refuse = [&](const std::string& what, std::string_view expected) {
        throw Error(ErrorKind::kInput, fmt::format("frame {}", frames.ids[i].value), what,
                    expected);
      };
      if (frames.cameras.empty() || !frames.cameras[i]) {
        refuse("has no camera, and a keyframe of stella_vslam needs one",
               "a camera for every frame");
      }
      const Camera& camera = map_.cameras()[frames.cameras[i]->value];
      if (!stella_camera(camera)) {
        refuse("has a camera of model " + camera.model + ", which stella_vslam does not have",
               "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, or "
               "FULL_OPENCV with k4 = k5 = k6 = 0");
      }
    }
  }

  static std::optional<StellaCamera> stella_camera(const Camera& camera) {
    StellaCamera result;
    result.model_type = "Perspective";
    const Intrinsics k = intrinsics(camera);
    result.fx = k.fx;
    result.fy = k.fy;
    result.cx = k.cx;
    result.cy = k.cy;
    const std::vector<double>& p = camera.parameters;
    if (camera.model == "SIMPLE_PINHOLE" || camera.model == "PINHOLE") return result;
    if (camera.model == "SIMPLE_RADIAL" || camera.model == "RADIAL") {
      result.k1 = p[3];
      result.k2 = p.size() > 4 ? p[4] : 0.0;
      return result;
    }
    if (camera.model == "OPENCV_FISHEYE") {
      result.model_type = "Fisheye";
      result.k1 = p[4];
      result.k2 = p[5];
      result.k3 = p[6];
      result.k4 = p[7];
      return result;
    }
    const bool is_full =
        camera.model == "FULL_OPENCV" && p[9] == 0.0 && p[10] == 0.0 && p[11] == 0.0;
    if (camera.model != "OPENCV" && !is_full) return std::nullopt;
    result.k1 = p[4];
    result.k2 = p[5];
    result.p1 = p[6];
    result.p2 = p[7];
    if (is_full) result.k3 = p[8];
    return result;
  }

  static std::int64_t next_id(const std::vector<std::uint64_t>& ids) {
    return ids.empty() ? 0
                       : static_cast<std::int64_t>(*std::max_element(ids.begin(), ids.end())) + 1;
  }

  // The observations of each frame, by the index of their keypoint, or else of the landmark.
  void list_keypoints() {
    const ObservationTable& observations = map_.observations();
    keypoints_.resize(map_.frame_count());
    landmark_of_.resize(observations.frames.size());
    for (std::uint32_t i = 0; i < map_.landmark_count() && map_.has_observations(); ++i) {
      for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
        landmark_of_[k] = i;
        keypoints_[observations.frames[k].value].push_back(k);
      }
    }
    if (observations.keypoints.empty()) return;
    for (auto& of_frame : keypoints_) {
      const auto key = [&](std::uint64_t k) {
        return observations.keypoints[k].value_or(static_cast<std::uint32_t>(kMost32));
      };
      std::stable_sort(of_frame.begin(), of_frame.end(),
                       [&](std::uint64_t a, std::uint64_t b) { return key(a) < key(b); });
    }
  }

  static constexpr std::size_t kMostShared = 1000;

  // A spanning tree: the parent of a frame is the earlier frame that shares most landmarks with it.
  void find_parents() {
    children_.resize(map_.frame_count());
    for (std::uint32_t i = 0; i < map_.frame_count(); ++i) {
      std::map<std::uint32_t, std::size_t> shared;
      for (const std::uint64_t k : keypoints_[i]) {
        auto others = map_.observing_frames(LandmarkIndex{landmark_of_[k]});
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
      if (parents_.back()) children_[*parents_.back()].push_back(i);
    }
  }

  void write_cameras() {
    out_.begin_map(map_.cameras().size());
    for (const Camera& camera : map_.cameras()) {
      const StellaCamera c = stella_camera(camera).value_or(StellaCamera{});
      const bool is_fisheye = c.model_type == "Fisheye";
      out_.text(camera_name(camera));
      out_.begin_map(is_fisheye ? 17 : 18);
      const auto number = [&](std::string_view key, double value) {
        out_.text(key);
        out_.number(value);
      };
      const auto text = [&](std::string_view key, std::string_view value) {
        out_.text(key);
        out_.text(value);
      };
      const auto whole = [&](std::string_view key, std::int64_t value) {
        out_.text(key);
        out_.whole(value);
      };
      text("color_order", "Gray");
      whole("cols", camera.width);
      number("cx", c.cx.value_or(0.0));
      number("cy", c.cy.value_or(0.0));
      number("focal_x_baseline", 0.0);
      number("fps", 30.0);
      number("fx", c.fx.value_or(0.0));
      number("fy", c.fy.value_or(0.0));
      number("k1", c.k1);
      number("k2", c.k2);
      number("k3", c.k3);
      if (is_fisheye) number("k4", c.k4);
      text("model_type", c.model_type);
      whole("num_grid_cols", 64);
      whole("num_grid_rows", 48);
      if (!is_fisheye) {
        number("p1", c.p1);
        number("p2", c.p2);
      }
      whole("rows", camera.height);
      text("setup_type", "Monocular");
    }
  }

  // Where the keypoint is in the undistorted image.
  Pixel undistorted(const Camera& camera, const Pixel& pixel) {
    if (camera.model == "PINHOLE" || camera.model == "SIMPLE_PINHOLE") return pixel;
    const Intrinsics k = intrinsics(camera);
    if (const auto x = unproject(camera, pixel)) {
      return {k.fx * x->x() + k.cx, k.fy * x->y() + k.cy};
    }
    ++folded_;
    return pixel;
  }

  void write_keyframe(std::uint32_t i) {
    const FrameTable& frames = map_.frames();
    const ObservationTable& observations = map_.observations();
    const Camera& camera = map_.cameras()[frames.cameras[i]->value];
    const auto& of_frame = keypoints_[i];
    out_.text(std::to_string(frame_ids_[i]));
    out_.begin_map(14);
    out_.text("cam");
    out_.text(camera_name(camera));
    out_.text("depths");
    out_.begin_array(0);
    out_.text("descs");
    out_.begin_array(of_frame.size());
    for (const std::uint64_t k : of_frame) write_descriptor(k);
    out_.text("lm_ids");
    out_.begin_array(of_frame.size());
    for (const std::uint64_t k : of_frame) {
      out_.whole(static_cast<std::int64_t>(landmark_ids_[landmark_of_[k]]));
    }
    out_.text("loop_edges");
    out_.begin_array(0);
    out_.text("n_keypts");
    out_.whole(static_cast<std::int64_t>(of_frame.size()));
    out_.text("orb_params");
    out_.text(kOrbParameters);
    const auto& q = frames.quaternions[i];
    out_.text("rot_cw");
    out_.begin_array(4);
    for (std::size_t j = 1; j < 4; ++j) out_.number(-q[j]);
    out_.number(q[0]);
    out_.text("span_children");
    out_.begin_array(children_[i].size());
    for (const std::uint32_t child : children_[i]) {
      out_.whole(static_cast<std::int64_t>(frame_ids_[child]));
    }
    out_.text("span_parent");
    out_.whole(parents_[i] ? static_cast<std::int64_t>(frame_ids_[*parents_[i]]) : -1);
    const Eigen::Vector3d t =
        map_.world_from_camera(FrameIndex{i}).inverse() * Eigen::Vector3d::Zero();
    out_.text("trans_cw");
    out_.begin_array(3);
    for (int j = 0; j < 3; ++j) out_.number(t[j]);
    out_.text("ts");
    out_.number(frames.timestamps_s.empty() ? 0.0 : frames.timestamps_s[i].value_or(0.0));
    out_.text("undist_keypts");
    out_.begin_array(of_frame.size());
    for (const std::uint64_t k : of_frame) {
      const std::int32_t octave =
          observations.octaves.empty() ? 0 : observations.octaves[k].value_or(0);
      const Pixel pixel = undistorted(camera, observations.pixels[k]);
      most_octave_ = std::max(most_octave_, octave);
      out_.begin_map(3);
      out_.text("ang");
      out_.number(-1.0);  // OpenCV's value for unknown
      out_.text("oct");
      out_.whole(octave);
      out_.text("pt");
      out_.begin_array(2);
      out_.number(pixel.u);
      out_.number(pixel.v);
    }
    out_.text("x_rights");
    out_.begin_array(0);
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

  // The observations after the first have the landmark's further descriptors, one each.
  std::span<const std::uint8_t> descriptor_of(std::uint64_t observation) const {
    const std::uint32_t landmark = landmark_of_[observation];
    const std::uint64_t place = observation - map_.observations().offsets[landmark];
    return map_.landmarks().descriptors->descriptor(landmark,
                                                    place <= further_written(landmark) ? place : 0);
  }

  void write_descriptor(std::uint64_t observation) {
    out_.begin_array(kOrbBytes / 4);
    const std::span<const std::uint8_t> bytes =
        has_orb() ? descriptor_of(observation) : std::span<const std::uint8_t>();
    for (std::size_t word = 0; word < kOrbBytes / 4; ++word) {
      std::uint32_t value = 0;
      if (!bytes.empty()) {
        for (std::size_t j = 0; j < 4; ++j) {
          value |= std::uint32_t{bytes[4 * word + j]} << (8 * j);
        }
      }
      out_.whole(value);
    }
  }

  void write_landmark(LandmarkIndex landmark) {
    const auto frames = map_.observing_frames(landmark);
    if (frames.empty()) return;
    const auto count = [&](const char* name) {
      const NamedColumn* const column = map_.column(name);
      const double value = column == nullptr ? std::numeric_limits<double>::quiet_NaN()
                                             : column->values[landmark.value];
      const bool is_count = value >= 0.0 && value < 4294967296.0;
      return is_count ? static_cast<std::int64_t>(value) : static_cast<std::int64_t>(frames.size());
    };
    const auto first = *std::min_element(frames.begin(), frames.end());
    out_.text(std::to_string(landmark_ids_[landmark.value]));
    out_.begin_map(5);
    out_.text("1st_keyfrm");
    out_.whole(static_cast<std::int64_t>(frame_ids_[first.value]));
    out_.text("n_fnd");
    out_.whole(count("found"));
    out_.text("n_vis");
    out_.whole(count("visible"));
    out_.text("pos_w");
    out_.begin_array(3);
    for (int j = 0; j < 3; ++j) out_.number(map_.landmarks().positions[landmark.value][j]);
    out_.text("ref_keyfrm");
    out_.whole(static_cast<std::int64_t>(frame_ids_[first.value]));
  }

  // The defaults of stella_vslam.
  void write_orb_parameters() {
    constexpr std::int32_t kLevels = 8;
    out_.begin_map(1);
    out_.text(kOrbParameters);
    out_.begin_map(5);
    out_.text("ini_fast_threshold");
    out_.whole(20);
    out_.text("min_fast_threshold");
    out_.whole(7);
    out_.text("name");
    out_.text(kOrbParameters);
    out_.text("num_levels");
    out_.whole(std::max(kLevels, most_octave_ + (most_octave_ < kMostOctave ? 1 : 0)));
    out_.text("scale_factor");
    out_.number(1.2);
  }

  void flush() {
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (bytes_.size() < kLarge) return;
    sink_(bytes_);
    bytes_.clear();
  }

  void remark() const {
    if (!options_.log) return;
    const auto say = [&](const std::string& text, RemarkKind kind = RemarkKind::kLoss) {
      options_.log({"stella_vslam: " + text, kind});
    };
    static constexpr std::array<std::string_view, 2> kColumns = {"visible", "found"};
    const detail::Holdings holdings{.image_names = false,
                                    .timestamps = true,
                                    .octaves = true,
                                    .colors = false,
                                    .descriptors = has_orb() ? "ORB" : "",
                                    .further_descriptors = holds_further(),
                                    .columns = kColumns};
    const std::string lost = detail::loss_remark(map_, holdings, "", "stella_vslam");
    if (!lost.empty()) options_.log({lost, RemarkKind::kLoss});
    if (observed_ < map_.landmark_count()) {
      say(fmt::format("{} landmarks without an observation have no place; left out",
                      map_.landmark_count() - observed_));
    }
    if (!has_orb()) {
      say("the landmarks have no ORB descriptors, so those of the keypoints are zero: stella_vslam "
          "cannot relocalise in this map",
          RemarkKind::kInformation);
    }
    if (renumbered_) say("ids are too large: numbered from 0");
    if (folded_ > 0) say(fmt::format("{} pixels have no line of sight; left distorted", folded_));
  }

  static constexpr std::int32_t kMostOctave = std::numeric_limits<std::int32_t>::max();

  const LandmarkMap& map_;
  const ByteSink& sink_;
  const MapWriteOptions& options_;
  std::string bytes_;
  MsgpackWriter out_;
  std::vector<std::uint64_t> frame_ids_;
  std::vector<std::uint64_t> landmark_ids_;
  std::vector<std::vector<std::uint64_t>> keypoints_;  // of each frame: observations
  std::vector<std::uint32_t> landmark_of_;             // of each observation
  std::vector<std::optional<std::uint32_t>> parents_;
  std::vector<std::vector<std::uint32_t>> children_;
  std::size_t observed_ = 0;
  std::size_t folded_ = 0;
  std::int32_t most_octave_ = 0;
  bool renumbered_ = false;
};

}  // namespace

LandmarkMap read_stella(ByteSource& source, const MapReadOptions& options) {
  detail::ReadingProgress progress(options, source.size().value_or(0));
  detail::BinaryRecords records(source, progress);
  MsgpackReader in(records);
  detail::StellaBuilder out(source.name(), options);
  bool has_landmarks = false;
  for_each_key(in, "map", [&](const std::string& key) {
    if (key == "cameras") {
      for_each_key(in, key,
                   [&](const std::string& name) { out.add_camera(name, read_camera(in)); });
    } else if (key == "keyframes") {
      for_each_key(in, key, [&](const std::string& id) {
        read_keyframe(in, id_of(in, id, "keyframe id"), out);
      });
    } else if (key == "landmarks") {
      has_landmarks = true;
      for_each_key(in, key, [&](const std::string& id) {
        read_landmark(in, id_of(in, id, "landmark id"), out);
      });
    } else {
      in.skip();
    }
  });
  if (!has_landmarks) in.refuse("map", "has no landmarks", "a map with landmarks");
  records.expect_end();
  return std::move(out).finish();
}

void write_stella(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options) {
  Writer(map, sink, options).write();
}

std::vector<MapFormat> stella_formats() {
  return {
      {.name = "stella",
       .title = "stella_vslam",
       .endings = {".msg"},
       .recognises = [](const MapInput& input) { return looks_like_stella(input.first_bytes); },
       .read = [](const MapInput& input,
                  const MapReadOptions& options) { return read_stella(*input.source, options); },
       .write_to = [](const LandmarkMap& map, const ByteSink& sink,
                      const MapWriteOptions& options) { write_stella(map, sink, options); }}};
}

}  // namespace cairn
