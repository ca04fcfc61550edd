// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/rtabmap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/zlib_stream.hpp"
#include "cairn/formats/detail/foreign/database_file.hpp"
#include "cairn/formats/detail/foreign/described_observations.hpp"
#include "cairn/formats/detail/foreign/descriptor_bytes.hpp"
#include "cairn/formats/detail/foreign/float_pose.hpp"
#include "cairn/formats/losses.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/storage/sqlite/database.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Kinds of links, as RTAB-Map numbers them.
constexpr std::int64_t kNeighbor = 0;
constexpr std::int64_t kUserClosure = 4;
constexpr std::int64_t kVirtualClosure = 5;
constexpr std::int64_t kNeighborMerged = 6;

struct Node {
  std::uint64_t id = 0;
  Rigid3 world_from_base;
  std::optional<double> stamp_s;
  std::string label;
  std::uint64_t session = 0;
  std::optional<GnssFix> gnss = {};
};

struct GraphLink {
  std::uint32_t from = 0;  // places in the nodes
  std::uint32_t to = 0;
  std::int64_t type = kNeighbor;
  std::optional<Rigid3> from_from_to;
  std::optional<Matrix6d> covariance;
};

[[noreturn]] void refuse(const sqlite::Database& database, const std::string& where,
                         std::string_view what, std::string_view expected) {
  throw Error(ErrorKind::kInput, fmt::format("{}: {}", database.name(), where), what, expected);
}

std::optional<double> finite(std::optional<double> value) {
  return value && std::isfinite(*value) ? value : std::nullopt;
}

// Poses that RTAB-Map optimised and kept, by node.
std::map<std::int64_t, Rigid3> optimised_poses(sqlite::Database& database) {
  std::map<std::int64_t, Rigid3> poses;
  const auto columns = database.columns("Admin");
  const auto has = [&](const char* name) {
    return std::find(columns.begin(), columns.end(), name) != columns.end();
  };
  if (!has("opt_ids") || !has("opt_poses")) return poses;
  auto rows = database.prepare("SELECT opt_ids, opt_poses FROM Admin LIMIT 1");
  if (!rows.step()) return poses;
  const auto packed_ids = rows.optional_blob(0);
  const auto packed_poses = rows.optional_blob(1);
  if (!packed_ids || !packed_poses) return poses;
  // Rows, columns and type follow the zlib data, as three 32-bit numbers.
  constexpr std::size_t kTail = 12;
  const auto unpack = [&](std::span<const std::byte> bytes, const char* of) {
    const auto content = bytes.size() < kTail
                             ? std::nullopt
                             : detail::inflate_zlib(bytes.first(bytes.size() - kTail));
    if (!content) refuse(database, "Admin", fmt::format("{} cannot be unpacked", of), "zlib data");
    return *content;
  };
  const std::string ids = unpack(*packed_ids, "opt_ids");
  const std::string matrices = unpack(*packed_poses, "opt_poses");
  constexpr std::size_t kPose = 12 * sizeof(float);
  const std::size_t count = ids.size() / sizeof(std::int32_t);
  if (ids.size() % sizeof(std::int32_t) != 0 || matrices.size() != count * kPose) {
    refuse(database, "Admin", fmt::format("{} poses of {} nodes", matrices.size() / kPose, count),
           "a pose for each node");
  }
  for (std::size_t i = 0; i < count; ++i) {
    std::int32_t id = 0;
    std::memcpy(&id, ids.data() + i * sizeof id, sizeof id);
    const auto pose =
        detail::pose_of_floats(std::as_bytes(std::span(matrices)).subspan(i * kPose, kPose));
    if (pose) poses.emplace(id, *pose);
  }
  return poses;
}

// Nodes with a pose and the links between them.
class Graph {
 public:
  Graph(sqlite::Database& database, const MapReadOptions& options)
      : database_(database), options_(options) {
    read_nodes();
    read_links();
  }

  std::vector<Node> nodes;  // by id, ascending
  std::vector<GraphLink> links;
  bool is_optimised = false;

  std::optional<std::uint32_t> find(std::int64_t id) const {
    const auto wanted = static_cast<std::uint64_t>(id);
    const auto found =
        std::lower_bound(nodes.begin(), nodes.end(), wanted,
                         [](const Node& node, std::uint64_t x) { return node.id < x; });
    if (id < 0 || found == nodes.end() || found->id != wanted) return std::nullopt;
    return static_cast<std::uint32_t>(found - nodes.begin());
  }

