// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/detail/disjoint_sets.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/foreign/database_file.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/rtabmap_graph.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

struct Calibration {
  std::optional<Camera> camera;
  Rigid3 base_from_camera;
};

// The first camera of a calibration, in any of RTAB-Map's forms; std::nullopt for other data.
class CalibrationReader {
 public:
  explicit CalibrationReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  std::optional<Calibration> read() {
    constexpr std::size_t kHeader = 11 * sizeof(std::int32_t);
    // Since 0.18, version numbers are first, which would be tiny as float32.
    if (bytes_.size() >= kHeader && word(0) >= 0 && word(0) < 100 && word(1) >= 0 &&
        word(1) < 1000) {
      if (word(3) == 0) return mono(0);
      if (word(3) == 1) return stereo();
      return std::nullopt;
    }
    return old_form();
  }

 private:
  std::int32_t word(std::size_t index) const { return at<std::int32_t>(index * 4); }
  template <class Number>
  Number at(std::size_t byte) const {
    Number value{};
    if (byte + sizeof value <= bytes_.size()) {
      std::memcpy(&value, bytes_.data() + byte, sizeof value);
    }
    return value;
  }

  // Header, then K, D, R, P as doubles, then the pose of the camera on the robot.
  std::optional<Calibration> mono(std::size_t start) const {
    const std::size_t first = start / 4;
    const std::int32_t width = word(first + 4);
    const std::int32_t height = word(first + 5);
    std::array<std::size_t, 5> sizes{};
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const std::int32_t size = word(first + 6 + i);
      if (size < 0 || size > 64) return std::nullopt;
      sizes[i] = static_cast<std::size_t>(size);
    }
    const std::size_t k = start + 44;
    const std::size_t d = k + 8 * sizes[0];
    const std::size_t r = d + 8 * sizes[1];
    const std::size_t p = r + 8 * sizes[2];
    const std::size_t local = p + 8 * sizes[3];
    if (local + 4 * sizes[4] > bytes_.size() || width < 0 || height < 0) return std::nullopt;
    Calibration result;
    if (sizes[4] == 12) {
      if (const auto pose = pose_of_floats(bytes_.subspan(local, 48))) {
        result.base_from_camera = *pose;
      }
    }
    if (sizes[0] == 9) {
      // Features are in the rectified image if there is one.
      const bool is_rectified = sizes[3] == 12;
      const std::size_t matrix = is_rectified ? p : k;
      const std::size_t row = is_rectified ? 4 : 3;
      Camera camera{CameraId{0},
                    "PINHOLE",
                    static_cast<std::uint32_t>(width),
                    static_cast<std::uint32_t>(height),
                    {at<double>(matrix), at<double>(matrix + 8 * (row + 1)),
                     at<double>(matrix + 16), at<double>(matrix + 8 * (row + 2))}};
      if (!is_rectified && (sizes[1] == 4 || sizes[1] == 5 || sizes[1] == 8)) {
        std::array<double, 8> c{};
        for (std::size_t i = 0; i < sizes[1]; ++i) c[i] = at<double>(d + 8 * i);
        if (std::any_of(c.begin(), c.end(), [](double x) { return x != 0.0; })) {
          camera.model = "FULL_OPENCV";
          camera.parameters.insert(camera.parameters.end(), c.begin(), c.end());
        }
      }
      result.camera = std::move(camera);
    }
    return result;
  }

  std::optional<Calibration> stereo() const {
    std::size_t start = 40;
    for (std::size_t i = 4; i < 8; ++i) {
      if (word(i) < 0 || word(i) > 64) return std::nullopt;
      start += 8 * static_cast<std::size_t>(word(i));
    }
    return start + 44 <= bytes_.size() ? mono(start) : std::nullopt;
  }

  // fx, fy, cx, cy, width, height (mono) or baseline (stereo, without a size before 0.11.10), then the pose.
  std::optional<Calibration> old_form() const {
    constexpr std::size_t kPose = 12 * sizeof(float);
    Calibration result;
    std::size_t numbers = 0;
    if (bytes_.size() % (24 + kPose) == 0) {
      numbers = 6;
    } else if (bytes_.size() == 28 + kPose) {
      numbers = 7;
    } else {
      return std::nullopt;
    }
    const auto pose = pose_of_floats(bytes_.subspan(4 * numbers, kPose));
    if (!pose) return std::nullopt;
    result.base_from_camera = *pose;
    const auto value = [&](std::size_t i) { return double{at<float>(4 * i)}; };
    const auto size = [&](std::size_t i) {
      const double x = value(i);
      return x >= 0.0 && x < 1e9 ? static_cast<std::uint32_t>(x) : 0U;
    };
    result.camera = Camera{CameraId{0},
                           "PINHOLE",
                           size(numbers - 2),
                           size(numbers - 1),
                           {value(0), value(1), value(2), value(3)}};
    return result;
  }

  std::span<const std::byte> bytes_;
};

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

