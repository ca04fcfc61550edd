// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cairn/core/ids.hpp"
#include "cairn/geometry/geodetic.hpp"
#include "cairn/geometry/rigid3.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/map/optional_column.hpp"

namespace cairn {

/// Georeference of a map: the similarity from its frame to a topocentric frame. A transform of the
/// map preserves its landmarks' positions on the Earth.
struct GeoReference {
  GeodeticPosition origin;  ///< origin of the east-north-up frame (ENU)
  double scale = 1.0;       ///< metres per unit of the map, 1e-9 to 1e9
  std::array<double, 4> quaternion = {1.0, 0.0, 0.0,
                                      0.0};               ///< enu_from_map, (w, x, y, z) as stored:
                                                          ///< norm within 1e-3 of 1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< map origin in ENU, metres

  Similarity3 enu_from_map() const;
  /// The georeference of the map after a transform.
  GeoReference moved(const Similarity3& new_from_old) const;
  /// Whether the map frame is the topocentric one, to 1e-9 in scale and angle (radians) and 1e-6 m.
  bool is_enu() const;

  GeodeticPosition geodetic(const Eigen::Vector3d& x_in_map) const;
  Eigen::Vector3d in_map(const GeodeticPosition& position) const;

  friend bool operator==(const GeoReference&, const GeoReference&) = default;
};

/// Keyframe position measured by a satellite receiver (GPS, GNSS). Unaffected by map transforms.
struct GnssFix {
  GeodeticPosition position;
  std::optional<double> accuracy_m;  ///< standard deviation of each coordinate; positive

  friend bool operator==(const GnssFix&, const GnssFix&) = default;
};

/// A ground control point: a mark with a surveyed position on the Earth, and its pixels in images.
/// Unaffected by map transforms.
struct ControlPoint {
  struct View {
    std::string image_name;  ///< image of a frame of this or another map; not empty
    Pixel pixel;

    friend bool operator==(const View&, const View&) = default;
  };

  std::string name;                  ///< not empty; not necessarily distinct
  double latitude_deg = 0.0;         ///< as in GeodeticPosition
  double longitude_deg = 0.0;        ///< as in GeodeticPosition
  std::optional<double> altitude_m;  ///< std::nullopt if unknown
  std::vector<View> views;

  friend bool operator==(const ControlPoint&, const ControlPoint&) = default;
};

/// Rigidly mounted cameras with known relative poses.
struct Rig {
  struct Mount {
    CameraIndex camera;
    std::array<double, 4> quaternion = {1.0, 0.0, 0.0, 0.0};  ///< camera_from_rig, (w, x, y, z) as
                                                              ///< stored: norm within 1e-3 of 1
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();    ///< camera_from_rig, map's unit

    Rigid3 camera_from_rig() const;

    friend bool operator==(const Mount&, const Mount&) = default;
  };

  RigId id;
  std::vector<Mount> mounts;  ///< at least one; each camera in at most one rig

  friend bool operator==(const Rig&, const Rig&) = default;
};

/// Unit of the lengths in a map.
enum class LengthUnit {
  kMetres,
  kFree,  ///< scale unknown, as from a single moving camera
};

/// "m", or "units" for free scale.
inline const char* unit_symbol(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "m" : "units";
}

/// Metadata of a map; std::nullopt if unknown.
struct MapInfo {
  LengthUnit length_unit = LengthUnit::kMetres;
  std::optional<std::string> world_frame;  ///< name of the frame of the positions
  std::optional<Eigen::Vector3d> gravity;  ///< unit vector downwards, in that frame
  std::optional<std::string> uuid;
  std::vector<std::string> provenance;  ///< steps that produced the map, oldest first
  std::optional<GeoReference> georeference = {};
  std::vector<ControlPoint> control_points = {};
};

/// Keyframes in columns. The optional columns are empty or have one entry per frame.
struct FrameTable {
  std::vector<FrameId> ids;
  std::vector<Eigen::Vector3d> translations;       ///< camera centre in the world
  std::vector<std::array<double, 4>> quaternions;  ///< world_from_camera, (w, x, y, z) as stored:
                                                   ///< norm within 1e-3 of 1
  OptionalColumn<CameraIndex> cameras;             ///< optional
  OptionalColumn<double> timestamps_s;             ///< optional
  std::vector<std::string> image_names;            ///< optional; empty text if unknown
  OptionalColumn<GnssFix> gnss;                    ///< optional
  /// Optional; covariance of world_from_camera, (δt, δφ) as in Rigid3::perturbed(), relative to the
  /// map's first keyframe. Grows with drift and for weakly connected keyframes.
  OptionalColumn<Matrix6d> pose_covariances;
  /// Optional; exposure instant of the frame's rig. Frames of one instant share one rig and one rig
  /// pose, with at most one frame per camera.
  OptionalColumn<InstantId> instants;
};

struct Color {
  std::uint8_t red = 0;
  std::uint8_t green = 0;
  std::uint8_t blue = 0;

