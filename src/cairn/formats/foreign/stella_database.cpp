// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/database_file.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/stella_builder.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {
namespace {

using Bytes = std::span<const std::byte>;

// OpenCV's cv::KeyPoint in memory.
struct StoredKeypoint {
  float x;
  float y;
  float size;
  float angle;
  float response;
  std::int32_t octave;
  std::int32_t class_id;
};
static_assert(sizeof(StoredKeypoint) == 28);

class StellaDatabaseReader {
 public:
  StellaDatabaseReader(sqlite::Database& database, const Execution& execution)
      : database_(database), out_(database.name(), execution) {}

  LandmarkMap read() {
    read_cameras();
    read_associations();
    read_keyframes();
    read_landmarks();
    return std::move(out_).finish();
  }

 private:
  [[noreturn]] void refuse(const std::string& where, std::string_view what,
                           std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", database_.name(), where), what, expected);
  }

  // Records of this size; the blob must contain a whole number of them. NULL has none.
  template <class Record>
  std::vector<Record> records(const std::optional<Bytes>& bytes, const std::string& where) const {
    if (!bytes) return {};
    if (bytes->size() % sizeof(Record) != 0) {
      refuse(where, fmt::format("{} bytes", bytes->size()),
             fmt::format("a multiple of {}", sizeof(Record)));
    }
    std::vector<Record> result(bytes->size() / sizeof(Record));
    if (!result.empty()) std::memcpy(result.data(), bytes->data(), bytes->size());
    return result;
  }

  std::uint64_t id(std::int64_t value, const char* table) const {
    if (value < 0) refuse(table, fmt::format("id {}", value), "0 or more");
    return static_cast<std::uint64_t>(value);
  }

  // Names are stored as blobs.
  static std::string name(const sqlite::Statement& row, int column) {
    if (row.type(column) == sqlite::ColumnType::kText) return std::string(row.text(column));
    const Bytes bytes = row.optional_blob(column).value_or(Bytes{});
    std::string text(bytes.size(), '\0');
    if (!bytes.empty()) std::memcpy(text.data(), bytes.data(), bytes.size());
    return text;
  }

  void read_cameras() {
    if (!database_.has_table("cameras")) return;
    auto row = database_.prepare(
        "SELECT name, setup_type, model_type, cols, rows, fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, "
        "distortion FROM cameras ORDER BY id");
    while (row.step()) {
      StellaCamera camera;
      camera.setup_type = name(row, 1);
      camera.model_type = name(row, 2);
      const auto size = [&](int column) {
        const std::int64_t value = row.integer(column);
        const bool fits = value >= 0 && value <= std::numeric_limits<std::uint32_t>::max();
        return fits ? static_cast<std::uint32_t>(value) : 0U;
      };
      camera.width = size(3);
      camera.height = size(4);
      camera.fx = row.optional_real(5);
      camera.fy = row.optional_real(6);
      camera.cx = row.optional_real(7);
      camera.cy = row.optional_real(8);
      camera.distortion.k1 = row.optional_real(9).value_or(0.0);
      camera.distortion.k2 = row.optional_real(10).value_or(0.0);
      camera.distortion.p1 = row.optional_real(11).value_or(0.0);
      camera.distortion.p2 = row.optional_real(12).value_or(0.0);
      camera.distortion.k3 = row.optional_real(13).value_or(0.0);
      camera.distortion.k4 = row.optional_real(14).value_or(0.0);
      camera.division = row.optional_real(15).value_or(0.0);
      out_.add_camera(name(row, 0), camera);
    }
  }

  void read_associations() {
    auto row = database_.prepare("SELECT id, lm_ids FROM associations ORDER BY id");
    while (row.step()) {
      const std::int64_t keyframe = row.integer(0);
      landmarks_of_[keyframe] = records<std::int32_t>(
          row.optional_blob(1), fmt::format("associations {}: lm_ids", keyframe));
    }
  }

  void read_keyframes() {
    if (column_or_null(database_, "keyframes", "undist_keypts") == "NULL") {
      refuse("keyframes", "has no column undist_keypts", "a map of stella_vslam 0.3 or newer");
    }
    auto row = database_.prepare(
        "SELECT id, ts, cam, pose_cw, undist_keypts, depths, descs FROM keyframes ORDER BY id");
    while (row.step()) {
      StellaKeyframe keyframe;
      const std::int64_t stored_id = row.integer(0);
      const std::string where = fmt::format("keyframes {}", stored_id);
      keyframe.id = id(stored_id, "keyframes");
      const auto time = row.optional_real(1);
      if (time && std::isfinite(*time)) keyframe.timestamp_s = time;
      keyframe.camera = name(row, 2);
      set_pose(keyframe, records<double>(row.optional_blob(3), where + ": pose_cw"), where);
      for (const StoredKeypoint& k :
           records<StoredKeypoint>(row.optional_blob(4), where + ": undist_keypts")) {
        if (!std::isfinite(k.x) || !std::isfinite(k.y)) {
          refuse(where + ": undist_keypts", "a pixel is not finite", "numbers");
        }
        keyframe.undistorted.push_back({double{k.x}, double{k.y}});
        keyframe.octaves.push_back(k.octave);
      }
      keyframe.depths = records<float>(row.optional_blob(5), where + ": depths");
      keyframe.descriptors =
          records<std::array<std::uint8_t, kOrbBytes>>(row.optional_blob(6), where + ": descs");
      std::vector<std::int64_t> landmarks;
      if (const auto found = landmarks_of_.find(stored_id); found != landmarks_of_.end()) {
        landmarks.assign(found->second.begin(), found->second.end());
      }
      const std::string defect = out_.add_keyframe(keyframe, landmarks);
      if (!defect.empty()) refuse(where, defect, "a keyframe of stella_vslam");
    }
  }

  // 4 x 4 doubles, column by column.
  void set_pose(StellaKeyframe& keyframe, const std::vector<double>& numbers,
                const std::string& where) const {
    if (numbers.size() != 16) {
      refuse(where + ": pose_cw", fmt::format("{} numbers", numbers.size()), "16 of them");
    }
    const Eigen::Map<const Eigen::Matrix4d> pose(numbers.data());
    const Eigen::Matrix3d rotation = pose.topLeftCorner<3, 3>();
    if (!pose.allFinite() || !is_rotation(rotation)) {
      refuse(where + ": pose_cw", "is no rigid motion", "a rotation and a translation");
    }
    keyframe.rotation_cw = Eigen::Quaterniond(rotation);
    keyframe.translation_cw = pose.topRightCorner<3, 1>();
  }

  void read_landmarks() {
    auto row = database_.prepare("SELECT id, pos_w, n_vis, n_fnd FROM landmarks ORDER BY id");
    while (row.step()) {
      const std::int64_t stored_id = row.integer(0);
      const std::string where = fmt::format("landmarks {}: pos_w", stored_id);
      const auto numbers = records<double>(row.optional_blob(1), where);
      if (numbers.size() != 3)
        refuse(where, fmt::format("{} numbers", numbers.size()), "3 of them");
      out_.add_landmark(id(stored_id, "landmarks"), {numbers[0], numbers[1], numbers[2]},
                        row.optional_real(2), row.optional_real(3));
    }
  }

  sqlite::Database& database_;
  StellaBuilder out_;
  std::unordered_map<std::int64_t, std::vector<std::int32_t>> landmarks_of_;
};

}  // namespace

LandmarkMap read_stella_database(const std::filesystem::path& path, const Execution& execution) {
  sqlite::Database database = open_foreign_database(path, execution);
  return StellaDatabaseReader(database, execution).read();
}

}  // namespace cairn::detail