struct Feature {
  std::uint32_t frame = 0;
  std::uint32_t keypoint = 0;
  std::int64_t word = 0;
  Pixel pixel;
  std::int32_t octave = 0;
  std::optional<Eigen::Vector3d> in_camera;
  std::uint32_t descriptor = kNone;  // place among those that are known
};

std::string descriptor_kind(sqlite::Database& database) {
  // As RTAB-Map numbers its detectors: the descriptor of each.
  constexpr std::array<const char*, 16> kKinds = {
      "SURF", "SIFT", "ORB", "FREAK",      "BRIEF", "FREAK", "BRIEF", "BRISK",
      "ORB",  "KAZE", "ORB", "SUPERPOINT", "FREAK", "DAISY", "DAISY", "unknown"};
  if (database.columns("Info").empty()) return "unknown";
  auto rows = database.prepare("SELECT parameters FROM Info LIMIT 1");
  if (!rows.step()) return "unknown";
  const std::string parameters(rows.optional_text(0).value_or(""));
  constexpr std::string_view kKey = "Kp/DetectorStrategy:";
  const std::size_t place = parameters.find(kKey);
  if (place == std::string::npos) return "unknown";
  const std::string_view value = std::string_view(parameters).substr(place + kKey.size());
  const auto number = parse_unsigned(value.substr(0, value.find(';')));
  return number && *number < kKinds.size() ? kKinds.at(*number) : "unknown";
}

class MapReader {
 public:
  MapReader(sqlite::Database& database, const Execution& execution)
      : database_(database),
        file_bytes_(FileReader(database.name()).size().value_or(0)),
        graph_(database, execution),
        out_(database.name(), execution) {}

  LandmarkMap read() {
    read_calibrations();
    for (std::size_t i = 0; i < graph_.nodes.size(); ++i) add_frame(i);
    read_features();
    group();
    make_landmarks();
    remark_on_closures();
    return std::move(out_).finish({.length_unit = LengthUnit::kMetres});
  }

 private:
  void read_calibrations() {
    calibrations_.resize(graph_.nodes.size());
    if (database_.columns("Data").empty()) return;
    std::size_t unknown = 0;
    auto rows = database_.prepare("SELECT id, calibration FROM Data ORDER BY id");
    while (rows.step()) {
      const auto node = graph_.find(rows.integer(0));
      const auto bytes = rows.optional_blob(1);
      if (!node || !bytes) continue;
      calibrations_[*node] = CalibrationReader(*bytes).read();
      auto& calibration = calibrations_[*node];
      if (calibration && calibration->camera && !camera_defect(*calibration->camera).empty()) {
        calibration->camera.reset();
      }
      unknown += !calibration || !calibration->camera ? 1 : 0;
    }
    out_.lost(unknown, "calibrations are unknown to the map");
  }

  void add_frame(std::size_t i) {
    const RtabmapNode& node = graph_.nodes[i];
    const Rigid3 pose = node.world_from_base * base_from_camera(i);
    std::optional<CameraIndex> camera;
    if (calibrations_[i] && calibrations_[i]->camera) camera = index_of(*calibrations_[i]->camera);
    world_from_camera_.push_back(pose);
    out_.add_frame({.id = FrameId{node.id},
                    .world_from_camera = pose.quaternion(),
                    .centre = pose.translation(),
                    .camera = camera,
                    .image_name = node.label,
                    .timestamp_s = node.stamp_s,
                    .gnss = node.gnss});
  }

  Rigid3 base_from_camera(std::size_t node) const {
    return calibrations_[node] ? calibrations_[node]->base_from_camera : Rigid3();
  }