  friend bool operator==(const Color&, const Color&) = default;
};

/// Limits on a landmark's data. They bound the memory that a small file can claim.
inline constexpr std::size_t kMostDescriptorBytes = 4096;
inline constexpr std::size_t kMostDescriptorsEach = 16;
inline constexpr std::size_t kMostNamedColumns = 512;

/// The landmarks' descriptors, all of one kind and size. A landmark has no descriptor, or one
/// representative descriptor and possibly further descriptors, of other views.
struct DescriptorColumn {
  std::string kind;                 ///< e.g. "ORB"
  std::size_t bytes_each = 0;       ///< 1 to kMostDescriptorBytes
  std::vector<std::uint8_t> known;  ///< per landmark: 1 if it has a descriptor
  std::vector<std::uint8_t> bytes;  ///< bytes_each per landmark, zero if unknown
  /// Landmark i's further descriptors are rows [further_offsets[i], further_offsets[i + 1]) of `further`.
  /// Empty if no landmark has any.
  std::vector<std::uint64_t> further_offsets = {};
  std::vector<std::uint8_t> further = {};  ///< bytes_each per row

  bool has_further() const { return !further_offsets.empty(); }
  /// Number of a landmark's descriptors, at most kMostDescriptorsEach.
  std::size_t count(std::size_t landmark) const {
    if (known[landmark] == 0) return 0;
    if (!has_further()) return 1;
    return 1 + static_cast<std::size_t>(further_offsets[landmark + 1] - further_offsets[landmark]);
  }
  /// Bytes of a landmark's k-th descriptor, k < count(landmark). The first represents the landmark.
  std::span<const std::uint8_t> descriptor(std::size_t landmark, std::size_t k) const {
    if (k == 0) return std::span(bytes).subspan(landmark * bytes_each, bytes_each);
    return std::span(further).subspan(
        static_cast<std::size_t>(further_offsets[landmark] + k - 1) * bytes_each, bytes_each);
  }
};

/// Numbers in single or double precision. A splat has up to 80 numbers in single precision, so that columns in double
/// precision would take twice the memory of its file.
class ColumnValues {
 public:
  using value_type = double;
  class const_iterator;

  /// Calls a function with the std::vector<double> or std::vector<float> of the numbers.
  template <class Function>
  decltype(auto) visit(const Function& function) const {
    return std::visit(function, values_);
  }
  template <class Function>
  decltype(auto) visit(const Function& function) {
    return std::visit(function, values_);
  }

  ColumnValues() = default;  ///< in double precision
  ColumnValues(std::vector<double> values) : values_(std::move(values)) {}
  ColumnValues(std::vector<float> values) : values_(std::move(values)) {}
  ColumnValues(std::initializer_list<double> values) : values_(std::vector<double>(values)) {}

  std::size_t size() const {
    return visit([](const auto& values) { return values.size(); });
  }
  bool empty() const { return size() == 0; }
  bool is_single() const { return std::holds_alternative<std::vector<float>>(values_); }
  double operator[](std::size_t i) const {
    return visit([i](const auto& values) { return static_cast<double>(values[i]); });
  }
  double back() const { return (*this)[size() - 1]; }
  const_iterator begin() const;
  const_iterator end() const;