  const LogSink& log() const { return options_.log; }
  void remark(const std::string& text) const { detail::log_remark(log(), database_.name(), text); }
  void lost(const std::string& text) const {
    detail::log_remark(log(), database_.name(), text, RemarkKind::kLoss);
  }

 private:
  void read_nodes() {
    const auto optimised = optimised_poses(database_);
    is_optimised = !optimised.empty();
    std::size_t without_pose = 0;
    const auto columns = database_.columns("Node");
    const bool has_gps = std::find(columns.begin(), columns.end(), "gps") != columns.end();
    auto rows = database_.prepare(
        has_gps ? "SELECT id, map_id, stamp, pose, label, gps FROM Node ORDER BY id"
                : "SELECT id, map_id, stamp, pose, label, NULL FROM Node ORDER BY id");
    std::size_t no_place = 0;
    while (rows.step()) {
      const std::int64_t id = rows.integer(0);
      if (id < 0) refuse(database_, fmt::format("Node {}", id), "a negative id", "0 or more");
      std::optional<Rigid3> pose;
      if (const auto found = optimised.find(id); found != optimised.end()) {
        pose = found->second;
      } else if (const auto bytes = rows.optional_blob(3); bytes && optimised.empty()) {
        pose = detail::pose_of_floats(*bytes);
      }
      if (!pose) {
        ++without_pose;
        continue;
      }
      Node node{static_cast<std::uint64_t>(id), *pose, finite(rows.optional_real(2)), {}};
      if (const auto label = rows.optional_text(4)) node.label = *label;
      const std::int64_t session = rows.optional_integer(1).value_or(0);
      node.session = session < 0 ? 0 : static_cast<std::uint64_t>(session);
      if (const auto bytes = rows.optional_blob(5); bytes && !bytes->empty()) {
        node.gnss = gnss_of(*bytes);
        no_place += node.gnss ? 0 : 1;
      }
      nodes.push_back(std::move(node));
    }
    if (without_pose > 0) {
      lost(fmt::format("{} nodes without {} pose are left out", without_pose,
                       is_optimised ? "an optimised" : "a"));
    }
    if (no_place > 0) {
      lost(fmt::format("GNSS positions of {} nodes are none on the Earth; left out", no_place));
    }
  }

  // From doubles: time, longitude, latitude, altitude, accuracy, bearing.
  static std::optional<GnssFix> gnss_of(std::span<const std::byte> bytes) {
    std::array<double, 6> numbers{};
    if (bytes.size() != sizeof numbers) return std::nullopt;
    std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
    GnssFix fix{{numbers[2], numbers[1], numbers[3]}, std::nullopt};
    if (!geodetic_defect(fix.position).empty()) return std::nullopt;
    if (numbers[4] > 0.0 && numbers[4] <= kLargestCoordinate) fix.accuracy_m = numbers[4];
    return fix;
  }

  void read_links() {
    const auto columns = database_.columns("Link");
    const bool is_old =
        std::find(columns.begin(), columns.end(), "information_matrix") == columns.end();
    std::size_t others = 0;
    auto rows = database_.prepare(
        is_old
            ? "SELECT from_id, to_id, type, transform, NULL FROM Link ORDER BY from_id, to_id, type"
            : "SELECT from_id, to_id, type, transform, information_matrix FROM Link "
              "ORDER BY from_id, to_id, type");
    std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
    while (rows.step()) {
      GraphLink link;
      link.type = rows.integer(2);
      const auto from = find(rows.integer(0));
      const auto to = find(rows.integer(1));
      // Priors, landmarks and gravity link a node with itself or with another object.
      const bool is_between = link.type >= kNeighbor && link.type <= kNeighborMerged &&
                              link.type != kVirtualClosure && from && to && *from != *to;
      if (!is_between) {
        ++others;
        continue;
      }
      link.from = *from;
      link.to = *to;
      // Both directions of a link are stored.
      if (!seen.emplace(std::min(*from, *to), std::max(*from, *to)).second) continue;
      if (const auto bytes = rows.optional_blob(3)) {
        link.from_from_to = detail::pose_of_floats(*bytes);
      }
      if (const auto bytes = rows.optional_blob(4)) link.covariance = covariance_of(*bytes);
      links.push_back(link);
    }
    if (others > 0) lost(fmt::format("{} priors and other links are left out", others));
  }