  CameraIndex index_of(const Camera& camera) {
    std::vector<Camera>& cameras = out_.tables().cameras;
    const auto same = std::find_if(cameras.rbegin(), cameras.rend(), [&](const Camera& other) {
      return is_same_lens(other, camera);
    });
    if (same != cameras.rend()) {
      return CameraIndex{static_cast<std::uint32_t>(cameras.rend() - same - 1)};
    }
    cameras.push_back(camera);
    cameras.back().id = CameraId{cameras.size() - 1};
    return CameraIndex{static_cast<std::uint32_t>(cameras.size() - 1)};
  }

  // Null if unknown.
  const Camera* camera_of(std::uint32_t frame) const {
    const auto index = out_.tables().frames.cameras[frame];
    return index ? &out_.tables().cameras[index->value] : nullptr;
  }

  void read_features() {
    if (database_.columns("Feature").empty()) return;
    const auto column = [&](const char* name) {
      return column_or_null(database_, "Feature", name);
    };
    auto rows = database_.prepare(
        fmt::format("SELECT node_id, word_id, pos_x, pos_y, {}, {}, {}, {}, {}, {} FROM Feature "
                    "ORDER BY node_id, rowid",
                    column("depth_x"), column("depth_y"), column("depth_z"), column("octave"),
                    column("descriptor_size"), column("descriptor")));
    std::size_t unposed = 0;
    std::size_t of_other_cameras = 0;
    std::uint32_t keypoint = 0;
    std::int64_t last_node = -1;
    while (rows.step()) {
      const std::int64_t node = rows.integer(0);
      if (node != last_node) keypoint = 0;
      last_node = node;
      const auto frame = graph_.find(node);
      Feature feature;
      feature.keypoint = keypoint++;
      if (!frame) {
        ++unposed;
        continue;
      }
      feature.frame = *frame;
      feature.word = rows.integer(1);
      feature.pixel = {rows.real(2), rows.real(3)};
      if (!std::isfinite(feature.pixel.u) || !std::isfinite(feature.pixel.v)) {
        refuse_database(database_, fmt::format("Feature of node {}", node),
                        "the pixel is not finite", "numbers");
      }
      const Camera* const camera = camera_of(*frame);
      // The images of several cameras lie side by side.
      if (camera != nullptr && feature.pixel.u >= camera->width) {
        ++of_other_cameras;
        continue;
      }
      feature.octave = static_cast<std::int32_t>(
          std::clamp<std::int64_t>(rows.optional_integer(7).value_or(0), 0, 1 << 30));
      const auto x = finite(rows.optional_real(4));
      const auto y = finite(rows.optional_real(5));
      const auto z = finite(rows.optional_real(6));
      if (x && y && z) {
        const Eigen::Vector3d in_base(*x, *y, *z);
        const Eigen::Vector3d in_camera = base_from_camera(*frame).inverse() * in_base;
        if (!in_base.isZero() && in_camera.z() > 0.0) feature.in_camera = in_camera;
      }
      if (take_descriptor(rows.optional_blob(9), rows.optional_integer(8).value_or(0))) {
        feature.descriptor = descriptors_++;
      }
      features_.push_back(feature);
    }
    out_.lost(unposed, "features of nodes without a pose are left out");
    out_.lost(of_other_cameras, "features of a second or further camera are left out");
  }

  // All of a database are of one size and type: that of the first. @return whether there is one of them
  bool take_descriptor(std::optional<std::span<const std::byte>> blob, std::int64_t size) {
    const auto count = static_cast<std::size_t>(
        std::clamp<std::int64_t>(size, 0, std::int64_t{kMostDescriptorBytes}));
    const bool is_known =
        blob && count > 0 && (blob->size() == count || blob->size() == sizeof(float) * count);
    if (is_known && descriptor_bytes_ == 0) {
      descriptor_bytes_ = count;
      stored_bytes_ = blob->size();
    }
    const bool fits = is_known && count == descriptor_bytes_ && blob->size() == stored_bytes_;
    if (fits) {
      const auto* const begin = reinterpret_cast<const std::uint8_t*>(blob->data());
      bytes_.insert(bytes_.end(), begin, begin + blob->size());
      // Rows of a damaged database may share a page.
      require_descriptor_budget(bytes_.size(), file_bytes_, database_.name());
    }
    return fits;
  }

  std::span<const std::uint8_t> descriptor(const Feature& feature) const {
    if (feature.descriptor == kNone) return {};
    return std::span(bytes_).subspan(feature.descriptor * descriptor_bytes_, descriptor_bytes_);
  }

  bool are_floats() const { return stored_bytes_ > descriptor_bytes_; }