  /// Changes a number. Rounds it in single precision, as the following functions do.
  void set(std::size_t i, double value) {
    visit([=]<class T>(std::vector<T>& values) { values[i] = static_cast<T>(value); });
  }
  void push_back(double value) {
    visit([=]<class T>(std::vector<T>& values) { values.push_back(static_cast<T>(value)); });
  }
  void resize(std::size_t size, double added = 0.0) {
    visit([=]<class T>(std::vector<T>& values) { values.resize(size, static_cast<T>(added)); });
  }
  void reserve(std::size_t size) {
    visit([=](auto& values) { values.reserve(size); });
  }

  friend bool operator==(const ColumnValues& a, const ColumnValues& b);

 private:
  std::variant<std::vector<double>, std::vector<float>> values_;
};

class ColumnValues::const_iterator {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = double;
  using difference_type = std::ptrdiff_t;
  using pointer = void;
  using reference = double;

  const_iterator() = default;
  const_iterator(const ColumnValues* column, std::size_t at) : column_(column), at_(at) {}
  double operator*() const { return (*column_)[at_]; }
  const_iterator& operator++() {
    ++at_;
    return *this;
  }
  const_iterator operator++(int) { return {column_, at_++}; }
  friend bool operator==(const const_iterator&, const const_iterator&) = default;