  // From 6 x 6 doubles; std::nullopt if singular.
  static std::optional<Matrix6d> covariance_of(std::span<const std::byte> bytes) {
    std::array<double, 36> numbers{};
    if (bytes.size() != sizeof numbers) return std::nullopt;
    std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
    Eigen::Matrix<double, 6, 6> information;
    for (int i = 0; i < 36; ++i) information(i / 6, i % 6) = numbers[static_cast<std::size_t>(i)];
    if (!information.allFinite()) return std::nullopt;
    const auto inverse =
        inverse_of_positive_definite(0.5 * (information + information.transpose()));
    if (!inverse || !inverse->allFinite()) return std::nullopt;
    return Matrix6d(0.5 * (*inverse + inverse->transpose()));
  }

  sqlite::Database& database_;
  const MapReadOptions& options_;
};

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
      if (const auto pose = detail::pose_of_floats(bytes_.subspan(local, 48))) {
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
    const auto pose = detail::pose_of_floats(bytes_.subspan(4 * numbers, kPose));
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
  MapReader(sqlite::Database& database, const MapReadOptions& options)
      : database_(database),
        file_bytes_(FileReader(database.name()).size().value_or(0)),
        graph_(database, options) {}

  LandmarkMap read() {
    read_calibrations();
    for (std::size_t i = 0; i < graph_.nodes.size(); ++i) add_frame(i);
    read_features();
    group();
    make_landmarks();
    tables_.info.length_unit = LengthUnit::kMetres;
    remark_on_closures();
    return detail::imported_map(std::move(tables_), database_.name(), graph_.log());
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
    if (unknown > 0) graph_.lost(fmt::format("{} calibrations are unknown to the map", unknown));
  }

  void add_frame(std::size_t i) {
    const Node& node = graph_.nodes[i];
    const Rigid3 base_from_camera =
        calibrations_[i] ? calibrations_[i]->base_from_camera : Rigid3();
    const Rigid3 pose = node.world_from_base * base_from_camera;
    const Eigen::Quaterniond q = pose.quaternion();
    FrameTable& frames = tables_.frames;
    frames.ids.push_back(FrameId{node.id});
    frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    frames.translations.push_back(pose.translation());
    frames.timestamps_s.push_back(node.stamp_s);
    frames.image_names.push_back(node.label);
    frames.gnss.push_back(node.gnss);
    world_from_camera_.push_back(pose);
    std::optional<CameraIndex> camera;
    if (calibrations_[i] && calibrations_[i]->camera) camera = index_of(*calibrations_[i]->camera);
    frames.cameras.push_back(camera);
  }

  CameraIndex index_of(const Camera& camera) {
    for (std::size_t i = tables_.cameras.size(); i-- > 0;) {
      const Camera& other = tables_.cameras[i];
      if (other.model == camera.model && other.width == camera.width &&
          other.height == camera.height && other.parameters == camera.parameters) {
        return CameraIndex{static_cast<std::uint32_t>(i)};
      }
    }
    tables_.cameras.push_back(camera);
    tables_.cameras.back().id = CameraId{tables_.cameras.size() - 1};
    return CameraIndex{static_cast<std::uint32_t>(tables_.cameras.size() - 1)};
  }

  void read_features() {
    const auto columns = database_.columns("Feature");
    const auto has = [&](const char* name) {
      return std::find(columns.begin(), columns.end(), name) != columns.end();
    };
    if (columns.empty()) return;
    const std::string sql = fmt::format(
        "SELECT node_id, word_id, pos_x, pos_y, {}, {}, {}, {}, {}, {} FROM Feature "
        "ORDER BY node_id, rowid",
        has("depth_x") ? "depth_x" : "NULL", has("depth_y") ? "depth_y" : "NULL",
        has("depth_z") ? "depth_z" : "NULL", has("octave") ? "octave" : "NULL",
        has("descriptor_size") ? "descriptor_size" : "NULL",
        has("descriptor") ? "descriptor" : "NULL");
    auto rows = database_.prepare(sql);
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
        refuse(database_, fmt::format("Feature of node {}", node), "the pixel is not finite",
               "numbers");
      }
      const auto& camera = tables_.frames.cameras[*frame];
      // The images of several cameras lie side by side.
      if (camera && feature.pixel.u >= tables_.cameras[camera->value].width) {
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
        const Rigid3 base_from_camera =
            calibrations_[*frame] ? calibrations_[*frame]->base_from_camera : Rigid3();
        const Eigen::Vector3d in_camera = base_from_camera.inverse() * in_base;
        if (!in_base.isZero() && in_camera.z() > 0.0) feature.in_camera = in_camera;
      }
      if (take_descriptor(rows.optional_blob(9), rows.optional_integer(8).value_or(0))) {
        feature.descriptor = descriptors_++;
      }
      features_.push_back(feature);
    }
    if (unposed > 0) {
      graph_.lost(fmt::format("{} features of nodes without a pose are left out", unposed));
    }
    if (of_other_cameras > 0) {
      graph_.lost(
          fmt::format("{} features of a second or further camera are left out", of_other_cameras));
    }
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
      detail::require_descriptor_budget(bytes_.size(), file_bytes_, database_.name());
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
    detail::to_bytes<float>(values, bytes_);
  }

  std::uint32_t root(std::uint32_t feature) {
    while (parent_[feature] != feature) {
      parent_[feature] = parent_[parent_[feature]];
      feature = parent_[feature];
    }
    return feature;
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
    const auto& camera = tables_.frames.cameras[feature.frame];
    if (!camera) return std::nullopt;
    const auto pixel = project(tables_.cameras[camera->value],
                               world_from_camera_[feature.frame].inverse() * x_in_world);
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
    parent_.resize(features_.size());
    std::iota(parent_.begin(), parent_.end(), 0U);
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
    for (const GraphLink& link : graph_.links) {
      const bool from_is_smaller = words[link.from].size() <= words[link.to].size();
      const auto& few = words[from_is_smaller ? link.from : link.to];
      const auto& many = words[from_is_smaller ? link.to : link.from];
      for (const auto& [word, feature] : few) {
        const auto found =
            std::lower_bound(many.begin(), many.end(), std::pair(word, std::uint32_t{0}));
        if (found == many.end() || found->first != word) continue;
        if (!agree(features_[feature], features_[found->second])) continue;
        const std::uint32_t a = root(feature);
        const std::uint32_t b = root(found->second);
        parent_[std::max(a, b)] = std::min(a, b);
      }
    }
  }

  void make_landmarks() {
    finish_floats();
    std::vector<std::uint32_t> landmark_of(features_.size(), kNone);
    std::vector<std::vector<std::uint32_t>> members;
    for (std::uint32_t i = 0; i < features_.size(); ++i) {
      const std::uint32_t first = root(i);
      if (landmark_of[first] == kNone) {
        landmark_of[first] = static_cast<std::uint32_t>(members.size());
        members.emplace_back();
      }
      members[landmark_of[first]].push_back(i);
    }
    detail::DescribedObservations observations(descriptor_bytes_);
    std::size_t without_depth = 0;
    std::size_t disagreeing = 0;
    NamedColumn words{"word", {}};
    for (const auto& of_landmark : members) {
      // Mean of the positions by depth, weighted by their certainty.
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      double weights = 0.0;
      for (const std::uint32_t i : of_landmark) {
        if (!features_[i].in_camera) continue;
        const double weight = 1.0 / (tolerance_m(features_[i]) * tolerance_m(features_[i]));
        sum += weight * in_world(features_[i]);
        weights += weight;
      }
      if (!(weights > 0.0) || !sum.allFinite()) {
        without_depth += of_landmark.size();
        continue;
      }
      const Eigen::Vector3d position = sum / weights;
      const std::uint64_t id = tables_.landmarks.ids.size();
      // One observation per frame, the nearest.
      std::map<std::uint32_t, std::pair<double, std::uint32_t>> best;
      for (const std::uint32_t i : of_landmark) {
        const Feature& feature = features_[i];
        const auto off = pixels_off(feature, position);
        const bool has_camera = tables_.frames.cameras[feature.frame].has_value();
        const bool is_near = has_camera
                                 ? off && *off <= kMostPixelsOff
                                 : feature.in_camera && (in_world(feature) - position).norm() <=
                                                            tolerance_m(feature);
        if (!is_near) {
          ++disagreeing;
          continue;
        }
        const auto [place, is_new] = best.try_emplace(feature.frame, off.value_or(0.0), i);
        if (!is_new) {
          ++disagreeing;
          if (off.value_or(0.0) < place->second.first) place->second = {off.value_or(0.0), i};
        }
      }
      if (best.empty()) continue;
      tables_.landmarks.ids.push_back(LandmarkId{id});
      tables_.landmarks.positions.push_back(position);
      words.values.push_back(static_cast<double>(features_[of_landmark.front()].word));
      for (const auto& [frame, chosen] : best) {
        const Feature& feature = features_[chosen.second];
        detail::DescribedObservations::Entry entry{id, FrameIndex{frame}, feature.pixel,
                                                   feature.keypoint};
        if (feature.in_camera) entry.depth = feature.in_camera->z();
        entry.octave = feature.octave;
        observations.add(entry, descriptor(feature));
      }
    }
    if (!words.values.empty()) tables_.landmarks.columns.push_back(std::move(words));
    detail::require_descriptor_budget(
        bytes_.size() + observations.descriptor_bytes_to_fill(tables_.landmarks.ids.size()),
        file_bytes_, database_.name());
    const std::string kind = descriptor_kind(database_);
    const bool is_binary = !are_floats() && descriptor_bytes_ <= 64;
    std::move(observations)
        .fill(tables_, kind, is_binary ? DescriptorNorm::kHamming : DescriptorNorm::kSquared);
    if (without_depth > 0) {
      graph_.lost(
          fmt::format("{} features without a depth, and with no match that has one, are "
                      "left out",
                      without_depth));
    }
    if (disagreeing > 0) {
      graph_.lost(
          fmt::format("{} features are not where their word is elsewhere; left out", disagreeing));
    }
    if (features_.empty()) {
      graph_.remark(
          "holds no features: the map has frames only (Mem/BinDataKept and "
          "Kp/MaxFeatures decide what RTAB-Map keeps)");
    }
  }

  void remark_on_closures() const {
    const auto closures = std::count_if(
        graph_.links.begin(), graph_.links.end(),
        [](const GraphLink& l) { return l.type != kNeighbor && l.type != kNeighborMerged; });
    if (graph_.is_optimised || closures == 0) return;
    graph_.remark(
        fmt::format("holds {} loop closures but no optimised poses: the poses are those of "
                    "odometry; let RTAB-Map optimise and save the graph first",
                    closures));
  }

  static constexpr double kMostPixelsOff = 8.0;

  sqlite::Database& database_;
  std::uint64_t file_bytes_;
  Graph graph_;
  MapTables tables_;
  std::vector<std::optional<Calibration>> calibrations_;  // of each node
  std::vector<Rigid3> world_from_camera_;
  std::vector<Feature> features_;
  std::vector<std::uint32_t> parent_;
  std::size_t descriptor_bytes_ = 0;
  std::size_t stored_bytes_ = 0;   // as many, or four times as many if they are float32
  std::uint32_t descriptors_ = 0;  // number of those in bytes_
  std::vector<std::uint8_t> bytes_;
};

}  // namespace