  // Descriptors of float32 become one byte per number.
  void finish_floats() {
    if (!are_floats()) return;
    std::vector<float> values(bytes_.size() / sizeof(float));
    std::memcpy(values.data(), bytes_.data(), values.size() * sizeof(float));
    bytes_.resize(values.size());
    to_bytes<float>(values, bytes_);
  }

  Eigen::Vector3d in_world(const Feature& feature) const {
    return world_from_camera_[feature.frame] * *feature.in_camera;
  }

  static double tolerance_m(const Feature& feature) {
    // A depth camera's error grows with the square of the depth.
    const double z = feature.in_camera->z();
    return 0.05 + 0.01 * z * z;
  }

  // Distance in pixels between a feature and the projection of a world point into its frame; std::nullopt if
  // there is none.
  std::optional<double> pixels_off(const Feature& feature,
                                   const Eigen::Vector3d& x_in_world) const {
    const Camera* const camera = camera_of(feature.frame);
    if (camera == nullptr) return std::nullopt;
    const auto pixel = project(*camera, world_from_camera_[feature.frame].inverse() * x_in_world);
    if (!pixel) return std::nullopt;
    return std::hypot(pixel->u - feature.pixel.u, pixel->v - feature.pixel.v);
  }

  bool agree(const Feature& a, const Feature& b) const {
    if (a.in_camera && b.in_camera) {
      return (in_world(a) - in_world(b)).norm() <= tolerance_m(a) + tolerance_m(b);
    }
    if (!a.in_camera && !b.in_camera) return false;
    const Feature& known = a.in_camera ? a : b;
    const auto off = pixels_off(a.in_camera ? b : a, in_world(known));
    return off && *off <= kMostPixelsOff;
  }

  // Unites features of one word in linked nodes.
  void group() {
    groups_ = DisjointSets(features_.size());
    // Of each frame, the words that occur once in it.
    std::vector<std::vector<std::pair<std::int64_t, std::uint32_t>>> words(graph_.nodes.size());
    for (std::uint32_t i = 0; i < features_.size(); ++i) {
      if (features_[i].word > 0) words[features_[i].frame].emplace_back(features_[i].word, i);
    }
    for (auto& of_frame : words) {
      std::sort(of_frame.begin(), of_frame.end());
      std::vector<std::pair<std::int64_t, std::uint32_t>> once;
      for (std::size_t i = 0; i < of_frame.size(); ++i) {
        const bool repeats =
            (i > 0 && of_frame[i - 1].first == of_frame[i].first) ||
            (i + 1 < of_frame.size() && of_frame[i + 1].first == of_frame[i].first);
        if (!repeats) once.push_back(of_frame[i]);
      }
      of_frame = std::move(once);
    }
    for (const RtabmapLink& link : graph_.links) {
      const bool from_is_smaller = words[link.from].size() <= words[link.to].size();
      const auto& few = words[from_is_smaller ? link.from : link.to];
      const auto& many = words[from_is_smaller ? link.to : link.from];
      for (const auto& [word, feature] : few) {
        const auto found =
            std::lower_bound(many.begin(), many.end(), std::pair(word, std::uint32_t{0}));
        if (found == many.end() || found->first != word) continue;
        if (agree(features_[feature], features_[found->second])) {
          groups_.join(feature, found->second);
        }
      }
    }
  }

  // The features of each landmark, in the order of their first ones.
  std::vector<std::vector<std::uint32_t>> groups() {
    std::vector<std::uint32_t> landmark_of(features_.size(), kNone);
    std::vector<std::vector<std::uint32_t>> members;
    for (std::uint32_t i = 0; i < features_.size(); ++i) {
      const std::size_t first = groups_.first_of(i);
      if (landmark_of[first] == kNone) {
        landmark_of[first] = static_cast<std::uint32_t>(members.size());
        members.emplace_back();
      }
      members[landmark_of[first]].push_back(i);
    }
    return members;
  }

