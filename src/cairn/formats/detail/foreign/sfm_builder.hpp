// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {

/// A posed image of another system.
struct SfmFrame {
  FrameId id;
  Eigen::Quaterniond world_from_camera = Eigen::Quaterniond::Identity();  ///< of norm 1
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::optional<CameraIndex> camera = {};
  std::string image_name = {};
  std::optional<double> timestamp_s = {};
  std::optional<GnssFix> gnss = {};
};

/// A frame from its inverse pose; the quaternion has norm 1.
SfmFrame frame_from_inverse(FrameId id, const Eigen::Quaterniond& camera_from_world,
                            const Eigen::Vector3d& translation);

/// An observation of a landmark. The landmark may be added later.
struct SfmObservation {
  std::uint64_t landmark_id = 0;
  FrameIndex frame;
  Pixel pixel;
  std::optional<std::uint32_t> keypoint = {};
  std::optional<double> depth = {};
  std::optional<std::int32_t> octave = {};
  /// Of the size that set_descriptors() states; empty if unknown.
  std::span<const std::uint8_t> descriptor = {};
};

/// Options of SfmBuilder::finish().
struct SfmEnd {
  LengthUnit length_unit = LengthUnit::kFree;
  bool sort_by_id =
      false;  ///< frames and landmarks; otherwise they keep the order in which they were added
  bool observations_by_frame = false;  ///< a landmark's observations by frame; otherwise as added
  /// Text of the logged loss, after the number of observations whose landmark does not exist; empty: not logged.
  std::string_view lost_observations = {};
  /// Names an entry in messages, as in LandmarkMap; by default the name of the file.
  EntryPlace place = {};
};

/// Builds a map from the content of another system's files. Logs what it leaves out.
class SfmBuilder {
 public:
  /// @param name name of the file or folder in messages
  /// @param first_pixel both coordinates of the centre of the top-left pixel in the system's files; 0 in Cairn
  SfmBuilder(std::string name, const Execution& execution, double first_pixel = 0.0)
      : name_(std::move(name)), execution_(execution), first_pixel_(first_pixel) {}

  const std::string& name() const { return name_; }
  /// The tables of the map, for content that no function here adds.
  MapTables& tables() { return tables_; }
  const MapTables& tables() const { return tables_; }

  void remark(std::string_view text) const;
  void lost(std::string_view text) const;
  /// Logs "COUNT TEXT" as a loss unless the count is 0.
  void lost(std::size_t count, std::string_view text) const;

  /// Adds a camera, or logs why Cairn cannot use it.
  /// @param key name of the camera, here and in messages
  /// @param camera std::nullopt if the camera is unknown, which the caller logs
  /// @param defect why the camera cannot be used, if the caller knows
  void add_camera(const std::string& key, std::optional<Camera> camera, std::string defect = {});
  bool has_camera(const std::string& key) const { return cameras_.contains(key); }
  /// std::nullopt for a camera that was not added or cannot be used.
  std::optional<CameraIndex> camera(const std::string& key) const;

  FrameIndex add_frame(SfmFrame frame);
  /// Adds a frame to the frames that a rig took at one instant. The rigs need not be known before finish().
  /// @param rig_from_world states where the frame is expected
  void add_to_instant(InstantId instant, FrameIndex frame, const Rigid3& rig_from_world) {
    taken_.push_back({instant, frame, rig_from_world});
  }
  std::size_t frame_count() const { return tables_.frames.ids.size(); }

  void add_landmark(std::uint64_t id, const Eigen::Vector3d& position,
                    const std::optional<Color>& color = {});
  std::size_t landmark_count() const { return tables_.landmarks.ids.size(); }
  /// Reserves memory for this number of landmarks.
  void reserve(std::size_t landmarks);

  /// Declares that observations have descriptors; to be called before the first observation is added. Each landmark
  /// gets the medoid of its observations' descriptors, and the descriptors of its most distinct views.
  void set_descriptors(std::string kind, std::size_t bytes_each, DescriptorNorm norm);
  /// Bytes of the descriptors so far, and the most bytes while finish() assigns descriptors to the landmarks.
  std::uint64_t descriptor_bytes() const { return descriptors_.size(); }
  std::uint64_t descriptor_bytes_to_finish() const {
    return 2 * descriptor_bytes() + landmark_count() * bytes_each_;
  }
  void add_observation(const SfmObservation& observation);
  /// The landmark of each observation so far.
  const std::vector<std::uint64_t>& observed_ids() const { return observed_ids_; }

  /// The map. If no observation was added, its observations are unknown, because programs that do not keep tracks write
  /// empty ones.
  LandmarkMap finish(const SfmEnd& end = {}) &&;

 private:
  struct Taken {
    InstantId instant;
    FrameIndex frame;
    Rigid3 rig_from_world;
  };
  void set_instants();
  void sort_by_id();
  std::size_t group_observations(bool by_frame);
  std::vector<std::uint32_t> landmark_rows() const;
  void choose_descriptors(const std::vector<std::size_t>& entries);

  std::string name_;
  const Execution& execution_;
  double first_pixel_;
  MapTables tables_;
  std::unordered_map<std::string, std::optional<CameraIndex>> cameras_;
  std::vector<Taken> taken_;
  std::vector<std::uint64_t> observed_ids_;  // landmark of each observation
  std::string descriptor_kind_;
  DescriptorNorm norm_ = DescriptorNorm::kHamming;
  std::size_t bytes_each_ = 0;
  // Per observation: end of its descriptor in descriptors_.
  std::vector<std::size_t> descriptor_ends_;
  std::vector<std::uint8_t> descriptors_;  // known descriptors
};

/// Limits the memory for descriptors that a small file may refer to many times, or that have room for every landmark.
/// @param name the file or folder
/// @throws Error (input) if this number of descriptor bytes exceeds memory_budget() of the file's bytes
void require_descriptor_budget(std::uint64_t descriptor_bytes, std::uint64_t file_bytes,
                               const std::string& name);

/// Converts the numbers of descriptors to one byte each, preserving ratios of distances. If all are integers
/// from 0 to 255 (SIFT), they are unchanged. Otherwise x becomes 128 + 127·x, rounded and clamped, because
/// learned features are in [-1, 1]. Numbers that are not finite count as 0.
/// @tparam Number float or double
/// @param bytes as many as there are numbers
template <class Number>
void to_bytes(std::span<const Number> numbers, std::span<std::uint8_t> bytes);

/// Whether a matrix is a rotation within 1e-3.
bool is_rotation(const Eigen::Matrix3d& matrix);
/// Whether a quaternion has a direction; false also if a number is not finite.
bool has_direction(const Eigen::Quaterniond& quaternion);

/// Numbers as a colour, rounded and clamped to 0 to 255.
Color color_of(const Eigen::Vector3d& rgb);

/// Both coordinates of the centre of the top-left pixel in COLMAP, kapture and nerfstudio.
inline constexpr double kPixelCentre = 0.5;

/// Adds `by` pixels to both coordinates of the principal point, which a panorama does not have; the camera's model
/// must be known.
void shift_centre(Camera& camera, double by);

/// Whether a regular file exists at the path. Opening a pipe there would block.
bool is_file(const std::filesystem::path& path);

}  // namespace cairn::detail
