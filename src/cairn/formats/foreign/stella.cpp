// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/msgpack.hpp"
#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/stella_builder.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint64_t kMostStella = std::numeric_limits<std::uint32_t>::max();

// Calls `read` with each key; it takes the value.
template <class Read>
void for_each_key(MsgpackReader& in, std::string_view field, const Read& read) {
  const std::uint64_t count = in.begin_map(field);
  for (std::uint64_t i = 0; i < count; ++i) read(in.text(field));
}

std::uint64_t id_of(const MsgpackReader& in, const std::string& key, std::string_view field) {
  const auto id = parse_unsigned(key);
  if (!id || *id > kMostStella) {
    in.refuse(field, printable(key) + " is no id", fmt::format("0 to {}", kMostStella));
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
  Distortion& d = camera.distortion;
  const std::map<std::string_view, double*> distortion = {{"k1", &d.k1},
                                                          {"k2", &d.k2},
                                                          {"p1", &d.p1},
                                                          {"p2", &d.p2},
                                                          {"k3", &d.k3},
                                                          {"k4", &d.k4},
                                                          {"distortion", &camera.division}};
  const std::map<std::string_view, std::optional<double>*> pinhole = {
      {"fx", &camera.fx}, {"fy", &camera.fy}, {"cx", &camera.cx}, {"cy", &camera.cy}};
  const auto size = [&](std::string_view field) {
    const std::int64_t value = in.whole(field);
    return value >= 0 && value <= std::int64_t{kMostStella} ? static_cast<std::uint32_t>(value)
                                                            : 0U;
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

void read_orb(MsgpackReader& in, StellaKeyframe& keyframe) {
  const std::uint64_t count = in.begin_array("descs");
  for (std::uint64_t i = 0; i < count; ++i) {
    in.begin_array("descriptor", kOrbBytes / 4);
    auto& bytes = keyframe.descriptors.emplace_back();
    for (std::size_t word = 0; word < kOrbBytes / 4; ++word) {
      const auto value = static_cast<std::uint64_t>(in.whole("descriptor"));
      if (value > kMostStella) in.refuse("descriptor", "a word is too large", "32 bits");
      for (std::size_t j = 0; j < 4; ++j) {
        bytes[4 * word + j] = static_cast<std::uint8_t>(value >> (8 * j) & 0xffU);
      }
    }
  }
}

void read_keyframe(MsgpackReader& in, std::uint64_t id, StellaBuilder& out) {
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
      read_orb(in, keyframe);
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

void read_landmark(MsgpackReader& in, std::uint64_t id, StellaBuilder& out) {
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

}  // namespace

bool is_stella(const MapInput& input) {
  const std::string_view bytes = input.first_bytes;
  if (bytes.size() < 2 || (static_cast<unsigned char>(bytes[0]) & 0xf0U) != 0x80) return false;
  const auto head = static_cast<unsigned char>(bytes[1]);
  if ((head & 0xe0U) != 0xa0) return false;
  const std::string_view key = bytes.substr(2, head & 0x1fU);
  constexpr std::array<std::string_view, 7> kKeys = {
      "cameras",          "frame_next_id", "keyframe_next_id", "keyframes",
      "landmark_next_id", "landmarks",     "orb_params"};
  return std::find(kKeys.begin(), kKeys.end(), key) != kKeys.end();
}

LandmarkMap read_stella(ByteSource& source, const Execution& execution) {
  ReadingProgress progress(execution, source.size().value_or(0));
  BinaryRecords records(source, progress);
  MsgpackReader in(records);
  StellaBuilder out(source.name(), execution);
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

}  // namespace cairn::detail