  // Mean of the positions by depth, weighted by their certainty; std::nullopt without a depth.
  std::optional<Eigen::Vector3d> position_of(const std::vector<std::uint32_t>& group) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (const std::uint32_t i : group) {
      if (!features_[i].in_camera) continue;
      const double weight = 1.0 / (tolerance_m(features_[i]) * tolerance_m(features_[i]));
      sum += weight * in_world(features_[i]);
      weights += weight;
    }
    if (!(weights > 0.0) || !sum.allFinite()) return std::nullopt;
    return sum / weights;
  }

  // One feature per frame, the nearest to the projection of the position. Counts the others.
  std::map<std::uint32_t, std::uint32_t> nearest_of(const std::vector<std::uint32_t>& group,
                                                    const Eigen::Vector3d& position,
                                                    std::size_t& others) const {
    std::map<std::uint32_t, std::uint32_t> nearest;
    std::map<std::uint32_t, double> distances;
    for (const std::uint32_t i : group) {
      const Feature& feature = features_[i];
      const auto off = pixels_off(feature, position);
      const bool is_near =
          camera_of(feature.frame) != nullptr
              ? off && *off <= kMostPixelsOff
              : feature.in_camera && (in_world(feature) - position).norm() <= tolerance_m(feature);
      if (!is_near) {
        ++others;
        continue;
      }
      const double distance = off.value_or(0.0);
      const auto [place, is_new] = distances.try_emplace(feature.frame, distance);
      others += is_new ? 0 : 1;
      if (!is_new && distance >= place->second) continue;
      place->second = distance;
      nearest[feature.frame] = i;
    }
    return nearest;
  }

  void make_landmarks() {
    finish_floats();
    const bool is_binary = !are_floats() && descriptor_bytes_ <= 64;
    out_.set_descriptors(descriptor_kind(database_), descriptor_bytes_,
                         is_binary ? DescriptorNorm::kHamming : DescriptorNorm::kSquared);
    std::size_t without_depth = 0;
    std::size_t disagreeing = 0;
    NamedColumn words{"word", {}};
    for (const auto& group : groups()) {
      const auto position = position_of(group);
      if (!position) {
        without_depth += group.size();
        continue;
      }
      const auto nearest = nearest_of(group, *position, disagreeing);
      if (nearest.empty()) continue;
      const std::uint64_t id = out_.landmark_count();
      out_.add_landmark(id, *position);
      words.values.push_back(static_cast<double>(features_[group.front()].word));
      for (const auto& [frame, chosen] : nearest) {
        const Feature& feature = features_[chosen];
        SfmObservation observation{.landmark_id = id,
                                   .frame = FrameIndex{frame},
                                   .pixel = feature.pixel,
                                   .keypoint = feature.keypoint,
                                   .octave = feature.octave,
                                   .descriptor = descriptor(feature)};
        if (feature.in_camera) observation.depth = feature.in_camera->z();
        out_.add_observation(observation);
      }
    }
    if (!words.values.empty()) out_.tables().landmarks.columns.push_back(std::move(words));
    require_descriptor_budget(bytes_.size() + out_.descriptor_bytes_to_finish(), file_bytes_,
                              database_.name());
    out_.lost(without_depth,
              "features without a depth, and with no match that has one, are left out");
    out_.lost(disagreeing, "features are not where their word is elsewhere; left out");
    if (features_.empty()) {
      out_.remark(
          "holds no features: the map has frames only (Mem/BinDataKept and "
          "Kp/MaxFeatures decide what RTAB-Map keeps)");
    }
  }

  void remark_on_closures() const {
    const auto closures = std::count_if(graph_.links.begin(), graph_.links.end(),
                                        [](const RtabmapLink& l) { return !l.is_neighbor(); });
    if (graph_.is_optimised || closures == 0) return;
    out_.remark(
        fmt::format("holds {} loop closures but no optimised poses: the poses are those of "
                    "odometry; let RTAB-Map optimise and save the graph first",
                    closures));
  }

  static constexpr double kMostPixelsOff = 8.0;

  sqlite::Database& database_;
  std::uint64_t file_bytes_;
  RtabmapGraph graph_;
  SfmBuilder out_;
  std::vector<std::optional<Calibration>> calibrations_;  // of each node
  std::vector<Rigid3> world_from_camera_;
  std::vector<Feature> features_;
  DisjointSets groups_{0};
  std::size_t descriptor_bytes_ = 0;
  std::size_t stored_bytes_ = 0;   // as many, or four times as many if they are float32
  std::uint32_t descriptors_ = 0;  // number of those in bytes_
  std::vector<std::uint8_t> bytes_;
};

}  // namespace

LandmarkMap read_rtabmap(const fs::path& path, const Execution& execution) {
  sqlite::Database database = open_foreign_database(path, execution);
  return MapReader(database, execution).read();
}

}  // namespace cairn::detail