 private:
  const ColumnValues* column_ = nullptr;
  std::size_t at_ = 0;
};

inline ColumnValues::const_iterator ColumnValues::begin() const {
  return {this, 0};
}
inline ColumnValues::const_iterator ColumnValues::end() const {
  return {this, size()};
}
inline bool operator==(const ColumnValues& a, const ColumnValues& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

/// One number per landmark under a user-defined name; NaN if unknown.
struct NamedColumn {
  std::string name;
  ColumnValues values;
};

/// Names of the columns; views of `columns`.
std::vector<std::string_view> column_names(std::span<const NamedColumn> columns);

/// Landmarks in columns. The optional columns are empty or have one entry per landmark.
struct LandmarkTable {
  std::vector<LandmarkId> ids;
  std::vector<Eigen::Vector3d> positions;  ///< in the world frame
  std::vector<Eigen::Matrix3d>
      covariances;               ///< optional; of the position; unknown if the first entry is NaN
  OptionalColumn<Color> colors;  ///< optional
  std::optional<DescriptorColumn> descriptors;
  std::vector<NamedColumn> columns;  ///< at most kMostNamedColumns, with distinct names
};

/// Measurement method of an observation's pixel.
enum class PixelSource : std::uint8_t {
  kCorner,     ///< a corner was detected there
  kPatch,      ///< the landmark's patch matches best there
  kReference,  ///< origin of the patch: this pixel defines the landmark
};
inline constexpr std::size_t kPixelSourceCount = 3;

/// "corner", "patch" or "reference".
std::string_view to_string(PixelSource source);

/// Observations in columns, grouped by landmark. One observation is one measurement of a landmark in one
/// keyframe. The optional columns are empty or have one entry per observation.
struct ObservationTable {
  /// Landmark i's observations are [offsets[i], offsets[i + 1]). Empty if the map has no
  /// observations (e.g. a point cloud) or no landmarks.
  std::vector<std::uint64_t> offsets;
  std::vector<FrameIndex> frames;
  std::vector<Pixel> pixels;
  OptionalColumn<std::uint32_t> keypoints;  ///< optional; index in the frame's features
  OptionalColumn<double> depths;            ///< optional; along the optical axis, map's unit
  OptionalColumn<std::int32_t> octaves;     ///< optional; pyramid level of the feature
  OptionalColumn<PixelSource> sources;      ///< optional; how the pixel was measured
  OptionalColumn<double> sigmas_px;  ///< optional; standard deviation of u and of v; positive
};

/// All columns of a map: the input of a LandmarkMap.
struct MapTables {
  MapInfo info;
  std::vector<Camera> cameras;
  FrameTable frames;
  LandmarkTable landmarks;
  ObservationTable observations;
  std::vector<Rig> rigs;
};

/// The columns of MapTables. The values are the section numbers of the binary format (docs/formats.md) and
/// never change.
enum class MapColumn : std::uint8_t {
  kWorldFrame = 1,
  kGravity = 2,
  kUuid = 3,
  kProvenance = 4,
  kCameras = 5,
  kFrameIds = 6,
  kTranslations = 7,
  kQuaternions = 8,
  kFrameCameras = 9,
  kTimestamps = 10,
  kImageNames = 11,
  kLandmarkIds = 12,
  kPositions = 13,
  kCovariances = 14,
  kColors = 15,
  kDescriptorKind = 16,
  kKnownDescriptors = 17,
  kDescriptors = 18,
  kColumnNames = 19,
  kColumnValues = 20,
  kOffsets = 21,
  kObservingFrames = 22,
  kPixels = 23,
  kKeypoints = 24,
  kDepths = 25,
  kOctaves = 26,
  kPixelSources = 27,
  kPixelSigmas = 28,
  kGeoReference = 29,
  kGnss = 30,
  kFurtherOffsets = 31,
  kFurtherDescriptors = 32,
  kControlPoints = 33,
  kPoseCovariances = 34,
  kRigs = 35,
  kInstants = 36,
};

/// Input location of a column entry, for messages, e.g. "desk.map:12: field 2 (id)". Rows of
/// kColumnValues count through all named columns in order.
using EntryPlace = std::function<std::string(MapColumn column, std::size_t row)>;

/// A landmark map: keyframes, landmarks and observations. Valid and immutable. An optional column without
/// known values is dropped; descriptors and named columns are kept.
class LandmarkMap {
 public:
  /// An empty map.
  LandmarkMap() = default;
  /// Validates the columns and takes them over, with their rows in the given order.
  /// @param place input location of entries; messages begin with it
  /// @throws Error (input) naming the invalid entry: sizes, duplicate ids, indices out of range, numbers
  ///        that are not finite, quaternion norms off 1 by more than 1e-3, matrices that are no covariance,
  ///        defective cameras, contradictory rigs
  explicit LandmarkMap(MapTables tables, const EntryPlace& place = {});

  const MapInfo& info() const { return tables_.info; }
  std::span<const Camera> cameras() const { return tables_.cameras; }
  std::span<const Rig> rigs() const { return tables_.rigs; }
  const FrameTable& frames() const { return tables_.frames; }
  const LandmarkTable& landmarks() const { return tables_.landmarks; }
  const ObservationTable& observations() const { return tables_.observations; }

  std::size_t frame_count() const { return tables_.frames.ids.size(); }
  std::size_t landmark_count() const { return tables_.landmarks.ids.size(); }
  std::size_t observation_count() const { return tables_.observations.frames.size(); }

  /// Pose of a frame with the quaternion normalised.
  Rigid3 world_from_camera(FrameIndex frame) const;
  bool has_covariances() const { return !tables_.landmarks.covariances.empty(); }
  /// std::nullopt if unknown.
  std::optional<Eigen::Matrix3d> covariance(LandmarkIndex landmark) const;
  /// Whether the map has observations; if not, observation counts are unknown, not zero.
  bool has_observations() const {
    return !tables_.observations.offsets.empty() || landmark_count() == 0;
  }
  /// Number of observations of a landmark; 0 if the map has none.
  std::size_t observation_count(LandmarkIndex landmark) const;
  /// Frames that observed a landmark, in the order of its observations.
  std::span<const FrameIndex> observing_frames(LandmarkIndex landmark) const;
  /// Pixels of a landmark, parallel to observing_frames().
  std::span<const Pixel> observed_pixels(LandmarkIndex landmark) const;

  std::optional<FrameIndex> find(FrameId id) const;
  std::optional<LandmarkIndex> find(LandmarkId id) const;
  /// The column of that name; null if there is none.
  const NamedColumn* column(std::string_view name) const;

  /// Moves the columns out, to build another map.
  MapTables tables() && { return std::move(tables_); }

 private:
  MapTables tables_;
  // Positions sorted by id; empty if the ids ascend.
  std::vector<std::uint32_t> frames_by_id_;
  std::vector<std::uint32_t> landmarks_by_id_;
};

}  // namespace cairn