LandmarkMap read_rtabmap(const fs::path& path, const MapReadOptions& options) {
  sqlite::Database database = detail::open_foreign_database(path, options);
  return MapReader(database, options).read();
}

PoseGraph read_rtabmap_graph(const fs::path& path, const MapReadOptions& options) {
  sqlite::Database database = detail::open_foreign_database(path, options);
  const Graph graph(database, options);
  PoseGraph result;
  for (const Node& node : graph.nodes) {
    result.nodes.push_back({NodeId{node.id}, node.label, fmt::format("map {}", node.session),
                            Similarity3(node.world_from_base)});
  }
  for (const GraphLink& link : graph.links) {
    if (!link.from_from_to) continue;
    Link out;
    out.target = NodeId{graph.nodes[link.from].id};
    out.source = NodeId{graph.nodes[link.to].id};
    out.target_from_source = Similarity3(*link.from_from_to);
    out.covariance = link.covariance;
    const bool is_neighbor = link.type == kNeighbor || link.type == kNeighborMerged;
    out.kind = is_neighbor                 ? LinkKind::kOdometry
               : link.type == kUserClosure ? LinkKind::kManual
                                           : LinkKind::kPlacement;
    result.links.push_back(std::move(out));
  }
  result.validate(path.string());
  return result;
}

std::vector<MapFormat> rtabmap_formats() {
  return {
      {.name = "rtabmap",
       .title = "RTAB-Map",
       .recognises =
           [](const MapInput& input) {
             return detail::is_database_with(input, {"Node", "Link", "Data"});
           },
       .read = [](const MapInput& input,
                  const MapReadOptions& options) { return read_rtabmap(input.path, options); }}};
}

}  // namespace cairn
